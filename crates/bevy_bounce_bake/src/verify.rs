//! How a baked file agrees with exact rays.
//!
//! Maps have texels and pixels, so they are wrong near edges of visibility and should be right everywhere else. A pair lies
//! within `d` of such an edge if some receiver `d` texels away in the same chart, or the receiver itself,
//!
//! - gets another exact answer for the sender: a shadow edge passes between the receivers, or the sender is behind the
//!   horizon of one of them;
//! - has a silhouette within `d` pixels of the sender: an edge where the first or the second surface on the way ends, or turns
//!   away from the receiver. What the silhouette of one surface leaves to see of another is bounded by the former's shadow
//!   edge, so that these are also the places where the answer changes as the sender moves; and where the second's edge,
//!   hidden behind the first, passes through a pixel whose centre looks past it, the map does not know the second; or
//! - is within `d` pixels of the sender's horizon, or the sender within `d` pixels of its own: one's plane is edge on for
//!   the other, and what turns by a pixel faces away.
//!
//! What chance would make of it is told beside: the share of all pairs that lies within a texel. Left are surfaces so close
//! behind each other that a pixel, seen aslant, reaches deeper than the gap between them: the depth that it keeps is of one place.
//!
//! Receivers move in the atlas and silhouettes are the mesh's own edges, because neither a curved surface's tangent plane
//! nor the sender's plane, seen edge on, says where the surface ends.

mod edges;
mod surface;

use bevy_bounce_cssm::{CssmFile, Filter, Texel};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::BakeError;
use crate::rays::Bvh;
use crate::scene::Scene;
use edges::{Cone, Edges};
use surface::{Sample, Surface};

/// Pairs a task.
const CHUNK: u64 = 4096;
/// Upper ends of the histogram's bins but the last, in texels of the receiver and pixels of the map.
pub const BIN_ENDS: [f32; 6] = [0.25, 0.5, 0.75, 1.0, 1.5, 2.0];
/// Receivers round a disagreement at each distance.
const AROUND: usize = 16;
/// One pair in so many is looked at whether maps and ray agree or not.
const EVERY: u64 = 64;
/// The bins up to one texel.
const ONE_TEXEL: usize = 4;

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
    /// Pairs that were looked at whether maps and ray agree or not.
    pub sampled: u64,
    /// Those of them that lie within one texel of where the exact answer changes: what chance would make of disagreements.
    pub sampled_near: u64,
}

impl Agreement {
    /// Agreeing pairs in percent of all.
    pub fn percent(&self) -> f64 {
        100.0 * self.agreeing as f64 / self.pairs.max(1) as f64
    }

    /// Disagreements within one texel of where the exact answer changes, in percent of all disagreements.
    pub fn near_percent(&self) -> f64 {
        let near: u64 = self.distances[..ONE_TEXEL].iter().sum();
        100.0 * near as f64 / (self.pairs - self.agreeing).max(1) as f64
    }

    fn plus(mut self, other: Self) -> Self {
        self.pairs += other.pairs;
        self.agreeing += other.agreeing;
        self.nearest += other.nearest;
        self.sampled += other.sampled;
        self.sampled_near += other.sampled_near;
        self.distances.iter_mut().zip(other.distances).for_each(|(a, b)| *a += b);
        self
    }
}

/// Compares the file with rays between `pairs` pairs of random points of the surface that face each other: no light goes
/// between others, whatever stands between them. Always the same pairs.
pub fn verify(file: &CssmFile, scene: &Scene, pairs: u64) -> Result<Agreement, BakeError> {
    let surface = Surface::new(file, scene)?;
    let bvh = Bvh::new(scene);
    let check = Check { file, edges: &Edges::new(&bvh), bvh: &bvh, surface: &surface };
    let chunks = pairs.div_ceil(CHUNK);
    let sum = (0..chunks).into_par_iter().map(|chunk| {
        let mut rng = fastrand::Rng::with_seed(chunk);
        let count = CHUNK.min(pairs - chunk * CHUNK);
        (0..count).fold(Agreement::default(), |sum, _| check.compare(&mut rng, sum))
    });
    Ok(sum.reduce(Agreement::default, Agreement::plus))
}

