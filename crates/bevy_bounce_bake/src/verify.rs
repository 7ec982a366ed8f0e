//! How a baked file agrees with exact rays.

use bevy_bounce_cssm::{CssmFile, Filter};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::BakeError;
use crate::rays::Bvh;
use crate::scene::Scene;

/// Pairs a task.
const CHUNK: u64 = 4096;
/// Upper ends of the histogram's bins but the last, in texels of the receiver and pixels of the map.
pub const BIN_ENDS: [f32; 6] = [0.25, 0.5, 0.75, 1.0, 1.5, 2.0];
/// Rays round a disagreement at each distance: places on a circle at the receiver, and round the sender.
const AROUND: usize = 16;

/// Planes seen at a smaller angle (sine) count as seen at this one.
const LEAST_SLOPE: f32 = 0.05;

/// What verification found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Agreement {
    /// Pairs of points that were asked about.
    pub pairs: u64,
    /// Those on which ray and maps agree, the maps filtered over texels and pixels and rounded.
    pub agreeing: u64,
    /// Those on which ray and a single pixel of a single texel agree.
    pub nearest: u64,
    /// Disagreements by their distance from where the exact answer changes; the last bin holds all beyond.
    pub distances: [u64; BIN_ENDS.len() + 1],
}

impl Agreement {
    /// Agreeing pairs in percent of all.
    pub fn percent(&self) -> f64 {
        100.0 * self.agreeing as f64 / self.pairs.max(1) as f64
    }

    fn plus(mut self, other: Self) -> Self {
        self.pairs += other.pairs;
        self.agreeing += other.agreeing;
        self.nearest += other.nearest;
        self.distances.iter_mut().zip(other.distances).for_each(|(a, b)| *a += b);
        self
    }
}

/// A random point of the surface.
struct Sample {
    position: Vec3,
    normal: Vec3,
    /// In 0 to 1 of the atlas.
    uv: Vec2,
    /// World size of a texel there.
    texel: f32,
}

/// The surface, to draw points from by area.
struct Surface {
    triangles: Vec<([Vec3; 3], [Vec2; 3], f32)>,
    /// Sum of the areas up to each triangle.
    areas: Vec<f64>,
}

/// Compares the file with rays between `pairs` pairs of random points of the surface, each in front of the first one's
/// surface. Always the same pairs.
pub fn verify(file: &CssmFile, scene: &Scene, pairs: u64) -> Result<Agreement, BakeError> {
    let surface = Surface::new(file, scene)?;
    let triangles: Vec<[Vec3; 3]> = scene.triangles().collect();
    let bvh = Bvh::new(&triangles);
    let chunks = pairs.div_ceil(CHUNK);
    let sum = (0..chunks).into_par_iter().map(|chunk| {
        let mut rng = fastrand::Rng::with_seed(chunk);
        let count = CHUNK.min(pairs - chunk * CHUNK);
        (0..count).fold(Agreement::default(), |sum, _| compare(file, &bvh, &surface, &mut rng, sum))
    });
    Ok(sum.reduce(Agreement::default, Agreement::plus))
}

/// One pair; drawn anew until one can be asked about.
fn compare(file: &CssmFile, bvh: &Bvh, surface: &Surface, rng: &mut fastrand::Rng, mut sum: Agreement) -> Agreement {
    for _ in 0..1000 {
        let (receiver, sender) = (surface.sample(rng), surface.sample(rng));
        let way = sender.position - receiver.position;
        let size = Vec2::new(file.meta.atlas[0] as f32, file.meta.atlas[1] as f32);
        let cell = (receiver.uv * size).as_uvec2().to_array();
        let texel = file.texel_at(cell).and_then(|index| file.texel(index));
        let Some(texel) = texel.filter(|_| way.dot(receiver.normal) > 8.0 * file.meta.lift) else { continue };
        let exact = |from: Vec3, to: Vec3| {
            let margin = 2.0 * file.meta.lift / from.distance(to);
            bvh.visible(from + receiver.normal * file.meta.lift, to, margin)
        };
        let visible = exact(receiver.position, sender.position);
        sum.pairs += 1;
        let point = sender.position.to_array();
        let share = file.visibility(&texel, (receiver.uv * size).to_array(), point, Filter::PixelsAndTexels);
        sum.nearest += u64::from(file.visible(&texel, point) == visible);
        if (share >= 0.5) == visible {
            sum.agreeing += 1;
        } else {
            // Angle of a pixel in the middle of a face, where pixels are largest.
            let pixel = 2.0 / file.meta.depth as f32 * way.length();
            let bin = BIN_ENDS.iter().position(|&distance| {
                changes_within(&receiver, &sender, distance, pixel, &|a, b| exact(a, b) != visible)
            });
            sum.distances[bin.unwrap_or(BIN_ENDS.len())] += 1;
        }
        return sum;
    }
    sum
}

