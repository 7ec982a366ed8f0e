//! What the guides say is so: their Rust is compiled, what they name exists, and their figures are those of the code.

mod snippets;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use bevy::camera::Exposure;
use bevy::reflect::{TypeInfo, Typed};
use bevy_bounce::{
    CssmFilter, CssmReceivers, CssmSettings, GiIsolate, GiLight, GiSettings, GlobalIllumination, Quality,
    RadianceCacheSettings, Resolution, SsbcSettings, Technique, VoxelizedGroup, VoxelizedMesh, VplVisibility,
};

const ADDING: &str = "docs/adding-to-a-game.md";
const BAKING: &str = "docs/baking.md";
const FAULTS: &str = "docs/when-something-leaks-or-flickers.md";
const README: &str = "README.md";

/// Texts for users, by their places below the root.
const TEXTS: [(&str, &str); 7] = [
    (ADDING, include_str!("../../../docs/adding-to-a-game.md")),
    (BAKING, include_str!("../../../docs/baking.md")),
    (FAULTS, include_str!("../../../docs/when-something-leaks-or-flickers.md")),
    (README, include_str!("../../../README.md")),
    ("ARCHITECTURE.md", include_str!("../../../ARCHITECTURE.md")),
    ("CONTRIBUTING.md", include_str!("../../../CONTRIBUTING.md")),
    ("crates/bevy_bounce_egui/README.md", include_str!("../../../crates/bevy_bounce_egui/README.md")),
];

/// Rust that is compiled: as code, or as documentation tests.
const COMPILED: [&str; 4] = [
    include_str!("guides/snippets.rs"),
    include_str!("../../../examples/baked_lightmap.rs"),
    include_str!("../../../crates/bevy_bounce/src/lib.rs"),
    include_str!("../../../crates/bevy_bounce_egui/src/lib.rs"),
];

const VIEWER: [&str; 2] =
    [include_str!("../../../examples/src/options.rs"), include_str!("../../../examples/viewer.rs")];
const BAKER: [&str; 1] = [include_str!("../../../crates/bevy_bounce_bake/src/command/args.rs")];
const BENCH: &str = include_str!("../../../xtask/src/bench.rs");
const CARGO: [&str; 5] = ["example", "help", "no-default-features", "path", "release"];

fn text(name: &str) -> &'static str {
    TEXTS.iter().find(|(place, _)| *place == name).map_or("", |(_, text)| text)
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Lines without indentation, empty ones left out.
fn lines(text: &str) -> Vec<&str> {
    text.lines().map(|line| line.trim().trim_start_matches("//!").trim()).filter(|line| !line.is_empty()).collect()
}

/// Contents of fenced blocks in that language.
fn blocks(text: &str, language: &str) -> Vec<String> {
    let mut blocks = Vec::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if let Some(info) = line.trim().strip_prefix("```") {
            let block: Vec<&str> = lines.by_ref().take_while(|line| line.trim() != "```").collect();
            if info.split(',').next() == Some(language) {
                blocks.push(block.join("\n"));
            }
        }
    }
    blocks
}

/// The text without its fenced blocks.
fn prose(text: &str) -> String {
    let mut fenced = false;
    let kept = text.lines().filter(|line| {
        let fence = line.trim().starts_with("```");
        fenced ^= fence;
        !fenced && !fence
    });
    kept.collect::<Vec<_>>().join("\n")
}

/// What stands between single backticks.
fn codes(text: &str) -> Vec<&str> {
    text.lines().flat_map(|line| line.split('`').skip(1).step_by(2)).collect()
}

fn is_compiled(block: &str) -> bool {
    let block = lines(block);
    COMPILED.iter().any(|source| lines(source).windows(block.len()).any(|window| window == block))
}

/// Targets of links that lead to this repository and are not there: files, or headings of texts.
fn dead_links(place: &str, text: &str) -> Vec<String> {
    let folder = root().join(place).parent().map(Path::to_owned).unwrap_or_default();
    let targets = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    let dead = targets.filter(|target| !target.starts_with("http")).filter(|target| {
        let (file, heading) = target.split_once('#').unwrap_or((target, ""));
        let path = if file.is_empty() { root().join(place) } else { folder.join(file) };
        let found = |text: String| heading.is_empty() || headings(&text).contains(heading);
        !(path.is_dir() || fs::read(&path).is_ok_and(|bytes| found(String::from_utf8_lossy(&bytes).into_owned())))
    });
    dead.map(str::to_owned).collect()
}