/// What pairs are compared with.
struct Check<'a> {
    file: &'a CssmFile,
    bvh: &'a Bvh<'a>,
    surface: &'a Surface<'a>,
    edges: &'a Edges<'a>,
}

impl Check<'_> {
    /// One pair; drawn anew until one can be asked about.
    fn compare(&self, rng: &mut fastrand::Rng, mut sum: Agreement) -> Agreement {
        let file = self.file;
        for _ in 0..1000 {
            let (Some(receiver), Some(sender)) = (self.surface.sample(rng), self.surface.sample(rng)) else { continue };
            let way = sender.position - receiver.position;
            let apart = 8.0 * file.meta.lift;
            let facing = way.dot(receiver.normal) > apart && way.dot(sender.normal) < -apart;
            let Some(texel) = self.texel(&receiver).filter(|_| facing) else { continue };
            let visible = self.exact(&receiver, sender.position);
            let point = sender.position.to_array();
            let share = file.visibility(&texel, receiver.at.to_array(), point, Filter::PixelsAndTexels);
            let agree = (share >= 0.5) == visible;
            let within = |&distance: &f32| self.changes_within(distance, &receiver, texel.chart, &sender, visible);
            if sum.pairs.is_multiple_of(EVERY) {
                sum.sampled += 1;
                sum.sampled_near += u64::from(BIN_ENDS[..ONE_TEXEL].iter().any(within));
            }
            sum.pairs += 1;
            sum.nearest += u64::from(file.visible(&texel, point) == visible);
            sum.agreeing += u64::from(agree);
            if !agree {
                let bin = BIN_ENDS.iter().position(within).unwrap_or(BIN_ENDS.len());
                sum.distances[bin] += 1;
            }
            return sum;
        }
        sum
    }

    fn texel(&self, sample: &Sample) -> Option<Texel> {
        let index = self.file.texel_at(sample.at.as_uvec2().to_array())?;
        self.file.texel(index)
    }

    /// Where rays start and end at the receiver.
    fn lifted(&self, receiver: &Sample) -> Vec3 {
        receiver.position + receiver.normal * self.file.meta.lift
    }

    fn exact(&self, receiver: &Sample, sender: Vec3) -> bool {
        let way = sender - receiver.position;
        let margin = 2.0 * self.file.meta.lift / way.length();
        way.dot(receiver.normal) > 0.0 && self.bvh.visible(self.lifted(receiver), sender, margin)
    }

    /// Whether the pair lies within `distance` of an edge of visibility; see the module.
    fn changes_within(&self, distance: f32, receiver: &Sample, chart: u32, sender: &Sample, visible: bool) -> bool {
        let at = |offset| self.surface.at(receiver.at + offset);
        let in_chart = |sample: &Sample| self.texel(sample).is_some_and(|texel| texel.chart == chart);
        let round = circle(distance).filter_map(at).filter(in_chart);
        // A pixel in the middle of a face, where pixels are largest.
        let tangent = distance * 2.0 / self.file.meta.depth as f32;
        std::iter::once(*receiver).chain(round).any(|receiver| {
            let origin = self.lifted(&receiver);
            let axis = (sender.position - origin).normalize_or(receiver.normal);
            let slope = axis.dot(receiver.normal).abs().min(axis.dot(sender.normal).abs());
            slope <= tangent
                || self.exact(&receiver, sender.position) != visible
                || self.edges.silhouette_in(&Cone { origin, axis, tangent }, self.file.meta.lift)
        })
    }
}

/// Offsets evenly round a circle.
fn circle(radius: f32) -> impl Iterator<Item = Vec2> {
    (0..AROUND).map(move |step| radius * Vec2::from_angle(std::f32::consts::TAU * step as f32 / AROUND as f32))
}
