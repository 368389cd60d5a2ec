//! What the kernel tells of its interfaces in files.

use std::path::{Path, PathBuf};

use nix::errno::Errno;
use nix::sys::socket::{AddressFamily, SockFlag, SockType};

use super::CanOpenError;

/// ARPHRD_CAN: the kind of a network interface.
const KIND_CAN: &str = "280";
/// IFF_UP.
const UP: u32 = 1;
/// Counters of frames that came over the bus and that the controller, its driver or the kernel lost.
const LOST: [&str; 4] = ["rx_over_errors", "rx_missed_errors", "rx_fifo_errors", "rx_dropped"];

/// Finds out why an interface cannot be used. `open` reports "no such device" for all of these reasons.
pub(super) fn look_at(interface: &str) -> Result<(), CanOpenError> {
    let interface = interface.to_owned();
    let probe = nix::sys::socket::socket(AddressFamily::Can, SockType::Raw, SockFlag::empty(), None);
    if matches!(probe, Err(Errno::EAFNOSUPPORT)) {
        return Err(CanOpenError::NoKernel { interface });
    }
    let (Some(kind), Some(flags)) = (read(&interface, "type"), read(&interface, "flags")) else {
        return Err(CanOpenError::Missing { interface });
    };
    if kind != KIND_CAN {
        return Err(CanOpenError::NotCan { interface });
    }
    let flags = u32::from_str_radix(flags.trim_start_matches("0x"), 16).unwrap_or(UP);
    if flags & UP == 0 { Err(CanOpenError::Down { interface }) } else { Ok(()) }
}

fn read(interface: &str, what: &str) -> Option<String> {
    // A name with a slash is not an interface, and must not lead out of the folder.
    let path: PathBuf = Path::new("/sys/class/net").join(interface.replace('/', "_")).join(what);
    std::fs::read_to_string(path).ok().map(|text| text.trim().to_owned())
}

/// The kernel's number of an interface.
pub(super) fn index(interface: &str) -> Option<u32> {
    read(interface, "ifindex")?.parse().ok()
}

/// The counters of an interface.
#[derive(Debug, Clone)]
pub(super) struct Statistics {
    interface: String,
    /// Frames lost before the interface was opened.
    before: u64,
}

impl Statistics {
    pub(super) fn of(interface: &str) -> Self {
        let mut statistics = Self { interface: interface.to_owned(), before: 0 };
        statistics.before = statistics.lost();
        statistics
    }

    /// Frames lost in this computer since the interface was opened.
    pub(super) fn lost(&self) -> u64 {
        let count = |name: &&str| read(&self.interface, &format!("statistics/{name}"))?.parse::<u64>().ok();
        LOST.iter().filter_map(count).sum::<u64>().saturating_sub(self.before)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_told_apart() {
        // The loopback interface is everywhere and is not CAN. If the kernel has no CAN, `look_at` reports that first.
        let no_kernel = matches!(look_at("lo"), Err(CanOpenError::NoKernel { .. }));
        assert!(no_kernel || matches!(look_at("lo"), Err(CanOpenError::NotCan { .. })), "{:?}", look_at("lo"));
        let missing = look_at("../../etc");
        assert!(no_kernel || matches!(missing, Err(CanOpenError::Missing { .. })), "{missing:?}");
    }
}
