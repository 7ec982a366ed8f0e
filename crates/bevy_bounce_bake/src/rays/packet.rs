//! Packets through the hierarchy.
//!
//! A packet's rays share an origin (or a direction), so that a triangle's edges and depth are linear functions of the pixel
//! (Olano and Greer, *Triangle Scan Conversion using 2D Homogeneous Coordinates*, 1997): one evaluation a pixel is the
//! exact ray test, and a ray through an edge that two triangles share meets at least one of them.

use glam::Vec3;

use super::{Bvh, FlatTriangle, Layers, PACKET, Plane};

/// Rounding that may make a node look farther than what is in it.
const SLACK: f32 = 1.0 + 1.0e-5;

/// A packet of rays.
pub trait Beam {
    /// Pixel centres.
    fn pixels(&self) -> (&[f32; PACKET], &[f32; PACKET]);
    /// The largest nearness of anything in a box; nothing if the beam misses the box.
    fn bound(&self, min: Vec3, max: Vec3) -> Option<f32>;
    /// A triangle as the beam sees it; nothing if all rays miss it.
    fn triangle(&self, corners: &[Vec3; 3]) -> Option<FlatTriangle>;
}

/// Finds the first two surfaces along each ray of the beam, in one traversal.
pub fn cast<B: Beam>(bvh: &Bvh, beam: &B, layers: &mut Layers, stack: &mut Vec<(u32, f32)>) {
    stack.clear();
    let visit = |index: u32| beam.bound(bvh.nodes[index as usize].min, bvh.nodes[index as usize].max);
    if let Some(near) = visit(0) {
        stack.push((0, near));
    }
    let (us, vs) = beam.pixels();
    let (mut horizon, mut stale) = (0.0, false);
    while let Some((index, near)) = stack.pop() {
        if stale {
            (horizon, stale) = (layers.horizon(), false);
        }
        if near * SLACK < horizon {
            continue;
        }
        let node = bvh.nodes[index as usize];
        if node.count > 0 {
            for index in node.first as usize..(node.first + node.count) as usize {
                let Some(triangle) = beam.triangle(&bvh.triangles[index]) else { continue };
                match bvh.cutout(index) {
                    None => layers.add(us, vs, &triangle, |_| true),
                    Some(cutout) => layers.add(us, vs, &triangle, |weights| cutout.is_there(bvh.materials, weights)),
                }
                stale = true;
            }
            continue;
        }
        let (left, right) = (visit(node.first), visit(node.first + 1));
        // The nearer child is taken first.
        match (left, right) {
            (Some(l), Some(r)) if l >= r => stack.extend([(node.first + 1, r), (node.first, l)]),
            (Some(l), Some(r)) => stack.extend([(node.first, l), (node.first + 1, r)]),
            (Some(l), None) => stack.push((node.first, l)),
            (None, Some(r)) => stack.push((node.first + 1, r)),
            (None, None) => {}
        }
    }
}

/// Whether some corner of the packet may lie inside an edge.
fn reaches(plane: Plane, us: &[f32; PACKET], vs: &[f32; PACKET]) -> bool {
    let (u, v) = ([us[0], us[PACKET - 1]], [vs[0], vs[PACKET - 1]]);
    plane.at(u[0], v[0]).max(plane.at(u[1], v[0])).max(plane.at(u[0], v[1])).max(plane.at(u[1], v[1])) >= 0.0
}

/// A packet of a cube map's face.
#[derive(Clone, Debug)]
pub struct CubeTile {
    /// Centre of the cube map.
    pub origin: Vec3,
    /// Axis of the face, 0 to 2.
    axis: usize,
    /// 1 or -1.
    sign: f32,
    us: [f32; PACKET],
    vs: [f32; PACKET],
    /// Bounds of the pixels, not only of their centres.
    u: [f32; 2],
    v: [f32; 2],
}

