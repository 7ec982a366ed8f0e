//! The query of baked visibility: the GPU's answer is the CPU's.

use bevy::math::{Affine3A, Quat, Vec3};
use bevy_bounce::cssm::tree::Tree;
use bevy_bounce::cssm::words::{PAGE_BITS, PAGES, Words};
use bevy_bounce_cssm::{CssmFile, Filter};
use bevy_bounce_shaders::types::NONE;
use bevy_bounce_tests::baked::{cornell_box, resources, small_block, smallest_page_bits};
use bevy_bounce_tests::compose::compose_source;
use bevy_bounce_tests::gpu::{Resources, gpu};

const PAIRS: usize = 1_000_000;
/// Threads of a dispatch.
const BATCH: usize = 1 << 18;

const QUERY: &str = "
#import bevy_bounce::cssm::maps::reads
#import bevy_bounce::cssm::query::{is_between, is_seen_from_outside, sight, visibility, STRAIGHT}
#import bevy_bounce::cssm::texels::{bakes, load_texel}

// Texel, then the point.
@group(2) @binding(0) var<storage, read> pairs: array<vec4<u32>>;
@group(2) @binding(1) var<storage, read_write> answers: array<vec4<u32>>;

@compute @workgroup_size(64)
fn ask(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&pairs) {
        return;
    }
    let pair = pairs[id.x];
    let texel = load_texel(0u, pair.x);
    let point = bitcast<vec3<f32>>(pair.yzw);
    reads = 0u;
    let seen = visibility(0u, texel, point, false) > 0.0;
    // The slot in the texel's record counts, too.
    let count = reads + 1u;
    let filtered = visibility(0u, texel, point, true);
    let outside = is_seen_from_outside(0u, texel.position, texel.position - point, STRAIGHT);
    let far = texel.position + (texel.position - bakes.objects[0].csm_center);
    let between = is_between(0u, point, far, STRAIGHT);
    let sees = sight(0u, texel, bakes.objects[0].csm_center + (point - bakes.objects[0].csm_center) * 2.0, false) > 0.0;
    let flags = u32(seen) | (u32(outside) << 1u) | (u32(between) << 2u) | (u32(sees) << 3u);
    answers[id.x] = vec4<u32>(flags, bitcast<u32>(filtered), 0u, count);
}
";

struct Answer {
    visible: bool,
    filtered: f32,
    outside: bool,
    /// Whether the object stands between the point and one outside the box.
    between: bool,
    /// Whether the texel sees a point twice as far from the object's middle.
    sees: bool,
    reads: u32,
}

/// Texels and points: half of them other texels, half anywhere in the object's box.
fn random_pairs(file: &CssmFile, count: usize) -> Vec<(usize, [f32; 3])> {
    let mut rng = fastrand::Rng::with_seed(11);
    let texels = file.meta.texels as usize;
    let pair = |i: usize| {
        let point = if i.is_multiple_of(2) {
            file.texel(rng.usize(0..texels)).expect("there are so many").position
        } else {
            std::array::from_fn(|axis| {
                let (min, max) = (file.meta.bounds_min[axis], file.meta.bounds_max[axis]);
                min + (max - min) * rng.f32()
            })
        };
        (rng.usize(0..texels), point)
    };
    (0..count).map(pair).collect()
}

fn ask(baked: Resources, pairs: &[(usize, [f32; 3])]) -> Vec<Answer> {
    let gpu = gpu();
    let kernel = gpu
        .cached("cssm query", || gpu.kernel(&compose_source(QUERY, "query.wgsl", &["COUNT_READS".into()])?, "ask"))
        .unwrap_or_else(|error| panic!("{error}"));
    let mut baked = baked;
    let mut answers = Vec::with_capacity(pairs.len());
    for batch in pairs.chunks(BATCH) {
        let words: Vec<u32> = batch
            .iter()
            .flat_map(|(texel, [x, y, z])| [*texel as u32, x.to_bits(), y.to_bits(), z.to_bits()])
            .collect();
        baked = baked.words("pairs", &words).zeroed("answers", 4 * batch.len());
        gpu.dispatch(&kernel, &baked, [batch.len().div_ceil(64) as u32, 1, 1]).expect("runs");
        let words = baked.read_words("answers").expect("reads back");
        answers.extend(words.as_chunks().0.iter().map(|[flags, filtered, _, reads]| Answer {
            visible: flags & 1 != 0,
            filtered: f32::from_bits(*filtered),
            outside: flags & 2 != 0,
            between: flags & 4 != 0,
            sees: flags & 8 != 0,
            reads: *reads,
        }));
    }
    answers
}

/// Answers that may differ: none on a software adapter, which rounds as the CPU does, and one in ten thousand elsewhere.
fn tolerated(answers: usize) -> usize {
    if gpu().adapter.contains("llvmpipe") { 0 } else { answers / 10_000 }
}

