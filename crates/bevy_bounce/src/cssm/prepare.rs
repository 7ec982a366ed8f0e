//! The bakes on the GPU, and what is solved on them.

use bevy::math::Affine3A;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferInitDescriptor, BufferUsages, ShaderType, UniformBuffer,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_bounce_cssm::{CssmAsset, CssmFile};
use bevy_bounce_shaders::types::{CSSM_TOP_NODES, CssmBakes, CssmGather, CssmLevel, CssmSurface, NONE};

use super::hull::Hull;
use super::object::ExtractedCssm;
use super::surfaces::surfaces;
use super::top::with_top;
use super::tree::Tree;
use super::words::{PAGE_BITS, PAGES, TooLarge, Words, placed};
use crate::scene::{Instances, SceneBuffers};

/// Bytes of a value that each texel or node has.
const VALUE: u64 = 16;

/// What is made of a bake once, whatever objects have it.
pub(super) struct Prepared {
    tree: Tree,
    surfaces: Vec<CssmSurface>,
    pub hull: Hull,
}

/// Of the bakes of all objects.
#[derive(Resource, Default)]
pub(super) struct PreparedBakes(pub HashMap<AssetId<CssmAsset>, Prepared>);

impl PreparedBakes {
    /// Prepares what is new and forgets what is not asked for.
    pub fn hold<'a>(&mut self, bakes: impl Iterator<Item = (AssetId<CssmAsset>, &'a CssmFile)> + Clone) {
        self.0.retain(|asset, _| bakes.clone().any(|(held, _)| held == *asset));
        for (asset, file) in bakes {
            self.0.entry(asset).or_insert_with(|| Prepared {
                tree: Tree::build(file),
                surfaces: surfaces(file),
                hull: Hull::new(file),
            });
        }
    }
}

/// Baked objects, and the light of their texels.
#[derive(Resource)]
pub(crate) struct Baked {
    /// The bake of each object that was asked for.
    pub assets: Vec<AssetId<CssmAsset>>,
    /// Which of these have found room; the others are left out.
    pub fits: Vec<bool>,
    /// `CssmBakes`.
    pub bakes: UniformBuffer<CssmBakes>,
    /// `CssmGather` of the texels.
    pub gather: UniformBuffer<CssmGather>,
    /// Records of the files.
    pub texels: Buffer,
    /// Of each bake, of the cube maps, then of the maps from outside.
    pub directory: Buffer,
    /// Blocks.
    pub pages: [Buffer; PAGES],
    /// `array<vec4<u32>>`, of each bake: nodes, then leaves.
    pub tree: Buffer,
    /// `array<CssmSurface>`, by place of light.
    pub surfaces: Buffer,
    /// `array<u32>`: instance of each part.
    pub part_instances: Buffer,
    /// `array<u32>`, by instance: the object that it is part of, or `NONE`. Instances beyond it are of none. Written where virtual lights
    /// see by bakes.
    pub instance_objects: Buffer,
    /// What that was written from: instance and object of each part.
    pub(super) instances_of: Vec<(u32, u32)>,
    /// Light that is shown.
    pub light: Light,
    /// Light whose bounces are under way, where these follow each other from frame to frame.
    pub next: Option<Next>,
    /// `array<vec4<f32>>`, by place of light, of each object its texels: radiance without bounces.
    pub sources: Buffer,
    /// One `CssmLevel` each, from the roots on.
    pub levels: Vec<Buffer>,
    /// What the light was solved from, and what it is to be solved from now; `None` before the first frame.
    pub solved: Option<State>,
    /// Of this frame.
    pub wanted: Option<State>,
    /// How often the texels were lit.
    pub times_lit: u64,
}

/// Light of the texels and of their hierarchies.
pub(crate) struct Light {
    /// `array<vec4<f32>>`, two by place of light, of each object its nodes, then those of the tree over the objects: radiance times area,
    /// area.
    pub powers: Buffer,
    /// `array<vec4<f32>>`, by place of light: irradiance over pi, nodes of the cuts. What texels send on.
    pub gathered: Buffer,
    /// The same with one bounce more, for pixels that show it; there where it was asked for.
    pub received: Option<Buffer>,
}

impl Light {
    fn new(device: &RenderDevice, lights: u32) -> Self {
        let bytes = u64::from(lights) * VALUE;
        Self {
            powers: storage(device, "bounce_cssm_powers", 2 * bytes + CSSM_TOP_NODES as u64 * VALUE),
            gathered: storage(device, "bounce_cssm_gathered", bytes),
            received: None,
        }
    }

    /// Makes room for what texels receive, or gives it up.
    pub fn receive(&mut self, asked: bool, device: &RenderDevice) {
        let bytes = self.gathered.size();
        let make = || storage(device, "bounce_cssm_received", bytes);
        self.received = asked.then(|| self.received.take().unwrap_or_else(make));
    }

