//! What would be published: it can be packed, tells what a registry asks for, and has in it what it is built from.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::process::Stdio;

use serde_json::Value;

use crate::Result;
use crate::licences::packages;
use crate::process::{cargo, line, run};

/// Files that each has besides its sources.
const PAPERS: [&str; 3] = ["LICENSE-APACHE", "LICENSE-MIT", "README.md"];
/// What the manifest of each says.
const FIELDS: [&str; 6] = ["description", "license", "repository", "readme", "keywords", "categories"];
/// What packing takes: what is there, and nothing from the network.
const OPTIONS: [&str; 3] = ["--allow-dirty", "--locked", "--offline"];

/// Packs every crate of the workspace that may be published, and looks at what is in it.
pub fn crates() -> Result<()> {
    let packages = packages()?;
    let (published, kept): (Vec<&Value>, Vec<&Value>) =
        packages.iter().filter(|package| package["source"].is_null()).partition(|package| package["publish"].is_null());
    let name = |package: &Value| package["name"].as_str().unwrap_or_default().to_owned();
    let mut pack = cargo(["package", "--workspace", "--no-verify"]);
    pack.args(kept.iter().flat_map(|package| ["--exclude".to_owned(), name(package)]));
    run(pack.args(OPTIONS))?;
    let mut complaints = Vec::new();
    for package in &published {
        let name = name(package);
        let manifest = PathBuf::from(package["manifest_path"].as_str().unwrap_or_default());
        let folder = manifest.parent().unwrap_or(Path::new("."));
        let complain = |complaint| format!("{name}: {complaint}");
        complaints.extend(unsaid(package).map(complain));
        complaints.extend(missing(&packed(&name)?, &sources(folder)?).map(complain));
    }
    if !complaints.is_empty() {
        return Err(format!("crates: {}", complaints.join("; ")).into());
    }
    println!("crates: {} can be published, with licences, a readme and all sources in them", published.len());
    Ok(())
}

/// Fields of the manifest that say nothing.
fn unsaid(package: &Value) -> impl Iterator<Item = String> {
    let says = |field: &str| match &package[field] {
        Value::String(text) => !text.is_empty(),
        Value::Array(list) => !list.is_empty(),
        _ => false,
    };
    FIELDS.into_iter().filter(move |field| !says(field)).map(|field| format!("no {field}"))
}

/// Files that are in the package.
fn packed(name: &str) -> Result<BTreeSet<PathBuf>> {
    let mut command = cargo(["package", "--list", "--package", name]);
    let output = command.args(OPTIONS).stderr(Stdio::inherit()).output();
    let output = output.map_err(|error| format!("cannot start `{}`: {error}", line(&command)))?;
    if !output.status.success() {
        return Err(format!("`{}` failed ({})", line(&command), output.status).into());
    }
    Ok(String::from_utf8_lossy(&output.stdout).lines().map(PathBuf::from).collect())
}

/// Files below `src`, and those that they include, by their places in the package.
fn sources(folder: &Path) -> Result<BTreeSet<PathBuf>> {
    let mut found = BTreeSet::new();
    let mut folders = vec![folder.join("src")];
    while let Some(below) = folders.pop() {
        let failed = |error| format!("{}: {error}", below.display());
        for entry in fs::read_dir(&below).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let place = path.strip_prefix(folder)?.to_owned();
            if path.extension().is_some_and(|extension| extension == "rs") {
                let text = fs::read_to_string(&path).map_err(failed)?;
                found.extend(included(&text).map(|file| resolved(&place, file)));
            }
            found.insert(place);
        }
    }
    Ok(found)
}

/// Files that a source has in it by name.
fn included(text: &str) -> impl Iterator<Item = &str> {
    ["include_str!(\"", "include_bytes!(\"", "include!(\""]
        .into_iter()
        .flat_map(|start| text.split(start).skip(1))
        .filter_map(|rest| rest.split('"').next())
}

/// A place that is told relative to a file's own; `..` stays where it leads out of the package.
fn resolved(file: &Path, told: &str) -> PathBuf {
    let mut place = file.parent().map(Path::to_owned).unwrap_or_default();
    for step in Path::new(told).components() {
        if step != Component::ParentDir || !place.pop() {
            place.push(step);
        }
    }
    place
}

/// What is needed and not in the package.
fn missing(packed: &BTreeSet<PathBuf>, sources: &BTreeSet<PathBuf>) -> impl Iterator<Item = String> {
    let papers = PAPERS.into_iter().map(PathBuf::from);
    let needed: BTreeSet<PathBuf> = papers.chain(sources.iter().cloned()).collect();
    needed.difference(packed).map(|file| format!("{} is not in it", file.display())).collect::<Vec<_>>().into_iter()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn manifests_that_say_too_little_are_told() {
        let package = serde_json::json!({
            "description": "what it is", "license": "MIT", "repository": null, "readme": "README.md",
            "keywords": [], "categories": ["graphics"],
        });
        assert_eq!(unsaid(&package).collect::<Vec<_>>(), ["no repository", "no keywords"]);
    }

    #[test]
    fn what_a_source_includes_is_found() {
        let text = "const A: &str = include_str!(\"a.wgsl\");\nconst B: &[u8] = include_bytes!(\"../data/b.bin\");";
        let files: Vec<PathBuf> = included(text).map(|file| resolved(Path::new("src/lib.rs"), file)).collect();
        assert_eq!(files, [PathBuf::from("src/a.wgsl"), PathBuf::from("data/b.bin")]);
        let outside = resolved(Path::new("src/lib.rs"), "../../README.md");
        assert_eq!(outside, PathBuf::from("../README.md"));
    }

    #[test]
    fn what_is_not_packed_is_told() {
        let files = |names: &[&str]| names.iter().map(PathBuf::from).collect::<BTreeSet<_>>();
        let packed = files(&["LICENSE-APACHE", "LICENSE-MIT", "src/lib.rs"]);
        let told: Vec<String> = missing(&packed, &files(&["src/lib.rs", "src/a.wgsl"])).collect();
        assert_eq!(told, ["README.md is not in it", "src/a.wgsl is not in it"]);
    }
}
