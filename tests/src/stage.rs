//! A scene rendered without a window, frame by frame, with the helpers of the examples.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use bevy::light::{DirectionalLightShadowMap, PointLightShadowMap};
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy_bounce::{
    CssmSettings, GiIsolate, GiSettings, GlobalIllumination, Quality, RadianceCacheSettings, Resolution, SsbcSettings,
    Technique, VplVisibility,
};
use bevy_bounce_cssm::CssmFile;
use bevy_bounce_examples::capture::{self, CaptureScene, Targets};
use bevy_bounce_examples::gltf::{GltfScenePlugin, SceneFile};
use bevy_bounce_examples::stage_clock::{self, StageClock};
use bevy_bounce_examples::{Run, app, headless};

use crate::gpu::webgpu_limits;
use crate::picture::Picture;

/// Settings that a software adapter renders in a moment, without bias compensation and history.
pub const SMALL: GiSettings = GiSettings {
    grid: 32,
    range: 40.0,
    vpls: 256,
    bounces: 6,
    visibility: VplVisibility::Voxel,
    tile: 24,
    bound: 1.0,
    probes: 0,
    sky: 64,
    resolution: Resolution::Full,
    ssbc: SsbcSettings::OFF,
    cssm: CssmSettings::DEFAULT,
    radiance_cache: RadianceCacheSettings::DEFAULT,
    history: 0,
};

/// Edge of the shadow maps of spot and directional lights, in texels, twice that of point lights' faces, whatever a
/// scene asks for. Larger ones keep a software adapter's rasteriser busy, whatever the size of the picture.
const SHADOW_MAP: usize = 512;

/// Global illumination with those settings.
pub fn illumination(settings: GiSettings) -> GlobalIllumination {
    GlobalIllumination { technique: Technique::InstantRadiosity, quality: Quality::Custom(settings), ..default() }
}

/// An app with one scene.
pub struct Stage {
    app: App,
    size: UVec2,
}

impl Stage {
    /// Builds the app, adds the scene and waits until everything is there. The scene spawns a `Camera3d`; it renders to a
    /// target of that size, with bounced light alone.
    pub fn new(size: UVec2, settings: GiSettings, scene: impl FnOnce(&mut App)) -> Self {
        Self::with_run(run(size, Some(illumination(settings))), scene)
    }

    /// With every option of a run.
    pub fn with_run(run: Run, scene: impl FnOnce(&mut App)) -> Self {
        Self::with_assets(run, None, scene)
    }

    /// With every option of a run, and the folder that asset paths start from.
    pub fn with_assets(run: Run, assets: Option<PathBuf>, scene: impl FnOnce(&mut App)) -> Self {
        let size = run.size;
        let mut app = app::build(&run, assets);
        scene(&mut app);
        app.insert_resource(DirectionalLightShadowMap { size: SHADOW_MAP });
        app.insert_resource(PointLightShadowMap { size: SHADOW_MAP / 2 });
        headless::warm_up(&mut app).unwrap_or_else(|error| panic!("{error}"));
        let mut stage = Self { app, size };
        let target = stage.app.world().resource::<Targets>().scene.clone();
        let mut cameras = stage.app.world_mut().query_filtered::<Entity, With<Camera3d>>();
        let cameras: Vec<Entity> = cameras.iter(stage.app.world()).collect();
        for camera in cameras {
            stage.app.world_mut().entity_mut(camera).insert(CaptureScene(target.clone()));
        }
        stage.frame(Duration::ZERO);
        stage
    }

    /// One of the project's own assets, with that bake of the whole.
    pub fn of_asset(name: &str, run: Run, matte: bool, bake: Option<CssmFile>) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets").join(name);
        let file = SceneFile::open(&path).unwrap_or_else(|error| panic!("{error}"));
        let camera = file.camera(None).unwrap_or_else(|error| panic!("{error}")).cloned();
        let folder = file.folder();
        Self::with_assets(run, Some(folder), |app| {
            app.add_plugins(GltfScenePlugin { file, camera, matte, flip_textures: false, bake });
        })
    }

    /// The world, to change it between frames.
    pub fn world(&mut self) -> &mut World {
        self.app.world_mut()
    }

    /// The only entity with that component.
    pub fn only<T: Component>(&mut self) -> Entity {
        let mut query = self.app.world_mut().query_filtered::<Entity, With<T>>();
        query.single(self.app.world()).unwrap_or_else(|error| panic!("{}: {error}", std::any::type_name::<T>()))
    }

    /// The render world.
    pub fn render_world(&self) -> &World {
        self.app.sub_app(RenderApp).world()
    }

    /// The render world, for queries.
    pub fn render_world_mut(&mut self) -> &mut World {
        self.app.sub_app_mut(RenderApp).world_mut()
    }

    /// Changes how the camera is lit.
    pub fn light_by(&mut self, illumination: GlobalIllumination) {
        let camera = self.only::<Camera3d>();
        self.world().entity_mut(camera).insert(illumination);
    }

    /// Renders a frame that much later in animation time.
    pub fn frame(&mut self, step: Duration) {
        headless::frame(&mut self.app, step).unwrap_or_else(|error| panic!("{error}"));
    }

    /// The next frame, in cd/m^2.
    pub fn picture(&mut self) -> Picture {
        self.frame(Duration::ZERO);
        self.captured()
    }

    /// The last frame, in cd/m^2.
    pub fn captured(&mut self) -> Picture {
        let pixels = capture::luminances(&mut self.app).unwrap_or_else(|error| panic!("{error}"));
        Picture { width: self.size.x as usize, height: self.size.y as usize, pixels }
    }

    /// The last frame as the display shows it: sRGB, four bytes a pixel.
    pub fn display(&self) -> Vec<u8> {
        self.read(&self.app.world().resource::<Targets>().display)
    }

    /// Milliseconds of the stages in so many more frames, on a software adapter with a
    /// [`StageClockPlugin`](bevy_bounce_examples::stage_clock::StageClockPlugin).
    pub fn stage_times(&mut self, frames: usize) -> BTreeMap<&'static str, Vec<f64>> {
        stage_clock::measure(&mut self.app, frames).unwrap_or_else(|error| panic!("{error}"));
        self.app.world().get_resource::<StageClock>().map(StageClock::stages).unwrap_or_default()
    }

    /// The texels of an image on the GPU.
    pub fn read(&self, image: &Handle<Image>) -> Vec<u8> {
        capture::read(&self.app, image).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Throws frames away until one needed nothing new. The first does not count: what comes of it in the game's world shows in
    /// the next.
    pub fn settle(&mut self) {
        self.frame(Duration::ZERO);
        headless::settle(&mut self.app, 1).unwrap_or_else(|error| panic!("{error}"));
    }

    /// The next frame after all that new settings need has been compiled: two frames are thrown away.
    pub fn settled_picture(&mut self) -> Picture {
        self.frame(Duration::ZERO);
        self.frame(Duration::ZERO);
        self.picture()
    }
}

/// A run without a window: bounced light alone, or everything where there is none.
pub fn run(size: UVec2, illumination: Option<GlobalIllumination>) -> Run {
    Run {
        outputs: Vec::new(),
        headless: true,
        size,
        steps: Vec::new(),
        isolate: if illumination.is_some() { GiIsolate::Indirect } else { GiIsolate::All },
        illumination,
        exposure: None,
        webgpu_limits: webgpu_limits(),
        stats: None,
        gizmos: false,
        panel: false,
        sky: None,
        forward: false,
        plain_bevy: false,
    }
}
