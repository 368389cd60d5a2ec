//! What a person who can write everything but the key may do to a records folder: a script of bytes chooses the files and
//! what happens to them. It shares no code with the station, so both cannot misread the format of the chain alike.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};

/// Most steps of one script.
const MOST_STEPS: usize = 4;

/// Everything below a folder: what each path is and holds.
pub(crate) type Tree = BTreeMap<PathBuf, Entry>;

/// What stands under a path.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Entry {
    File(Vec<u8>),
    Folder,
    Link(PathBuf),
}

/// Reads a folder.
///
/// # Errors
/// The error of the system.
pub(crate) fn tree(root: &Path) -> io::Result<Tree> {
    let mut found = Tree::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder)? {
            let path = entry?.path();
            let kind = path.symlink_metadata()?.file_type();
            let entry = if kind.is_symlink() {
                Entry::Link(fs::read_link(&path)?)
            } else if kind.is_dir() {
                folders.push(path.clone());
                Entry::Folder
            } else {
                Entry::File(fs::read(&path)?)
            };
            found.insert(path.strip_prefix(root).unwrap_or(&path).to_owned(), entry);
        }
    }
    Ok(found)
}

/// Makes a folder as a tree says.
///
/// # Errors
/// The error of the system.
pub(crate) fn plant(tree: &Tree, root: &Path) -> io::Result<()> {
    fs::create_dir_all(root)?;
    for (path, entry) in tree {
        let path = root.join(path);
        match entry {
            Entry::Folder => fs::create_dir_all(&path)?,
            Entry::File(bytes) => fs::write(&path, bytes)?,
            Entry::Link(target) => symlink(target, &path)?,
        }
    }
    Ok(())
}

/// Choices from a script; when it ends, all are the first.
struct Dice<'s>(&'s [u8]);

impl Dice<'_> {
    fn byte(&mut self) -> u8 {
        let (first, rest) = self.0.split_first().unwrap_or((&0, &[]));
        self.0 = rest;
        *first
    }

    fn below(&mut self, bound: usize) -> usize {
        (usize::from(self.byte()) << 8 | usize::from(self.byte())) % bound.max(1)
    }

    fn of<'t, T>(&mut self, choices: &'t [T]) -> Option<&'t T> {
        choices.get(self.below(choices.len()))
    }
}

/// Carries out a script below `records`, where the files of all runs are open to the attacker. Returns what was done, a
/// line each.
///
/// # Errors
/// The error of the system.
pub(crate) fn attack(records: &Path, script: &[u8]) -> io::Result<Vec<String>> {
    let mut dice = Dice(script);
    let mut done = Vec::new();
    for _ in 0..=dice.below(MOST_STEPS) {
        let found = tree(records)?;
        let files: Vec<&PathBuf> =
            found.iter().filter(|(_, entry)| matches!(entry, Entry::File(_))).map(|(path, _)| path).collect();
        let folders: Vec<&PathBuf> =
            found.iter().filter(|(_, entry)| **entry == Entry::Folder).map(|(path, _)| path).collect();
        let (Some(file), Some(other), Some(folder), Some(beside)) =
            (dice.of(&files), dice.of(&files), dice.of(&folders), dice.of(&folders))
        else {
            break;
        };
        done.push(step(records, &mut dice, [file, other], [folder, beside])?);
    }
    // An attacker who knows the station makes all digests, links and the counter anew.
    let knows = dice.byte();
    if knows & 1 != 0 {
        sums_anew(records)?;
        done.push("all digests are made anew".to_owned());
    }
    if knows & 2 != 0 {
        chain_anew(records, knows & 4 != 0)?;
        done.push("the chain and its counter are made anew".to_owned());
    }
    Ok(done)
}

