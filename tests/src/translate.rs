//! Composed shaders in the languages that wgpu's backends take, and what they ask of a device.

use naga::back::{PipelineConstants, glsl, hlsl, msl, pipeline_constants, spv};
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::{AddressSpace, ImageClass, ShaderStage, TypeInner};

use crate::compose::Composed;

/// Translates every entry point to SPIR-V, MSL, HLSL and GLSL; fails with all that went wrong.
pub fn translate_everywhere(composed: &Composed) -> Result<(), String> {
    let failures: Vec<_> = translations(composed)
        .into_iter()
        .filter_map(|translation| {
            let error = translation.result.err()?;
            Some(format!("{} to {}: {error}", translation.entry, translation.language))
        })
        .collect();
    if failures.is_empty() { Ok(()) } else { Err(failures.join("\n")) }
}

/// What came of one entry point in one language.
#[derive(Clone, Debug)]
pub struct Translation {
    /// Its name.
    pub entry: String,
    /// Language and version.
    pub language: &'static str,
    /// What the backend said.
    pub result: Result<(), String>,
}

/// Every entry point in every language.
pub fn translations(composed: &Composed) -> Vec<Translation> {
    let gles = glsl::Version::Embedded { version: 310, is_webgl: false };
    let mut translations = Vec::new();
    for entry in &composed.module.entry_points {
        let stage = (entry.stage, entry.name.as_str());
        let results = [
            ("SPIR-V", to_spirv(composed, stage)),
            ("MSL 2.1", to_msl(composed, stage)),
            ("HLSL 5.1", to_hlsl(composed, stage)),
            ("GLSL ES 3.10", to_glsl(composed, stage, gles)),
            ("GLSL 4.30", to_glsl(composed, stage, glsl::Version::Desktop(430))),
        ];
        translations.extend(results.map(|(language, result)| Translation {
            entry: entry.name.clone(),
            language,
            result,
        }));
    }
    translations
}

type Entry<'a> = (ShaderStage, &'a str);

/// As wgpu asks for on each backend.
const POLICIES: BoundsCheckPolicies = BoundsCheckPolicies {
    index: BoundsCheckPolicy::Restrict,
    buffer: BoundsCheckPolicy::Restrict,
    image_load: BoundsCheckPolicy::Restrict,
    binding_array: BoundsCheckPolicy::Unchecked,
};

fn to_spirv(composed: &Composed, (shader_stage, name): Entry) -> Result<(), String> {
    let options = spv::Options { lang_version: (1, 3), bounds_check_policies: POLICIES, ..Default::default() };
    let pipeline = spv::PipelineOptions { shader_stage, entry_point: name.to_owned() };
    let words = spv::write_vec(&composed.module, &composed.info, &options, Some(&pipeline));
    words.map_err(|error| error.to_string()).and_then(|words| non_empty(words.len()))
}

fn to_msl(composed: &Composed, entry: Entry) -> Result<(), String> {
    let options = msl::Options {
        lang_version: (2, 1),
        fake_missing_bindings: true,
        bounds_check_policies: POLICIES,
        ..Default::default()
    };
    let entry_point = Some((entry.0, entry.1.to_owned()));
    let pipeline = msl::PipelineOptions { entry_point, ..Default::default() };
    let (module, info) = without_overrides(composed, entry)?;
    let (text, translation) =
        msl::write_string(&module, &info, &options, &pipeline).map_err(|error| error.to_string())?;
    for name in translation.entry_point_names {
        name.map_err(|error| error.to_string())?;
    }
    non_empty(text.len())
}

fn to_hlsl(composed: &Composed, entry: Entry) -> Result<(), String> {
    let options =
        hlsl::Options { shader_model: hlsl::ShaderModel::V5_1, fake_missing_bindings: true, ..Default::default() };
    let pipeline = hlsl::PipelineOptions { entry_point: Some((entry.0, entry.1.to_owned())) };
    let (module, info) = without_overrides(composed, entry)?;
    let mut text = String::new();
    let reflection = hlsl::Writer::new(&mut text, &options, &pipeline)
        .write(&module, &info, None)
        .map_err(|error| error.to_string())?;
    for name in reflection.entry_point_names {
        name.map_err(|error| error.to_string())?;
    }
    non_empty(text.len())
}

