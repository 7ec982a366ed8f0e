//! Twin of the bias compensation: `ssbc/hierarchy.wgsl`, `ssbc/reduce.wgsl` and `ssbc/integrate.wgsl`, which count the texels
//! that they look at here, and the flat sum over all pixels near that they stand for.

use std::f32::consts::PI;

use bevy::math::{IVec2, Mat4, UVec2, Vec2, Vec3, Vec4, Vec4Swizzles};
use bevy_bounce_shaders::types::{SSBC_LEVELS, SsbcParameters};
use half::f16;

use super::decode_unit;
use super::near::near_light;

const NORMAL_EDGE: f32 = 0.95;
const PLANE_EDGE: f32 = 0.25;
const MOST_STEP: f32 = 0.25;
const FLAT: f32 = 0.002;
const BENT: f32 = 0.05;
const LOBE_HEIGHT: f32 = 0.438_691_34;
const LOBE_RADIUS: f32 = 0.620_403_23;
const NEAR: i32 = 2;
const NEAR_SOLID_ANGLE: f32 = 0.08;
const HALF_DIAGONAL: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// World positions as a function of pixel coordinates and depth.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    pub(super) origin: Vec4,
    pub(super) x: Vec4,
    pub(super) y: Vec4,
    pub(super) depth: Vec4,
    pixel: f32,
    clip_from_world: Mat4,
}

impl Lens {
    /// Of a view of that size.
    pub fn new(world_from_clip: Mat4, size: UVec2) -> Self {
        let m = world_from_clip;
        let step = 2.0 / size.as_vec2();
        let y = -m.y_axis * step.y;
        Self {
            origin: m.w_axis - m.x_axis + m.y_axis,
            x: m.x_axis * step.x,
            y,
            depth: m.z_axis,
            pixel: y.xyz().length(),
            clip_from_world: m.inverse(),
        }
    }

    /// Position, and the edge of a pixel there.
    pub fn position(&self, pixel: Vec2, depth: f32) -> (Vec3, f32) {
        let p = self.origin + self.x * pixel.x + self.y * pixel.y + self.depth * depth;
        (p.xyz() / p.w, self.pixel / p.w.abs())
    }

    fn texel(&self, texel: IVec2, level: u32, depth: f32) -> (Vec3, f32) {
        let scale = (1 << level) as f32;
        let (position, edge) = self.position((texel.as_vec2() + 0.5) * scale, depth);
        (position, edge * scale)
    }

    fn across(&self, normal: Vec3) -> f32 {
        0.5 * (normal.dot(self.x.xyz()).abs() + normal.dot(self.y.xyz()).abs())
    }

    // Twin of `depth_range` in `ssbc/hierarchy.wgsl`, of a pixel.
    fn depth_range(&self, position: Vec3, normal: Vec3, depth: f32) -> f32 {
        let along = normal.dot(self.depth.xyz()) - normal.dot(position) * self.depth.w;
        (2.0 * self.across(normal) / along.abs().max(1e-30)).min(MOST_STEP * depth)
    }
}

/// What the camera sees.
#[derive(Clone, Debug)]
pub struct GBuffer {
    /// Pixels.
    pub size: UVec2,
    /// Where they lie.
    pub lens: Lens,
    /// Bits of the reverse-z depth and octahedral normal, pixel by pixel.
    pub surface: Vec<[u32; 2]>,
    /// What each pixel sends, and its area over that of the pixel seen head-on.
    pub radiance: Vec<Vec4>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Node {
    depth: f32,
    near: f32,
    far: f32,
    area: f32,
    normal: Vec3,
    edge: bool,
    radiance: Vec3,
}

/// All levels, from the pixels up. Nothing is packed here.
pub struct Hierarchy {
    levels: Vec<(IVec2, Vec<Node>)>,
}

/// Irradiance over pi, and what it took.
#[derive(Clone, Copy, Debug, Default)]
pub struct Gathered {
    /// The light.
    pub light: Vec3,
    /// Pixels and texels looked at.
    pub samples: u32,
}

impl GBuffer {
    fn index(&self, pixel: UVec2) -> usize {
        (pixel.y * self.size.x + pixel.x) as usize
    }

    fn contains(&self, texel: IVec2, level: u32) -> bool {
        ((texel << IVec2::splat(level as i32)).cmplt(self.size.as_ivec2())).all()
    }

    /// Reverse-z depth at a pixel.
    pub fn depth(&self, pixel: UVec2) -> f32 {
        f32::from_bits(self.surface[self.index(pixel)][0])
    }

    /// What a pixel sends, and its area over that of the pixel seen head-on.
    pub fn radiance_at(&self, pixel: UVec2) -> Vec4 {
        self.radiance[self.index(pixel)]
    }