impl CubeTile {
    /// The packet whose first pixel is (`x`, `y`) on a face (twice the axis, plus 1 for the negative side) of `side` by
    /// `side` pixels.
    pub fn new(face: usize, x: usize, y: usize, side: usize) -> Self {
        let at = |pixel: f32| 2.0 * pixel / side as f32 - 1.0;
        let centers = |first: usize| std::array::from_fn(|i| at((first + i) as f32 + 0.5));
        let ends = |first: usize| [at(first as f32), at((first + PACKET) as f32)];
        let sign = if face.is_multiple_of(2) { 1.0 } else { -1.0 };
        Self { origin: Vec3::ZERO, axis: face / 2, sign, us: centers(x), vs: centers(y), u: ends(x), v: ends(y) }
    }

    /// A vector as a function of the pixel: its product with the pixel's direction, whose part along the axis is 1.
    #[inline]
    pub fn plane(&self, vector: Vec3) -> Plane {
        let [u, v] = [(self.axis + 1) % 3, (self.axis + 2) % 3];
        Plane { a: self.sign * vector[self.axis], b: vector[u], c: vector[v] }
    }

    /// Pixel centres.
    pub fn centers(&self) -> (&[f32; PACKET], &[f32; PACKET]) {
        (&self.us, &self.vs)
    }

    /// Whether some ray may leave on the side of `normal`.
    pub fn leaves(&self, normal: Vec3) -> bool {
        let plane = self.plane(normal);
        reaches(plane, &self.us, &self.vs)
    }
}

impl CubeTile {
    /// The rows where corners lie, or all where one is not in front.
    #[inline]
    fn rows(&self, corners: [Vec3; 3]) -> std::ops::Range<usize> {
        let depths = corners.map(|corner| self.sign * corner[self.axis]);
        if depths[0].min(depths[1]).min(depths[2]) <= 0.0 {
            return 0..PACKET;
        }
        let axis = (self.axis + 2) % 3;
        let [a, b, c] = [0, 1, 2].map(|i| corners[i][axis] / depths[i]);
        FlatTriangle::rows(&self.vs, a.min(b).min(c), a.max(b).max(c))
    }
}

impl Beam for CubeTile {
    fn pixels(&self) -> (&[f32; PACKET], &[f32; PACKET]) {
        (&self.us, &self.vs)
    }

    #[inline]
    fn bound(&self, min: Vec3, max: Vec3) -> Option<f32> {
        let (min, max) = (min - self.origin, max - self.origin);
        let (a, u, v) = (self.axis, (self.axis + 1) % 3, (self.axis + 2) % 3);
        let (near, far) = if self.sign > 0.0 { (min[a], max[a]) } else { (-max[a], -min[a]) };
        let near = near.max(0.0);
        // The pixels between the centres' bounds reach from `low * z` to `high * z`.
        let misses = |min: f32, max: f32, [low, high]: [f32; 2]| {
            max < low * if low > 0.0 { near } else { far } || min > high * if high > 0.0 { far } else { near }
        };
        let missed = far <= 0.0 || misses(min[u], max[u], self.u) || misses(min[v], max[v], self.v);
        // What lies between the centres of pixels meets no ray.
        let between = |centers: &[f32; PACKET], min: f32, max: f32| {
            let (low, high) = (min / if min > 0.0 { far } else { near }, max / if max > 0.0 { near } else { far });
            FlatTriangle::rows(centers, low, high).is_empty()
        };
        let missed = missed || near > 0.0 && (between(&self.us, min[u], max[u]) || between(&self.vs, min[v], max[v]));
        (!missed).then(|| 1.0 / near)
    }

