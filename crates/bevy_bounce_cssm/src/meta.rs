//! What the file says about itself.

use crate::CssmError;
use crate::block::{LANES, ROWS};

/// Words of the section.
pub const META_WORDS: usize = 30;

/// Sizes, units and where the bake came from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Meta {
    /// Width and height of the atlas in texels.
    pub atlas: [u32; 2],
    /// Side of a cube map's face in pixels.
    pub depth: u32,
    /// Texels with a cube map.
    pub texels: u32,
    /// Blocks of at most 64 texels.
    pub blocks: u32,
    /// Connected pieces of the atlas.
    pub charts: u32,
    /// Traversal, as the baker numbers them.
    pub strategy: u32,
    /// Side of the grid of directions from which the object was seen from outside; 0 without such maps.
    pub csm_grid: u32,
    /// Side of a map from outside in pixels.
    pub csm_side: u32,
    /// Smallest corner of the object's box, in world units of its own space.
    pub bounds_min: [f32; 3],
    /// Largest corner.
    pub bounds_max: [f32; 3],
    /// Depth of one step in a cube map, in world units.
    pub quantum: f32,
    /// How far above its texel a cube map's centre stands, in world units.
    pub lift: f32,
    /// Centre of the sphere that the maps from outside show.
    pub csm_center: [f32; 3],
    /// Its radius, in world units.
    pub csm_radius: f32,
    /// Depth of one step in a map from outside, in world units.
    pub csm_quantum: f32,
    /// Hash of the scene's files, to tell whether a bake is of their present state.
    pub source_hash: u64,
    /// Rays that were cast for cube maps, those on the surfaces' front.
    pub rays: u64,
    /// Those on which two surfaces are closer than one step.
    pub close: u64,
    /// Constant pieces stored.
    pub runs: u64,
}

impl Meta {
    /// Groups of 32 pixels in a cube map.
    pub fn groups(&self) -> usize {
        6 * (self.depth as usize * self.depth as usize) / ROWS
    }

    /// Blocks of the maps from outside, and groups in each.
    pub fn csm_shape(&self) -> (usize, usize) {
        let (grid, side) = (self.csm_grid as usize, self.csm_side as usize);
        (grid * grid / LANES, side * side / ROWS)
    }

    /// The section.
    pub fn to_words(&self) -> [u32; META_WORDS] {
        let mut words = [0; META_WORDS];
        let mut at = 0;
        let mut put = |word: u32| {
            words[at] = word;
            at += 1;
        };
        self.atlas.into_iter().for_each(&mut put);
        let sizes = [self.depth, self.texels, self.blocks, self.charts, self.strategy, self.csm_grid, self.csm_side];
        sizes.into_iter().for_each(&mut put);
        let lengths = [self.quantum, self.lift, self.csm_radius, self.csm_quantum];
        let corners = [self.bounds_min, self.bounds_max, self.csm_center];
        corners.as_flattened().iter().chain(&lengths).for_each(|value| put(value.to_bits()));
        for value in [self.source_hash, self.rays, self.close, self.runs] {
            put(value as u32);
            put((value >> 32) as u32);
        }
        words
    }

    /// Understands the section and checks what it says by itself.
    pub fn from_words(words: &[u32]) -> Result<Self, CssmError> {
        let wrong = |problem: String| CssmError::section("meta", problem);
        let words: &[u32; META_WORDS] =
            words.try_into().map_err(|_| wrong(format!("it has {} words instead of {META_WORDS}", words.len())))?;
        let float = |at: usize| f32::from_bits(words[at]);
        let vector = |at: usize| [float(at), float(at + 1), float(at + 2)];
        let long = |at: usize| u64::from(words[at]) | u64::from(words[at + 1]) << 32;
        let meta = Self {
            atlas: [words[0], words[1]],
            depth: words[2],
            texels: words[3],
            blocks: words[4],
            charts: words[5],
            strategy: words[6],
            csm_grid: words[7],
            csm_side: words[8],
            bounds_min: vector(9),
            bounds_max: vector(12),
            csm_center: vector(15),
            quantum: float(18),
            lift: float(19),
            csm_radius: float(20),
            csm_quantum: float(21),
            source_hash: long(22),
            rays: long(24),
            close: long(26),
            runs: long(28),
        };
        meta.check().map_err(wrong)?;
        Ok(meta)
    }

    fn check(&self) -> Result<(), String> {
        let side = |name: &str, side: u32| match side {
            8..=256 if side.is_multiple_of(8) => Ok(()),
            _ => Err(format!("{name} is {side}: a multiple of 8 up to 256 is allowed")),
        };
        side("the side of a cube map", self.depth)?;
        if self.csm_grid > 0 {
            side("the grid of directions", self.csm_grid)?;
            side("the side of a map from outside", self.csm_side)?;
        }
        if self.atlas.iter().any(|&size| size == 0 || size > 1 << 16) {
            return Err(format!("the atlas is {} by {}", self.atlas[0], self.atlas[1]));
        }
        let corners = [self.bounds_min, self.bounds_max, self.csm_center];
        let ordered = self.bounds_min.iter().zip(&self.bounds_max).all(|(min, max)| min <= max);
        if !ordered || !corners.as_flattened().iter().all(|value| value.is_finite()) {
            return Err("the object's bounds are not a box".into());
        }
        let lengths = [self.quantum, self.lift, self.csm_radius, self.csm_quantum];
        if lengths.iter().any(|length| !(length.is_finite() && *length > 0.0)) {
            return Err("a length is not a positive number".into());
        }
        Ok(())
    }
}
