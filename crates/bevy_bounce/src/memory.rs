//! What the plugins hold on the GPU.

use std::collections::BTreeMap;

use bevy::prelude::*;

use crate::avg::VoxelGrid;
use crate::compose::LightmappedInView;
use crate::cssm::{Baked, PixelLight};
use crate::fog::LitFog;
use crate::history::History;
use crate::probes::ProbeBuffers;
use crate::radiance_cache::{CacheBuffers, VoxelLight};
use crate::scene::SceneBuffers;
use crate::shadow_atlas::ShadowAtlas;
use crate::ssbc::SsbcTextures;
use crate::view::ViewTextures;
use crate::vpl::VplBuffers;

/// Bytes that the plugins hold on the GPU, by what they are for; of view textures, all cameras together.
///
/// For measurements: it asks the render world (`app.get_sub_app_mut(RenderApp)`), which an app with pipelined rendering
/// keeps to itself.
pub fn gpu_memory(render_world: &mut World) -> BTreeMap<&'static str, u64> {
    let mut views = render_world.query::<&ViewTextures>();
    let mut compensated = render_world.query::<&SsbcTextures>();
    let mut fogs = render_world.query::<&LitFog>();
    let mut kept = render_world.query::<&History>();
    let mut lightmapped = render_world.query::<&LightmappedInView>();
    let mut resting = render_world.query::<&PixelLight>();
    let mut cached = render_world.query::<&CacheBuffers>();
    let items = render_world.get_resource::<SceneBuffers>().map(SceneBuffers::bytes).into_iter().flatten();
    let items = items.chain(render_world.get_resource::<VoxelGrid>().map(VoxelGrid::bytes).into_iter().flatten());
    let items = items.chain(render_world.get_resource::<VplBuffers>().map(VplBuffers::bytes).into_iter().flatten());
    let items = items.chain(render_world.get_resource::<ShadowAtlas>().map(ShadowAtlas::bytes).into_iter().flatten());
    let items = items.chain(render_world.get_resource::<Baked>().map(Baked::bytes).into_iter().flatten());
    let items = items.chain(render_world.get_resource::<VoxelLight>().map(VoxelLight::bytes).into_iter().flatten());
    let items = items.chain(render_world.get_resource::<ProbeBuffers>().map(ProbeBuffers::bytes).into_iter().flatten());
    let items = items.chain(views.iter(render_world).flat_map(ViewTextures::bytes));
    let items = items.chain(compensated.iter(render_world).flat_map(SsbcTextures::bytes));
    let items = items.chain(cached.iter(render_world).flat_map(CacheBuffers::bytes));
    let items = items.chain(lightmapped.iter(render_world).flat_map(LightmappedInView::bytes));
    let items = items.chain(resting.iter(render_world).flat_map(PixelLight::bytes));
    let items = items.chain(fogs.iter(render_world).flat_map(LitFog::bytes));
    let items = items.chain(kept.iter(render_world).flat_map(History::bytes));
    let mut memory = BTreeMap::new();
    for (name, bytes) in items {
        *memory.entry(name).or_default() += bytes;
    }
    memory
}
