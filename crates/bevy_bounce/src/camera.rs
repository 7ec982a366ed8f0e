//! What a camera needs for bounced light, brought along and handed back.
//!
//! Bevy decides per app how opaque materials are drawn, and a `Camera3d` without the matching prepasses loses them. So on a
//! device that can run the plugins, all opaque materials and all 3D cameras are deferred. A camera that asks for bounced
//! light is given [`Hdr`] and black [`AmbientLight`] besides, and gets back what it had when it no longer asks; until then
//! that is its sky, see [`GiSettings::sky`](crate::GiSettings::sky). On a device that lacks something, nothing of this happens.

use bevy::camera::Hdr;
use bevy::core_pipeline::core_3d::check_msaa;
use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass};
use bevy::light::AmbientLight;
use bevy::pbr::DefaultOpaqueRendererMethod;
use bevy::pbr::deferred::insert_deferred_lighting_pass_id_component;
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::renderer::RenderDevice;
use bevy::render::settings::WgpuLimits;

use crate::{GlobalIllumination, Technique};

/// Brightness of the ambient light that cameras with bounced light are given: none, and told by its sign from a game's own.
const DARK: f32 = -0.0;

/// What a camera had before bounced light changed it.
#[derive(Component, Clone, Debug)]
pub(crate) struct Found {
    hdr: bool,
    ambient: Option<AmbientLight>,
}

impl Found {
    /// Its own ambient light.
    pub fn ambient(&self) -> Option<&AmbientLight> {
        self.ambient.as_ref()
    }
}

/// Without brightness. The rest stays, so that a game may set that alone.
fn darkened(ambient: Option<&AmbientLight>) -> AmbientLight {
    AmbientLight { brightness: DARK, ..ambient.cloned().unwrap_or_default() }
}

/// Whether it is ours.
fn is_darkened(ambient: &AmbientLight) -> bool {
    ambient.brightness.to_bits() == DARK.to_bits()
}

impl GlobalIllumination {
    /// Whether anything is to be computed.
    pub(crate) fn is_active(&self) -> bool {
        self.technique != Technique::None
    }
}

/// What the device offers less of than the plugins need, which is no more than WebGPU guarantees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MissingLimit {
    name: &'static str,
    needed: u64,
    offered: u64,
}

/// The first limit that falls short.
pub(crate) fn missing_limit(offered: &WgpuLimits) -> Option<MissingLimit> {
    let floor = WgpuLimits::default();
    macro_rules! limits {
        ($($name:ident),* $(,)?) => {
            [$(MissingLimit {
                name: stringify!($name),
                needed: u64::from(floor.$name),
                offered: u64::from(offered.$name),
            }),*]
        };
    }
    limits![
        max_bind_groups,
        max_color_attachment_bytes_per_sample,
        max_compute_invocations_per_workgroup,
        max_compute_workgroup_size_x,
        max_compute_workgroup_size_y,
        max_compute_workgroup_storage_size,
        max_compute_workgroups_per_dimension,
        max_sampled_textures_per_shader_stage,
        max_storage_buffers_per_shader_stage,
        max_storage_textures_per_shader_stage,
        max_uniform_buffers_per_shader_stage,
        max_uniform_buffer_binding_size,
        max_storage_buffer_binding_size,
    ]
    .into_iter()
    .find(|limit| limit.offered < limit.needed)
}

/// Whether there is a device and it can run the plugins. Valid from `Plugin::finish` on.
pub(crate) fn device_is_adequate(app: &App) -> bool {
    device(app).is_some_and(|device| missing_limit(&device.limits()).is_none())
}

fn device(app: &App) -> Option<&RenderDevice> {
    app.get_sub_app(RenderApp)?.world().get_resource::<RenderDevice>()
}

/// The same, with a warning where a device falls short.
fn is_adequate_or_warn(app: &App) -> bool {
    let Some(device) = device(app) else { return false };
    let missing = missing_limit(&device.limits());
    if let Some(limit) = missing {
        warn!(
            "no global illumination: this device's {} is {}, and {} is needed",
            limit.name, limit.offered, limit.needed
        );
    }
    missing.is_none()
}

/// Makes the app deferred, where the device can run the plugins; says what it lacks where not. Call it from
/// `Plugin::finish`.
pub(crate) fn finish(app: &mut App) {
    if !is_adequate_or_warn(app) {
        return;
    }
    app.insert_resource(DefaultOpaqueRendererMethod::deferred()).add_systems(
        PostUpdate,
        (make_deferred, prepare_cameras::<true>).before(check_msaa).before(insert_deferred_lighting_pass_id_component),
    );
}

/// The same for an app that stays forward: cameras that ask for bounced light lose ambient light, and nothing else changes.
pub(crate) fn finish_forward(app: &mut App) {
    if is_adequate_or_warn(app) {
        app.add_systems(PostUpdate, prepare_cameras::<false>);
    }
}

/// Every 3D camera draws what deferred materials need.
fn make_deferred(
    mut commands: Commands,
    cameras: Query<Entity, (With<Camera3d>, Or<(Without<DepthPrepass>, Without<DeferredPrepass>)>)>,
) {
    for camera in &cameras {
        commands.entity(camera).insert((DepthPrepass, DeferredPrepass, Msaa::Off));
    }
}

