//! The voxel grid, kernel by kernel: conservative, exact in area, the same to the bit, facings kept apart.

use std::collections::{BTreeMap, BTreeSet};

use bevy::math::{Affine3A, IVec3, Quat, UVec3, Vec3};
use bevy_bounce_shaders::types::{Cell, Grid, INSTANCE_FLIPPED, INSTANCE_TWO_SIDED};
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::scene::{TestScene, cuboid, leap_count, measure_distances, run, voxelize};
use bevy_bounce_tests::twins::grid::{AREA_ONE, SUM_WORDS, cell_index, facing_of, voxel_distance, voxel_facings};
use bevy_bounce_tests::twins::random::Random;
use bevy_bounce_tests::twins::voxels::{self, Triangle};

/// Voxels: the shader widens its test by as much.
const SLACK: f64 = 1e-4;

fn normal(triangle: &Triangle) -> Vec3 {
    (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).normalize()
}

fn index_of(grid: &Grid, voxel: IVec3) -> Option<usize> {
    let inside = voxel.cmpge(IVec3::ZERO).all() && voxel.cmplt(grid.dims.as_ivec3()).all();
    let [x, y, z] = voxel.as_uvec3().to_array();
    inside.then(|| ((z * grid.dims.y + y) * grid.dims.x + x) as usize)
}

/// Thin, tiny, edge-on, huge and ordinary triangles, none of them without area.
fn adversarial() -> Vec<Triangle> {
    let mut random = Random::new(7);
    let mut triangles = Vec::new();
    for _ in 0..60 {
        let p = random.vector() * 3.0;
        triangles.push([p, p + random.vector(), p + random.vector()]);
        // Thinner than a hundredth of a voxel, many voxels long.
        let along = random.vector() * 4.0;
        triangles.push([p, p + along, p + along * 0.5 + random.vector() * 2e-3]);
        // Smaller than a hundredth of a voxel.
        triangles.push([p, p + random.vector() * 2e-3, p + random.vector() * 2e-3]);
        // In a plane of the axes: edge-on to the others.
        let axis = random.below(3) as usize;
        let mut flat = [random.vector(), random.vector(), random.vector()];
        flat.iter_mut().for_each(|corner| corner[axis] = p[axis]);
        triangles.push(flat);
    }
    // Huge: across the whole grid.
    triangles.push([Vec3::new(-4.0, -3.9, -4.0), Vec3::new(4.0, -3.5, -4.0), Vec3::new(4.0, 3.7, 4.0)]);
    triangles.push([Vec3::new(-4.0, -4.0, 0.01), Vec3::new(4.0, -4.0, 0.01), Vec3::new(0.0, 4.0, 0.01)]);
    triangles.retain(|triangle| voxels::area(triangle) > 1e-9);
    triangles
}

struct Built {
    grid: Grid,
    words: Vec<u32>,
    sums: Vec<i32>,
    cells: Vec<Cell>,
    counters: Vec<u32>,
    /// Bricks of large triangles.
    queued: u32,
}

impl Built {
    fn new(scene: &TestScene, grid: Grid) -> Self {
        Self::with_queue(scene, grid, None)
    }

    fn with_queue(scene: &TestScene, grid: Grid, queue: Option<usize>) -> Self {
        let resources = voxelize(gpu(), scene, &grid, queue);
        let words = |name| resources.read_words(name).expect("reads back");
        Self {
            grid,
            words: words("voxels"),
            sums: words("sums").into_iter().map(|word| word as i32).collect(),
            cells: resources.read_structs("cells").expect("reads back"),
            counters: words("counters"),
            queued: words("queue")[0],
        }
    }

    fn facings(&self, voxel: IVec3) -> u32 {
        index_of(&self.grid, voxel).map_or(0, |index| voxel_facings(self.words[index]))
    }

    fn cell(&self, voxel: IVec3, facing: u32) -> Option<usize> {
        let word = self.words[index_of(&self.grid, voxel)?];
        (voxel_facings(word) & (1 << facing) != 0).then(|| cell_index(word, facing) as usize)
    }

