//! The workspace according to its manifests and files.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::source::{Module, modules};

/// A crate of the workspace.
#[derive(Debug)]
pub(crate) struct Crate {
    /// Its name in other manifests.
    pub name: String,
    /// Crates of the workspace that its manifest names.
    pub built_on: BTreeSet<String>,
    /// Its modules, without test modules.
    pub modules: Vec<Module>,
    /// Lines of Rust in its folder, including tests and benches.
    pub lines: usize,
}

impl Crate {
    /// Its name in code.
    #[must_use]
    pub(crate) fn in_code(&self) -> String {
        self.name.replace('-', "_")
    }
}

/// The crates of the workspace except its tests, which may use every crate.
///
/// # Errors
/// A manifest or a source cannot be read.
pub(crate) fn crates(root: &Path) -> Result<Vec<Crate>, String> {
    let workspace = manifest(&root.join("Cargo.toml"))?;
    let members: Vec<&str> = workspace["workspace"]["members"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(toml::Value::as_str)
        .filter(|member| *member != "tests")
        .collect();
    let manifests = members
        .iter()
        .map(|member| manifest(&root.join(member).join("Cargo.toml")))
        .collect::<Result<Vec<toml::Table>, String>>()?;
    let name = |manifest: &toml::Table| manifest["package"]["name"].as_str().unwrap_or_default().to_owned();
    let names: BTreeSet<String> = manifests.iter().map(name).collect();
    members
        .iter()
        .zip(&manifests)
        .map(|(member, manifest)| {
            let read = |file: &Path| std::fs::read_to_string(root.join(file)).ok();
            Ok(Crate {
                name: name(manifest),
                built_on: dependencies(manifest).into_iter().filter(|name| names.contains(name)).collect(),
                modules: modules(&Path::new(member).join("lib.rs"), &read)?,
                lines: lines(&root.join(member))?,
            })
        })
        .collect()
}

fn manifest(file: &Path) -> Result<toml::Table, String> {
    let text = std::fs::read_to_string(file).map_err(|error| format!("{}: {error}", file.display()))?;
    text.parse().map_err(|error| format!("{}: {error}", file.display()))
}

/// All names in a manifest's tables of dependencies, including those for tests and for one kind of machine.
fn dependencies(table: &toml::Table) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for (key, value) in table {
        let Some(inner) = value.as_table() else { continue };
        if key.ends_with("dependencies") {
            found.extend(inner.keys().cloned());
        } else {
            found.extend(dependencies(inner));
        }
    }
    found
}

fn lines(folder: &Path) -> Result<usize, String> {
    let entries = std::fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.iter().try_fold(0, |sum, path| {
        Ok(sum
            + if path.is_dir() {
                lines(path)?
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?.lines().count()
            } else {
                0
            })
    })
}

/// The crates that name a path with this beginning (`std::fs`, `clap`), each with a place.
#[must_use]
pub(crate) fn users<'a>(crates: &'a [Crate], beginning: &str) -> BTreeMap<&'a str, String> {
    let wanted: Vec<&str> = beginning.split("::").collect();
    let mut found = BTreeMap::new();
    for one in crates {
        let place = one.modules.iter().find_map(|module| {
            let named = module.named.iter().find(|named| {
                // A single word of a root is not a path.
                (named.path.len() > 1 || named.known_as.is_some())
                    && named.path.len() >= wanted.len()
                    && named.path.iter().zip(&wanted).all(|(a, b)| a == b)
            })?;
            Some(format!("{}:{}", module.file.display(), named.line))
        });
        if let Some(place) = place {
            found.insert(one.name.as_str(), place);
        }
    }
    found
}
