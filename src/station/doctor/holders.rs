//! Finds the programs that use a port or interface besides this one, from what the kernel tells of processes.
//!
//! Two programs that read one serial port share its bytes: each gets a part, and both see damaged frames on a line without
//! fault. A port that was opened without a lock shows no sign of that.

use std::fs;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use gnc_text::printable;

/// Most characters of a command line that a person needs to recognise a program.
const COMMAND_CHARACTERS: usize = 80;
/// Lists of the kernel in which a receiver of CAN frames may stand.
const RECEIVERS: [&str; 5] = ["rcvlist_all", "rcvlist_fil", "rcvlist_inv", "rcvlist_sff", "rcvlist_eff"];

/// The folder in which the kernel describes processes. Tests use a folder of their own.
#[derive(Debug, Clone)]
pub(crate) struct Proc(pub(super) PathBuf);

impl Default for Proc {
    fn default() -> Self {
        Self("/proc".into())
    }
}

/// A program that has a device open.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Holder {
    pub(super) process: u32,
    /// Its command line, or its name.
    pub(super) command: String,
}

/// What is known of the users of a device.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Holders {
    /// All but this program, by their number.
    pub(super) found: Vec<Holder>,
    /// Processes of other users, into which only root may look.
    pub(super) hidden: usize,
}

impl Proc {
    /// The programs that have this device open. The program at the other end of a pseudo-terminal is none of them.
    pub(super) fn holders(&self, device: &Path) -> Holders {
        let mut holders = Holders::default();
        let Ok(wanted) = fs::metadata(device) else { return holders };
        let Ok(processes) = fs::read_dir(&self.0) else { return holders };
        for process in processes.flatten() {
            let Some(number) = process.file_name().to_str().and_then(|name| name.parse::<u32>().ok()) else { continue };
            if number == std::process::id() {
                continue;
            }
            let Ok(open) = fs::read_dir(process.path().join("fd")) else {
                // A process that has ended meanwhile is gone, and not hidden.
                holders.hidden += usize::from(process.path().exists());
                continue;
            };
            let files: Vec<PathBuf> = open.flatten().map(|file| file.path()).collect();
            let is_wanted = |file: &PathBuf| fs::metadata(file).is_ok_and(|meta| same_device(&meta, &wanted));
            if files.iter().any(is_wanted) && !is_other_end(&process.path(), &files, device) {
                holders.found.push(Holder { process: number, command: command(&process.path()) });
            }
        }
        holders.found.sort_by_key(|holder| holder.process);
        holders
    }

    /// The number of receivers that listen to a CAN interface, on any of its ids. The kernel does not tell whose they are.
    pub(super) fn can_receivers(&self, interface: &str) -> usize {
        let lists = RECEIVERS.iter().filter_map(|list| fs::read_to_string(self.0.join("net/can").join(list)).ok());
        let of = |list: String| {
            let devices = list.lines().filter_map(|line| line.split_whitespace().next().map(str::to_owned));
            devices.filter(|device| device == interface || device == "any").count()
        };
        lists.map(of).sum()
    }
}

fn same_device(one: &fs::Metadata, other: &fs::Metadata) -> bool {
    let is_device = one.rdev() != 0;
    if is_device { one.rdev() == other.rdev() } else { (one.dev(), one.ino()) == (other.dev(), other.ino()) }
}

/// Whether the process has the other end of this pseudo-terminal: it is what the port leads to.
fn is_other_end(process: &Path, files: &[PathBuf], device: &Path) -> bool {
    let Ok(device) = device.canonicalize() else { return false };
    let Some(index) = device.strip_prefix("/dev/pts").ok().and_then(Path::to_str) else { return false };
    files.iter().filter_map(|file| file.file_name()).any(|file| {
        let told = fs::read_to_string(process.join("fdinfo").join(file)).unwrap_or_default();
        told.lines().any(|line| line.strip_prefix("tty-index:").is_some_and(|told| told.trim() == index))
    })
}

fn command(process: &Path) -> String {
    let words = fs::read(process.join("cmdline")).unwrap_or_default();
    let words = String::from_utf8_lossy(&words).trim_end_matches('\0').replace('\0', " ");
    let name = || fs::read_to_string(process.join("comm")).unwrap_or_default().trim().to_owned();
    let command = if words.is_empty() { name() } else { words };
    let shown: String = command.chars().take(COMMAND_CHARACTERS).collect();
    printable(&shown).into_owned()
}
