//! Memory layouts of the structs and values of the constants that Rust and WGSL share.

use std::collections::BTreeMap;
use std::path::PathBuf;

use bevy::render::render_resource::ShaderType;
use bevy_bounce_shaders::types;
use naga::{Expression, Literal, TypeInner};

use crate::compose::{Composed, plain_name};

/// Where the members of a struct lie, bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Name and offset of each member.
    pub members: Vec<(String, u64)>,
    /// Size, with padding to the alignment.
    pub size: u64,
}

/// The text of `types.rs` and of all in `types`: encase knows offsets but not names.
fn types_text() -> String {
    let types = concat!(env!("CARGO_MANIFEST_DIR"), "/../shaders/src/types");
    let files =
        std::fs::read_dir(types).expect("the folder of types").map(|file| file.expect("a file of types").path());
    let files = files.chain([PathBuf::from(types).with_extension("rs")]);
    files.map(|file| std::fs::read_to_string(file).expect("text")).collect()
}

macro_rules! layouts {
    ($($name:ident),* $(,)?) => {
        [$((
            stringify!($name),
            (<types::$name as ShaderType>::METADATA.extra.offsets.to_vec(), types::$name::min_size().get()),
        )),*]
    };
}

/// Layouts of all structs of `types.rs`, by name, as encase writes them.
pub fn rust_layouts() -> BTreeMap<String, Layout> {
    let known = layouts![
        Instance,
        Chunk,
        Material,
        Light,
        Scene,
        Grid,
        GridLevel,
        VoxelGroup,
        VoxelGroups,
        Region,
        Cell,
        Vpl,
        CompactVpl,
        DeformJob,
        DeformChunk,
        ThumbnailJob,
        Sky,
        Path,
        Digit,
        Occluder,
        OccluderChunk,
        AtlasParameters,
        SurfacePoint,
        WorldPoint,
        Emitter,
        VplParameters,
        VplHeader,
        SsbcParameters,
        HistoryParameters,
        CssmBake,
        CssmTop,
        CssmBakes,
        CssmGather,
        CssmLevel,
        CssmSurface,
        LightVolume,
        CacheGrid,
        CacheCounters,
        RadianceCache,
        ProbeParameters,
        FogParameters,
        FroxelParameters,
        ProbePlace,
    ];
    let fields = struct_fields(&types_text());
    let mut layouts = BTreeMap::new();
    for (name, (offsets, size)) in known {
        let names = fields.get(name).cloned().unwrap_or_default();
        assert_eq!(names.len(), offsets.len(), "fields of {name} in types.rs");
        layouts.insert(name.to_owned(), Layout { members: names.into_iter().zip(offsets).collect(), size });
    }
    let missing: Vec<_> = fields.keys().filter(|name| !layouts.contains_key(*name)).collect();
    assert!(missing.is_empty(), "structs of types.rs that are not listed in layout.rs: {missing:?}");
    layouts
}

/// Public fields of every public struct, in order.
fn struct_fields(text: &str) -> BTreeMap<String, Vec<String>> {
    let mut structs = BTreeMap::<String, Vec<String>>::new();
    let mut current = None;
    for line in text.lines() {
        if let Some(rest) = line.strip_prefix("pub struct ") {
            current = rest.split([' ', '{']).next().map(str::to_owned);
        } else if line == "}" {
            current = None;
        } else if let (Some(name), Some(field)) = (&current, line.trim().strip_prefix("pub ")) {
            let field = field.split(':').next().unwrap_or_default();
            structs.entry(name.clone()).or_default().push(field.to_owned());
        }
    }
    structs
}

/// Layouts of the structs in a composed shader, by plain name.
pub fn wgsl_layouts(composed: &Composed) -> BTreeMap<String, Layout> {
    let structs = composed.module.types.iter().filter_map(|(_, ty)| match (&ty.name, &ty.inner) {
        (Some(name), TypeInner::Struct { members, span }) => {
            let member = |m: &naga::StructMember| (m.name.clone().unwrap_or_default(), u64::from(m.offset));
            let layout = Layout { members: members.iter().map(member).collect(), size: u64::from(*span) };
            Some((plain_name(name).to_owned(), layout))
        }
        _ => None,
    });
    structs.collect()
}

/// Scalar constants of `types.rs`, by name.
pub fn rust_constants() -> BTreeMap<String, f64> {
    let text = types_text();
    let constants = text.lines().filter_map(|line| {
        let (name, value) = line.strip_prefix("pub const ")?.split_once(" = ")?;
        let (name, _) = name.split_once(':')?;
        Some((name.to_owned(), scalar(value.trim_end_matches(';'))?))
    });
    constants.collect()
}

fn scalar(text: &str) -> Option<f64> {
    match text {
        "u32::MAX" => Some(f64::from(u32::MAX)),
        _ => text.replace('_', "").parse().ok(),
    }
}

/// Scalar constants of a composed shader, by plain name.
pub fn wgsl_constants(composed: &Composed) -> BTreeMap<String, f64> {
    let module = &composed.module;
    let constants = module.constants.iter().filter_map(|(_, constant)| {
        let Expression::Literal(literal) = module.global_expressions[constant.init] else { return None };
        let value = match literal {
            Literal::F32(value) => f64::from(value),
            Literal::U32(value) => f64::from(value),
            Literal::I32(value) => f64::from(value),
            Literal::AbstractInt(value) => value as f64,
            Literal::AbstractFloat(value) => value,
            _ => return None,
        };
        Some((plain_name(constant.name.as_deref()?).to_owned(), value))
    });
    constants.collect()
}