/// Anchors of a text, as forges make them.
fn headings(text: &str) -> BTreeSet<String> {
    let prose = prose(text);
    let titles =
        prose.lines().filter_map(|line| line.strip_prefix('#')).map(|line| line.trim_start_matches('#').trim());
    let letter = |c: char| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_');
    titles
        .map(|title| title.to_lowercase().chars().filter(|c| letter(*c)).collect::<String>().replace(' ', "-"))
        .collect()
}

/// Long options that clap derives from the fields of a source file.
fn derived_options(source: &str) -> BTreeSet<String> {
    let mut options = BTreeSet::new();
    let mut is_long = false;
    for line in source.lines().map(str::trim) {
        if line.starts_with("#[arg(") {
            is_long = line.contains("long");
        } else if is_long && !line.starts_with("//") {
            let field = line.trim_start_matches("pub ").split(':').next().unwrap_or_default();
            options.insert(field.replace('_', "-"));
            is_long = false;
        }
    }
    options
}

/// Long options that a text names.
fn named_options(text: &str) -> BTreeSet<String> {
    let letter = |c: char| c.is_ascii_lowercase() || c == '-';
    let names = text.split([' ', '`', '\n', '(']).filter_map(|word| word.strip_prefix("--"));
    let names = names.map(|word| word.split(|c| !letter(c)).next().unwrap_or_default().to_owned());
    names.filter(|name| name.starts_with(|c: char| c.is_ascii_lowercase())).collect()
}

/// Options that a text may name.
fn known_options(place: &str) -> BTreeSet<String> {
    let sources = match place {
        BAKING => BAKER.to_vec(),
        README => [&VIEWER[..], &BAKER[..]].concat(),
        _ => VIEWER.to_vec(),
    };
    let derived = sources.into_iter().flat_map(derived_options);
    derived.chain(named_options(BENCH)).chain(CARGO.map(str::to_owned)).collect()
}

/// Fields or variants of every type whose members the guides name.
fn members() -> BTreeMap<&'static str, BTreeSet<&'static str>> {
    let of = |info: &'static TypeInfo| match info {
        TypeInfo::Struct(info) => info.field_names().iter().copied().collect(),
        TypeInfo::Enum(info) => info.variant_names().iter().copied().collect(),
        _ => BTreeSet::new(),
    };
    let types = [
        GiSettings::type_info(),
        SsbcSettings::type_info(),
        CssmSettings::type_info(),
        RadianceCacheSettings::type_info(),
        GlobalIllumination::type_info(),
        GiLight::type_info(),
        VoxelizedGroup::type_info(),
        VoxelizedMesh::type_info(),
        GiIsolate::type_info(),
        Quality::type_info(),
        Technique::type_info(),
        VplVisibility::type_info(),
        Resolution::type_info(),
        CssmFilter::type_info(),
        CssmReceivers::type_info(),
    ];
    types.into_iter().map(|info| (info.type_path_table().ident().unwrap_or_default(), of(info))).collect()
}

/// `Type::member`s of the text that are not there, and how many are.
fn unknown_members(text: &str) -> (Vec<String>, usize) {
    let (members, prose) = (members(), prose(text));
    let named = codes(&prose).into_iter().filter_map(|code| code.split_once("::"));
    let ours: Vec<_> = named.filter_map(|(name, member)| Some((name, member, members.get(name)?))).collect();
    let is_known = |member: &str, known: &BTreeSet<&str>| known.contains(member) || member == "OFF";
    let unknown = ours.iter().filter(|(_, member, known)| !is_known(member, known));
    (unknown.map(|(name, member, _)| format!("{name}::{member}")).collect(), ours.len())
}

/// All Rust below a folder, strings joined where they go over several lines.
fn rust_below(folder: &Path, found: &mut String) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            rust_below(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&path).unwrap_or_default();
            let mut parts = text.split("\\\n");
            found.push_str(parts.next().unwrap_or_default());
            parts.for_each(|part| found.push_str(part.trim_start()));
        }
    }
}

/// First cells of a table whose header starts with that cell.
fn first_cells<'a>(text: &'a str, header: &str) -> Vec<&'a str> {
    let rows = text.lines().skip_while(|line| !line.starts_with(&format!("| {header} |"))).skip(2);
    rows.take_while(|line| line.starts_with('|')).filter_map(|line| line.split('|').nth(1)).map(str::trim).collect()
}

#[test]
fn rust_of_the_guides_is_compiled() {
    let mut count = 0;
    for (place, text) in TEXTS {
        for block in blocks(text, "rust") {
            assert!(is_compiled(&block), "{place}: nothing that is compiled contains\n{block}");
            count += 1;
        }
    }
    assert!(count > 8, "{count} blocks");
}

