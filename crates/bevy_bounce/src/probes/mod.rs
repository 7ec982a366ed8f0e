//! Bounced light for what is not in the G-buffer: transparent and forward-rendered surfaces, particles, whole apps that stay
//! forward. A volume of light probes over the scene, lit anew every frame by all virtual lights, which Bevy's own shaders
//! read as an [`IrradianceVolume`](bevy::light::IrradianceVolume).
//!
//! # Data
//!
//! | data | bytes at 20^3 probes | holds |
//! |---|---|---|
//! | image of the volume | 375 KiB | what Bevy's shaders read: a half float colour for each of six directions |
//! | `places` | 750 KiB | where the light of each direction is taken |
//! | `light` | 750 KiB | it, before directions without light of their own are filled |
//!
//! A direction's value is irradiance over pi as everywhere here, in cd/m^2 times a power of two near the exposure of
//! the cameras, which [`IrradianceVolume::intensity`](bevy::light::IrradianceVolume::intensity) takes back: Bevy
//! multiplies the value by the diffuse colour and by the exposure.
//!
//! # Cost
//!
//! Six sums over all virtual lights a probe, of which each sees about half: 25 million lookups at 20^3 probes and 1024 lights. It
//! does not depend on the picture's size, and there is none in frames in which no view draws anything by a forward shader. On a
//! software adapter that is five times what `interleaved` takes at 640x360: `see_through --size 640x360 --stats`.
//! Nothing persists from frame to frame but where the volume lies: it follows the scene's bounds, in whole steps, two frames
//! behind where rendering is pipelined.
//!
//! # What it cannot do
//!
//! It is as fine as its probes are near each other. Walls thinner than that let light by onto what floats before them;
//! what is on them gets its own: see `probes/place.wgsl`. Six directions are a coarse picture of light for surfaces
//! that are aslant and far from others: Bevy's shaders mix them by the squares of the normal's components, so that
//! beside an axis the others hardly count. Of fifty particles in the Cornell box all are within 15 % of opaque ones
//! where they face along an axis, 49 where they are turned to a camera in the closed box, and 28 where they look into
//! the dark out of the open one: the exact light of the six directions is as far off there
//! (`cargo test --workspace --test suite -- particles:: --nocapture`). Beyond the bounds of what reflects light there
//! is none.

mod extract;
mod forward;
mod passes;
mod pipelines;
mod prepare;
mod receivers;
mod volume;

use bevy::app::SubApp;
use bevy::camera::visibility::VisibilitySystems;
use bevy::light::SimulationLightSystems;
use bevy::prelude::*;
use bevy::render::renderer::RenderGraph;
use bevy::render::{ExtractSchedule, Render, RenderApp, RenderStartup};

use crate::GiSystems;
use crate::avg::prepare_grid;
use crate::camera::device_is_adequate;
use crate::compute::load_shaders;
use crate::plugins::configure_stages;
use crate::recovery::forget_resource;

pub use forward::GiForwardPlugin;
pub(crate) use prepare::ProbeBuffers;
pub use volume::ProbeVolume;

/// Whether Bevy's shaders read irradiance volumes on this target.
const VOLUMES_ARE_READ: bool = cfg!(not(target_arch = "wasm32"));

/// Lights what is not in the G-buffer; see the [module](self).
pub struct ProbeVolumePlugin;

impl Plugin for ProbeVolumePlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<ProbeVolume>();
    }

    fn finish(&self, app: &mut App) {
        if !device_is_adequate(app) {
            return;
        }
        if !VOLUMES_ARE_READ {
            warn!(
                "transparent and forward-rendered surfaces get no bounced light: Bevy leaves irradiance volumes out on the web"
            );
            return;
        }
        load_shaders(app);
        let Some(render_world) = app.get_sub_app(RenderApp).map(SubApp::world) else { return };
        let (Some(device), Some(adapter)) = (render_world.get_resource(), render_world.get_resource()) else { return };
        let one_volume = volume::OneVolume::on(device, adapter);
        app.insert_resource(one_volume).init_resource::<volume::SceneBox>().add_systems(
            PostUpdate,
            (
                volume::keep_volume.before(TransformSystems::Propagate).before(SimulationLightSystems::UpdateBounds),
                volume::hide_volume
                    .after(VisibilitySystems::CheckVisibility)
                    .before(SimulationLightSystems::AssignLightsToClusters),
            ),
        );
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        configure_stages(render_app);
        render_app
            .init_resource::<extract::ExtractedProbes>()
            .add_systems(RenderStartup, (pipelines::init_pipelines, forget_resource::<ProbeBuffers>))
            .add_systems(ExtractSchedule, (extract::extract_probes, extract::return_bounds))
            .add_systems(Render, prepare::prepare_probes.in_set(GiSystems::Prepare).after(prepare_grid))
            .add_systems(RenderGraph, passes::light_probes.in_set(GiSystems::Probes));
    }
}