    /// Position and normal at a pixel, and the edge of the pixel; `None` where nothing is seen.
    pub fn surface_at(&self, pixel: UVec2) -> Option<(Vec3, Vec3, f32)> {
        let [depth, normal] = self.surface[self.index(pixel)];
        let (position, edge) = self.lens.position(pixel.as_vec2() + 0.5, f32::from_bits(depth));
        (depth != 0).then(|| (position, decode_unit(normal), edge))
    }

    fn node(&self, texel: IVec2) -> Node {
        if !self.contains(texel, 0) {
            return Node::default();
        }
        let pixel = texel.as_uvec2();
        let Some((position, normal, edge)) = self.surface_at(pixel) else { return Node::default() };
        let (depth, light) = (self.depth(pixel), self.radiance_at(pixel));
        let area = light.w.max(1e-4) * edge * edge;
        let range = self.lens.depth_range(position, normal, depth);
        let (near, far) = (depth + range, depth - range);
        Node { depth, near, far, area, normal, edge: false, radiance: light.xyz() }
    }
}

impl Hierarchy {
    /// All levels.
    pub fn new(gbuffer: &GBuffer) -> Self {
        let padded = gbuffer.size.map(|pixels| pixels.next_multiple_of(1 << SSBC_LEVELS));
        let texels = |level: u32| {
            let size = (padded >> UVec2::splat(level)).as_ivec2();
            (size, (0..size.y).flat_map(move |y| (0..size.x).map(move |x| IVec2::new(x, y))))
        };
        let (size, pixels) = texels(0);
        let mut levels = vec![(size, pixels.map(|pixel| gbuffer.node(pixel)).collect::<Vec<Node>>())];
        for level in 1..=SSBC_LEVELS {
            let (below_size, below) = &levels[level as usize - 1];
            let below = |texel: IVec2| below[(texel.y * below_size.x + texel.x) as usize];
            let (size, texels) = texels(level);
            let nodes = texels.map(|texel| merge(gbuffer, [0, 1, 2, 3].map(|i| below(child(texel, i))), texel, level));
            levels.push((size, nodes.collect()));
        }
        Self { levels }
    }

    fn node(&self, texel: IVec2, level: u32) -> Node {
        let (size, nodes) = &self.levels[level as usize];
        nodes[(texel.y * size.x + texel.x) as usize]
    }
}

fn child(texel: IVec2, i: i32) -> IVec2 {
    2 * texel + IVec2::new(i & 1, i >> 1)
}

fn merge(gbuffer: &GBuffer, below: [Node; 4], texel: IVec2, level: u32) -> Node {
    let mut node = Node { far: 1e30, ..Default::default() };
    let mut seen = 0.0;
    for below in below.iter().filter(|below| below.area > 0.0) {
        seen += 1.0;
        node.depth += below.depth;
        node.near = node.near.max(below.near);
        node.far = node.far.min(below.far);
        node.area += below.area;
        node.normal += below.normal * below.area;
        node.radiance += below.radiance * below.area;
        node.edge |= below.edge;
    }
    if seen == 0.0 {
        return node;
    }
    node.depth /= seen;
    node.radiance /= node.area;
    node.normal = node.normal.try_normalize().unwrap_or(Vec3::Y);
    let (position, edge) = gbuffer.lens.texel(texel, level, node.depth);
    for (i, below) in (0..).zip(below) {
        let child = child(texel, i);
        if below.area > 0.0 {
            let offset = gbuffer.lens.texel(child, level - 1, below.depth).0 - position;
            node.edge |=
                node.normal.dot(offset).abs() > PLANE_EDGE * edge || node.normal.dot(below.normal) < NORMAL_EDGE;
        } else {
            node.edge |= gbuffer.contains(child, level - 1);
        }
    }
    node
}

/// Who is lit, by what, as exactly as what.
struct Integral<'a> {
    gbuffer: &'a GBuffer,
    hierarchy: &'a Hierarchy,
    parameters: SsbcParameters,
    bound: f32,
    position: Vec3,
    normal: Vec3,
    pixel: IVec2,
}

enum Visit {
    Light(Vec3),
    Refine,
}

const NOTHING: Visit = Visit::Light(Vec3::ZERO);

fn residual_term(height: f32, other_height: f32, square: f32, area: f32, bound: f32) -> f32 {
    (height * other_height / square / (square + area / PI) - bound).max(0.0)
}

fn radius_ratio(area_ratio: f32) -> f32 {
    HALF_DIAGONAL * area_ratio.max(1.0)
}

fn is_near(offset: IVec2) -> bool {
    offset.abs().max_element() <= NEAR
}

