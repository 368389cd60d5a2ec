//! Checks the records folder, the clock and the terminal.

use std::io::IsTerminal as _;
use std::path::Path;

use gnc_bench::clock;
use gnc_records::store::chain;
use gnc_records::store::reader::{self, Wanted};
use nix::errno::Errno;
use nix::sys::statvfs::statvfs;
use nix::unistd::{AccessFlags, access};

use super::Finding;
use crate::progress::Progress;
use crate::version;

/// With less room than this a day's records do not fit: an hour of captures is 40 MB, a module's acceptance 250 MB.
const LITTLE_MB: u64 = 2000;
/// With less room than this the next run may already fail.
const NOTHING_MB: u64 = 300;
/// The smallest size at which the screen shows everything.
const COLUMNS_AND_ROWS: (u16, u16) = (80, 24);

/// Checks the records folder, and finds runs without an end.
pub(super) fn records(folder: &Path) -> Vec<Finding> {
    let shown = gnc_text::shown_path(folder);
    if !folder.is_dir() && folder.symlink_metadata().is_ok() {
        let is = if folder.exists() { "it is a file, not a folder" } else { "it is a link that leads nowhere" };
        let mend = "move it away, or choose another folder with records = under [station]";
        return vec![Finding::bad(format!("records cannot go to {shown}: {is}"), mend)];
    }
    if !folder.exists() {
        let there = existing(folder);
        return vec![match access(there, AccessFlags::W_OK).and_then(|()| try_out(there)) {
            Ok(()) => Finding::good(format!("records go to {shown}, which the first run creates")),
            Err(error) => Finding::bad(
                format!(
                    "records cannot go to {shown}: {} is not writable ({})",
                    gnc_text::shown_path(there),
                    std::io::Error::from(error)
                ),
                "choose another folder with records = under [station], or make this one writable",
            ),
        }];
    }
    if let Err(error) = access(folder, AccessFlags::R_OK | AccessFlags::W_OK | AccessFlags::X_OK) {
        let mend = format!("sudo chown $USER {shown}; or remount it writable");
        return vec![Finding::bad(format!("records cannot go to {shown}: {}", std::io::Error::from(error)), mend)];
    }
    let mut findings = vec![Finding::good(format!("records go to {shown}"))];
    if let Err(error) = chain::try_out(folder) {
        let what = format!("no run can be closed: {}", gnc_text::with_causes(&error));
        findings.push(Finding::bad(what, error.try_this()));
    }
    let progress = Progress::begin("records of earlier runs are looked at");
    // One after the other: all of them together may be more than the memory holds.
    let counted = reader::wanted(folder, Wanted::default()).map(|runs| {
        runs.fold((0_usize, 0_usize), |(all, open), run| (all + 1, open + usize::from(!run.sealed && !run.running)))
    });
    drop(progress);
    match counted {
        Ok((all, open)) => {
            if open > 0 {
                let what = format!("{open} of {all} runs in {shown} have no end or were not closed");
                findings.push(Finding::warning(what, format!("gnc-station records list --records {shown}")));
            }
        }
        Err(error) => findings.push(Finding::bad(gnc_text::with_causes(&error), error.try_this())),
    }
    findings
}

/// Checks the room on the disk of the records.
pub(super) fn disk(folder: &Path) -> Option<Finding> {
    let there = existing(folder);
    let disk = statvfs(there).ok()?;
    let free_mb = disk.blocks_available().saturating_mul(disk.fragment_size()) / 1_000_000;
    let what = format!("{free_mb} MB are free where records go");
    Some(match free_mb {
        0..NOTHING_MB => Finding::bad(what, "move the records of old days to another disk"),
        NOTHING_MB..LITTLE_MB => Finding::warning(what, "move the records of old days to another disk"),
        _ => Finding::good(what),
    })
}

/// Checks the clock as a run does. A clock that was set back gives folders of a day that already exists.
pub(super) fn clock(folder: Option<&Path>) -> Finding {
    let now = clock::now();
    let newest = folder.and_then(reader::newest_day);
    let mend = "sudo timedatectl set-ntp true";
    match (clock::check(now, version::program().build.as_ref(), newest), newest) {
        (Err(error), _) => Finding::bad(error.to_string(), mend),
        (Ok(()), Some(newest)) if newest > now.date_naive() => {
            let what = format!("the clock says {}, but there are records of {newest}", now.format("%F %T %:z"));
            Finding::warning(what, mend)
        }
        (Ok(()), _) => Finding::good(format!("the clock says {}", now.format("%F %T %:z"))),
    }
}

pub(super) fn terminal() -> Finding {
    if !std::io::stdout().is_terminal() {
        return Finding::good("standard output is not a terminal, so the size of the screen was not checked");
    }
    let (columns, rows) = terminal_size::terminal_size().map_or((0, 0), |(width, height)| (width.0, height.0));
    let what = format!("the terminal has {columns} columns and {rows} rows");
    if columns < COLUMNS_AND_ROWS.0 || rows < COLUMNS_AND_ROWS.1 {
        return Finding::warning(what, "make it 80x24 or larger: the screen needs that much");
    }
    Finding::good(what)
}

/// Creates a folder in this one and takes it away again: the kernel lets root write in folders, such as `/proc`, in which
/// nothing can be made.
fn try_out(there: &Path) -> Result<(), Errno> {
    let tried = there.join(format!(".doctor-{}", std::process::id()));
    let tries = std::fs::create_dir(&tried).and_then(|()| std::fs::remove_dir(&tried));
    tries.map_err(|error| error.raw_os_error().map_or(Errno::EIO, Errno::from_raw))
}

/// The folder, or the nearest folder above it that exists.
fn existing(folder: &Path) -> &Path {
    let above = folder.ancestors().find(|folder| folder.exists() && !folder.as_os_str().is_empty());
    above.unwrap_or_else(|| Path::new("."))
}
