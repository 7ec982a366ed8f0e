//! The hierarchy of a baked object's texels: a binary tree by median cut, with spheres round the texels and cones round their
//! normals, in depth-first order. Section 4.2 of the paper.
//!
//! A node's first child follows it; its skip pointer says where to go on without what is below. Every node halves its texels
//! (the first half is the larger one), so that a node of `n` texels has `2 n - 1` nodes with itself: how many texels a node
//! has, and where a texel's leaf is, follow from places alone.
//!
//! ```text
//! node    word 0   centre: x, y, in 65535ths of the object's box
//!              1   centre: z; radius, half float
//!              2   axis of the cone, octahedral, 12 bits each; sine of a quarter of its opening, in 255ths, 8 bits
//!              3   skip pointer
//! behind the nodes, four a word of 128 bits: the texel of each leaf, in the order of the leaves
//! ```
//!
//! A sphere contains the squares of all texels below its node, a cone all their normals: that is what bounds of light
//! need, and tighter than to contain the spheres and cones of the nodes below. What is rounded is rounded so that they
//! still do.

use bevy::math::{Vec2, Vec3};
use bevy_bounce_cssm::{CssmFile, Texel};
use half::f16;

/// A hierarchy as the GPU takes it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tree {
    /// Nodes, then leaves four at a time; see the [module](self).
    pub words: Vec<[u32; 4]>,
    /// Texels.
    pub texels: u32,
    /// From the middle of a square of the largest texel's area to its corners, world units of the object's space.
    pub reach: f32,
}

/// A node, unpacked as the shader does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// Centre of the sphere round the texels, world units of the object's space.
    pub center: Vec3,
    /// Its radius.
    pub radius: f32,
    /// Axis of the cone round the normals, unit length.
    pub axis: Vec3,
    /// Cosine of its half angle.
    pub cosine: f32,
    /// The next node without what is below this one.
    pub skip: u32,
}

/// Weight of normals against positions where texels are split: two opposite normals are as far apart as this share of a node's box.
const NORMAL_WEIGHT: f32 = 0.5;

impl Tree {
    /// Over all texels of a file. Takes `n log^2 n` steps.
    pub fn build(file: &CssmFile) -> Self {
        let texels: Vec<Texel> = (0..file.meta.texels as usize).filter_map(|index| file.texel(index)).collect();
        let mut order: Vec<u32> = (0..texels.len() as u32).collect();
        let mut builder = Builder {
            texels: &texels,
            low: file.meta.bounds_min.into(),
            size: Vec3::from(file.meta.bounds_max) - Vec3::from(file.meta.bounds_min),
            words: Vec::with_capacity(2 * texels.len() + texels.len() / 4),
        };
        if !order.is_empty() {
            builder.add(&mut order);
        }
        let mut words = builder.words;
        for leaves in order.chunks(4) {
            words.push(std::array::from_fn(|i| leaves.get(i).copied().unwrap_or(0)));
        }
        Self { words, texels: texels.len() as u32, reach: texels.iter().map(reach).fold(0.0, f32::max) }
    }

    /// Nodes: one less than twice the texels.
    pub fn nodes(&self) -> u32 {
        (2 * self.texels).saturating_sub(1)
    }

    /// Levels below the root: 0 for a single texel.
    pub fn levels(&self) -> u32 {
        u32::BITS - self.texels.saturating_sub(1).leading_zeros()
    }

    /// The node at that place, in a box with those corners.
    pub fn node(&self, index: u32, bounds: [Vec3; 2]) -> Node {
        let [a, b, c, skip] = self.words[index as usize];
        let part = Vec3::new((a & 0xffff) as f32, (a >> 16) as f32, (b & 0xffff) as f32) / 65535.0;
        let octahedral = Vec2::new((c & 0xfff) as f32, (c >> 12 & 0xfff) as f32) / 4095.0 * 2.0 - 1.0;
        Node {
            center: bounds[0] + part * (bounds[1] - bounds[0]),
            radius: f16::from_bits((b >> 16) as u16).to_f32(),
            axis: from_octahedral(octahedral),
            cosine: 1.0 - 2.0 * ((c >> 24) as f32 / 255.0).powi(2),
            skip,
        }
    }

