//! Compares the commands on a page with the existing programs and packages.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The default package of `cargo run`.
const DEFAULT_PACKAGE: &str = "gnc-station";
/// Options of cargo that name a target of a package.
const TARGETS: [&str; 4] = ["test", "bench", "bin", "example"];

/// The programs and packages that commands may name.
#[derive(Debug)]
pub(crate) struct Programs {
    station: PathBuf,
    /// Name of each package, with its folder and its manifest.
    packages: BTreeMap<String, (PathBuf, toml::Table)>,
    /// The help of each subcommand that was needed; `None` if there is no such subcommand.
    helps: RefCell<BTreeMap<String, Option<String>>>,
}

impl Programs {
    /// # Errors
    /// A manifest that cannot be read.
    pub(crate) fn of(root: &Path, station: &Path) -> Result<Self, String> {
        let workspace = manifest(root)?;
        let members = workspace["workspace"]["members"].as_array().into_iter().flatten();
        let mut packages = BTreeMap::new();
        for folder in members.filter_map(toml::Value::as_str).map(|member| root.join(member)) {
            let manifest = manifest(&folder)?;
            let name = manifest["package"]["name"].as_str().unwrap_or_default().to_owned();
            packages.insert(name, (folder, manifest));
        }
        Ok(Self { station: station.to_owned(), packages, helps: RefCell::default() })
    }

    /// The mistakes in a piece of code, if it is a command of cargo or of the station.
    #[must_use]
    pub(crate) fn mistakes(&self, code: &str) -> Vec<String> {
        let words: Vec<&str> = code.split_whitespace().take_while(|word| *word != "#").collect();
        match words[..] {
            ["$", ..] => self.mistakes(code.trim_start_matches("$ ")),
            ["gnc-station", ref rest @ ..] => self.of_station(rest),
            ["cargo", ref rest @ ..] => self.of_cargo(rest),
            // The pages about methods of `compute` leave the program's name out.
            [method, "FILE" | "FILE.toml", ..] if is_subcommand(method) => {
                self.of_station(&[&["compute"], &words[..]].concat())
            }
            _ => Vec::new(),
        }
    }

    fn of_station(&self, words: &[&str]) -> Vec<String> {
        let subcommand: Vec<&str> = words.iter().copied().take_while(|word| is_subcommand(word)).collect();
        let spoken = [&["gnc-station"], &subcommand[..]].concat().join(" ");
        let mut helps = self.helps.borrow_mut();
        let help = helps.entry(spoken.clone()).or_insert_with(|| self.help(&subcommand));
        let Some(help) = help else { return vec![format!("there is no `{spoken}`")] };
        let options = words.iter().filter_map(|word| {
            let word = word.trim_matches(|mark: char| "[]|,".contains(mark));
            word.starts_with("--").then(|| word.split('=').next().unwrap_or(word))
        });
        let known = |option: &str| {
            help.split(|mark: char| !mark.is_ascii_alphanumeric() && mark != '-').any(|word| word == option)
        };
        options.filter(|option| !known(option)).map(|option| format!("`{spoken}` has no {option}")).collect()
    }

    fn help(&self, subcommand: &[&str]) -> Option<String> {
        let output = Command::new(&self.station).args(subcommand).arg("--help").output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
    }

    fn of_cargo(&self, words: &[&str]) -> Vec<String> {
        let end = words.iter().position(|word| *word == "--").unwrap_or(words.len());
        let (of_cargo, of_program) = words.split_at(end);
        let after = |option: &str| {
            let place = of_cargo.iter().position(|word| *word == option)?;
            of_cargo.get(place + 1).copied()
        };
        let Some((folder, manifest)) = self.packages.get(after("-p").unwrap_or(DEFAULT_PACKAGE)) else {
            return vec![format!("there is no package {}", after("-p").unwrap_or_default())];
        };
        let named = TARGETS.into_iter().filter_map(|kind| Some((kind, after(&format!("--{kind}"))?)));
        let missing = named.filter(|(kind, name)| !has_target(folder, manifest, kind, name));
        let package = manifest["package"]["name"].as_str().unwrap_or_default();
        let mut mistakes: Vec<String> = missing.map(|(kind, name)| format!("{package} has no {kind} {name}")).collect();
        if of_cargo.first() == Some(&"run") && after("-p").is_none() {
            mistakes.extend(self.of_station(of_program.get(1..).unwrap_or_default()));
        }
        mistakes
    }
}

fn manifest(folder: &Path) -> Result<toml::Table, String> {
    let file = folder.join("Cargo.toml");
    let text = std::fs::read_to_string(&file).map_err(|error| format!("{}: {error}", file.display()))?;
    text.parse().map_err(|error| format!("{}: {error}", file.display()))
}

/// Whether a package has a target of a kind, by its manifest or by the file that cargo finds.
fn has_target(folder: &Path, manifest: &toml::Table, kind: &str, name: &str) -> bool {
    let stated = manifest.get(kind).and_then(toml::Value::as_array).into_iter().flatten();
    let file = folder.join(if kind == "bench" { "benches".to_owned() } else { format!("{kind}s") });
    stated.filter_map(|target| target.get("name")?.as_str()).any(|target| target == name)
        || file.join(format!("{name}.rs")).exists()
        || file.join(name).join("main.rs").exists()
}

/// Whether a word is like `plan`, `check` or `six-position`. File names have a dot, and placeholders are in capitals.
fn is_subcommand(word: &str) -> bool {
    word.starts_with(|mark: char| mark.is_ascii_lowercase())
        && word.chars().all(|mark| mark.is_ascii_lowercase() || mark == '-')
}
