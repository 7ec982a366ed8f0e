//! What a run does, checked before anything heavy starts.

use std::fs::{self, OpenOptions};
use std::path::{Path, PathBuf};
use std::time::Duration;

use bevy::prelude::*;
use bevy_bounce::{
    CssmFilter, CssmReceivers, GiIsolate, GiSettings, GlobalIllumination, Quality, Resolution, Technique, VplVisibility,
};

use crate::options::{
    FilterOption, IsolateOption, QualityOption, ReceiversOption, ResolutionOption, ShowOption, Sky, Switch,
    TechniqueOption, VisibilityOption,
};
use crate::{Error, Options};

/// A checked command line.
#[derive(Resource, Clone, Debug)]
pub struct Run {
    /// Pictures to write.
    pub outputs: Vec<Output>,
    /// No window.
    pub headless: bool,
    /// Pixels.
    pub size: UVec2,
    /// Animation time that each frame before the capture adds.
    pub steps: Vec<Duration>,
    /// What cameras get instead of their own; `None` takes it away.
    pub illumination: Option<GlobalIllumination>,
    /// What the picture holds.
    pub isolate: GiIsolate,
    /// Exposure of every camera, EV100.
    pub exposure: Option<f32>,
    /// WebGPU's default limits, no optional features.
    pub webgpu_limits: bool,
    /// Where statistics go.
    pub stats: Option<PathBuf>,
    /// With the virtual lights drawn.
    pub gizmos: bool,
    /// With the panel open.
    pub panel: bool,
    /// Constant sky.
    pub sky: Option<Sky>,
    /// Forward, with MSAA: bounced light from light probes alone.
    pub forward: bool,
    /// Without this project's plugins.
    pub plain_bevy: bool,
}

/// A picture to write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Output {
    /// Display-referred, 8 bits a channel.
    Png(PathBuf),
    /// Linear cd/m^2 before exposure, 32-bit floats.
    Exr(PathBuf),
}

impl Options {
    /// Checks what can be checked without a GPU.
    pub fn check(&self) -> Result<Run, Error> {
        let outputs = self.output.iter().map(|path| output(path)).collect::<Result<Vec<_>, _>>()?;
        if let Some(path) = &self.stats {
            check_writable(path)?;
        }
        let without = self.plain_bevy || self.technique() == TechniqueOption::None;
        if without && !matches!(self.isolate(), GiIsolate::All | GiIsolate::Direct) {
            return Err(Error::Usage(
                "bounced light alone: without a technique there is none; try --technique vpl".into(),
            ));
        }
        if self.forward && self.isolate() != GiIsolate::All {
            return Err(Error::Usage("--forward: only whole pictures, for Bevy lights them in one pass".into()));
        }
        Ok(Run {
            headless: self.headless || !outputs.is_empty() || self.stats.is_some(),
            outputs,
            size: self.size,
            steps: self.steps(),
            illumination: (!without).then(|| self.illumination()),
            isolate: self.isolate(),
            exposure: self.exposure,
            webgpu_limits: self.webgpu_limits,
            stats: self.stats.clone(),
            gizmos: self.gizmos,
            panel: self.panel,
            sky: self.sky,
            forward: self.forward,
            plain_bevy: self.plain_bevy,
        })
    }

    /// The technique that was asked for.
    pub fn technique(&self) -> TechniqueOption {
        self.technique.unwrap_or(TechniqueOption::Vpl)
    }

    /// Whether it asks for bakes.
    pub fn uses_bakes(&self) -> bool {
        self.technique() == TechniqueOption::Cssm || self.visibility == Some(VisibilityOption::Cssm)
    }

    fn isolate(&self) -> GiIsolate {
        match (self.show, self.isolate) {
            (Some(ShowOption::Bounded), _) => GiIsolate::Bounded,
            (Some(ShowOption::Residual), _) => GiIsolate::Residual,
            (Some(ShowOption::Compensated), _) | (None, IsolateOption::Indirect) => GiIsolate::Indirect,
            (None, IsolateOption::All) => GiIsolate::All,
            (None, IsolateOption::Direct) => GiIsolate::Direct,
            (None, IsolateOption::Glossy) => GiIsolate::Glossy,
            (None, IsolateOption::Irradiance) => GiIsolate::Irradiance,
            (None, IsolateOption::Split) => GiIsolate::Split,
            (None, IsolateOption::VoxelAlbedo) => GiIsolate::VoxelAlbedo,
            (None, IsolateOption::VoxelNormal) => GiIsolate::VoxelNormal,
            (None, IsolateOption::VoxelLight) => GiIsolate::VoxelLight,
            (None, IsolateOption::VoxelLevels) => GiIsolate::VoxelLevels,
            (None, IsolateOption::ShadowAtlas) => GiIsolate::ShadowAtlas,
            (None, IsolateOption::Clusters) => GiIsolate::Clusters,
            (None, IsolateOption::Caches) => GiIsolate::Caches,
            (None, IsolateOption::CutSize) => GiIsolate::CutSize,
            (None, IsolateOption::TreeLevels) => GiIsolate::TreeLevels,
            (None, IsolateOption::BakedAtlas) => GiIsolate::BakedAtlas,
        }
    }

