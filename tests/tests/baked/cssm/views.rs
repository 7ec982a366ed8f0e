//! Pictures of what is between the bakes and their light.

use bevy::asset::RenderAssetUsages;
use bevy::camera::Exposure;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::image::Image;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy::render::view::{ColorGrading, ColorGradingGlobal};
use bevy_bounce::cssm::texel_cuts;
use bevy_bounce::cssm::tree::Tree;
use bevy_bounce::{CssmReceivers, CssmSettings, GiIsolate, GiSettings, GlobalIllumination, Quality, Technique};
use bevy_bounce_cssm::{CssmFile, Texel};
use bevy_bounce_tests::baked::cornell_box;
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::stage::{SMALL, Stage, illumination, run};

use super::stage::{box_bake, furnace, furnace_eye};

const ALBEDO: f32 = 0.5;
const EMITTED: f32 = 1000.0;

fn radiosity(error: f32) -> GlobalIllumination {
    received(CssmReceivers::Pixels, error)
}

fn received(receivers: CssmReceivers, error: f32) -> GlobalIllumination {
    let cssm = CssmSettings { error, receivers, ..CssmSettings::DEFAULT };
    let settings = GiSettings { bounces: 1, cssm, ..SMALL };
    GlobalIllumination { technique: Technique::SurfaceRadiosity, quality: Quality::Custom(settings), ..default() }
}

fn glowing_box(atlas: u32) -> (Stage, CssmFile) {
    (furnace(EMITTED, ALBEDO, Transform::IDENTITY, atlas, 1), box_bake(ALBEDO, atlas))
}

/// Has the walls emit something else.
fn glow(stage: &mut Stage, emitted: f32) {
    let mut materials = stage.world().resource_mut::<Assets<StandardMaterial>>();
    materials.iter_mut().for_each(|(_, material)| material.emissive = LinearRgba::rgb(emitted, emitted, emitted));
}

/// The picture as it is in the target, before exposure is taken out again.
fn shown(stage: &mut Stage, isolate: GiIsolate) -> Picture {
    let camera = stage.only::<Camera3d>();
    stage.world().entity_mut(camera).insert(isolate);
    let exposure = stage.world().get::<Exposure>(camera).copied().unwrap_or_default().exposure();
    stage.settled_picture().map(|pixel| pixel.map(|value| value * exposure))
}

/// The count whose colour that is.
fn count_of([red, green, blue]: [f32; 3]) -> f32 {
    let at = if red > 0.0 { 3.0 + red - green } else { 1.0 + green - blue };
    if red + green + blue == 0.0 { 0.0 } else { 8.0_f32.powf(at) }
}

/// Nodes of a pixel's cut, in the mean.
pub(super) fn nodes_of_pixels(stage: &mut Stage) -> f64 {
    let cuts = shown(stage, GiIsolate::CutSize);
    cuts.pixels.iter().map(|pixel| f64::from(count_of(*pixel))).sum::<f64>() / cuts.pixels.len() as f64
}

/// Where all texels send more than the error, each pixel gathers from every one of them; where they send nothing, from none.
#[test]
fn cuts_are_counted() {
    let (mut stage, file) = glowing_box(16);
    let texels = file.meta.texels as f32;
    stage.light_by(radiosity(0.05));
    let all = shown(&mut stage, GiIsolate::CutSize);
    let wrong = all.pixels.iter().map(|pixel| count_of(*pixel)).find(|count| (count / texels - 1.0).abs() > 0.02);
    assert_eq!(wrong, None, "of {texels} texels");
    glow(&mut stage, 0.002 * EMITTED);
    stage.light_by(radiosity(128.0));
    let few = shown(&mut stage, GiIsolate::CutSize).map(|pixel| [count_of(pixel); 3]);
    let (least, most) = few.pixels.iter().fold((f32::INFINITY, 0.0_f32), |(a, b), [n, ..]| (a.min(*n), b.max(*n)));
    println!("{texels} texels; cuts of {least:.1} to {most:.1} nodes");
    assert!(least > 0.9 && most < 0.7 * texels);
    glow(&mut stage, 0.0);
    assert_eq!(shown(&mut stage, GiIsolate::CutSize).mean_luminance(), 0.0);
}

/// The same of texels. With a single bounce, none is between them.
#[test]
fn cuts_of_texels_are_counted() {
    let (mut stage, file) = glowing_box(16);
    let texels = file.meta.texels as usize;
    stage.light_by(received(CssmReceivers::Texels, 0.05));
    stage.settled_picture();
    let [sent, shown] = texel_cuts(stage.render_world()).expect("texels are lit");
    assert!(sent == vec![0.0; texels] && shown.len() == texels);
    let wrong = shown.iter().find(|&&count| count == 0.0 || count > texels as f32);
    assert_eq!(wrong, None, "of {texels} texels");
    glow(&mut stage, 0.0);
    stage.settled_picture();
    assert_eq!(texel_cuts(stage.render_world()), Some([vec![0.0; texels], vec![0.0; texels]]));
}