#[test]
fn links_lead_somewhere() {
    for (place, text) in TEXTS {
        assert_eq!(dead_links(place, text), Vec::<String>::new(), "{place}");
    }
}

#[test]
fn options_are_there() {
    for place in [ADDING, BAKING, FAULTS, README] {
        let (named, known) = (named_options(text(place)), known_options(place));
        let unknown: Vec<_> = named.difference(&known).collect();
        assert!(unknown.is_empty() && !named.is_empty(), "{place}: {unknown:?}");
    }
    let missing: Vec<_> = derived_options(BAKER[0])
        .difference(&named_options(text(BAKING)))
        .filter(|name| *name != "output")
        .cloned()
        .collect();
    assert_eq!(missing, Vec::<String>::new(), "not in {BAKING}");
}

#[test]
fn settings_are_there() {
    for (place, least) in [(ADDING, 20), (FAULTS, 60), (BAKING, 2), (README, 1)] {
        let (unknown, count) = unknown_members(text(place));
        assert!(unknown.is_empty() && count >= least, "{place}: {unknown:?} of {count}");
    }
}

#[test]
fn messages_stages_and_memory_are_there() {
    let mut source = String::new();
    rust_below(&root().join("crates"), &mut source);
    let quoted = |cells: Vec<&str>| -> Vec<String> { cells.into_iter().flat_map(codes).map(str::to_owned).collect() };
    for (place, header, before) in
        [(BAKING, "the line says", ""), (FAULTS, "stage", "\"bounce/"), (FAULTS, "row in the panel", "\"")]
    {
        let names = quoted(first_cells(text(place), header));
        assert!(names.len() > 8, "{place}: {names:?}");
        for name in names {
            assert!(source.contains(&format!("{before}{name}")), "{place}: `{name}` is nowhere");
        }
    }
}

#[test]
fn tables_of_quality_are_those_of_the_code() {
    for (name, quality) in
        [("Low", Quality::Low), ("Medium", Quality::Medium), ("High", Quality::High), ("Ultra", Quality::Ultra)]
    {
        let GiSettings { vpls, tile, grid, resolution, ssbc, .. } = quality.settings();
        let shaded = if resolution == Resolution::Full { "every pixel" } else { "half resolution" };
        let mebibytes = f64::from(vpls * tile * tile * 4) / f64::from(1 << 20);
        let mebibytes = if mebibytes < 1.0 { format!("{mebibytes:.1}") } else { format!("{mebibytes}") };
        for (place, row) in [
            (README, format!(" | {vpls} | {tile}² | {grid}³ | {shaded} | {} |", ssbc.iterations)),
            (ADDING, format!(" | {vpls} | {grid}³ | {shaded} | {mebibytes} MiB |")),
        ] {
            let is_row = |line: &str| line.starts_with(&format!("| `{name}`")) && line.ends_with(&row);
            assert!(text(place).lines().any(is_row), "{place}: no row {name}{row}");
        }
    }
}

#[test]
fn emission_is_as_the_guide_says() {
    let sent = 1.0 / Exposure::default().exposure();
    assert!(text(ADDING).contains(&format!("an emission of 1 sends {sent:.0} cd/m²")), "{sent}");
}

/// Each of the checks above finds what is wrong.
#[test]
fn what_is_wrong_is_found() {
    let block = blocks(text(FAULTS), "rust").remove(0);
    assert!(is_compiled(&block) && !is_compiled(&block.replace("4096", "4097")));
    let links =
        "[a](baking.md) [b](baking.md#verify-nothing) [c](none.md) [d](#before-you-ship) [e](../README.md#the-panel)";
    assert_eq!(dead_links(ADDING, links), ["baking.md#verify-nothing", "none.md"]);
    let named = named_options("try `--vpls 3`, --grit\n--isolate=all or a--b");
    let unknown: Vec<String> = named.difference(&known_options(FAULTS)).cloned().collect();
    assert_eq!((named.len(), unknown), (3, vec!["grit".to_owned()]));
    let (unknown, count) =
        unknown_members("`GiSettings::vpls` and `GiSettings::lights`, `Technique::Best`, `Vec::new`");
    assert_eq!((unknown, count), (vec!["GiSettings::lights".to_owned(), "Technique::Best".to_owned()], 3));
    assert_eq!(first_cells("| a | b |\n|---|---|\n| `c` | d |\n\n| e | f |", "a"), ["`c`"]);
}