    /// Area that a cell has summed up, voxel faces.
    fn area(&self, voxel: IVec3, facing: u32) -> f64 {
        self.cell(voxel, facing).map_or(0.0, |cell| f64::from(self.sums[cell * SUM_WORDS]) / f64::from(AREA_ONE))
    }

    /// All sums, all words, all means: what must be the same from run to run.
    fn bits(&self) -> (Vec<u32>, Vec<i32>, Vec<[u32; 4]>) {
        let used = self.counters[0] as usize;
        let cells = self.cells[..used].iter().map(|cell| [cell.albedo, cell.normal, cell.plane_area, cell.bounds]);
        (self.words.clone(), self.sums[..used * SUM_WORDS].to_vec(), cells.collect())
    }
}

#[test]
fn no_touched_voxel_is_missed_and_none_else_marked() {
    let mut scene = TestScene::new(Vec3::splat(0.5));
    let triangles = adversarial();
    scene.soup(&triangles);
    let grid = scene.grid(0.29);
    let built = Built::new(&scene, grid);

    let mut allowed = BTreeSet::new();
    for triangle in &triangles {
        let facing = 1 << facing_of(normal(triangle));
        for voxel in voxels::areas(triangle, grid.origin, grid.voxel_size).into_keys().map(IVec3::from) {
            assert!(built.facings(voxel) & facing != 0, "{triangle:?} lies in {voxel} unmarked");
        }
        for voxel in voxels::sampled(triangle, grid.origin, grid.voxel_size, 200) {
            assert!(built.facings(voxel) & facing != 0, "{triangle:?} touches {voxel} unmarked");
        }
        let near = voxels::near(triangle, grid.origin, grid.voxel_size, 4.0 * SLACK);
        allowed.extend(near.into_iter().map(|voxel| (voxel, facing)));
    }
    let mut marked = 0;
    for z in 0..grid.dims.z as i32 {
        for y in 0..grid.dims.y as i32 {
            for x in 0..grid.dims.x as i32 {
                let facings = built.facings(IVec3::new(x, y, z));
                for facing in (0..6).map(|i| 1 << i).filter(|facing| facings & facing != 0) {
                    assert!(allowed.contains(&([x, y, z], facing)), "voxel {x} {y} {z} is marked, nothing is near");
                    marked += 1;
                }
            }
        }
    }
    assert_eq!(built.counters[0], marked, "one cell for each marked facing");
    assert_eq!(built.counters[1], 0, "no overflow");
}

#[test]
fn areas_equal_the_triangles() {
    let mut scene = TestScene::new(Vec3::splat(0.5));
    let triangles = adversarial();
    scene.soup(&triangles);
    let grid = scene.grid(0.29);
    let built = Built::new(&scene, grid);
    let face = f64::from(grid.voxel_size).powi(2);

    let mut expected = BTreeMap::<([i32; 3], u32), (f64, f64)>::new();
    for triangle in &triangles {
        let facing = facing_of(normal(triangle));
        for (voxel, area) in voxels::areas(triangle, grid.origin, grid.voxel_size) {
            let entry = expected.entry((voxel, facing)).or_default();
            entry.0 += area / face;
            entry.1 += 1.0;
        }
    }
    for ((voxel, facing), (area, count)) in &expected {
        let sum = built.area(IVec3::from(*voxel), *facing);
        // Each triangle is rounded to a step of the fixed point, and positions to floats.
        let tolerance = 2.0 * (count + 2.0) / f64::from(AREA_ONE) + 1e-4 * area;
        assert!((sum - area).abs() <= tolerance, "voxel {voxel:?} facing {facing}: {sum}, expected {area}");
    }
    let total: f64 = triangles.iter().map(voxels::area).sum::<f64>() / face;
    let cells = built.counters[0] as usize;
    let sum: f64 = (0..cells).map(|cell| f64::from(built.sums[cell * SUM_WORDS])).sum::<f64>() / f64::from(AREA_ONE);
    assert!((sum / total - 1.0).abs() < 2e-3, "total area {sum}, expected {total}");
    let counter = f64::from(built.counters[2]) / 256.0;
    assert!((counter / total - 1.0).abs() < 2e-2, "counted area {counter}, expected {total}");
}