/// Whether the exact answer changes when the receiver moves by `distance` texels in its surface, the sender by as many
/// pixels in its own, or both.
fn changes_within(
    receiver: &Sample,
    sender: &Sample,
    distance: f32,
    pixel: f32,
    changed: &dyn Fn(Vec3, Vec3) -> bool,
) -> bool {
    let circle = |axis: Vec3, radius: f32| {
        let (across, up) = axis.any_orthonormal_pair();
        (0..AROUND).map(move |step| {
            let (sin, cos) = (std::f32::consts::TAU * step as f32 / AROUND as f32).sin_cos();
            radius * (cos * across + sin * up)
        })
    };
    let way = (sender.position - receiver.position).normalize_or(receiver.normal);
    // Where the ray through another pixel meets the sender's plane. Seen edge on, a plane has no such place near.
    let slope = way.dot(sender.normal);
    let slope = slope.signum() * slope.abs().max(LEAST_SLOPE);
    let onto_plane = |offset: Vec3| offset - way * (offset.dot(sender.normal) / slope);
    let from: Vec<Vec3> = circle(receiver.normal, distance * receiver.texel).chain([Vec3::ZERO]).collect();
    let to: Vec<Vec3> = circle(way, distance * pixel).map(onto_plane).chain([Vec3::ZERO]).collect();
    from.iter().any(|a| to.iter().any(|b| changed(receiver.position + *a, sender.position + *b)))
}

impl Surface {
    fn new(file: &CssmFile, scene: &Scene) -> Result<Self, BakeError> {
        let parts: Vec<_> = file.parts.iter().collect();
        let same = parts.len() == scene.parts.len()
            && parts.iter().zip(&scene.parts).all(|(baked, part)| baked.triangles == part.source_count);
        if !same || scene.source_hash != file.meta.source_hash {
            return Err(BakeError::Atlas(
                "the bake is of another scene, or of an older state of it; bake it anew".into(),
            ));
        }
        let size = Vec2::new(file.meta.atlas[0] as f32, file.meta.atlas[1] as f32);
        let (mut triangles, mut areas, mut sum) = (Vec::new(), Vec::new(), 0.0);
        for (baked, part) in parts.iter().zip(&scene.parts) {
            for (number, corners) in part.source_triangles.iter().zip(&part.triangles) {
                let corners = corners.map(|index| part.positions[index as usize]);
                let Some(uv) = file.parts.triangle(baked.first_triangle + number) else { continue };
                let uv = uv.map(Vec2::from);
                let area = 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
                let cells = 0.5 * ((uv[1] - uv[0]) * size).perp_dot((uv[2] - uv[0]) * size).abs();
                sum += f64::from(area);
                areas.push(sum);
                triangles.push((corners, uv, (area / cells.max(f32::MIN_POSITIVE)).sqrt()));
            }
        }
        Ok(Self { triangles, areas })
    }

    fn sample(&self, rng: &mut fastrand::Rng) -> Sample {
        let at = rng.f64() * self.areas.last().copied().unwrap_or(0.0);
        let index = self.areas.partition_point(|&sum| sum < at).min(self.triangles.len() - 1);
        let (corners, uv, texel) = self.triangles[index];
        let (mut b, mut c) = (rng.f32(), rng.f32());
        if b + c > 1.0 {
            (b, c) = (1.0 - b, 1.0 - c);
        }
        let position = corners[0] + b * (corners[1] - corners[0]) + c * (corners[2] - corners[0]);
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
        Sample { position, normal, uv: uv[0] + b * (uv[1] - uv[0]) + c * (uv[2] - uv[0]), texel }
    }
}
