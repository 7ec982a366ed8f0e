//! The examples that are lit by baked visibility.

use std::path::Path;
use std::time::Duration;

use bevy::prelude::*;
use bevy_bounce::cssm::times_lit;
use bevy_bounce::{CssmObject, CssmSettings, GiIsolate, GiSettings, GlobalIllumination, Quality, Technique};
use bevy_bounce_examples::Run;
use bevy_bounce_examples::scenes::{ChurchPlugin, HeadsPlugin};
use bevy_bounce_tests::metrics::Metrics;
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::stage::{SMALL, Stage, run};

const SIZE: UVec2 = UVec2::new(96, 54);

/// With direct light, as fast as it may be.
fn whole() -> Run {
    let settings = GiSettings { bounces: 2, cssm: CssmSettings { error: 64.0, ..CssmSettings::DEFAULT }, ..SMALL };
    let radiosity =
        GlobalIllumination { technique: Technique::SurfaceRadiosity, quality: Quality::Custom(settings), ..default() };
    Run { isolate: GiIsolate::All, ..run(SIZE, Some(radiosity)) }
}

/// What the display shows, for looking at.
fn show(stage: &Stage, name: &str) {
    let Some(folder) = std::env::var_os("BOUNCE_PICTURES") else { return };
    let picture = image::RgbaImage::from_vec(SIZE.x, SIZE.y, stage.display()).expect("four bytes a pixel");
    picture.save(Path::new(&folder).join(name)).expect("can be written");
}

#[test]
fn heads_turn() {
    let mut stage = Stage::with_run(whole(), |app| {
        app.add_plugins(HeadsPlugin);
    });
    let first = stage.picture();
    show(&stage, "cssm_heads.0.png");
    assert_eq!(stage.world().query::<&CssmObject>().iter(stage.world()).count(), 3);
    let times = times_lit(stage.render_world());
    stage.frame(Duration::from_millis(1500));
    let later = stage.captured();
    show(&stage, "cssm_heads.1.png");
    assert_eq!(times_lit(stage.render_world()), times + 1);
    let metrics = Metrics::new(&later, &first).expect("sizes are equal");
    assert!(metrics.nonfinite == 0 && metrics.nrmse > 0.05 && (metrics.energy - 1.0).abs() < 0.1, "{metrics:?}");
}

#[test]
fn a_church_is_lit_by_its_floor() {
    let mut stage = Stage::with_run(whole(), |app| {
        app.add_plugins(ChurchPlugin);
    });
    let lit = stage.picture();
    show(&stage, "cssm_church.png");
    let object = stage.only::<CssmObject>();
    stage.world().entity_mut(object).remove::<CssmObject>();
    let direct = stage.picture();
    // The vault is far from any sun.
    let vault = |picture: &Picture| picture.mean_of(36..60, 2..12)[1];
    println!("vault {} cd/m^2, without bounces {}", vault(&lit), vault(&direct));
    assert!(lit.nonfinite() == 0 && vault(&lit) > 10.0 && vault(&direct) < 0.05 * vault(&lit));
}
