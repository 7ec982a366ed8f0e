//! Buffers of the probes.

use bevy::prelude::*;
use bevy::render::render_resource::{Buffer, BufferDescriptor, BufferUsages, ShaderType, UniformBuffer};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_bounce_shaders::types::{PROBE_FACES, ProbeParameters, ProbePlace};

use super::extract::ExtractedProbes;

/// Bytes of a texel, and of a face's light.
const TEXEL_BYTES: u64 = 8;
const LIGHT_BYTES: u64 = 16;

/// What the probes need on the GPU; there while a camera asks for them.
#[derive(Resource)]
pub(crate) struct ProbeBuffers {
    /// Where they are.
    pub parameters: UniformBuffer<ProbeParameters>,
    /// `array<ProbePlace>`, face by face.
    pub places: Buffer,
    /// `array<vec4<f32>>`, face by face.
    pub light: Buffer,
    faces: u32,
}

impl ProbeBuffers {
    fn new(device: &RenderDevice, faces: u32) -> Self {
        let buffer = |label, stride: u64| {
            device.create_buffer(&BufferDescriptor {
                label: Some(label),
                size: u64::from(faces) * stride,
                usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            })
        };
        Self {
            parameters: UniformBuffer::default(),
            places: buffer("bounce_probe_places", ProbePlace::min_size().get()),
            light: buffer("bounce_probe_light", LIGHT_BYTES),
            faces,
        }
    }

    /// Faces of all probes.
    pub fn faces(&self) -> u32 {
        self.faces
    }

    /// Names and sizes of what is held on the GPU, bytes.
    pub fn bytes(&self) -> [(&'static str, u64); 2] {
        let volume = u64::from(self.faces) * TEXEL_BYTES;
        [("probes: volume", volume), ("probes: light", self.places.size() + self.light.size())]
    }
}

pub(super) fn prepare_probes(
    mut commands: Commands,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    extracted: Res<ExtractedProbes>,
    held: Option<ResMut<ProbeBuffers>>,
) {
    let Some(probes) = extracted.0 else {
        commands.remove_resource::<ProbeBuffers>();
        return;
    };
    let volume = probes.volume;
    let faces = volume.dims.element_product() * PROBE_FACES;
    let parameters = ProbeParameters {
        origin: volume.origin,
        spacing: volume.spacing,
        dims: volume.dims,
        scale: probes.intensity.recip(),
    };
    match held {
        Some(mut held) if held.faces == faces => {
            if *held.parameters.get() != parameters {
                held.parameters.set(parameters);
                held.parameters.write_buffer(&device, &queue);
            }
        }
        _ => {
            let mut buffers = ProbeBuffers::new(&device, faces);
            buffers.parameters.set(parameters);
            buffers.parameters.write_buffer(&device, &queue);
            commands.insert_resource(buffers);
        }
    }
}