    #[inline]
    fn triangle(&self, corners: &[Vec3; 3]) -> Option<FlatTriangle> {
        let [a, b, c] = corners.map(|corner| corner - self.origin);
        let normal = (b - a).cross(c - a);
        let volume = a.dot(normal);
        if volume == 0.0 {
            return None;
        }
        // Turned so that rays from either side find the inside positive.
        let sign = volume.signum();
        let edges = [(a, b), (b, c), (c, a)].map(|(from, to)| self.plane(from.cross(to)).scaled(sign));
        let meets = edges.iter().all(|edge| reaches(*edge, &self.us, &self.vs));
        let rows = self.rows([a, b, c]);
        (meets && !rows.is_empty()).then(|| FlatTriangle { edges, nearness: self.plane(normal / volume), rows })
    }
}

/// A packet of a parallel projection.
#[derive(Clone, Debug)]
pub struct OrthoTile {
    /// Across, up and forward: a left-handed or right-handed orthonormal frame.
    pub frame: [Vec3; 3],
    /// Middle of the back plane, from which nearness is counted against the rays.
    pub back: Vec3,
    /// Pixel centres in world units.
    us: [f32; PACKET],
    vs: [f32; PACKET],
}

impl OrthoTile {
    /// The packet whose first pixel is (`x`, `y`) of `side` by `side` pixels that show a square from `-radius` to `radius`.
    pub fn new(frame: [Vec3; 3], back: Vec3, radius: f32, [x, y]: [usize; 2], side: usize) -> Self {
        let at = |pixel: f32| (2.0 * pixel / side as f32 - 1.0) * radius;
        let centers = |first: usize| std::array::from_fn(|i| at((first + i) as f32 + 0.5));
        Self { frame, back, us: centers(x), vs: centers(y) }
    }
}

impl Beam for OrthoTile {
    fn pixels(&self) -> (&[f32; PACKET], &[f32; PACKET]) {
        (&self.us, &self.vs)
    }

    fn bound(&self, min: Vec3, max: Vec3) -> Option<f32> {
        let (middle, half) = (0.5 * (min + max) - self.back, 0.5 * (max - min) * SLACK);
        let [u, v, w] = self.frame.map(|axis| (middle.dot(axis), half.dot(axis.abs())));
        let misses = |(at, reach): (f32, f32), centers: &[f32; PACKET]| {
            FlatTriangle::rows(centers, at - reach, at + reach).is_empty()
        };
        (!misses(u, &self.us) && !misses(v, &self.vs)).then_some(w.1 - w.0)
    }

    fn triangle(&self, corners: &[Vec3; 3]) -> Option<FlatTriangle> {
        let flat = corners.map(|corner| {
            let offset = corner - self.back;
            self.frame.map(|axis| offset.dot(axis))
        });
        let [a, b, c] = flat.map(|[x, y, _]| (x, y));
        let area = (b.0 - a.0) * (c.1 - a.1) - (c.0 - a.0) * (b.1 - a.1);
        if area == 0.0 {
            return None;
        }
        let edge = |(x0, y0): (f32, f32), (x1, y1): (f32, f32)| {
            Plane { a: x0 * y1 - x1 * y0, b: y0 - y1, c: x1 - x0 }.scaled(area.signum())
        };
        let edges = [edge(a, b), edge(b, c), edge(c, a)];
        if !edges.iter().all(|edge| reaches(*edge, &self.us, &self.vs)) {
            return None;
        }
        // Nearness is the negative of what lies ahead of the back plane; weights of the corners are the opposite edges.
        let weight = |at: [f32; 3], edge: Plane| edge.scaled(-at[2] / area.abs());
        let [p, q, r] = [weight(flat[0], edges[1]), weight(flat[1], edges[2]), weight(flat[2], edges[0])];
        let nearness = Plane { a: p.a + q.a + r.a, b: p.b + q.b + r.b, c: p.c + q.c + r.c };
        let rows = FlatTriangle::rows(&self.vs, a.1.min(b.1).min(c.1), a.1.max(b.1).max(c.1));
        (!rows.is_empty()).then_some(FlatTriangle { edges, nearness, rows })
    }
}
