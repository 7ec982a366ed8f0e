//! Every setting changes the picture, and as its documentation says.

use std::collections::{BTreeMap, BTreeSet};

use bevy::prelude::*;
use bevy::reflect::{PartialReflect, ReflectRef};
use bevy_bounce::{
    CssmFilter, CssmReceivers, GiIsolate, GiSettings, GlobalIllumination, Quality, Resolution, SsbcSettings, Technique,
    VplVisibility,
};
use bevy_bounce_examples::options::Sky;
use bevy_bounce_tests::baked::small_cornell_box;
use bevy_bounce_tests::metrics::Metrics;
use bevy_bounce_tests::picture::{Picture, luminance};
use bevy_bounce_tests::stage::{SMALL, Stage, run};

const SIZE: UVec2 = UVec2::new(64, 36);
/// Enough pixels that the number of caches follows from the setting.
const CACHED_SIZE: UVec2 = UVec2::new(384, 216);
/// By shadow maps.
const MAPPED: GiSettings = GiSettings { visibility: VplVisibility::Atlas, ..SMALL };
/// Bounded so much that there is a lot to give back.
const COMPENSATED: GiSettings =
    GiSettings { bound: 0.4, ssbc: SsbcSettings { iterations: 1, ..SsbcSettings::OFF }, ..SMALL };

/// What a setting is looked at by.
#[derive(Clone, Copy, Debug)]
enum View {
    /// Bounced light of virtual lights.
    Lights,
    /// What bias compensation adds.
    Residual,
    /// The whole picture, with what is lit by probes.
    Whole,
    /// Bounced light of caches.
    Caches,
    /// Bounced light of baked objects.
    Baked,
}

/// What its values do to that, from one to the next.
#[derive(Clone, Copy, Debug)]
enum Effect {
    /// Make it another.
    Change,
    Brighten,
    Darken,
    /// Bring it nearer to that of the last.
    Refine,
    /// Make neighbours more alike.
    Smooth,
    /// Make pictures under a lamp that flickers more alike.
    Calm,
}

/// The Cornell box, baked, under a sky, with a ball of metal and a pane of glass.
fn stage(size: UVec2) -> Stage {
    let mut run = run(size, Some(light(View::Lights, SMALL)));
    run.sky = Some(Sky([0.4, 0.5, 0.8]));
    let mut stage = Stage::of_asset("cornell_box.glb", run, true, Some(small_cornell_box().clone()));
    let world = stage.world();
    let metal = StandardMaterial { metallic: 1.0, perceptual_roughness: 0.3, ..default() };
    let glass =
        StandardMaterial { base_color: Color::WHITE.with_alpha(0.9), alpha_mode: AlphaMode::Blend, ..default() };
    let ball = (Mesh::from(Sphere::new(0.6)), metal, Vec3::new(0.6, 0.8, 1.4));
    let pane = (Mesh::from(Rectangle::new(1.0, 1.5)), glass, Vec3::new(-1.3, 2.5, 1.0));
    for (mesh, material, at) in [ball, pane] {
        let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
        world.spawn((Mesh3d(mesh), MeshMaterial3d(material), Transform::from_translation(at)));
    }
    stage
}

fn light(view: View, settings: GiSettings) -> GlobalIllumination {
    let technique = match view {
        View::Lights | View::Residual | View::Whole => Technique::InstantRadiosity,
        View::Caches => Technique::RadianceCache,
        View::Baked => Technique::SurfaceRadiosity,
    };
    GlobalIllumination { technique, quality: Quality::Custom(settings), ..default() }
}

fn picture(stage: &mut Stage, view: View, settings: GiSettings) -> Picture {
    let camera = stage.only::<Camera3d>();
    let isolate = match view {
        View::Residual => GiIsolate::Residual,
        View::Whole => GiIsolate::All,
        View::Lights | View::Caches | View::Baked => GiIsolate::Indirect,
    };
    stage.world().entity_mut(camera).insert(isolate);
    stage.light_by(light(view, settings));
    let picture = stage.settled_picture();
    assert!(picture.nonfinite() == 0 && picture.mean_luminance() >= 0.0, "{settings:?}");
    picture
}