fn to_glsl(composed: &Composed, entry: Entry, version: glsl::Version) -> Result<(), String> {
    let options = glsl::Options { version, ..Default::default() };
    let pipeline = glsl::PipelineOptions { shader_stage: entry.0, entry_point: entry.1.to_owned(), multiview: None };
    let (module, info) = without_overrides(composed, entry)?;
    // A check of the mip level needs textureQueryLevels, which GLSL ES lacks: wgpu leaves it out there.
    let image_load = if matches!(version, glsl::Version::Embedded { .. }) {
        BoundsCheckPolicy::Unchecked
    } else {
        POLICIES.image_load
    };
    let policies = BoundsCheckPolicies { image_load, ..POLICIES };
    let mut text = String::new();
    glsl::Writer::new(&mut text, &module, &info, &options, &pipeline, policies)
        .and_then(|mut writer| writer.write())
        .map_err(|error| error.to_string())?;
    non_empty(text.len())
}

fn without_overrides<'a>(
    composed: &'a Composed,
    entry: Entry,
) -> Result<(std::borrow::Cow<'a, naga::Module>, std::borrow::Cow<'a, naga::valid::ModuleInfo>), String> {
    let constants = PipelineConstants::default();
    pipeline_constants::process_overrides(&composed.module, &composed.info, Some(entry), &constants)
        .map_err(|error| error.to_string())
}

fn non_empty(length: usize) -> Result<(), String> {
    if length == 0 { Err("nothing was written".to_owned()) } else { Ok(()) }
}

/// What an entry point asks of a device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Demand {
    /// Storage buffers.
    pub storage_buffers: u32,
    /// Storage textures.
    pub storage_textures: u32,
    /// Sampled textures.
    pub sampled_textures: u32,
    /// Samplers.
    pub samplers: u32,
    /// Uniform buffers.
    pub uniform_buffers: u32,
    /// Bytes of the largest of them.
    pub uniform_bytes: u32,
    /// Threads of a workgroup.
    pub threads: u32,
    /// Longest axis of a workgroup: x, y, z.
    pub workgroup: [u32; 3],
    /// Workgroup memory, bytes.
    pub workgroup_bytes: u32,
    /// Highest bind group, plus one.
    pub groups: u32,
}

impl Demand {
    /// What each entry point of the module asks for, by name.
    pub fn of_entries(composed: &Composed) -> Vec<(String, Self)> {
        let entries = composed.module.entry_points.iter().enumerate();
        entries.map(|(index, entry)| (entry.name.clone(), Self::of(composed, index))).collect()
    }

    fn of(composed: &Composed, index: usize) -> Self {
        let (module, info) = (&composed.module, composed.info.get_entry_point(index));
        let mut demand = Self { workgroup: module.entry_points[index].workgroup_size, ..Default::default() };
        demand.threads = demand.workgroup.iter().product();
        for (handle, variable) in module.global_variables.iter() {
            if info[handle].is_empty() {
                continue;
            }
            if let Some(binding) = variable.binding {
                demand.groups = demand.groups.max(binding.group + 1);
            }
            let inner = &module.types[variable.ty].inner;
            match (variable.space, inner) {
                (AddressSpace::Storage { .. }, _) => demand.storage_buffers += 1,
                (AddressSpace::Uniform, _) => {
                    demand.uniform_buffers += 1;
                    demand.uniform_bytes = demand.uniform_bytes.max(inner.size(module.to_ctx()));
                }
                (AddressSpace::WorkGroup, _) => {
                    demand.workgroup_bytes += inner.size(module.to_ctx()).next_multiple_of(16);
                }
                (_, TypeInner::Image { class: ImageClass::Storage { .. }, .. }) => demand.storage_textures += 1,
                (_, TypeInner::Image { .. }) => demand.sampled_textures += 1,
                (_, TypeInner::Sampler { .. }) => demand.samplers += 1,
                _ => {}
            }
        }
        demand
    }

    /// Fails with everything that is more than WebGPU's default limits allow.
    /// <https://www.w3.org/TR/webgpu/#limits>
    pub fn check_webgpu(&self) -> Result<(), String> {
        let limits = [
            ("storage buffers", self.storage_buffers, 8),
            ("storage textures", self.storage_textures, 4),
            ("sampled textures", self.sampled_textures, 16),
            ("samplers", self.samplers, 16),
            ("uniform buffers", self.uniform_buffers, 12),
            ("bytes of a uniform buffer", self.uniform_bytes, 65536),
            ("threads a workgroup", self.threads, 256),
            ("workgroup size x", self.workgroup[0], 256),
            ("workgroup size y", self.workgroup[1], 256),
            ("workgroup size z", self.workgroup[2], 64),
            ("bytes of workgroup memory", self.workgroup_bytes, 16384),
            ("bind groups", self.groups, 4),
        ];
        let broken = limits.iter().filter(|(_, value, limit)| value > limit);
        let broken: Vec<_> = broken.map(|(name, value, limit)| format!("{value} {name}, limit {limit}")).collect();
        if broken.is_empty() { Ok(()) } else { Err(broken.join("; ")) }
    }
}