#[test]
fn the_grid_is_the_same_to_the_bit_whatever_the_order() {
    let triangles = adversarial();
    let build = |triangles: &[Triangle], queue| {
        let mut scene = TestScene::new(Vec3::new(0.3, 0.6, 0.9));
        scene.soup(triangles);
        let mut grid = scene.grid(0.29);
        grid.origin = Vec3::splat(-4.5);
        grid.dims = UVec3::splat(32);
        Built::with_queue(&scene, grid, queue)
    };
    let roomy = build(&triangles, None);
    let first = roomy.bits();
    let build = |triangles: &[Triangle], queue| build(triangles, queue).bits();
    assert!(first == build(&triangles, None), "two runs differ");
    let mut shuffled = triangles.clone();
    shuffled.reverse();
    shuffled.rotate_left(17);
    assert!(first == build(&shuffled, None), "the order of the triangles shows");
    // Not by much: Mesa's software driver leaves a thread's loops after 65,535 iterations.
    let short = roomy.queued as usize - 7;
    assert!(first == build(&triangles, Some(short)), "a full queue shows");
    let mut moved = triangles;
    moved[0][0] += 0.01;
    assert!(first != build(&moved, None), "a moved vertex does not show");
}

#[test]
fn opposite_faces_of_a_thin_wall_keep_apart() {
    let mut scene = TestScene::new(Vec3::new(1.0, 0.0, 0.0));
    scene.materials.push(bevy_bounce_tests::scene::matte(Vec3::new(0.0, 0.0, 1.0)));
    // A wall of a tenth of a voxel: red towards +z, blue towards -z.
    let quad = |z: f32| {
        let [a, b, c, d] = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, z));
        [[a, b, c], [a, c, d]]
    };
    scene.mesh(&quad(0.02), 0, 0, Affine3A::IDENTITY);
    scene.mesh(&quad(0.0).map(|[a, b, c]| [a, c, b]), 1, 0, Affine3A::IDENTITY);
    let grid = scene.grid(0.2);
    let built = Built::new(&scene, grid);
    let middle = ((Vec3::new(0.1, 0.1, 0.01) - grid.origin) / grid.voxel_size).floor().as_ivec3();
    assert_eq!(built.facings(middle), 0b11_0000, "both faces are in one voxel");
    for (facing, albedo, toward) in [(4, 0xff00_00ff_u32, Vec3::Z), (5, 0xffff_0000, Vec3::NEG_Z)] {
        let cell = built.cells[built.cell(middle, facing).expect("has a cell")];
        assert_eq!(cell.albedo, albedo, "colours do not mix");
        let mean = bevy_bounce_tests::twins::decode_unit(cell.normal);
        assert!(mean.dot(toward) > 0.999, "normals do not cancel: {mean}");
        assert!((built.area(middle, facing) - 1.0).abs() < 1e-3);
    }
}

/// Of a voxel in x, in [`white_of_a_panel`].
const MIDDLE: f32 = 0.513;

/// Share of white in a voxel of a tenth that has a black wall from `wall` on and, 0.04 before it, a white panel up to `panel`, in x.
fn white_of_a_panel(wall: f32, panel: f32) -> f32 {
    let quad = |low: f32, high: f32, z: f32| {
        let [a, b, c, d] = [(low, 0.0), (high, 0.0), (high, 1.0), (low, 1.0)].map(|(x, y)| Vec3::new(x, y, z));
        [[a, b, c], [a, c, d]]
    };
    let mut scene = TestScene::new(Vec3::ZERO);
    scene.materials.push(bevy_bounce_tests::scene::matte(Vec3::ONE));
    scene.mesh(&quad(wall, 1.0, 0.53), 0, 0, Affine3A::IDENTITY);
    scene.mesh(&quad(0.0, panel, 0.57), 1, 0, Affine3A::IDENTITY);
    let built = Built::new(&scene, scene.grid(0.1));
    let voxel = ((Vec3::new(MIDDLE, 0.5, 0.55) - built.grid.origin) / built.grid.voxel_size).floor().as_ivec3();
    let cell = built.cells[built.cell(voxel, 4).expect("has a cell")];
    f32::from(cell.albedo as u8) / 255.0
}