fn steps<T>(base: GiSettings, values: impl IntoIterator<Item = T>, set: fn(&mut GiSettings, T)) -> Vec<GiSettings> {
    let step = |value| {
        let mut settings = base;
        set(&mut settings, value);
        settings
    };
    values.into_iter().map(step).collect()
}

/// Values of each setting, and what they do.
fn cases() -> Vec<(View, Effect, Vec<GiSettings>)> {
    use Effect::*;
    use Resolution::{Full, Half};
    use VplVisibility::{Atlas, Baked, Ism, None, Voxel};
    let receivers = [CssmReceivers::Pixels, CssmReceivers::Texels];
    let filters = [CssmFilter::Nearest, CssmFilter::Pixels];
    vec![
        (View::Lights, Refine, steps(SMALL, [16, 32, 64], |s, v| s.grid = v)),
        (View::Lights, Change, steps(SMALL, [1.0, 40.0], |s, v| s.range = v)),
        (View::Lights, Refine, steps(SMALL, [64, 256, 2048], |s, v| s.vpls = v)),
        (View::Lights, Brighten, steps(SMALL, [1, 2, 6], |s, v| s.bounces = v)),
        (View::Lights, Darken, steps(SMALL, [None, Voxel], |s, v| s.visibility = v)),
        // Which of these is nearest to a bake is chance in a box; against exact rays the suite has their order.
        (View::Lights, Refine, steps(SMALL, [None, Ism, Baked], |s, v| s.visibility = v)),
        (View::Lights, Refine, steps(SMALL, [None, Voxel, Baked], |s, v| s.visibility = v)),
        (View::Lights, Refine, steps(SMALL, [None, Atlas, Baked], |s, v| s.visibility = v)),
        (View::Lights, Refine, steps(MAPPED, [8, 16, 96], |s, v| s.tile = v)),
        (View::Lights, Brighten, steps(SMALL, [0.05, 0.4, 1.0], |s, v| s.bound = v)),
        (View::Lights, Refine, steps(SMALL, [16, 64, 256], |s, v| s.sky = v)),
        (View::Lights, Smooth, steps(SMALL, [Full, Half], |s, v| s.resolution = v)),
        (View::Lights, Calm, steps(SMALL, [0, 8], |s, v| s.history = v)),
        (View::Whole, Brighten, steps(SMALL, [0, 8], |s, v| s.probes = v)),
        (View::Lights, Brighten, steps(COMPENSATED, [0, 1, 2], |s, v| s.ssbc.iterations = v)),
        (View::Residual, Refine, steps(COMPENSATED, [2.0, 0.3, 0.02], |s, v| s.ssbc.solid_angle = v)),
        (View::Residual, Refine, steps(COMPENSATED, [2.0, 0.3, 0.02], |s, v| s.ssbc.edge_solid_angle = v)),
        (View::Residual, Change, steps(COMPENSATED, [Half, Full], |s, v| s.ssbc.resolution = v)),
        (View::Residual, Smooth, steps(COMPENSATED, [false, true], |s, v| s.ssbc.blur = v)),
        (View::Lights, Brighten, steps(SMALL, [false, true], |s, v| s.radiance_cache.glossy = v)),
        (View::Caches, Change, steps(SMALL, [256, 32768], |s, v| s.radiance_cache.caches = v)),
        (View::Caches, Smooth, steps(SMALL, [1.5, 4.0], |s, v| s.radiance_cache.reach = v)),
        (View::Caches, Brighten, steps(SMALL, [false, true], |s, v| s.radiance_cache.further_bounces = v)),
        (View::Baked, Refine, steps(SMALL, [64.0, 16.0, 2.0], |s, v| s.cssm.error = v)),
        (View::Baked, Smooth, steps(SMALL, filters, |s, v| s.cssm.filter = v)),
        (View::Baked, Brighten, steps(SMALL, [false, true], |s, v| s.cssm.glossy = v)),
        (View::Baked, Smooth, steps(SMALL, receivers, |s, v| s.cssm.receivers = v)),
    ]
}

/// Every value below a struct by its path, as text.
fn leaves(value: &dyn PartialReflect, path: &str, found: &mut BTreeMap<String, String>) {
    let ReflectRef::Struct(fields) = value.reflect_ref() else {
        found.insert(path.to_owned(), format!("{value:?}"));
        return;
    };
    for (name, field) in fields.iter_fields() {
        leaves(field, &format!("{path}.{name}"), found);
    }
}