    fn bytes(&self) -> u64 {
        self.powers.size() + self.gathered.size() + self.received.as_ref().map_or(0, |received| received.size())
    }
}

/// A bounce a frame.
pub(crate) struct Next {
    pub light: Light,
    /// Bounces that it has; nothing when it is all there.
    pub bounces: Option<u32>,
    /// Whether something has changed since its first bounce.
    pub is_late: bool,
}

impl Next {
    /// Nothing has bounced yet.
    pub fn new(device: &RenderDevice, lights: u32) -> Self {
        Self { light: Light::new(device, lights), bounces: None, is_late: false }
    }
}

/// All that the light of the texels depends on.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct State {
    bakes: CssmBakes,
    gather: CssmGather,
    /// Gathers between texels and the one of the pixels.
    pub bounces: u32,
    /// Whether those between texels follow each other from frame to frame.
    pub spread: bool,
    /// Whether texels gather the last one, too.
    pub at_texels: bool,
    /// What [`Instances::look`] says of each.
    parts: Vec<[u32; 3]>,
    revision: u64,
}

fn storage(device: &RenderDevice, label: &'static str, size: u64) -> Buffer {
    device.create_buffer(&BufferDescriptor {
        label: Some(label),
        size: size.max(16),
        usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// A buffer of pieces, one after the other.
fn filled(device: &RenderDevice, label: &'static str, pieces: &[&[u32]]) -> Buffer {
    let words: usize = pieces.iter().map(|piece| piece.len()).sum();
    let buffer = device.create_buffer(&BufferDescriptor {
        label: Some(label),
        size: 4 * words.max(4) as u64,
        usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST,
        mapped_at_creation: true,
    });
    let mut at = 0;
    let mut mapped = buffer.slice(..).get_mapped_range_mut();
    for piece in pieces {
        let end = at + 4 * piece.len();
        mapped.slice(at..end).copy_from_slice(bytemuck::cast_slice(piece));
        at = end;
    }
    drop(mapped);
    buffer.unmap();
    buffer
}

/// Of each instance the object that it is part of, or `NONE`; at least `places` of them.
fn objects_of_instances(parts: &[(u32, u32)], places: usize) -> Vec<u32> {
    let mut objects = vec![NONE; places];
    for (slot, object) in parts.iter().filter(|(slot, _)| *slot != NONE) {
        objects.resize(objects.len().max(*slot as usize + 1), NONE);
        objects[*slot as usize] = *object;
    }
    objects
}

impl Baked {
    /// Uploads the words of the objects' bakes, each once. Says which of them found no room.
    pub(super) fn new<'a>(
        device: &RenderDevice,
        objects: impl Iterator<Item = (AssetId<CssmAsset>, &'a CssmFile)>,
        prepared: &'a PreparedBakes,
    ) -> (Self, Vec<(AssetId<CssmAsset>, TooLarge)>) {
        let mut words = Words::new(PAGE_BITS);
        let mut bakes = HashMap::new();
        let (mut assets, mut fits, mut too_large) = (Vec::new(), Vec::new(), Vec::new());
        let (mut shown, mut parts) = (Vec::new(), 0);
        for (asset, file) in objects {
            let Some(prepared) = prepared.0.get(&asset) else { continue };
            let bake = *bakes.entry(asset).or_insert_with(|| words.bake(file, &prepared.tree));
            let added = bake.and_then(|bake| words.object(bake, Affine3A::IDENTITY));
            assets.push(asset);
            fits.push(added.is_ok());
            match added {
                Ok(()) => {
                    shown.extend(prepared.surfaces.iter().flat_map(|surface| surface_words(surface, parts)));
                    parts += file.parts.iter().count() as u32;
                }
                Err(error) => too_large.push((asset, error)),
            }
        }
        let level = |level: u32| {
            device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some("bounce_cssm_level"),
                contents: &level.to_ne_bytes(),
                usage: BufferUsages::UNIFORM,
            })
        };
        debug_assert_eq!(CssmLevel::min_size().get(), 4);
        let lights = words.table.lights;
        let levels = words.table.objects.iter().map(|bake| bake.levels).max().unwrap_or(0);
        let baked = Self {
            assets,
            fits,
            bakes: UniformBuffer::from(words.table),
            gather: UniformBuffer::default(),
            texels: filled(device, "bounce_cssm_texels", words.texels.all()),
            directory: filled(device, "bounce_cssm_directory", words.directory.all()),
            pages: std::array::from_fn(|page| filled(device, "bounce_cssm_blocks", &words.page(page))),
            tree: filled(device, "bounce_cssm_tree", words.trees.all()),
            surfaces: filled(device, "bounce_cssm_surfaces", &[&shown]),
            part_instances: storage(device, "bounce_cssm_parts", 4 * u64::from(parts)),
            instance_objects: filled(device, "bounce_cssm_instances", &[&[NONE; 4]]),
            instances_of: Vec::new(),
            light: Light::new(device, lights),
            next: None,
            sources: storage(device, "bounce_cssm_sources", u64::from(lights) * VALUE),
            // The leaves need one, too.
            levels: (0..levels.max(1)).map(level).collect(),
            solved: None,
            wanted: None,
            times_lit: 0,
        };
        (baked, too_large)
    }

    fn write_instances(&mut self, parts: &[(u32, u32)], device: &RenderDevice, queue: &RenderQueue) {
        let objects = objects_of_instances(parts, (self.instance_objects.size() / 4) as usize);
        let bytes = 4 * objects.len() as u64;
        if self.instance_objects.size() < bytes {
            self.instance_objects = storage(device, "bounce_cssm_instances", bytes);
        }
        queue.write_buffer(&self.instance_objects, 0, bytemuck::cast_slice(&objects));
    }

    /// Whether the texels' light is that of this frame, at least as far as it has bounced.
    pub fn is_lit(&self) -> bool {
        self.wanted.is_some() && self.wanted == self.solved
    }

    /// Whether it has also bounced as often as asked, so that it stays while nothing changes.
    pub fn rests(&self) -> bool {
        self.is_lit() && self.next.as_ref().is_none_or(|next| next.bounces.is_none())
    }

    /// Whether the objects stand in this frame.
    pub fn is_placed(&self) -> bool {
        self.wanted.is_some()
    }

    /// Objects.
    pub fn count(&self) -> u32 {
        self.bakes.get().count
    }

    /// Texels of all objects.
    pub fn lights(&self) -> u32 {
        self.bakes.get().lights
    }

    /// Places in the complete rows of that level, of all objects that have it.
    pub fn row(&self, level: u32) -> u32 {
        let bakes = self.bakes.get();
        let have = bakes.objects.iter().take(bakes.count as usize).filter(|bake| level < bake.levels).count();
        (have as u32) << level
    }

    /// Names and sizes of what is held on the GPU, bytes.
    pub fn bytes(&self) -> [(&'static str, u64); 4] {
        let next = self.next.as_ref().map_or(0, |next| next.light.bytes());
        let maps = self.directory.size() + self.pages.iter().map(|page| page.size()).sum::<u64>();
        [
            ("cssm: maps", maps),
            (
                "cssm: texels",
                self.texels.size() + self.surfaces.size() + self.part_instances.size() + self.instance_objects.size(),
            ),
            ("cssm: hierarchy", self.tree.size()),
            ("cssm: light", self.light.bytes() + self.sources.size() + next),
        ]
    }
}

/// The words of a `CssmSurface`, whose part is one of all objects'.
fn surface_words(surface: &CssmSurface, first_part: u32) -> [u32; 3] {
    let part = if surface.part == NONE { NONE } else { first_part + surface.part };
    [part, surface.triangle, surface.barycentric]
}

/// Says what this frame's light depends on, and uploads what of it is small.
pub(super) fn prepare_light(
    baked: Option<ResMut<Baked>>,
    extracted: Res<ExtractedCssm>,
    instances: Option<Res<Instances>>,
    scene: Option<Res<SceneBuffers>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let Some(mut baked) = baked else { return };
    let baked = &mut *baked;
    let (Some(instances), Some(scene), false) = (instances, scene, extracted.placed.is_empty()) else {
        baked.wanted = None;
        return;
    };
    let mut bakes = *baked.bakes.get();
    for (bake, place) in bakes.objects.iter_mut().zip(&extracted.placed) {
        *bake = placed(*bake, *place);
    }
    let bakes = with_top(bakes);
    let look = |entity: &Option<Entity>| entity.and_then(|entity| instances.look(entity)).unwrap_or([NONE; 3]);
    let state = State {
        bakes,
        gather: extracted.gather,
        bounces: extracted.bounces,
        spread: extracted.spread,
        at_texels: extracted.at_texels,
        parts: extracted.parts.iter().map(|part| look(&part.mesh)).collect(),
        revision: scene.light_revision(),
    };
    if baked.wanted.as_ref() != Some(&state) {
        baked.bakes.set(bakes);
        baked.bakes.write_buffer(&device, &queue);
        baked.gather.set(extracted.gather);
        baked.gather.write_buffer(&device, &queue);
        if !state.parts.is_empty() {
            let slots: Vec<u32> = state.parts.iter().map(|[slot, ..]| *slot).collect();
            queue.write_buffer(&baked.part_instances, 0, bytemuck::cast_slice(&slots));
        }
        baked.wanted = Some(state);
    }
    if extracted.are_eyes {
        let slots = baked.wanted.iter().flat_map(|wanted| &wanted.parts).map(|[slot, ..]| *slot);
        let parts: Vec<_> = slots.zip(extracted.parts.iter().map(|part| part.object)).collect();
        if baked.instances_of != parts {
            baked.write_instances(&parts, &device, &queue);
            baked.instances_of = parts;
        }
    }
}