#[test]
fn what_lies_in_front_hides_what_is_behind() {
    let behind = white_of_a_panel(0.0, 1.0);
    // 2^(8 * 0.4) to 1.
    assert!((behind - 0.902).abs() < 0.01, "behind a panel a wall takes {} of its colour", 1.0 - behind);
    let beside = white_of_a_panel(MIDDLE, MIDDLE);
    assert!((beside - 0.5).abs() < 0.01, "beside each other both are seen: {beside}");
}

#[test]
fn flags_turn_and_double_the_sides() {
    let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let facings = |flags| {
        let mut scene = TestScene::new(Vec3::ONE);
        scene.mesh(&[triangle], 0, flags, Affine3A::from_translation(Vec3::new(5.0, -3.0, 1.0)));
        let grid = scene.grid(0.3);
        let built = Built::new(&scene, grid);
        let at = ((Vec3::new(5.2, -2.8, 1.0) - grid.origin) / grid.voxel_size).floor().as_ivec3();
        built.facings(at)
    };
    assert_eq!(facings(0), 0b01_0000);
    assert_eq!(facings(INSTANCE_FLIPPED), 0b10_0000);
    assert_eq!(facings(INSTANCE_TWO_SIDED), 0b11_0000);
}

#[test]
fn means_of_a_tilted_plane_are_exact() {
    let turn =
        Affine3A::from_rotation_translation(Quat::from_euler(bevy::math::EulerRot::XYZ, 0.3, 0.4, 0.1), Vec3::ONE);
    let mut scene = TestScene::new(Vec3::new(0.25, 0.5, 0.75));
    let [a, b, c, d] = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 0.0));
    scene.mesh(&[[a, b, c], [a, c, d]], 0, 0, turn);
    let grid = scene.grid(0.17);
    let built = Built::new(&scene, grid);
    let plane_normal = turn.transform_vector3(Vec3::Z);
    let mut seen = 0;
    for (voxel, area) in voxels::areas(&scene.triangles[0], grid.origin, grid.voxel_size) {
        if area < 0.2 * f64::from(grid.voxel_size).powi(2) {
            continue;
        }
        let voxel = IVec3::from(voxel);
        let cell = built.cells[built.cell(voxel, facing_of(plane_normal)).expect("has a cell")];
        let mean = bevy_bounce_tests::twins::decode_unit(cell.normal);
        assert!(mean.dot(plane_normal) > 0.99995, "{mean}, expected {plane_normal}");
        let center = grid.origin + (voxel.as_vec3() + 0.5) * grid.voxel_size;
        let plane = (turn.translation - bevy::math::Vec3A::from(center)).dot(plane_normal.into()) / grid.voxel_size;
        let stored = half::f16::from_bits(cell.plane_area as u16).to_f32();
        assert!((stored - plane).abs() < 4e-3, "plane at {stored}, expected {plane}");
        for (byte, expected) in cell.albedo.to_le_bytes().into_iter().zip([64, 128, 191, 255]) {
            assert!(byte.abs_diff(expected) <= 1, "albedo {:08x}", cell.albedo);
        }
        seen += 1;
    }
    assert!(seen > 50, "only {seen} voxels were looked at");
}

#[test]
fn broken_triangles_leave_the_grid_sane() {
    let mut scene = TestScene::new(Vec3::ONE);
    let good = [Vec3::ZERO, Vec3::X, Vec3::Y];
    scene.soup(&[good]);
    let grid = scene.grid(0.25);
    let expected = Built::new(&scene, grid).bits();
    let nan = Vec3::new(f32::NAN, 0.0, 0.0);
    let far = Vec3::splat(f32::INFINITY);
    scene.soup(&[
        [nan, Vec3::X, Vec3::Y],
        [Vec3::ZERO, far, Vec3::Y],
        [Vec3::X, Vec3::X, Vec3::X],
        [Vec3::ZERO, Vec3::X, Vec3::X * 2.0],
        [Vec3::splat(1e30), Vec3::splat(-1e30), Vec3::Y],
    ]);
    scene.mesh(&[good], 0, 0, Affine3A::from_scale(Vec3::ZERO));
    let bits = Built::new(&scene, grid).bits();
    assert!(bits == expected, "triangles without area or with NaN show");
}