/// One step with two files and two folders.
fn step(records: &Path, dice: &mut Dice<'_>, files: [&Path; 2], folders: [&Path; 2]) -> io::Result<String> {
    let [file, other] = files.map(|file| records.join(file));
    let [folder, beside] = folders.map(|folder| records.join(folder));
    let named = |what: &str| {
        format!(
            "{what}: {} {} {} {}",
            files[0].display(),
            files[1].display(),
            folders[0].display(),
            folders[1].display()
        )
    };
    let fresh = |folder: &Path, name: &str| folder.join(name);
    Ok(match dice.below(17) {
        0 => {
            let mut bytes = fs::read(&file)?;
            let at = dice.below(bytes.len());
            if let Some(byte) = bytes.get_mut(at) {
                *byte ^= dice.byte().max(1);
            }
            fs::write(&file, bytes)?;
            named("a byte of the first file is changed")
        }
        1 => {
            let mut bytes = fs::read(&file)?;
            bytes.truncate(dice.below(bytes.len() + 1));
            fs::write(&file, bytes)?;
            named("the first file is cut")
        }
        2 => {
            let mut bytes = fs::read(&file)?;
            bytes.extend([dice.byte(), b'\n']);
            fs::write(&file, bytes)?;
            named("the first file is longer")
        }
        3 => {
            fs::remove_file(&file)?;
            named("the first file is removed")
        }
        4 => {
            fs::rename(&file, fresh(&folder, "renamed"))?;
            named("the first file is moved to the first folder")
        }
        5 => {
            let (one, two) = (fs::read(&file)?, fs::read(&other)?);
            fs::write(&file, two)?;
            fs::write(&other, one)?;
            named("the files are swapped")
        }
        6 => {
            fs::write(fresh(&folder, "inserted"), [dice.byte()])?;
            named("a file is added to the first folder")
        }
        7 => {
            fs::remove_dir_all(&folder)?;
            named("the first folder is removed")
        }
        8 => {
            let name = folder.file_name().unwrap_or_default().to_string_lossy().replace(['0', '1'], "2");
            let to = folder.with_file_name(name);
            if !to.exists() {
                fs::rename(&folder, to)?;
            }
            named("the first folder is renamed")
        }
        9 => {
            if !folder.starts_with(&beside) && !beside.starts_with(&folder) {
                let aside = records.join("aside");
                fs::rename(&folder, &aside)?;
                fs::rename(&beside, &folder)?;
                fs::rename(&aside, &beside)?;
            }
            named("the folders are swapped")
        }
        10 => {
            let copy = tree(&folder)?;
            let to = folder.with_file_name(["2026-11-20", "T-9", "235959-functional"][dice.below(3)]);
            if !to.exists() {
                plant(&copy, &to)?;
            }
            named("the first folder is there once more")
        }
        11 => {
            let aside = records.with_extension("aside");
            fs::create_dir_all(&aside)?;
            let target = aside.join("file");
            fs::rename(&file, &target)?;
            symlink(&target, &file)?;
            named("the first file is behind a link")
        }
        12 => {
            let aside = records.with_extension("aside");
            fs::create_dir_all(&aside)?;
            let target = aside.join("folder");
            if target.symlink_metadata().is_err() {
                fs::rename(&folder, &target)?;
                symlink(&target, &folder)?;
            }
            named("the first folder is behind a link")
        }
        13 => {
            let length = fs::read(&file)?.len();
            fs::write(&file, vec![0; length])?;
            named("the first file is zeros")
        }
        15 => {
            let to = fresh(&folder, ["empty", "plan", "T-9", "235959-functional"][dice.below(4)]);
            if !to.exists() {
                fs::create_dir(&to)?;
            }
            named("an empty folder is added to the first folder")
        }
        14 => {
            fs::copy(&other, &file)?;
            named("the first file is as the second")
        }
        _ => {
            let bytes = fs::read(&file)?;
            let mut lines: Vec<&[u8]> = bytes.split_inclusive(|byte| *byte == b'\n').collect();
            let (one, two) = (dice.below(lines.len()), dice.below(lines.len()));
            match dice.below(3) {
                0 if !lines.is_empty() => lines.swap(one, two),
                1 if !lines.is_empty() => {
                    lines.remove(one);
                }
                _ => lines.extend(lines.get(one).copied()),
            }
            fs::write(&file, lines.concat())?;
            named("lines of the first file are swapped, gone or there twice")
        }
    })
}

