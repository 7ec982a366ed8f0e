//! The bake on the GPU, and what is solved on it.

use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferInitDescriptor, BufferUsages, ShaderType, UniformBuffer,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_bounce_cssm::{CssmAsset, CssmFile};
use bevy_bounce_shaders::types::{CssmBake, CssmGather, CssmLevel, NONE};

use super::object::ExtractedCssm;
use super::surfaces::surfaces;
use super::tree::Tree;
use super::words::{self, PAGE_BITS, PAGES, TooLarge};
use crate::scene::{Instances, SceneBuffers};

/// Bytes of a value that each texel or node has.
const VALUE: u64 = 16;

/// A bake, and the light of its texels.
#[derive(Resource)]
pub(crate) struct Baked {
    /// Whose words these are.
    pub asset: AssetId<CssmAsset>,
    /// `CssmBake`.
    pub parameters: UniformBuffer<CssmBake>,
    /// `CssmGather` of the texels.
    pub gather: UniformBuffer<CssmGather>,
    /// Records of the file.
    pub texels: Buffer,
    /// Of the cube maps, then of the maps from outside.
    pub directory: Buffer,
    /// Blocks.
    pub pages: [Buffer; PAGES],
    /// `array<vec4<u32>>`: nodes, then leaves.
    pub tree: Buffer,
    /// `array<CssmSurface>`, by texel.
    pub surfaces: Buffer,
    /// `array<u32>`: instance of each part.
    pub part_instances: Buffer,
    /// `array<vec4<f32>>`, by node: radiance times area, area.
    pub powers: Buffer,
    /// `array<vec4<f32>>`, by texel: radiance without bounces.
    pub sources: Buffer,
    /// `array<vec4<f32>>`, by texel: irradiance over pi, nodes of the cut.
    pub gathered: Buffer,
    /// One `CssmLevel` each, from the root on.
    pub levels: Vec<Buffer>,
    /// What the light was solved from, and what it is to be solved from now; `None` before the first frame.
    pub solved: Option<State>,
    /// Of this frame.
    pub wanted: Option<State>,
    /// How often the texels were lit.
    pub times_lit: u64,
    template: CssmBake,
}

/// All that the light of the texels depends on.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct State {
    parameters: CssmBake,
    gather: CssmGather,
    /// Gathers between texels and the one of the pixels.
    pub bounces: u32,
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
        usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC,
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

impl Baked {
    /// Uploads a file's words and builds its hierarchy.
    pub fn new(device: &RenderDevice, asset: AssetId<CssmAsset>, file: &CssmFile) -> Result<Self, TooLarge> {
        words::check_size(file, PAGE_BITS)?;
        let tree = Tree::build(file);
        let surfaces: Vec<u32> =
            surfaces(file).iter().flat_map(|surface| [surface.part, surface.triangle, surface.barycentric]).collect();
        let texels = u64::from(tree.texels);
        let level = |level: u32| {
            device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some("bounce_cssm_level"),
                contents: &level.to_ne_bytes(),
                usage: BufferUsages::UNIFORM,
            })
        };
        debug_assert_eq!(CssmLevel::min_size().get(), 4);
        let template = words::parameters(file, Affine3A::IDENTITY, PAGE_BITS);
        Ok(Self {
            asset,
            parameters: UniformBuffer::from(template),
            gather: UniformBuffer::default(),
            texels: filled(device, "bounce_cssm_texels", &[&file.texels]),
            directory: filled(device, "bounce_cssm_directory", &words::directory(file)),
            pages: std::array::from_fn(|page| {
                filled(device, "bounce_cssm_blocks", &words::page(file, page, PAGE_BITS))
            }),
            tree: filled(device, "bounce_cssm_tree", &[tree.words.as_flattened()]),
            surfaces: filled(device, "bounce_cssm_surfaces", &[&surfaces]),
            part_instances: storage(device, "bounce_cssm_parts", 4 * file.parts.iter().count() as u64),
            powers: storage(device, "bounce_cssm_powers", u64::from(tree.nodes()) * VALUE),
            sources: storage(device, "bounce_cssm_sources", texels * VALUE),
            gathered: storage(device, "bounce_cssm_gathered", texels * VALUE),
            levels: (0..tree.levels()).map(level).collect(),
            solved: None,
            wanted: None,
            times_lit: 0,
            template,
        })
    }

    /// Texels.
    pub fn texel_count(&self) -> u32 {
        self.template.texel_count
    }

    /// Names and sizes of what is held on the GPU, bytes.
    pub fn bytes(&self) -> [(&'static str, u64); 4] {
        let maps = self.directory.size() + self.pages.iter().map(|page| page.size()).sum::<u64>();
        [
            ("cssm: maps", maps),
            ("cssm: texels", self.texels.size() + self.surfaces.size() + self.part_instances.size()),
            ("cssm: hierarchy", self.tree.size()),
            ("cssm: light", self.powers.size() + self.sources.size() + self.gathered.size()),
        ]
    }
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
    let (Some(placed), Some(instances), Some(scene)) = (extracted.placed, instances, scene) else {
        baked.wanted = None;
        return;
    };
    let parameters = words::placed(baked.template, placed);
    let look = |entity: &Option<Entity>| entity.and_then(|entity| instances.look(entity)).unwrap_or([NONE; 3]);
    let state = State {
        parameters,
        gather: extracted.gather,
        bounces: extracted.bounces,
        parts: extracted.parts.iter().map(look).collect(),
        revision: scene.light_revision(),
    };
    if baked.wanted.as_ref() != Some(&state) {
        baked.parameters.set(parameters);
        baked.parameters.write_buffer(&device, &queue);
        baked.gather.set(extracted.gather);
        baked.gather.write_buffer(&device, &queue);
        if !state.parts.is_empty() {
            let slots: Vec<u32> = state.parts.iter().map(|[slot, ..]| *slot).collect();
            queue.write_buffer(&baked.part_instances, 0, bytemuck::cast_slice(&slots));
        }
        baked.wanted = Some(state);
    }
}

/// How the pixels of a view gather, on the GPU.
#[derive(Component)]
pub(super) struct CssmViewUniform(pub UniformBuffer<CssmGather>);

pub(super) fn prepare_views(
    mut commands: Commands,
    mut views: Query<(Entity, &super::object::CssmView, Option<&mut CssmViewUniform>)>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    for (entity, view, uniform) in &mut views {
        match uniform {
            Some(uniform) if *uniform.0.get() == view.0 => {}
            Some(mut uniform) => {
                uniform.0.set(view.0);
                uniform.0.write_buffer(&device, &queue);
            }
            None => {
                let mut uniform = UniformBuffer::from(view.0);
                uniform.write_buffer(&device, &queue);
                commands.entity(entity).insert(CssmViewUniform(uniform));
            }
        }
    }
}