#[test]
fn cells_beyond_capacity_are_counted_and_left_out() {
    let mut scene = TestScene::new(Vec3::ONE);
    scene.soup(&cuboid(Vec3::ZERO, Vec3::ONE));
    let mut grid = scene.grid(0.1);
    let whole = Built::new(&scene, grid).counters[0];
    grid.cell_capacity = whole / 2;
    let built = Built::new(&scene, grid);
    assert_eq!(built.counters[0], whole / 2);
    assert_eq!(built.counters[1], whole - whole / 2);
    for &word in &built.words {
        let end = cell_index(word, 6);
        assert!(voxel_facings(word) == 0 || end <= grid.cell_capacity, "a voxel points past the cells");
    }
}

/// The prefix sum alone, on voxels marked by hand.
#[test]
fn the_prefix_sum_is_exact() {
    let mut random = Random::new(3);
    let sizes = [[1, 1, 1], [1023, 1, 1], [1024, 1, 1], [1025, 1, 1], [64, 64, 64], [65, 64, 64], [77, 91, 43]];
    for dims in sizes.map(UVec3::from) {
        for density in [0, 1, 2, 16] {
            let count = dims.element_product() as usize;
            let mark = |random: &mut Random| if random.below(16) < density { random.below(64) } else { 0 };
            let facings: Vec<u32> = (0..count).map(|_| mark(&mut random)).collect();
            let grid = Grid { voxel_size: 1.0, dims, cell_capacity: 6 * count as u32, ..Default::default() };
            let marked: Vec<u32> = facings.iter().map(|facings| facings << 22).collect();
            let blocks = count.div_ceil(1024);
            let resources = Resources::new(gpu())
                .uniform("grid", &grid)
                .words("voxels", &marked)
                .zeroed("blocks", blocks)
                .zeroed("counters", 4);
            run(gpu(), "avg/cells.wgsl", "count_blocks", &resources, [blocks as u32, 1, 1]);
            run(gpu(), "avg/cells.wgsl", "scan_blocks", &resources, [1, 1, 1]);
            run(gpu(), "avg/cells.wgsl", "assign_cells", &resources, [blocks as u32, 1, 1]);
            let mut next = 0;
            let twin: Vec<u32> = facings
                .iter()
                .map(|facings| {
                    let first = next;
                    next += facings.count_ones();
                    if *facings == 0 { 0 } else { facings << 22 | first }
                })
                .collect();
            assert!(resources.read_words("voxels").expect("reads back") == twin, "{dims}, density {density}");
            assert_eq!(resources.read_words("counters").expect("reads back")[0], next, "{dims}, density {density}");
        }
    }
}

#[test]
fn distances_are_those_to_the_nearest_block_with_a_marked_voxel() {
    let mut random = Random::new(11);
    for (dims, marks) in [([40, 24, 33], 5), ([7, 50, 3], 40), ([20, 20, 20], 0), ([1, 1, 1], 1)] {
        let dims = UVec3::from(dims);
        let count = dims.element_product() as usize;
        let mut voxels = vec![0; count];
        (0..marks).for_each(|_| voxels[random.below(count as u32) as usize] = 1 << 22);
        let grid = Grid { voxel_size: 1.0, dims, cell_capacity: 1, ..Default::default() };
        let resources = Resources::new(gpu())
            .uniform("grid", &grid)
            .words("voxels", &voxels)
            .zeroed("occupied", leap_count(&grid))
            .zeroed("along_x", leap_count(&grid))
            .zeroed("along_y", leap_count(&grid));
        measure_distances(gpu(), &grid, &resources);
        let words = resources.read_words("voxels").expect("reads back");
        let at = |i: usize| {
            let (x, y) = (dims.x as usize, dims.y as usize);
            IVec3::new((i % x) as i32, (i / x % y) as i32, (i / (x * y)) as i32)
        };
        let marked: Vec<IVec3> = (0..count).filter(|&i| voxels[i] != 0).map(|i| at(i) / 2).collect();
        for (i, &word) in words.iter().enumerate() {
            let nearest = marked.iter().map(|m| (*m - at(i) / 2).abs().max_element()).min().unwrap_or(15).min(15);
            assert_eq!(voxel_distance(word), nearest as u32, "voxel {} of {dims}", at(i));
        }
    }
}
