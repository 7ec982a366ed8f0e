//! Paths, the virtual lights that are made of them, and the tree over these.

use bevy::math::Vec3;
use bevy::render::render_resource::ShaderType;

/// A virtual point light: a cosine emitter.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Vpl {
    /// World position.
    pub position: Vec3,
    /// Bounces behind it, 0 on an emissive surface; the highest bit is set where its light met a surface. While its path
    /// is [`UNSETTLED`], the cell that was met.
    pub bounce_met: u32,
    /// Unit normal.
    pub normal: Vec3,
    /// Of the sequence that its path follows: the same while its light is there.
    pub sample: u32,
    /// Linear RGB flux, lumens.
    pub flux: Vec3,
    /// Direction of the light that it reflects, octahedral, 2 snorm8; in the upper half, voxels which that had come freely, f16. In the
    /// list, bits of the area of the surface that it stands for, square world units.
    pub incoming: u32,
}

impl Vpl {
    /// Bounces behind it: 0 on an emissive surface.
    pub const fn bounce(&self) -> u32 {
        self.bounce_met & !(1 << 31)
    }

    /// Whether its light met a surface.
    pub const fn met(&self) -> bool {
        self.bounce_met >> 31 == 1
    }
}

/// What shading reads of a light of the list. See `vpl/compact.wgsl`.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct CompactVpl {
    /// World position.
    pub position: Vec3,
    /// Sum of the flux over red, green and blue, lumens.
    pub flux: f32,
    /// Unit normal.
    pub normal: Vec3,
    /// Shares of red and green in that sum, 2 unorm16.
    pub shares: u32,
}

impl CompactVpl {
    /// Linear RGB flux, lumens.
    pub fn flux(&self) -> Vec3 {
        let [red, green] = [self.shares & 0xffff, self.shares >> 16].map(|share| share as f32 / 65535.0);
        self.flux * Vec3::new(red, green, (1.0 - red - green).max(0.0))
    }
}

impl From<&Vpl> for CompactVpl {
    fn from(vpl: &Vpl) -> Self {
        let flux = vpl.flux.element_sum();
        let [red, green, _] = (vpl.flux / flux.max(1e-30) * 65535.0).round().to_array().map(|share| share as u32);
        Self { position: vpl.position, flux, normal: vpl.normal, shares: red | green << 16 }
    }
}

/// Lights of the list that a uniform buffer has room for.
pub const UNIFORM_VPLS: u32 = 2048;

/// Words known of a brick of the grid: lights times 2^15; candidates whose light falls into it, and of these those whose light
/// meets something from there; area of the groups in it, in 1/65536 voxel faces.
pub const BRICK_WORDS: u32 = 4;
/// Places of which a path from a directional light starts at one.
pub const CANDIDATES: u32 = 8;
/// Words of an entry of the lists of triangles. See `vpl/triangle_lists.wgsl`.
pub const LIST_ENTRY_WORDS: u32 = 2;

/// A path that was traced.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Path {
    /// Vertices.
    pub length: u32,
    /// Bounce of the first one: 0 on an emissive surface, else 1.
    pub first_bounce: u32,
    /// While it is traced, the bounces that are left to it, [`UNSETTLED`], and whether a triangle was met; then,
    /// vertices of the paths before it.
    pub first: u32,
    /// Not of this path: as the i-th, the i-th of those that go on; all ones where there are no more.
    pub alive: u32,
}

/// Bit of [`Path::first`]: a vertex more is where the grid was met, and not yet set on a surface.
pub const UNSETTLED: u32 = 1 << 31;

/// An emissive triangle as an area light.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Emitter {
    /// World position of its first corner.
    pub position: Vec3,
    /// 1 where it shines on both sides.
    pub two_sided: u32,
    /// From the first corner to the second.
    pub edge_b: Vec3,
    /// Power, lumens (luminance), of this triangle and those before it.
    pub cumulative_power: f32,
    /// From the first corner to the third.
    pub edge_c: Vec3,
    /// Keeps rows of 16 bytes.
    pub padding_a: u32,
    /// Unit normal of the side that is seen.
    pub normal: Vec3,
    /// Keeps rows of 16 bytes.
    pub padding_b: u32,
    /// Linear RGB flux, lumens, of all its sides.
    pub flux: Vec3,
    /// Keeps rows of 16 bytes.
    pub padding_c: u32,
}

/// Sizes of the path tracer.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct VplParameters {
    /// Virtual lights there is room for.
    pub capacity: u32,
    /// Paths traced.
    pub path_count: u32,
    /// Longest path, bounces.
    pub max_bounces: u32,
    /// Scale of the bound of the geometry term.
    pub bound_scale: f32,
}

/// Bits of each coordinate of a place on a Hilbert curve.
pub const HILBERT_BITS: u32 = 7;

/// Steps of the error of a node of the tree over the vertices: 32 an octave. See `vpl/cuts.wgsl`.
pub const NODE_STEPS: u32 = 1024;

/// Subsets of the virtual lights: a pixel of each 4x4 block is lit by one of them.
pub const SUBSETS: usize = 16;

/// What the list of virtual lights holds.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct VplHeader {
    /// First light of each subset, and the end of the last.
    pub subset_start: [u32; SUBSETS + 1],
    /// Paths traced: fluxes are divided by it.
    pub path_count: u32,
    /// Largest geometry term where lights lie as densely as on the average, 1/m^2.
    pub geometry_bound: f32,
    /// Lights in the list.
    pub count: u32,
    /// Scale of the bound of the geometry term.
    pub bound_scale: f32,
}