    /// The texel of a leaf, by its place in the order of leaves.
    pub fn leaf(&self, rank: u32) -> u32 {
        self.words[(self.nodes() + rank / 4) as usize][rank as usize % 4]
    }
}

struct Builder<'a> {
    texels: &'a [Texel],
    low: Vec3,
    size: Vec3,
    words: Vec<[u32; 4]>,
}

impl Builder<'_> {
    fn add(&mut self, order: &mut [u32]) {
        let skip = self.words.len() as u32 + 2 * order.len() as u32 - 1;
        let node = self.node(order, skip);
        self.words.push(node);
        if order.len() > 1 {
            let axis = self.widest(order);
            let half = order.len().div_ceil(2);
            let key = |index: &u32| key(&self.texels[*index as usize], axis);
            order.select_nth_unstable_by(half - 1, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
            let (first, second) = order.split_at_mut(half);
            self.add(first);
            self.add(second);
        }
    }

    /// Along which axis a node's texels are split: 0 to 2 of their positions, 3 to 5 of their normals.
    fn widest(&self, order: &[u32]) -> usize {
        let mut low = [f32::INFINITY; 6];
        let mut high = [f32::NEG_INFINITY; 6];
        for &index in order {
            for axis in 0..6 {
                let value = key(&self.texels[index as usize], axis);
                low[axis] = low[axis].min(value);
                high[axis] = high[axis].max(value);
            }
        }
        let size: [f32; 6] = std::array::from_fn(|axis| high[axis] - low[axis]);
        let normals = 0.5 * NORMAL_WEIGHT * Vec3::from_slice(&size).length();
        let wide = |axis: usize| if axis < 3 { size[axis] } else { size[axis] * normals };
        (0..6).max_by(|&a, &b| wide(a).total_cmp(&wide(b)).then(b.cmp(&a))).unwrap_or(0)
    }

    fn node(&self, order: &[u32], skip: u32) -> [u32; 4] {
        let texels = || order.iter().map(|&index| &self.texels[index as usize]);
        let (low, high) = texels().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), texel| {
            (low.min(texel.position.into()), high.max(texel.position.into()))
        });
        let part = ((0.5 * (low + high) - self.low) / self.size.max(Vec3::splat(f32::MIN_POSITIVE)) * 65535.0)
            .round()
            .clamp(Vec3::ZERO, Vec3::splat(65535.0));
        let center = self.low + part / 65535.0 * self.size;
        let radius = texels().map(|texel| center.distance(texel.position.into()) + reach(texel)).fold(0.0, f32::max);
        let sum: Vec3 = texels().map(|texel| Vec3::from(texel.normal) * texel.area).sum();
        let octahedral = ((to_octahedral(sum.try_normalize().unwrap_or(Vec3::Z)) * 0.5 + 0.5) * 4095.0).round();
        let axis = from_octahedral(octahedral / 4095.0 * 2.0 - 1.0);
        let cosine = texels().map(|texel| axis.dot(texel.normal.into())).fold(1.0, f32::min);
        // Both ways of computing a length or a cosine, here and on the GPU, are within these of each other.
        let radius = half_above(radius * (1.0 + 1.0e-5));
        let sine = ((0.5 * (1.0 + 1.0e-5 - cosine)).max(0.0).sqrt() * 255.0).ceil().min(255.0);
        let [x, y, z] = part.as_uvec3().to_array();
        let [u, v] = octahedral.as_uvec2().to_array();
        [x | y << 16, z | u32::from(radius) << 16, u | v << 12 | (sine as u32) << 24, skip]
    }
}

/// From the middle of a square of the texel's area to its corners.
fn reach(texel: &Texel) -> f32 {
    (0.5 * texel.area).sqrt()
}

fn key(texel: &Texel, axis: usize) -> f32 {
    if axis < 3 { texel.position[axis] } else { texel.normal[axis - 3] }
}

/// Bits of the smallest half float that is not below a value.
fn half_above(value: f32) -> u16 {
    let half = f16::from_f32(value);
    half.to_bits() + u16::from(half.to_f32() < value)
}