/// Half the exposure asks for as fine cuts of twice the light, whether the lens halves it or the grading; and where the
/// display darkens what is dark, light is taken together sooner.
#[test]
#[ignore = "takes minutes on a software adapter"]
fn cuts_are_as_fine_as_the_display_shows() {
    const LIGHT: f32 = 2.0;
    let (mut stage, _) = glowing_box(24);
    stage.light_by(radiosity(16.0));
    let camera = stage.only::<Camera3d>();
    let mut nodes = |light: f32, ev100: f32, stops: f32, tonemapping: Tonemapping| {
        glow(&mut stage, light);
        let global = ColorGradingGlobal { exposure: stops, ..default() };
        let display = (Exposure { ev100 }, ColorGrading { global, ..default() }, tonemapping);
        stage.world().entity_mut(camera).insert(display);
        nodes_of_pixels(&mut stage)
    };
    let first = nodes(LIGHT, 4.0, 0.0, Tonemapping::None);
    let darker = nodes(LIGHT, 5.0, 0.0, Tonemapping::None);
    let graded = nodes(LIGHT, 4.0, -1.0, Tonemapping::None);
    let brighter = nodes(2.0 * LIGHT, 5.0, 0.0, Tonemapping::None);
    let neutral = nodes(LIGHT, 4.0, 0.0, Tonemapping::KhronosPbrNeutral);
    println!("{first:.1} nodes; darker {darker:.1}, graded {graded:.1}, brighter {brighter:.1}, neutral {neutral:.1}");
    assert!(darker < 0.9 * first && neutral < 0.9 * first);
    assert!((graded / darker - 1.0).abs() < 0.01 && (brighter / first - 1.0).abs() < 0.01);
}

/// Where the camera's ray through a pixel leaves the box.
fn wall_at(pixel: usize, size: UVec2) -> Vec3 {
    let at = Vec2::new((pixel as u32 % size.x) as f32, (pixel as u32 / size.x) as f32) + 0.5;
    let half = (0.5 * PerspectiveProjection::default().fov).tan() * Vec2::new(size.x as f32 / size.y as f32, 1.0);
    let place = (2.0 * at / size.as_vec2() - 1.0) * half * Vec2::new(1.0, -1.0);
    let eye = furnace_eye();
    let direction = eye.rotation * place.extend(-1.0);
    let distance = (Vec3::splat(1.5).copysign(direction) - eye.translation) / direction;
    eye.translation + direction * distance.min_element()
}

/// The colour of a leaf by the way to it from the root.
fn color_of(tree: &Tree, rank: u32) -> [f32; 3] {
    let (mut color, mut left, mut count) = ([0.1_f32; 3], rank, tree.texels);
    for level in 0.. {
        if count <= 1 {
            break;
        }
        let half = count.div_ceil(2);
        if left < half {
            count = half;
        } else {
            (left, count) = (left - half, count - half);
            color[level % 3] += 0.9 * 0.5_f32.powi(level as i32 / 3 + 1);
        }
    }
    color
}

/// Every pixel shows the leaf of the texel that it is on.
#[test]
fn levels_lie_on_their_texels() {
    let (mut stage, file) = glowing_box(24);
    let picture = shown(&mut stage, GiIsolate::TreeLevels);
    let size = UVec2::new(picture.width as u32, picture.height as u32);
    let tree = Tree::build(&file);
    let texels: Vec<_> = (0..file.meta.texels as usize).filter_map(|index| file.texel(index)).collect();
    let right = picture.pixels.iter().enumerate().filter(|(pixel, color)| {
        let place = wall_at(*pixel, size);
        let distance = |rank: &u32| {
            let texel = &texels[tree.leaf(*rank) as usize];
            let off = place - Vec3::from(texel.position);
            off.length_squared() + 100.0 * off.dot(texel.normal.into()).powi(2)
        };
        let rank = (0..tree.texels).min_by(|a, b| distance(a).total_cmp(&distance(b))).expect("there are texels");
        Vec3::from(**color).distance(Vec3::from(color_of(&tree, rank))) < 2.0e-3
    });
    let right = right.count();
    // Between two texels rounding decides.
    println!("{right} of {} pixels", picture.pixels.len());
    assert!(right * 100 > picture.pixels.len() * 97, "{right} of {} pixels", picture.pixels.len());
}