/// The only setting in which they differ.
fn setting(steps: &[GiSettings]) -> String {
    let mut values: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for step in steps {
        let mut found = BTreeMap::new();
        leaves(step, "", &mut found);
        found.into_iter().for_each(|(path, value)| _ = values.entry(path).or_default().insert(value));
    }
    values.retain(|_, values| values.len() > 1);
    let names: Vec<String> = values.into_keys().collect();
    assert_eq!(names.len(), 1, "{names:?} are changed at once");
    names.concat()
}

/// Mean difference of neighbours in a row over the mean.
fn roughness(picture: &Picture) -> f64 {
    let light: Vec<f64> = picture.pixels.iter().map(|pixel| luminance(*pixel)).collect();
    let differences = light.chunks(picture.width).flat_map(|row| row.windows(2)).map(|pair| (pair[0] - pair[1]).abs());
    differences.sum::<f64>() / light.iter().sum::<f64>()
}

/// Share of the light that comes and goes under a lamp that flickers by half a percent.
fn restlessness(stage: &mut Stage, view: View, settings: GiSettings) -> f64 {
    let lamp = stage.only::<SpotLight>();
    picture(stage, view, settings);
    let mut lit_by = |factor: f32| {
        if let Some(mut light) = stage.world().get_mut::<SpotLight>(lamp) {
            light.intensity *= factor;
        }
        stage.picture().mean_luminance()
    };
    let flickers: Vec<f64> = (0..8).map(|_| (lit_by(1.005) / lit_by(1.0 / 1.005) - 1.0).abs()).collect();
    flickers[flickers.len() - 1]
}

/// A figure of each picture, which may look at the last one, too.
fn of_pictures(
    stage: &mut Stage,
    view: View,
    steps: &[GiSettings],
    figure: impl Fn(&Picture, &Picture) -> f64,
) -> Vec<f64> {
    let pictures: Vec<Picture> = steps.iter().map(|settings| picture(stage, view, *settings)).collect();
    assert!(pictures.windows(2).all(|pair| pair[0] != pair[1]), "no effect");
    let last = &pictures[pictures.len() - 1];
    pictures.iter().map(|picture| figure(picture, last)).collect()
}

/// What has to fall from one value to the next; for a mere change, what does so anyway.
fn measure(stage: &mut Stage, view: View, effect: Effect, steps: &[GiSettings]) -> Vec<f64> {
    match effect {
        Effect::Change => {
            of_pictures(stage, view, steps, |_, _| 0.0);
            (0..steps.len()).map(|step| -(step as f64)).collect()
        }
        Effect::Brighten => of_pictures(stage, view, steps, |picture, _| -picture.mean_luminance()),
        Effect::Darken => of_pictures(stage, view, steps, |picture, _| picture.mean_luminance()),
        Effect::Refine => {
            let error = |picture: &Picture, last: &Picture| Metrics::new(picture, last).expect("sizes are equal").nrmse;
            of_pictures(stage, view, steps, error)
        }
        Effect::Smooth => of_pictures(stage, view, steps, |picture, _| roughness(picture)),
        Effect::Calm => steps.iter().map(|settings| restlessness(stage, view, *settings)).collect(),
    }
}

#[test]
fn every_setting_does_what_it_says() {
    let mut all = BTreeMap::new();
    leaves(&SMALL, "", &mut all);
    let cases = cases();
    let tried: BTreeSet<String> = cases.iter().map(|(_, _, steps)| setting(steps)).collect();
    assert_eq!(tried, all.into_keys().collect(), "settings that are tried and those that there are");
    let (mut stage, mut cached) = (stage(SIZE), stage(CACHED_SIZE));
    let first = picture(&mut stage, View::Lights, SMALL);
    let mut wrong = Vec::new();
    for (view, effect, steps) in cases {
        let name = setting(&steps);
        let stage = if matches!(view, View::Caches) { &mut cached } else { &mut stage };
        let figures = measure(stage, view, effect, &steps);
        println!("{name}, {view:?}: {effect:?} {figures:.4?}");
        if figures.windows(2).any(|pair| pair[1] >= pair[0]) {
            wrong.push(format!("{name}, {view:?}: {effect:?} {figures:?}"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(first == picture(&mut stage, View::Lights, SMALL), "a setting left something behind");
}