/// Light of one pixel, as a polygon where it is near.
fn pixel_light(gbuffer: &GBuffer, receiver: (Vec3, Vec3), bound: f32, from_receiver: IVec2, pixel: UVec2) -> Vec3 {
    let (position, normal) = receiver;
    let Some((other, other_normal, edge)) = gbuffer.surface_at(pixel) else { return Vec3::ZERO };
    let offset = other - position;
    let square = offset.length_squared();
    let (height, other_height) = (normal.dot(offset), -other_normal.dot(offset));
    let radiance = gbuffer.radiance_at(pixel);
    if is_near(from_receiver) && other_height > -FLAT * edge && normal.dot(other_normal) < 0.9 {
        return radiance.xyz() * near_light(gbuffer, receiver, bound, pixel.as_ivec2());
    }
    if height <= 0.0 || other_height <= 0.0 {
        return Vec3::ZERO;
    }
    let area = radiance.w * edge * edge;
    radiance.xyz() * (area * residual_term(height, other_height, square, area, bound))
}

impl Integral<'_> {
    fn visit_plane(&self, node: &Node, texel: IVec2, level: u32) -> Visit {
        let (position, edge) = self.gbuffer.lens.texel(texel, level, node.depth);
        let radius = radius_ratio(node.area / (edge * edge)) * edge;
        let offset = position - self.position;
        let square = offset.length_squared().max(1e-20);
        let distance = square.sqrt();
        let flat = FLAT * (distance + radius);
        let other_height = -node.normal.dot(offset);
        let middle = self.normal.dot(offset);
        let cosine = self.normal.dot(node.normal);
        let height = middle + radius * (1.0 - cosine * cosine).max(0.0).sqrt();
        let other_highest = other_height + flat + if level > 0 { BENT * radius } else { 0.0 };
        let reach = radius + radius / (1 << level) as f32;
        let nearest = (distance - reach).max(other_highest);
        if other_highest <= 0.0 || height <= flat || height * other_highest <= self.bound * nearest.powi(4) {
            return NOTHING;
        }
        let touches = distance - reach <= other_highest;
        let between = if touches { nearest } else { (distance - 0.5 * radius).max(other_highest) }.powi(2);
        let solid_angle = node.area * height * other_highest / (between * (between + node.area / PI));
        let limit = if level > 0 { f32::INFINITY } else { NEAR_SOLID_ANGLE };
        let is_large = solid_angle > self.parameters.solid_angle.min(limit);
        if is_large && level > 0 {
            return Visit::Refine;
        }
        if is_large && is_near(texel - self.pixel) {
            let receiver = (self.position, self.normal);
            return Visit::Light(node.radiance * near_light(self.gbuffer, receiver, self.bound, texel));
        }
        let weight = node.area * residual_term(middle.max(0.0), other_height.max(0.0), square, node.area, self.bound);
        Visit::Light(node.radiance * weight)
    }

    fn visit_edge(&self, node: &Node, texel: IVec2, level: u32) -> Visit {
        let lens = &self.gbuffer.lens;
        let [near, far] = [node.near, node.far].map(|depth| lens.texel(texel, level, depth));
        let (to_near, to_far) = (near.0 - self.position, far.0 - self.position);
        let along = to_far - to_near;
        let share = (-to_near.dot(along) / along.length_squared().max(1e-20)).clamp(0.0, 1.0);
        let distance = (to_near + along * share).length();
        let nearest = (distance - HALF_DIAGONAL * near.1.max(far.1)).max(0.0);
        let slope = lens.across(self.normal) / lens.pixel;
        let height = (self.normal.dot(to_near) + slope * near.1).max(self.normal.dot(to_far) + slope * far.1);
        if height <= FLAT * far.1 || height <= self.bound * nearest.powi(3) {
            return NOTHING;
        }
        let cosine = (height / distance.max(1e-10)).min(1.0);
        if node.area * cosine / (distance * distance + node.area / PI) > self.parameters.edge_solid_angle {
            return Visit::Refine;
        }
        let offset = lens.texel(texel, level, 0.5 * (node.near + node.far)).0 - self.position;
        let other_height = (-node.normal.dot(offset)).max(0.0);
        let square = offset.length_squared().max(1e-20);
        let height = self.normal.dot(offset).max(0.0);
        Visit::Light(node.radiance * (node.area * residual_term(height, other_height, square, node.area, self.bound)))
    }

    fn visit(&self, texel: IVec2, level: u32) -> Visit {
        let node = self.hierarchy.node(texel, level);
        match (node.area > 0.0, node.edge) {
            (false, _) => NOTHING,
            (true, false) => self.visit_plane(&node, texel, level),
            (true, true) => self.visit_edge(&node, texel, level),
        }
    }
}

/// An ellipse along the axes of the screen, pixels.
#[derive(Clone, Copy, Debug)]
pub struct Disc {
    /// Where it is.
    pub middle: Vec2,
    /// Along each axis.
    pub radius: Vec2,
}

