//! Checks a serial port: it exists, this user may use it, it has the rate, and its adapter does not wait.

use std::os::unix::fs::{FileTypeExt as _, MetadataExt as _};
use std::path::Path;

use gnc_link::serial::{self, OpenError};
use nix::unistd::{AccessFlags, Gid, Group, access};

use super::{Finding, Health, Sys};

/// FTDI adapters keep a byte this long to fill a packet. The waits of the ICD allow for an adapter that waits a little.
const LATENCY_MS: i64 = 2;
/// The kernel's number of the devices that are no hardware: `/dev/null`, `/dev/zero` and their like.
const MEMORY_DEVICES: u64 = 1;

pub(super) fn look(port: &Path, rate_baud: u32, sys: &Sys) -> Vec<Finding> {
    let found = opens(port, rate_baud, "[socket] port");
    let latency = latency(port, sys).filter(|_| found.health != Health::Bad);
    [found].into_iter().chain(latency).collect()
}

/// Whether it is a device that may be a serial port, as far as that can be told without opening it. Half of all programs have
/// `/dev/null` open.
pub(super) fn may_be_one(port: &Path) -> bool {
    std::fs::metadata(port)
        .is_ok_and(|meta| meta.file_type().is_char_device() && nix::sys::stat::major(meta.rdev()) != MEMORY_DEVICES)
}

/// Whether the port is there and opens; `key` is that of the bench file which names it.
pub(super) fn opens(port: &Path, rate_baud: u32, key: &str) -> Finding {
    let shown = gnc_text::shown_path(port);
    let Ok(meta) = std::fs::metadata(port) else {
        let what = format!("port {shown} is not there");
        return Finding::bad(what, "plug the adapter in; `gnc-station ports` lists the ports");
    };
    if !meta.file_type().is_char_device() {
        let mend = format!("correct {key} in the bench file; `gnc-station ports` lists the ports");
        return Finding::bad(format!("{shown} is not a serial port"), mend);
    }
    if access(port, AccessFlags::R_OK | AccessFlags::W_OK).is_err() {
        let group = Group::from_gid(Gid::from_raw(meta.gid())).ok().flatten();
        let group = group.map_or_else(|| meta.gid().to_string(), |group| group.name);
        let what = format!("this user may not use port {shown}, which belongs to the group {group}");
        return Finding::bad(what, format!("sudo usermod -aG {group} $USER, then log in again"));
    }
    opened(port, rate_baud)
}

/// Opens the port as the station does and closes it again. This shows another program on the port, and a rate that the
/// driver refuses.
fn opened(port: &Path, rate_baud: u32) -> Finding {
    match serial::try_open(port, rate_baud) {
        Ok(()) => Finding::good(format!("port {} at {rate_baud} bit/s", gnc_text::shown_path(port))),
        Err(error @ OpenError::Busy { .. }) => Finding::warning(error.to_string(), error.try_this()),
        Err(error) => Finding::bad(gnc_text::with_causes(&error), error.try_this()),
    }
}

/// Whether another program has locked the port, as a run of the station does.
pub(super) fn is_busy(port: &Path, rate_baud: u32) -> bool {
    matches!(serial::try_open(port, rate_baud), Err(OpenError::Busy { .. }))
}

fn latency(port: &Path, sys: &Sys) -> Option<Finding> {
    let name = std::fs::canonicalize(port).ok()?;
    let name = name.file_name()?.to_str()?.to_owned();
    let timer = format!("tty/{name}/device/latency_timer");
    let waits_ms = sys.number(&timer)?;
    (waits_ms > LATENCY_MS).then(|| {
        let what = format!("the adapter of {} holds received bytes back for {waits_ms} ms", gnc_text::shown_path(port));
        Finding::warning(what, format!("echo 1 | sudo tee {}", gnc_text::shown_path(&sys.0.join(&timer))))
    })
}
