//! Exposure measured once, from what the camera sees: the mean luminance, extremes held back, comes out at middle grey.

use bevy::camera::Exposure;
use bevy::prelude::*;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::window::PrimaryWindow;

use crate::Run;
use crate::capture::{self, CaptureScene};

/// What the mean of the picture should come out at, linear, before tonemapping.
const MIDDLE: f32 = 0.35;
/// Finished frames between looks at a window's picture.
const INTERVAL: u32 = 10;

/// On a camera: without `--exposure`, its exposure is measured as soon as it sees something.
///
/// Windowless runs do so after warming up; windows need [`MeteringPlugin`].
#[derive(Component, Clone, Copy, Debug)]
pub struct Metered;

/// Measures the exposure of [`Metered`] cameras in windows.
pub struct MeteringPlugin;

/// Reads back what `camera` sees.
#[derive(Component)]
struct Meter {
    camera: Entity,
    frames: u32,
    last: Option<f32>,
}

impl Plugin for MeteringPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Update, start);
    }
}

fn start(
    cameras: Query<Entity, (With<Camera3d>, Added<Metered>)>,
    windows: Query<&Window, With<PrimaryWindow>>,
    mut images: ResMut<Assets<Image>>,
    mut commands: Commands,
    run: Res<Run>,
) {
    let Ok(window) = windows.single() else { return };
    for camera in cameras.iter().filter(|_| run.exposure.is_none()) {
        let image = images.add(capture::scene_image(window.physical_size().max(UVec2::ONE)));
        commands.entity(camera).insert(CaptureScene(image.clone()));
        let meter = Meter { camera, frames: 0, last: None };
        commands.spawn((Readback::texture(image), meter)).observe(look);
    }
}

/// Pipelines are compiled while the window is already there: two looks must agree.
fn look(
    read: On<ReadbackComplete>,
    mut meters: Query<&mut Meter>,
    mut exposures: Query<&mut Exposure>,
    mut commands: Commands,
) {
    let Ok(mut meter) = meters.get_mut(read.entity) else { return };
    meter.frames += 1;
    if !meter.frames.is_multiple_of(INTERVAL) {
        return;
    }
    let Ok(mut exposure) = exposures.get_mut(meter.camera) else { return };
    let seen = exposure_for(&capture::decode(&read.data, *exposure));
    if let Some(ev100) = seen.filter(|_| seen == meter.last) {
        exposure.ev100 = ev100;
        commands.entity(meter.camera).remove::<CaptureScene>();
        commands.entity(read.entity).despawn();
    }
    meter.last = seen;
}

/// EV100 that shows these luminances, in cd/m^2, well; `None` for a black picture. In half stops, so that the last bit
/// of a frame does not matter.
pub fn exposure_for(picture: &[[f32; 3]]) -> Option<f32> {
    let luminance = |[r, g, b]: &[f32; 3]| 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let mut lit: Vec<f32> = picture.iter().map(luminance).filter(|value| value.is_finite() && *value > 0.0).collect();
    lit.sort_by(f32::total_cmp);
    let ceiling = *lit.get(lit.len() * 9 / 10)?;
    let mean = lit.iter().map(|value| value.min(ceiling)).sum::<f32>() / lit.len() as f32;
    let ev100 = (mean / (1.2 * MIDDLE)).log2();
    Some((ev100 * 2.0).round() / 2.0).filter(|ev100| ev100.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_follows_luminance() {
        let grey = |value| vec![[value; 3]; 16];
        let (dim, bright) = (exposure_for(&grey(10.0)), exposure_for(&grey(160.0)));
        assert_eq!(dim.zip(bright).map(|(dim, bright)| bright - dim), Some(4.0));
        assert_eq!(exposure_for(&grey(0.0)), None);
        assert_eq!(exposure_for(&[]), None);
    }
}