/// Cameras that ask for bounced light have what it takes, `HDR` or not; those that no longer do get back what they had.
fn prepare_cameras<const HDR: bool>(
    mut commands: Commands,
    mut cameras: Query<
        (Entity, Option<&GlobalIllumination>, Has<Hdr>, Option<&AmbientLight>, Option<&mut Found>),
        With<Camera3d>,
    >,
) {
    for (entity, illumination, hdr, ambient, found) in &mut cameras {
        let mut camera = commands.entity(entity);
        match (illumination.is_some_and(GlobalIllumination::is_active), found) {
            (true, None) => {
                let own = ambient.filter(|ambient| !is_darkened(ambient)).cloned();
                camera.insert((Found { hdr, ambient: own }, darkened(ambient)));
                if HDR {
                    camera.insert(Hdr);
                }
            }
            (true, Some(mut found)) => {
                if HDR && !hdr {
                    found.hdr = false;
                    camera.insert(Hdr);
                }
                match (ambient.filter(|ambient| is_darkened(ambient)), &mut found.ambient) {
                    // A game may set the colour alone.
                    (Some(dark), Some(own)) => own.color = dark.color,
                    (Some(_), None) => {}
                    (None, own) => {
                        *own = ambient.cloned();
                        camera.insert(darkened(ambient));
                    }
                }
            }
            (false, Some(found)) => {
                camera.remove::<Found>();
                if HDR && !found.hdr {
                    camera.remove::<Hdr>();
                }
                match (ambient.filter(|ambient| !is_darkened(ambient)), found.ambient.clone()) {
                    (Some(_), _) => {}
                    (None, Some(own)) => _ = camera.insert(own),
                    (None, None) => _ = camera.remove::<AmbientLight>(),
                }
            }
            (false, None) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn app() -> App {
        let mut app = App::new();
        app.add_systems(Update, (make_deferred, prepare_cameras::<true>));
        app
    }

    #[test]
    fn webgpu_defaults_are_enough() {
        assert_eq!(missing_limit(&WgpuLimits::default()), None);
    }

    #[test]
    fn the_limit_that_falls_short_is_named() {
        let limits = WgpuLimits { max_storage_buffers_per_shader_stage: 4, ..default() };
        let expected = MissingLimit { name: "max_storage_buffers_per_shader_stage", needed: 8, offered: 4 };
        assert_eq!(missing_limit(&limits), Some(expected));
    }

    #[test]
    fn every_3d_camera_is_deferred() {
        let mut app = app();
        let camera = app.world_mut().spawn((Camera3d::default(), Msaa::Sample4)).id();
        app.update();
        let camera = app.world().entity(camera);
        assert!(camera.contains::<DepthPrepass>() && camera.contains::<DeferredPrepass>());
        assert_eq!(camera.get::<Msaa>(), Some(&Msaa::Off));
        assert!(!camera.contains::<Hdr>() && !camera.contains::<AmbientLight>());
    }

    #[test]
    fn a_camera_gets_back_what_it_had() {
        let ambient = AmbientLight { brightness: 7.0, ..default() };
        for (hdr, had) in [(false, None), (true, Some(ambient))] {
            for by_technique in [false, true] {
                let mut app = app();
                let camera = app.world_mut().spawn((Camera3d::default(), GlobalIllumination::default())).id();
                let mut entity = app.world_mut().entity_mut(camera);
                if hdr {
                    entity.insert(Hdr);
                }
                if let Some(ambient) = had.clone() {
                    entity.insert(ambient);
                }
                app.update();
                app.update();
                let entity = app.world().entity(camera);
                assert!(entity.contains::<Hdr>());
                assert_eq!(entity.get::<AmbientLight>().map(|ambient| ambient.brightness), Some(0.0));

                let mut entity = app.world_mut().entity_mut(camera);
                if by_technique {
                    entity.insert(GlobalIllumination { technique: Technique::None, ..default() });
                } else {
                    entity.remove::<GlobalIllumination>();
                }
                app.update();
                app.update();
                let entity = app.world().entity(camera);
                assert_eq!(entity.contains::<Hdr>(), hdr);
                assert_eq!(
                    entity.get::<AmbientLight>().map(|ambient| ambient.brightness),
                    had.as_ref().map(|ambient| ambient.brightness)
                );
            }
        }
    }

    #[test]
    fn a_forward_app_loses_its_ambient_light_alone() {
        let mut app = App::new();
        app.add_systems(Update, prepare_cameras::<false>);
        let camera = app.world_mut().spawn((Camera3d::default(), Msaa::Sample4, GlobalIllumination::default())).id();
        app.update();
        let entity = app.world().entity(camera);
        assert_eq!(entity.get::<AmbientLight>().map(|ambient| ambient.brightness), Some(0.0));
        assert!(!entity.contains::<Hdr>() && !entity.contains::<DeferredPrepass>());
        assert_eq!(entity.get::<Msaa>(), Some(&Msaa::Sample4));
        app.world_mut().entity_mut(camera).insert(Hdr).remove::<GlobalIllumination>();
        app.update();
        let entity = app.world().entity(camera);
        assert!(entity.contains::<Hdr>() && !entity.contains::<AmbientLight>());
    }

    #[test]
    fn ambient_light_that_comes_later_is_handed_back_too() {
        let mut app = app();
        let camera = app.world_mut().spawn((Camera3d::default(), GlobalIllumination::default())).id();
        app.update();
        app.world_mut().entity_mut(camera).insert(AmbientLight { brightness: 3.0, ..default() });
        app.update();
        let brightness = |app: &App| app.world().get::<AmbientLight>(camera).map(|ambient| ambient.brightness);
        assert_eq!(brightness(&app), Some(0.0));
        app.world_mut().entity_mut(camera).remove::<GlobalIllumination>();
        app.update();
        assert_eq!(brightness(&app), Some(3.0));
    }
}
