//! Which graphics adapter, and what is asked of it.

use bevy::render::settings::{WgpuFeatures, WgpuLimits, WgpuSettings, WgpuSettingsPriority};
use bevy::tasks::block_on;
use wgpu::{Backends, Instance, InstanceDescriptor, PowerPreference, RequestAdapterOptions};

use crate::Error;

const INSTALL: &str = "install a Vulkan driver, or Mesa's software one (Debian, Ubuntu: apt-get install \
                       mesa-vulkan-drivers)";

/// The renderer's settings; `webgpu_limits` asks for WebGPU's default limits and for no optional feature whatever.
pub fn settings(webgpu_limits: bool) -> WgpuSettings {
    // OpenGL has no compute on many machines: better no adapter than one that cannot do it.
    let backends = Some(Backends::from_env().unwrap_or(Backends::PRIMARY));
    if !webgpu_limits {
        return WgpuSettings { backends, ..Default::default() };
    }
    WgpuSettings {
        backends,
        priority: WgpuSettingsPriority::WebGPU,
        features: WgpuFeatures::empty(),
        limits: WgpuLimits::default(),
        constrained_limits: Some(WgpuLimits::default()),
        ..Default::default()
    }
}

/// Looks for an adapter that can do what `settings` ask, because Bevy would panic without one.
pub fn check(settings: &WgpuSettings) -> Result<(), Error> {
    let backends = settings.backends.unwrap_or(Backends::PRIMARY);
    let mut descriptor = InstanceDescriptor::new_without_display_handle();
    descriptor.backends = backends;
    let force_fallback_adapter =
        std::env::var("WGPU_FORCE_FALLBACK_ADAPTER").is_ok_and(|value| !matches!(value.as_str(), "" | "0" | "false"));
    let options = RequestAdapterOptions {
        power_preference: PowerPreference::from_env().unwrap_or(PowerPreference::HighPerformance),
        force_fallback_adapter,
        compatible_surface: None,
    };
    let adapter = block_on(Instance::new(descriptor).request_adapter(&options))
        .map_err(|_| Error::Adapter(format!("no graphics adapter found: {INSTALL}")))?;
    if !matches!(settings.priority, WgpuSettingsPriority::WebGPU) {
        return Ok(());
    }
    let mut missing = None;
    settings.limits.check_limits_with_fail_fn(&adapter.limits(), false, |name, asked, allowed| {
        missing.get_or_insert((name, asked, allowed));
    });
    match missing {
        None => Ok(()),
        Some((name, asked, allowed)) => Err(Error::Adapter(format!(
            "{}: below WebGPU's default limits: {name} is {allowed}, needed are {asked}; choose another adapter with \
             WGPU_ADAPTER_NAME, or {INSTALL}",
            adapter.get_info().name
        ))),
    }
}
