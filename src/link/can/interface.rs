//! What the kernel tells of its interfaces in files.

use std::path::{Path, PathBuf};

use nix::errno::Errno;
use nix::sys::socket::{AddressFamily, SockFlag, SockType};

use super::{CanOpenError, kind};
use crate::doubt::Doubt;

/// ARPHRD_CAN: the kind of a network interface.
const KIND_CAN: &str = "280";
/// The kind that each driver of a controller registers; vcan and vxcan have kinds of their own.
const WITH_CONTROLLER: &str = "can";
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

/// Why the interface with this number does not prove that a bus is behind it.
pub(super) fn doubt(interface: &str, index: u32) -> Option<Doubt> {
    let has_device = Path::new("/sys/class/net").join(interface.replace('/', "_")).join("device").exists();
    doubt_by(interface, kind::kind(index), has_device)
}

fn doubt_by(interface: &str, kind: Result<Option<String>, Errno>, has_device: bool) -> Option<Doubt> {
    let interface = interface.to_owned();
    match kind {
        Ok(Some(kind)) if kind != WITH_CONTROLLER => Some(Doubt::VirtualInterface { interface, kind }),
        // An adapter that a program plays on a pseudo-terminal is of this kind too. The slcan driver of the kernel names no
        // device for any adapter.
        Ok(Some(_)) => (!has_device).then_some(Doubt::ControllerWithoutDevice(interface)),
        Ok(None) => Some(Doubt::InterfaceWithoutDevice(interface)),
        Err(_) => Some(Doubt::InterfaceNotAsked(interface)),
    }
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
    fn a_controller_with_a_device_is_beyond_doubt() {
        let doubt = |kind: Option<&str>, has_device| doubt_by("can0", Ok(kind.map(str::to_owned)), has_device);
        assert_eq!(doubt(Some("can"), true), None);
        for kind in ["vcan", "vxcan"] {
            let of_kind = Doubt::VirtualInterface { interface: "can0".into(), kind: kind.into() };
            assert_eq!(doubt(Some(kind), false), Some(of_kind.clone()));
            assert_eq!(doubt(Some(kind), true), Some(of_kind), "a device that was put there");
        }
        let slcan = Doubt::ControllerWithoutDevice("can0".into());
        assert!(slcan.try_this().contains("slcan:/dev/ttyACM0"), "{slcan}");
        assert_eq!(doubt(Some("can"), false), Some(slcan), "slcan of the kernel");
        let without_device = Some(Doubt::InterfaceWithoutDevice("can0".into()));
        assert_eq!(doubt(None, true), without_device, "the kernel does not say");
        assert_eq!(doubt(None, false), without_device);
    }

    /// A service with `RestrictAddressFamilies` gets one error, a container with seccomp others.
    #[test]
    fn a_kernel_that_may_not_be_asked_is_no_missing_device() {
        for why in [Errno::EAFNOSUPPORT, Errno::EPERM, Errno::EACCES, Errno::ENOSYS] {
            for has_device in [true, false] {
                let doubt = doubt_by("can0", Err(why), has_device).unwrap();
                assert_eq!(doubt, Doubt::InterfaceNotAsked("can0".into()), "{why}");
                assert!(doubt.to_string().contains("AF_NETLINK") && doubt.try_this().contains("AF_NETLINK"), "{doubt}");
            }
        }
    }

    #[test]
    fn names_are_told_apart() {
        // The loopback interface is everywhere and is not CAN. If the kernel has no CAN, `look_at` reports that first.
        let no_kernel = matches!(look_at("lo"), Err(CanOpenError::NoKernel { .. }));
        assert!(no_kernel || matches!(look_at("lo"), Err(CanOpenError::NotCan { .. })), "{:?}", look_at("lo"));
        let missing = look_at("../../etc");
        assert!(no_kernel || matches!(missing, Err(CanOpenError::Missing { .. })), "{missing:?}");
    }
}
