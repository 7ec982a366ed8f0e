//! The first two surfaces along each ray of a packet.

/// Side of a packet in pixels.
pub const PACKET: usize = 8;

/// `a + b u + c v` over a packet's pixels.
#[derive(Clone, Copy, Debug, Default)]
pub struct Plane {
    /// Value at the middle of the face.
    pub a: f32,
    /// Change along u.
    pub b: f32,
    /// Change along v.
    pub c: f32,
}

impl Plane {
    /// Value at (u, v).
    #[inline]
    pub fn at(self, u: f32, v: f32) -> f32 {
        self.a + self.c * v + self.b * u
    }

    /// The plane times a factor.
    #[inline]
    pub fn scaled(self, factor: f32) -> Self {
        Self { a: self.a * factor, b: self.b * factor, c: self.c * factor }
    }
}

/// A triangle as a packet sees it.
#[derive(Clone, Debug)]
pub struct FlatTriangle {
    /// Positive inside, in proportion to the weight of the corner opposite: the third, the first and the second one's.
    pub edges: [Plane; 3],
    /// Of the triangle's plane.
    pub nearness: Plane,
    /// The rows that the triangle may reach.
    pub rows: std::ops::Range<usize>,
}

impl FlatTriangle {
    /// The rows of a packet whose centres lie in a range of v, and what rounding may add.
    pub fn rows(vs: &[f32; PACKET], low: f32, high: f32) -> std::ops::Range<usize> {
        let row = |v: f32| (v - vs[0]) * ((PACKET - 1) as f32 / (vs[PACKET - 1] - vs[0]));
        let (first, last) = ((row(low) - ROW_SLACK).ceil().max(0.0), (row(high) + ROW_SLACK).floor() + 1.0);
        first as usize..last.clamp(0.0, PACKET as f32) as usize
    }
}

/// Rounding that a row's number may suffer from, in rows.
const ROW_SLACK: f32 = 0.01;

/// The two nearest surfaces of each ray as *nearness*: a quantity that grows towards the eye, is linear in the image of a
/// plane, and is 0 for nothing. For a perspective it is the inverse of depth, for a parallel projection the depth counted
/// from the back.
#[derive(Clone)]
pub struct Layers {
    /// Of the first surface.
    pub first: [[f32; PACKET]; PACKET],
    /// Of the second.
    pub second: [[f32; PACKET]; PACKET],
    /// By how much the first surface's nearness varies between a pixel's centre and its corners.
    pub first_reach: [[f32; PACKET]; PACKET],
    /// The second's.
    pub second_reach: [[f32; PACKET]; PACKET],
    /// Rays on which two surfaces were closer than `merge`.
    pub close: u32,
    /// Two surfaces closer than `merge.0 + merge.1 * nearness^2` are one.
    merge: (f32, f32),
    /// Half the side of a pixel, in units of u and v.
    half_pixel: f32,
}

impl Layers {
    /// Nothing met yet.
    pub fn new(merge: (f32, f32), half_pixel: f32) -> Self {
        let nothing = [[0.0; PACKET]; PACKET];
        let [first, second, first_reach, second_reach] = [nothing; 4];
        Self { first, second, first_reach, second_reach, close: 0, merge, half_pixel }
    }

    /// Adds a triangle: it covers the pixels where all edges are positive or zero, nearness is positive, and `is_there` says
    /// so of the weights of its corners.
    #[inline]
    pub fn add(
        &mut self,
        us: &[f32; PACKET],
        vs: &[f32; PACKET],
        triangle: &FlatTriangle,
        is_there: impl Fn([f32; 3]) -> bool,
    ) {
        let FlatTriangle { edges, nearness, rows } = triangle;
        let reach = (nearness.b.abs() + nearness.c.abs()) * self.half_pixel;
        let mut close = [0u32; PACKET];
        for y in rows.clone() {
            let planes = [edges[0], edges[1], edges[2], *nearness];
            let row = planes.map(|plane| (plane.a + plane.c * vs[y], plane.b));
            let (first, second) = (&mut self.first[y], &mut self.second[y]);
            let (first_reach, second_reach) = (&mut self.first_reach[y], &mut self.second_reach[y]);
            for x in 0..PACKET {
                let [e0, e1, e2, near] = row.map(|(start, step)| start + step * us[x]);
                let inside = e0.min(e1).min(e2) >= 0.0 && is_there([e1, e2, e0].map(|edge| edge / (e0 + e1 + e2)));
                let near = if inside { near.max(0.0) } else { 0.0 };
                let (old, old_second) = (first[x], second[x]);
                let merged = (near - old).abs() <= self.merge.0 + self.merge.1 * old * old;
                let nearer = near > old;
                let behind = near.min(old);
                let replaces = (behind > old_second) & !merged;
                second[x] = if replaces { behind } else { old_second };
                second_reach[x] = if replaces & nearer { first_reach[x] } else { second_reach[x] };
                second_reach[x] = if replaces & !nearer { reach } else { second_reach[x] };
                first[x] = near.max(old);
                first_reach[x] = if nearer { reach } else { first_reach[x] };
                close[x] += u32::from(merged & (near > 0.0) & (old > 0.0));
            }
        }
        self.close += close.iter().sum::<u32>();
    }

    /// The least nearness of any second surface: what is farther than that, adds nothing.
    #[inline]
    pub fn horizon(&self) -> f32 {
        self.second.as_flattened().iter().fold(f32::INFINITY, |a, &b| a.min(b))
    }
}
