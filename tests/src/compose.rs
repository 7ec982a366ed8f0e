//! The shipped WGSL as naga modules.
//!
//! Composed as Bevy composes it: naga_oil, imports by their `#define_import_path`. Bevy's own modules are taken from a
//! Bevy app without a renderer, so they are those of the Bevy version that the workspace builds with.

use std::collections::HashMap;
use std::sync::{LazyLock, Mutex, PoisonError};
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::settings::{RenderCreation, WgpuSettings};
use bevy::shader::{Shader, ShaderDefVal, ShaderImport};
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;
use bevy_bounce_shaders::SHADERS;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga_oil::compose::{Composer, NagaModuleDescriptor, ShaderDefValue};

/// What WGSL may use on every WebGPU device.
const CAPABILITIES: Capabilities = Capabilities::MULTISAMPLED_SHADING
    .union(Capabilities::CUBE_ARRAY_TEXTURES)
    .union(Capabilities::SHADER_FLOAT16_IN_FLOAT32);

/// A composed shader and what naga found out about it.
#[derive(Clone)]
pub struct Composed {
    /// Names are as written, but for imported items: see [`plain_name`].
    pub module: naga::Module,
    /// Result of validation, with the capabilities that WebGPU has without optional features.
    pub info: ModuleInfo,
}

/// Composes the shader of that path within the shader crate.
pub fn compose(path: &str, defs: &[ShaderDefVal]) -> Result<Composed, String> {
    let shader = bevy_bounce_shaders::shader(path).ok_or_else(|| format!("no shader {path}"))?;
    compose_source(shader.source, path, defs)
}

/// Composes any WGSL, which may import our modules and Bevy's.
pub fn compose_source(source: &str, path: &str, defs: &[ShaderDefVal]) -> Result<Composed, String> {
    static LIBRARY: LazyLock<Mutex<Library>> = LazyLock::new(|| Mutex::new(Library::new()));
    let mut library = LIBRARY.lock().unwrap_or_else(PoisonError::into_inner);
    library.compose(source, path, defs)
}

/// The name as it is in the source: naga_oil appends the module's to imported items.
pub fn plain_name(name: &str) -> &str {
    name.split("X_naga_oil_").next().unwrap_or(name)
}

struct Library {
    modules: HashMap<String, Shader>,
    composer: Composer,
    has_bevy: bool,
}

impl Library {
    fn new() -> Self {
        let ours = SHADERS.iter().map(|shader| {
            let shader = Shader::from_wgsl(shader.source, format!("bevy_bounce/{}", shader.path));
            (shader.import_path.module_name().into_owned(), shader)
        });
        let composer = Composer::default().with_capabilities(CAPABILITIES);
        Self { modules: ours.collect(), composer, has_bevy: false }
    }

    fn compose(&mut self, source: &str, path: &str, defs: &[ShaderDefVal]) -> Result<Composed, String> {
        let shader = Shader::from_wgsl(source.to_owned(), path.to_owned());
        for import in &shader.imports {
            self.add(import)?;
        }
        let descriptor = NagaModuleDescriptor {
            shader_defs: defs.iter().cloned().map(definition).collect(),
            ..NagaModuleDescriptor::from(&shader)
        };
        let module = self.composer.make_naga_module(descriptor).map_err(|error| {
            let report = error.emit_to_string(&self.composer);
            format!("{path} with {defs:?}:\n{report}")
        })?;
        let info = Validator::new(ValidationFlags::all(), CAPABILITIES)
            .validate(&module)
            .map_err(|error| format!("{path} with {defs:?}: {}", error.emit_to_string(source)))?;
        Ok(Composed { module, info })
    }

    /// Adds a module and all it imports.
    fn add(&mut self, import: &ShaderImport) -> Result<(), String> {
        let name = import.module_name().into_owned();
        if self.composer.contains_module(&name) {
            return Ok(());
        }
        if !self.modules.contains_key(&name) && !self.has_bevy {
            self.has_bevy = true;
            let theirs = bevy_shaders();
            self.modules.extend(theirs.into_iter().map(|s| (s.import_path.module_name().into_owned(), s)));
        }
        let shader = self.modules.get(&name).ok_or_else(|| format!("no module {name}"))?.clone();
        for import in &shader.imports {
            self.add(import)?;
        }
        let added = self.composer.add_composable_module((&shader).into()).map(drop);
        added.map_err(|error| format!("{name}:\n{}", error.emit_to_string(&self.composer)))
    }
}

fn definition(def: ShaderDefVal) -> (String, ShaderDefValue) {
    match def {
        ShaderDefVal::Bool(name, value) => (name, ShaderDefValue::Bool(value)),
        ShaderDefVal::Int(name, value) => (name, ShaderDefValue::Int(value)),
        ShaderDefVal::UInt(name, value) => (name, ShaderDefValue::UInt(value)),
    }
}

/// Every shader that Bevy's default plugins load.
fn bevy_shaders() -> Vec<Shader> {
    let no_gpu = WgpuSettings { backends: None, ..default() };
    let mut app = App::new();
    app.add_plugins(
        DefaultPlugins
            .build()
            .disable::<WinitPlugin>()
            .disable::<bevy::log::LogPlugin>()
            .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
            .set(RenderPlugin { render_creation: RenderCreation::Automatic(Box::new(no_gpu)), ..default() }),
    );
    // Some are only added here.
    app.finish();
    app.cleanup();
    // Loaded by what draws with it, of which there is nothing without a renderer.
    const FULLSCREEN: &str = "embedded://bevy_core_pipeline/fullscreen_vertex_shader/fullscreen.wgsl";
    let _fullscreen: Handle<Shader> = app.world().resource::<AssetServer>().load(FULLSCREEN);
    // They are embedded, yet load as assets do: wait until no more have come for a while.
    let (mut loaded, mut since) = (0, Instant::now());
    while since.elapsed() < Duration::from_millis(500) {
        app.update();
        let count = app.world().resource::<Assets<Shader>>().len();
        if count != loaded {
            (loaded, since) = (count, Instant::now());
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    app.world().resource::<Assets<Shader>>().iter().map(|(_, shader)| shader.clone()).collect()
}
