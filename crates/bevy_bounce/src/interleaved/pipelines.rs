//! Kernels of the interleaved shading and their bindings.

use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_2d, texture_storage_2d, uniform_buffer_sized,
};
use bevy::render::render_resource::{PipelineCache, StorageTextureAccess, TextureFormat, TextureSampleType};
use bevy::shader::ShaderDefVal;

use crate::compute::{GiShaders, Kernel, KernelDescriptor, are_ready};
use crate::shadow_atlas::{visibility_def, visibility_layouts};
use crate::{Resolution, VplVisibility};

/// What the kernels are specialised for.
#[derive(Clone, Copy, Debug, Hash, PartialEq, Eq)]
pub(super) struct PassesKey {
    pub visibility: VplVisibility,
    pub resolution: Resolution,
    /// The list of lights fits into a uniform buffer.
    pub few_lights: bool,
    /// Light straight from the sky, too.
    pub sky: bool,
    /// And how much of it is seen.
    pub sky_seen: bool,
}

impl PassesKey {
    fn defs(self) -> Vec<ShaderDefVal> {
        let half = (self.resolution == Resolution::Half).then(|| "HALF_RESOLUTION".into());
        let sky = self.sky.then(|| "SKY".into());
        [visibility_def(self.visibility), half, sky].into_iter().flatten().collect()
    }
}

/// Kernels of the interleaved shading, made when they are first asked for.
#[derive(Resource, Default)]
pub(super) struct InterleavedPipelines(HashMap<PassesKey, Passes>);

/// What runs in a view.
pub(super) struct Passes {
    pub near: Kernel,
    pub shade: Kernel,
    pub rows: Kernel,
    pub columns: Kernel,
    /// `columns` for what of the sky is seen.
    pub sky_columns: Option<Kernel>,
}

impl InterleavedPipelines {
    /// The kernels of that key.
    pub fn passes(&mut self, key: PassesKey, shaders: &GiShaders) -> &Passes {
        self.0.entry(key).or_insert_with(|| Passes::new(key, shaders))
    }

    /// The key itself, once its kernels are compiled; until then, of those whose are, the one that leaves out the least of the sky; few
    /// lights may be shaded as many. `None` while there is none.
    pub fn compiled(&self, key: PassesKey, cache: &PipelineCache) -> Option<PassesKey> {
        let more = PassesKey { few_lights: false, ..key };
        let less = [more, PassesKey { sky_seen: false, ..key }, PassesKey { sky: false, sky_seen: false, ..key }];
        let is_ready = |key: &PassesKey| self.0.get(key).is_some_and(|passes| passes.are_ready(cache));
        [key].into_iter().chain(less).find(is_ready)
    }
}

impl Passes {
    fn are_ready(&self, cache: &PipelineCache) -> bool {
        are_ready([&self.near, &self.shade, &self.rows, &self.columns].into_iter().chain(&self.sky_columns), cache)
    }

    fn new(key: PassesKey, shaders: &GiShaders) -> Self {
        let uniform = uniform_buffer_sized(false, None);
        let read = storage_buffer_read_only_sized(false, None);
        let surface = texture_2d(TextureSampleType::Uint);
        let light = texture_2d(TextureSampleType::Float { filterable: false });
        let output = texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly);
        // View; surface; header, list; result; grid, densities; light so far; what of the sky is seen.
        let lights = if key.few_lights { uniform } else { read };
        let all = [uniform, surface, read, lights, output, uniform, read, light, output];
        let (filter, shade) = (&all[..8], if key.sky_seen { &all[..] } else { &all[..8] });
        // Its threads read different lights, which a uniform buffer gives one after the other.
        let near = [uniform, surface, read, read, output, uniform, read];
        let groups = visibility_layouts(key.visibility, key.sky);
        let kernel = |path, entry, bindings: &[_], defs: &[&'static str]| {
            let defs = key.defs().into_iter().chain(defs.iter().map(|&def| def.into())).collect();
            Kernel::new(shaders, KernelDescriptor { path, entry, bindings, groups: &groups, defs })
        };
        let few: &[_] = if key.few_lights { &["FEW_LIGHTS"] } else { &[] };
        let few_and_seen = [few, &["SKY_SEEN"]].concat();
        let columns = |defs| kernel("interleaved/filter.wgsl", "filter_columns", filter, defs);
        Self {
            near: kernel("interleaved/near.wgsl", "near", &near, &[]),
            shade: kernel("interleaved/shade.wgsl", "shade", shade, if key.sky_seen { &few_and_seen } else { few }),
            rows: kernel("interleaved/filter.wgsl", "filter_rows", filter, &[]),
            columns: columns(few),
            sky_columns: key.sky_seen.then(|| columns(&few_and_seen)),
        }
    }
}

/// A new device has none of the last one's. For `RenderStartup`.
pub(super) fn init_pipelines(mut commands: Commands) {
    commands.insert_resource(InterleavedPipelines::default());
}