#[test]
fn a_million_answers_are_the_cpus() {
    let file = cornell_box();
    let pairs = random_pairs(file, PAIRS);
    // Of several pages, so that the way to each is taken.
    let bits = smallest_page_bits(file);
    assert!(file.maps.blocks.len() + file.csm.blocks.len() > 1 << bits, "several pages");
    let answers = ask(resources(gpu(), &[(file, Affine3A::IDENTITY)], bits), &pairs);
    let center = Vec3::from(file.meta.csm_center);
    let (mut wrong, mut wrong_outside, mut wrong_filtered, mut seen, mut seen_outside) = (0, 0, 0, 0, 0);
    let (mut wrong_between, mut between, mut wrong_sees, mut sees) = (0, 0, 0, 0);
    for ((index, point), answer) in pairs.iter().zip(&answers) {
        let texel = file.texel(*index).expect("there are so many");
        let visible = file.visible(&texel, *point);
        let towards = std::array::from_fn(|axis| texel.position[axis] - point[axis]);
        let outside = file.seen_from_outside(texel.position, towards);
        let filtered = file.visibility(&texel, [0.0; 2], *point, Filter::Pixels);
        wrong += usize::from(visible != answer.visible);
        wrong_outside += usize::from(outside != answer.outside);
        wrong_filtered += usize::from((filtered - answer.filtered).abs() > 1.0e-5);
        let place = Vec3::from(texel.position);
        let hidden = file.stands_between(*point, (place + (place - center)).to_array());
        let far = file.sees(&texel, (center + (Vec3::from(*point) - center) * 2.0).to_array());
        wrong_between += usize::from(hidden != answer.between);
        wrong_sees += usize::from(far != answer.sees);
        between += usize::from(hidden);
        sees += usize::from(far);
        seen += usize::from(visible);
        seen_outside += usize::from(outside);
    }
    let reads: f64 = answers.iter().map(|answer| f64::from(answer.reads)).sum::<f64>() / answers.len() as f64;
    println!(
        "{}: of {PAIRS}, {wrong} differ, {wrong_filtered} filtered, {wrong_outside} from outside, \
         {wrong_between} between, {wrong_sees} of points outside; {seen} visible, {seen_outside} from outside, {between} between, \
         {sees} of points outside; {reads:.2} reads a query",
        gpu().adapter
    );
    let all = [wrong, wrong_filtered, wrong_outside, wrong_between, wrong_sees];
    assert!(all.iter().all(|&count| count <= tolerated(PAIRS)), "{all:?} answers differ");
    assert!([seen, seen_outside, between, sees].iter().all(|&count| count > PAIRS / 20 && count < PAIRS - PAIRS / 20));
    assert!(reads <= 10.0, "{reads} reads a query");
}

#[test]
fn pages_do_not_change_answers() {
    let file = cornell_box();
    let pairs = random_pairs(file, 20_000);
    let whole = ask(resources(gpu(), &[(file, Affine3A::IDENTITY)], PAGE_BITS), &pairs);
    let paged = ask(resources(gpu(), &[(file, Affine3A::IDENTITY)], smallest_page_bits(file)), &pairs);
    assert!(whole.iter().zip(&paged).all(|(a, b)| a.visible == b.visible && a.outside == b.outside));
}

#[test]
fn what_does_not_fit_is_named() {
    let (file, tree) = (cornell_box(), Tree::build(cornell_box()));
    assert!(Words::new(PAGE_BITS).bake(file, &tree).is_ok());
    let bits = smallest_page_bits(file);
    let too_large = Words::new(bits - 1).bake(file, &tree).map_err(|error| (error.section, error.limit));
    assert!(matches!(too_large, Err((_, limit)) if limit == 1 << (bits - 1) || limit == PAGES << (bits - 1)));
    // What is there already takes room, too.
    let mut words = Words::new(bits);
    let bake = words.bake(file, &tree).expect("there is just enough room");
    assert_eq!(words.bake(file, &tree).map_err(|error| error.section), Err("blocks"));
    assert_eq!(words.object(bake, Affine3A::IDENTITY), Ok(()));
    assert_eq!((words.table.count, words.table.lights), (1, file.meta.texels));
}

const LOCATE: &str = "
#import bevy_bounce::cssm::locate::locate
#import bevy_bounce::cssm::texels::{bakes, load_texel, object_of, to_world, turn_to_world}

@group(2) @binding(0) var<storage, read_write> answers: array<vec4<u32>>;

// At a texel, and as far above it as an eighth of the object's box is long.
@compute @workgroup_size(64)
fn ask(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= bakes.lights {
        return;
    }
    let object = object_of(id.x);
    let texel = load_texel(object, id.x - bakes.objects[object].first_light);
    let place = to_world(object, texel.position);
    let normal = turn_to_world(object, texel.normal);
    let on = locate(place, normal);
    let size = distance(bakes.objects[object].bounds_min, bakes.objects[object].bounds_max);
    let above = locate(place + normal * (0.125 * size), normal);
    answers[id.x] = vec4<u32>(on.object, on.texel, above.object, above.texel);
}
";

/// A room and a block in it: each place finds its own texel, and the air finds none.
#[test]
fn places_find_their_texels() {
    let (room, block) = (cornell_box(), small_block());
    let at = Affine3A::from_rotation_translation(Quat::from_rotation_y(0.4), Vec3::new(0.9, 2.5, 0.3));
    let kernel = gpu()
        .cached("cssm locate", || gpu().kernel(&compose_source(LOCATE, "locate.wgsl", &[])?, "ask"))
        .unwrap_or_else(|error| panic!("{error}"));
    let lights = (room.meta.texels + block.meta.texels) as usize;
    let resources =
        resources(gpu(), &[(room, Affine3A::IDENTITY), (block, at)], PAGE_BITS).zeroed("answers", 4 * lights);
    gpu().dispatch(&kernel, &resources, [lights.div_ceil(64) as u32, 1, 1]).expect("runs");
    let answers = resources.read_words("answers").expect("reads back");
    let (mut wrong, mut in_the_air) = (0, 0);
    for (light, [object, texel, above, _]) in (0..).zip(answers.as_chunks::<4>().0) {
        let own = if light < room.meta.texels { [0, light] } else { [1, light - room.meta.texels] };
        wrong += usize::from([*object, *texel] != own);
        in_the_air += usize::from(*above == NONE);
    }
    println!("of {lights} texels {wrong} find others; {in_the_air} are found in the air");
    assert!(wrong == 0, "{wrong} of {lights} texels find others");
    assert!(in_the_air * 10 > lights * 9, "{in_the_air} of {lights} are in the air");
}
