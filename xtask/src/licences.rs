//! The licences of all that is built on, against the list in `deny.toml`. Needs no network once dependencies are fetched;
//! `cargo deny check advisories` looks for known faults, which takes a database from the network.

use std::collections::BTreeMap;
use std::fs;
use std::process::Stdio;

use serde_json::Value;
use spdx::{Expression, Licensee, ParseMode};
use toml_edit::{DocumentMut, Item};

use crate::Result;
use crate::process::{cargo, line, root};

/// What `[licenses]` of `deny.toml` allows, in the terms of cargo-deny.
struct Policy {
    allowed: Vec<Licensee>,
    /// By crate, besides.
    exceptions: BTreeMap<String, Vec<Licensee>>,
}

impl Policy {
    fn parse(text: &str) -> Result<Self> {
        let document: DocumentMut = text.parse().map_err(|error| format!("deny.toml: {error}"))?;
        let licences = document.get("licenses").ok_or("deny.toml: there is no [licenses]")?;
        let mut exceptions = BTreeMap::new();
        for exception in licences.get("exceptions").and_then(Item::as_array).into_iter().flatten() {
            let exception = exception.as_inline_table().ok_or("deny.toml: exceptions are tables")?;
            let name =
                exception.get("crate").and_then(|name| name.as_str()).ok_or("deny.toml: an exception has a crate")?;
            exceptions.insert(name.to_owned(), licensees(exception.get("allow").and_then(|list| list.as_array()))?);
        }
        Ok(Self { allowed: licensees(licences.get("allow").and_then(Item::as_array))?, exceptions })
    }

    /// What is wrong with a package of that name under that licence.
    fn complaint(&self, name: &str, licence: Option<&str>) -> Option<String> {
        let Some(licence) = licence else { return Some("it names no licence".into()) };
        let expression = match Expression::parse_mode(licence, ParseMode::LAX) {
            Ok(expression) => expression,
            Err(error) => return Some(format!("`{licence}`: {}", error.reason)),
        };
        let besides = self.exceptions.get(name).into_iter().flatten();
        let allowed: Vec<&Licensee> = self.allowed.iter().chain(besides).collect();
        let may = expression.evaluate(|term| allowed.iter().any(|licensee| licensee.satisfies(term)));
        (!may).then(|| format!("deny.toml does not allow `{licence}`"))
    }
}

fn licensees(list: Option<&toml_edit::Array>) -> Result<Vec<Licensee>> {
    let list = list.ok_or("deny.toml: licences are a list")?;
    list.iter()
        .map(|licence| {
            let licence = licence.as_str().ok_or("deny.toml: a licence is a text")?;
            Licensee::parse(licence).map_err(|error| format!("deny.toml: `{licence}`: {}", error.reason).into())
        })
        .collect()
}

/// Checks every package that the lock file names for the features of the workspace, on every platform.
pub fn licences() -> Result<()> {
    let policy = fs::read_to_string(root().join("deny.toml")).map_err(|error| format!("deny.toml: {error}"))?;
    let policy = Policy::parse(&policy)?;
    let packages = packages()?;
    let text = |package: &Value, field: &str| package[field].as_str().map(str::to_owned);
    let mut complaints = Vec::new();
    for package in &packages {
        let (name, version) = (text(package, "name").unwrap_or_default(), text(package, "version").unwrap_or_default());
        if let Some(complaint) = policy.complaint(&name, text(package, "license").as_deref()) {
            complaints.push(format!("{name} {version}: {complaint}"));
        }
    }
    if !complaints.is_empty() {
        return Err(format!("licences: {}", complaints.join("; ")).into());
    }
    println!("licences: {} packages, all under licences that deny.toml allows", packages.len());
    Ok(())
}

/// All packages of the workspace and all that it depends on.
pub fn packages() -> Result<Vec<Value>> {
    let mut command = cargo(["metadata", "--format-version", "1", "--all-features", "--locked"]);
    let output = command.stderr(Stdio::inherit()).output();
    let output = output.map_err(|error| format!("cannot start `{}`: {error}", line(&command)))?;
    if !output.status.success() {
        return Err(format!("`{}` failed ({})", line(&command), output.status).into());
    }
    let metadata: Value = serde_json::from_slice(&output.stdout)?;
    Ok(metadata["packages"].as_array().cloned().unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    const DENY: &str = r#"
        [licenses]
        allow = ["MIT", "Apache-2.0", "Apache-2.0 WITH LLVM-exception"]
        exceptions = [{ crate = "fonts", allow = ["OFL-1.1"] }]
    "#;

    #[test]
    fn licences_are_allowed_as_the_list_says() -> Result<()> {
        let policy = Policy::parse(DENY)?;
        let allowed = |name, licence| policy.complaint(name, licence).is_none();
        for licence in
            ["MIT", "MIT/Apache-2.0", "GPL-3.0 OR MIT", "Apache-2.0 WITH LLVM-exception", "MIT AND Apache-2.0"]
        {
            assert!(allowed("some", Some(licence)), "{licence}");
        }
        for licence in [Some("GPL-3.0"), Some("MIT AND GPL-3.0"), Some("OFL-1.1"), Some("mine"), None] {
            assert!(!allowed("some", licence), "{licence:?}");
        }
        assert!(allowed("fonts", Some("MIT AND OFL-1.1")) && !allowed("fonts", Some("GPL-3.0")));
        Ok(())
    }

    #[test]
    fn a_list_that_is_wrong_is_told() {
        for (deny, told) in [("", "[licenses]"), ("[licenses]", "list"), ("[licenses]\nallow = [\"Mine\"]", "`Mine`")] {
            let told_so = Policy::parse(deny).err().is_some_and(|error| error.to_string().contains(told));
            assert!(told_so, "{deny}");
        }
    }
}