    fn illumination(&self) -> GlobalIllumination {
        let preset = match self.quality {
            QualityOption::Low => Quality::Low,
            QualityOption::Medium => Quality::Medium,
            QualityOption::High => Quality::High,
            QualityOption::Ultra => Quality::Ultra,
        };
        let mut settings = preset.settings();
        settings.vpls = self.vpls.unwrap_or(settings.vpls);
        settings.bounces = self.bounces.unwrap_or(settings.bounces);
        settings.grid = self.grid.unwrap_or(settings.grid);
        settings.range = self.range.unwrap_or(settings.range);
        settings.visibility = match self.visibility {
            Some(VisibilityOption::None) => VplVisibility::None,
            Some(VisibilityOption::Voxel) => VplVisibility::Voxel,
            Some(VisibilityOption::Ism) => VplVisibility::Ism,
            Some(VisibilityOption::Atlas) => VplVisibility::Atlas,
            Some(VisibilityOption::Cssm) => VplVisibility::Baked,
            None => settings.visibility,
        };
        settings.bound = self.bound.unwrap_or(settings.bound);
        settings.probes = self.probes.unwrap_or(settings.probes);
        settings.ssbc.iterations = self.ssbc.unwrap_or(settings.ssbc.iterations);
        let pixels = |asked: Option<ResolutionOption>, preset| match asked {
            Some(ResolutionOption::Full) => Resolution::Full,
            Some(ResolutionOption::Half) => Resolution::Half,
            None => preset,
        };
        settings.resolution = pixels(self.resolution, settings.resolution);
        settings.ssbc.resolution = pixels(self.ssbc_resolution, settings.ssbc.resolution);
        settings.cssm.error = self.cssm_error.unwrap_or(settings.cssm.error);
        settings.cssm.receivers = match self.cssm_receivers {
            Some(ReceiversOption::Pixels) => CssmReceivers::Pixels,
            Some(ReceiversOption::Texels) => CssmReceivers::Texels,
            None => settings.cssm.receivers,
        };
        settings.cssm.filter = match self.cssm_filter {
            Some(FilterOption::Nearest) => CssmFilter::Nearest,
            Some(FilterOption::Pixels) => CssmFilter::Pixels,
            None => settings.cssm.filter,
        };
        settings.radiance_cache.glossy = self.glossy == Some(Switch::On);
        settings.cssm.glossy = self.glossy == Some(Switch::On);
        settings.radiance_cache.caches = self.caches.unwrap_or(settings.radiance_cache.caches);
        settings.radiance_cache.reach = self.cache_reach.unwrap_or(settings.radiance_cache.reach);
        settings.history = match self.temporal {
            Some(Switch::Off) => 0,
            Some(Switch::On) => GiSettings::default().history,
            None => settings.history,
        };
        let technique = match self.technique() {
            TechniqueOption::RadianceCache => Technique::RadianceCache,
            TechniqueOption::Cssm => Technique::SurfaceRadiosity,
            _ => Technique::InstantRadiosity,
        };
        let quality = if settings == preset.settings() { preset } else { Quality::Custom(settings) };
        GlobalIllumination { technique, quality, budget: self.budget, ..Default::default() }
    }

    fn steps(&self) -> Vec<Duration> {
        let time = Duration::from_secs_f64(self.time.unwrap_or(0.0));
        let count = match (self.frames, self.time) {
            (Some(frames), _) => frames,
            (None, Some(seconds)) => ((seconds * 60.0).ceil() as u32).max(1),
            (None, None) if self.stats.is_some() => 32,
            (None, None) => 1,
        };
        let step = time / count;
        let mut steps = vec![step; count as usize];
        if let Some(last) = steps.last_mut() {
            *last += time - step * count;
        }
        steps
    }
}

fn output(path: &Path) -> Result<Output, Error> {
    check_writable(path)?;
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("png") => Ok(Output::Png(path.to_owned())),
        Some("exr") => Ok(Output::Exr(path.to_owned())),
        _ => Err(Error::file(path, "cannot tell the format: name it .png or .exr")),
    }
}

fn check_writable(path: &Path) -> Result<(), Error> {
    let existed = path.exists();
    match OpenOptions::new().write(true).create(true).truncate(false).open(path) {
        Ok(_) if existed => Ok(()),
        Ok(_) => fs::remove_file(path).map_err(|error| Error::file(path, format!("cannot be written: {error}"))),
        Err(error) => {
            Err(Error::file(path, format!("cannot be written: {error}; choose a folder that exists and is yours")))
        }
    }
}