/// Each texel stands in its cell with what it sends, so many times as large or one of so many; those of which that is
/// not known are passed over.
fn assert_atlas(stage: &mut Stage, file: &CssmFile, larger: usize, every: usize, sent: impl Fn(Texel) -> Option<f32>) {
    let camera = stage.only::<Camera3d>();
    let exposure = stage.world().get::<Exposure>(camera).copied().unwrap_or_default().exposure();
    let picture = shown(stage, GiIsolate::BakedAtlas);
    let [width, height] = file.meta.atlas.map(|cells| cells as usize);
    for (pixel, found) in picture.pixels.iter().enumerate() {
        let [column, row] = [pixel % picture.width, pixel / picture.width].map(|at| at / larger * every);
        let inside = column < width && row < height;
        let texel =
            inside.then(|| file.texel_at([column as u32, row as u32])).flatten().and_then(|index| file.texel(index));
        let Some(sent) = texel.map_or(Some(0.0), &sent) else { continue };
        let expected = sent * exposure;
        assert!((found[1] - expected).abs() <= 2.0e-3 * expected, "{pixel}: {found:?}, not {expected}");
    }
}

/// Texels stand in their cells with their light, enlarged or every other one.
#[test]
fn atlases_are_shown_lit() {
    for (atlas, larger, every) in [(16, 2, 1), (64, 1, 2)] {
        let (mut stage, file) = glowing_box(atlas);
        assert_atlas(&mut stage, &file, larger, every, |_| Some(EMITTED));
    }
}

/// Has only the half towards positive x emit, by a texture.
fn glow_by_halves(stage: &mut Stage) {
    let world = stage.world();
    let size = Extent3d { width: 2, height: 1, depth_or_array_layers: 1 };
    let halves = vec![0, 0, 0, 255, 255, 255, 255, 255];
    let format = TextureFormat::Rgba8UnormSrgb;
    let halves = Image::new(size, TextureDimension::D2, halves, format, RenderAssetUsages::default());
    let halves = world.resource_mut::<Assets<Image>>().add(halves);
    for (_, mesh) in world.resource_mut::<Assets<Mesh>>().iter_mut() {
        let positions = mesh.attribute(Mesh::ATTRIBUTE_POSITION).and_then(|values| values.as_float3());
        let across = |[x, ..]: &[f32; 3]| [x / 4.0 + 0.5, 0.5];
        let uvs: Vec<[f32; 2]> = positions.unwrap_or_default().iter().map(across).collect();
        mesh.insert_attribute(Mesh::ATTRIBUTE_UV_0, uvs);
    }
    let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
    materials.iter_mut().for_each(|(_, material)| material.emissive_texture = Some(halves.clone()));
}

/// Texels emit what a texture says, and light the rest by it.
#[test]
fn what_a_texture_emits_bounces() {
    let (mut stage, file) = glowing_box(16);
    stage.light_by(radiosity(1.0));
    let whole = shown(&mut stage, GiIsolate::Indirect).mean_luminance();
    glow_by_halves(&mut stage);
    let half = shown(&mut stage, GiIsolate::Indirect).mean_luminance();
    println!("{:.3} of the light", half / whole);
    assert!((0.3..0.7).contains(&(half / whole)), "{half} of {whole}");
    assert_atlas(&mut stage, &file, 2, 1, |texel| {
        let x = texel.position[0];
        (x.abs() > 0.25).then_some(if x > 0.0 { EMITTED } else { 0.0 })
    });
}

/// They differ from each other and from the light; without bakes, and without the technique, there is nothing.
#[test]
fn pictures_of_bakes_come_and_go() {
    use GiIsolate::{BakedAtlas, CutSize, Indirect, TreeLevels};
    let size = UVec2::new(160, 90);
    let mut stage =
        Stage::of_asset("cornell_box.glb", run(size, Some(radiosity(16.0))), true, Some(cornell_box().clone()));
    let pictures = [Indirect, CutSize, TreeLevels, BakedAtlas].map(|isolate| (isolate, shown(&mut stage, isolate)));
    for (number, (isolate, picture)) in pictures.iter().enumerate() {
        assert!(picture.nonfinite() == 0 && picture.mean_luminance() > 0.0, "{isolate:?}");
        assert!(pictures[..number].iter().all(|(_, other)| other != picture), "{isolate:?} shows the same");
        if let Some(folder) = std::env::var_os("BOUNCE_PICTURES") {
            let path = std::path::Path::new(&folder).join(format!("cssm.{isolate:?}.png"));
            picture.save(&path).unwrap_or_else(|error| panic!("{error}"));
        }
    }
    let again = shown(&mut stage, Indirect);
    assert!(again == pictures[0].1, "a picture leaves something behind");
    stage.light_by(illumination(SMALL));
    for isolate in [CutSize, TreeLevels, BakedAtlas] {
        assert_eq!(shown(&mut stage, isolate).mean_luminance(), 0.0, "{isolate:?}");
    }
}