/// Where a sphere is seen.
pub fn sphere_on_screen(clip_from_world: Mat4, size: UVec2, middle: Vec3, radius: f32) -> Disc {
    let half_size = 0.5 * size.as_vec2();
    let row = |i: usize| clip_from_world.row(i).xyz();
    let clip = clip_from_world * middle.extend(1.0);
    let product = |i: usize, j: usize| clip[i] * clip[j] - radius * radius * row(i).dot(row(j));
    let ww = product(3, 3);
    if ww <= 0.0 {
        return Disc { middle: half_size, radius: size.as_vec2() };
    }
    let at = Vec2::new(product(0, 3), -product(1, 3)) / ww;
    let extent = Vec2::from_array([0, 1].map(|i| (product(i, 3).powi(2) - product(i, i) * ww).max(0.0).sqrt() / ww));
    Disc { middle: half_size + at * half_size, radius: (extent * half_size).max(Vec2::splat(1e-3)) }
}

fn is_within(texel: IVec2, level: u32, disc: Disc) -> bool {
    let half_edge = 0.5 * (1 << level) as f32;
    let middle = (texel.as_vec2() * 2.0 + 1.0) * half_edge;
    let away = ((middle - disc.middle).abs() - half_edge).max(Vec2::ZERO) / disc.radius;
    away.length_squared() < 1.0
}

/// The residual at a pixel, through the hierarchy; nothing where nothing is seen.
pub fn gather(
    gbuffer: &GBuffer,
    hierarchy: &Hierarchy,
    parameters: SsbcParameters,
    bound: f32,
    pixel: UVec2,
) -> Gathered {
    let mut gathered = Gathered::default();
    let Some((position, normal, _)) = gbuffer.surface_at(pixel) else { return gathered };
    let integral = Integral { gbuffer, hierarchy, parameters, bound, position, normal, pixel: pixel.as_ivec2() };
    let reach = 1.0 / bound.sqrt();
    let (size, lobe) = (gbuffer.size, position + normal * (LOBE_HEIGHT * reach));
    let disc = sphere_on_screen(gbuffer.lens.clip_from_world, size, lobe, LOBE_RADIUS * reach);
    let top = (2.0 * disc.radius.max_element()).log2().ceil().clamp(0.0, SSBC_LEVELS as f32) as u32;
    let shift = IVec2::splat(top as i32);
    let low = (disc.middle - disc.radius).max(Vec2::ZERO).as_ivec2() >> shift;
    let high = (disc.middle + disc.radius).clamp(Vec2::ZERO, size.as_vec2() - 1.0).as_ivec2() >> shift;
    let mut waiting: Vec<(IVec2, u32)> =
        (low.y..=high.y).flat_map(|y| (low.x..=high.x).map(move |x| (IVec2::new(x, y), top))).collect();
    while let Some((texel, level)) = waiting.pop() {
        if !is_within(texel, level, disc) {
            continue;
        }
        gathered.samples += 1;
        match integral.visit(texel, level) {
            Visit::Light(light) => gathered.light += light,
            Visit::Refine => waiting.extend([0, 1, 2, 3].map(|i| (child(texel, i), level - 1))),
        }
    }
    gathered.light /= PI;
    gathered
}

/// The residual at a pixel as a sum over all pixels within the radius.
pub fn flat_sum(gbuffer: &GBuffer, bound: f32, pixel: UVec2) -> Gathered {
    let mut gathered = Gathered::default();
    let Some((position, normal, footprint)) = gbuffer.surface_at(pixel) else { return gathered };
    let radius = 1.0 / bound.sqrt() / footprint;
    let low = (pixel.as_vec2() - radius).max(Vec2::ZERO).as_uvec2();
    let high = (pixel.as_vec2() + radius).ceil().as_uvec2().min(gbuffer.size - 1);
    let disc = Disc { middle: pixel.as_vec2() + 0.5, radius: Vec2::splat(radius) };
    for y in low.y..=high.y {
        for x in low.x..=high.x {
            if is_within(IVec2::new(x as i32, y as i32), 0, disc) {
                gathered.samples += 1;
                let other = UVec2::new(x, y);
                let offset = other.as_ivec2() - pixel.as_ivec2();
                gathered.light += pixel_light(gbuffer, (position, normal), bound, offset, other);
            }
        }
    }
    gathered.light /= PI;
    gathered
}

/// Twin of Bevy's rgb9e5.
pub fn rgb9e5_to_vec3(word: u32) -> Vec3 {
    let scale = ((word >> 27) as f32 - 24.0).exp2();
    Vec3::new((word & 511) as f32, (word >> 9 & 511) as f32, (word >> 18 & 511) as f32) * scale
}

/// Half floats, four a pixel, as the radiance texture holds them.
pub fn half_texels(radiance: &[Vec4]) -> Vec<u8> {
    radiance.iter().flat_map(|texel| texel.to_array()).flat_map(|c| f16::from_f32(c).to_le_bytes()).collect()
}