pub(crate) fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The folders `DATE/SERIAL/RUN`.
fn runs(tree: &Tree) -> Vec<&PathBuf> {
    tree.iter()
        .filter(|(path, entry)| **entry == Entry::Folder && path.components().count() == 3)
        .map(|(path, _)| path)
        .collect()
}

/// Writes the digests of each run anew, as if the files had always been so.
pub(crate) fn sums_anew(records: &Path) -> io::Result<()> {
    let found = tree(records)?;
    for run in runs(&found).into_iter().filter(|run| found.contains_key(&run.join("SHA256SUMS"))) {
        let of_run = found.iter().filter_map(|(path, entry)| match entry {
            Entry::File(bytes) => Some((path.strip_prefix(run).ok()?, bytes)),
            Entry::Folder | Entry::Link(_) => None,
        });
        let covered =
            of_run.filter(|(path, _)| !["SHA256SUMS", "SHA256SUMS.sig"].iter().any(|own| *path == Path::new(own)));
        let sums: String = covered.map(|(path, bytes)| format!("{}  {}\n", sha256(bytes), path.display())).collect();
        fs::write(records.join(run).join("SHA256SUMS"), sums)?;
    }
    Ok(())
}

/// Writes all lines of the chain anew: numbers without holes, true links and digests, and a counter that fits. Lines of runs
/// whose folder is gone are left out. Signatures stay as they are, or are left out.
pub(crate) fn chain_anew(records: &Path, unsigned: bool) -> io::Result<()> {
    let found = tree(records)?;
    let mut lines: Vec<(u64, PathBuf, Vec<String>)> = Vec::new();
    for (path, entry) in &found {
        let (Entry::File(bytes), Some("CHAIN")) = (entry, path.file_name().and_then(|name| name.to_str())) else {
            continue;
        };
        for line in String::from_utf8_lossy(bytes).lines() {
            let words: Vec<String> = line.split(' ').map(str::to_owned).collect();
            let number = words.first().and_then(|word| word.parse().ok());
            let (Some(number), true) = (number, words.len() >= 8) else { continue };
            lines.push((number, path.clone(), words));
        }
    }
    lines.sort();
    let (mut number, mut before) = (0_u64, "0".repeat(64));
    let mut chains: BTreeMap<PathBuf, String> =
        lines.iter().map(|(_, path, _)| (path.clone(), String::new())).collect();
    for (_, path, words) in lines {
        let run = records.join(&words[7]);
        let covering = if words[4] == "begin" {
            let journal = fs::read(run.join("events.jsonl")).unwrap_or_default();
            journal.split_inclusive(|byte| *byte == b'\n').next().map(<[u8]>::to_vec)
        } else {
            fs::read(run.join("SHA256SUMS")).ok()
        };
        let Some(covering) = covering else { continue };
        number += 1;
        let digest = sha256(&covering);
        let (tail, signature) = match words.iter().rposition(|word| word == "sig") {
            Some(at) => (&words[4..at], format!(" {}", words[at..].join(" "))),
            None => (&words[4..], String::new()),
        };
        let tail = tail.join(" ");
        let link = sha256(format!("{number} {before} {digest} {tail}").as_bytes());
        let signature = if unsigned { String::new() } else { signature };
        if let Some(chain) = chains.get_mut(&path) {
            chain.push_str(&format!("{number} {before} {digest} {link} {tail}{signature}\n"));
        }
        before = link;
    }
    for (path, text) in chains {
        fs::write(records.join(path), text)?;
    }
    fs::write(records.join("COUNTER"), format!("{number} {before}\n"))
}