fn to_octahedral(n: Vec3) -> Vec2 {
    Vec2::from(bevy_bounce_cssm::octahedral::to_square(n.into()))
}

fn from_octahedral(p: Vec2) -> Vec3 {
    bevy_bounce_cssm::octahedral::from_square(p.into()).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_bounce_cssm::Meta;

    fn file(count: usize, seed: u32) -> CssmFile {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let mut texels = Vec::new();
        for _ in 0..count {
            let position = [next() * 4.0 - 1.0, next() * 3.0, next() * 0.5];
            let normal = Vec3::new(next() - 0.5, next() - 0.5, next() - 0.5).normalize_or(Vec3::Z).into();
            texels.extend(Texel { position, normal, area: 0.1 + next(), ..Texel::default() }.to_words());
        }
        let meta =
            Meta { texels: count as u32, bounds_min: [-1.0, 0.0, 0.0], bounds_max: [3.0, 3.0, 0.5], ..Meta::default() };
        CssmFile {
            meta,
            texels,
            cells: Vec::new(),
            parts: Default::default(),
            maps: Default::default(),
            csm: Default::default(),
        }
    }

    const BOUNDS: [Vec3; 2] = [Vec3::new(-1.0, 0.0, 0.0), Vec3::new(3.0, 3.0, 0.5)];

    /// Texels below a node and whether sphere and cone contain them all; checks the same of the nodes below.
    fn check(file: &CssmFile, tree: &Tree, index: u32, rank: u32) -> Vec<u32> {
        let node = tree.node(index, BOUNDS);
        let count = (node.skip - index).div_ceil(2);
        let leaves: Vec<u32> = if count == 1 {
            vec![tree.leaf(rank)]
        } else {
            let half = count.div_ceil(2);
            let second = index + 2 * half;
            assert_eq!(tree.node(index + 1, BOUNDS).skip, second);
            assert_eq!(tree.node(second, BOUNDS).skip, node.skip);
            [check(file, tree, index + 1, rank), check(file, tree, second, rank + half)].concat()
        };
        for &leaf in &leaves {
            let texel = file.texel(leaf as usize).expect("a leaf is a texel");
            assert!(
                node.center.distance(texel.position.into()) + reach(&texel) <= node.radius,
                "node {index}: {node:?}"
            );
            assert!(node.axis.dot(texel.normal.into()) >= node.cosine, "node {index}: {node:?} {texel:?}");
        }
        leaves
    }

    #[test]
    fn every_texel_is_in_one_leaf_and_all_bounds_hold() {
        for (count, seed) in [(1, 1), (2, 2), (3, 3), (37, 4), (1000, 5)] {
            let file = file(count, seed);
            let tree = Tree::build(&file);
            let mut leaves = check(&file, &tree, 0, 0);
            leaves.sort_unstable();
            assert_eq!(leaves, (0..count as u32).collect::<Vec<_>>());
            assert_eq!(tree.words.len(), 2 * count - 1 + count.div_ceil(4));
        }
    }

    #[test]
    fn skip_pointers_visit_each_node_once_beyond_65536() {
        let file = file(70_000, 9);
        let tree = Tree::build(&file);
        assert_eq!(tree.levels(), 17);
        let mut leaves = check(&file, &tree, 0, 0);
        leaves.sort_unstable();
        assert!(leaves.into_iter().eq(0..70_000), "a texel is in no leaf or in two");
        assert_eq!(tree.nodes(), 139_999);
        let second = tree.node(1, BOUNDS).skip;
        assert!(second > 65_536 && tree.node(second, BOUNDS).skip == tree.nodes());
    }

    #[test]
    fn the_same_texels_give_the_same_tree() {
        assert_eq!(Tree::build(&file(500, 7)), Tree::build(&file(500, 7)));
    }

    #[test]
    fn radii_are_rounded_up() {
        for value in [0.0, 1.0e-6, 0.1, 1.0, 1234.5] {
            assert!(f16::from_bits(half_above(value)).to_f32() >= value);
        }
    }
}
