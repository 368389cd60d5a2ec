//! Whether hardware is at the other end of a port or bus, as far as this computer can see.
//!
//! A program can play a board on a pseudo-terminal or on a virtual CAN interface, and a run then looks like one of a real
//! board. The kernel tells them apart: by the number of the device that is open, and by the device behind a driver. A name
//! proves nothing, since a link of any name may lead to a pseudo-terminal.

use std::fmt;
use std::fs::{self, Metadata};
use std::io;
use std::os::fd::AsRawFd;
use std::os::unix::fs::{FileTypeExt as _, MetadataExt as _};
use std::path::{Path, PathBuf};

use nix::sys::stat::{major, minor};

/// Major numbers of pseudo-terminals in the kernel's list of devices: both ends of the old kind (2 and 3), masters (128 to 135)
/// and slaves (136 to 143) of the kind that Unix98 has.
const PSEUDO_TERMINALS: [std::ops::RangeInclusive<u64>; 2] = [2..=3, 128..=143];
/// Major number of the names for whatever terminal a process has: `/dev/tty` may be a pseudo-terminal.
const ALIASES: u64 = 5;
/// Where the kernel shows the device behind a number.
const DEVICES: &str = "/sys/dev/char";

/// Why a port or bus does not prove that a board is at its other end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Doubt {
    /// The port is a pseudo-terminal: a program is at its other end.
    PseudoTerminal(PathBuf),
    /// This computer sees no device behind the port.
    PortWithoutDevice(PathBuf),
    /// The interface is of a kind without a controller, such as vcan.
    VirtualInterface {
        /// The interface.
        interface: String,
        /// Its kind, as the kernel calls it.
        kind: String,
    },
    /// This computer sees no device behind the interface.
    InterfaceWithoutDevice(String),
    /// The kernel calls the interface one of a controller, and no device is behind it: so is each slcan interface of the
    /// kernel, on an adapter or on a pseudo-terminal.
    ControllerWithoutDevice(String),
    /// This process may not ask the kernel what the interface is.
    InterfaceNotAsked(String),
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shown = |path: &Path| gnc_text::printable(&path.to_string_lossy()).into_owned();
        match self {
            Self::PseudoTerminal(port) => write!(f, "port {} is a pseudo-terminal", shown(port)),
            Self::PortWithoutDevice(port) => {
                write!(f, "port {} has no device that this computer can see", shown(port))
            }
            Self::VirtualInterface { interface, kind } => {
                let (interface, kind) = (gnc_text::printable(interface), gnc_text::printable(kind));
                write!(f, "CAN interface {interface} is virtual ({kind})")
            }
            Self::InterfaceWithoutDevice(interface) => {
                let interface = gnc_text::printable(interface);
                write!(f, "CAN interface {interface} has no device that this computer can see")
            }
            Self::ControllerWithoutDevice(interface) => {
                let interface = gnc_text::printable(interface);
                write!(
                    f,
                    "CAN interface {interface} has no device that this computer can see, as slcan of the kernel has none"
                )
            }
            Self::InterfaceNotAsked(interface) => {
                let interface = gnc_text::printable(interface);
                write!(f, "this process may not ask the kernel what CAN interface {interface} is (AF_NETLINK)")
            }
        }
    }
}

impl Doubt {
    /// What a person can do so that runs count.
    #[must_use]
    pub fn try_this(&self) -> &'static str {
        match self {
            Self::PseudoTerminal(_) => {
                "name the port of an adapter at this computer; `gnc-station ports` lists the ports"
            }
            Self::PortWithoutDevice(_) => {
                "name an adapter at this computer, and not a port that a server or a driver lends; a container needs /sys"
            }
            Self::VirtualInterface { .. } => "name the interface of a CAN adapter; `ip -br link type can` lists them",
            Self::InterfaceWithoutDevice(_) => "name the interface of a CAN adapter; a container needs /sys",
            Self::ControllerWithoutDevice(_) => {
                "with an slcan adapter name it itself, port = \"slcan:/dev/ttyACM0\"; a container needs /sys"
            }
            Self::InterfaceNotAsked(_) => {
                "allow AF_NETLINK in RestrictAddressFamilies of its systemd unit, or in the seccomp rules of its container"
            }
        }
    }

    /// The error of a link that came back as something else than it was.
    pub(crate) fn on_return(&self) -> io::Error {
        io::Error::other(format!("{self}; that was not so when the link was opened"))
    }

    /// Looks at the port that is open: nothing can be put in its place after the look.
    pub(crate) fn of_open_port(port: &Path, open: &impl AsRawFd) -> Option<Self> {
        // The link in /proc stands for the open device itself, wherever its name leads by now.
        match fs::metadata(format!("/proc/self/fd/{}", open.as_raw_fd())) {
            Ok(meta) => Self::of_device(port, &meta, Path::new(DEVICES)),
            Err(_) => Some(Self::PortWithoutDevice(port.to_owned())),
        }
    }

    /// Looks at a port by its name. A port that is not there has no doubt: opening it says what is wrong.
    pub(crate) fn of_port(port: &Path) -> Option<Self> {
        let meta = fs::metadata(port).ok().filter(|meta| meta.file_type().is_char_device())?;
        Self::of_device(port, &meta, Path::new(DEVICES))
    }

    fn of_device(port: &Path, meta: &Metadata, devices: &Path) -> Option<Self> {
        Self::of_number(port, major(meta.rdev()), minor(meta.rdev()), devices)
    }

    fn of_number(port: &Path, major: u64, minor: u64, devices: &Path) -> Option<Self> {
        if PSEUDO_TERMINALS.iter().any(|numbers| numbers.contains(&major)) {
            return Some(Self::PseudoTerminal(port.to_owned()));
        }
        let has_device = major != ALIASES && devices.join(format!("{major}:{minor}")).join("device").exists();
        (!has_device).then(|| Self::PortWithoutDevice(port.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_the_device_tells() {
        let devices = std::env::temp_dir().join(format!("gnc-doubt-{}", std::process::id()));
        fs::create_dir_all(devices.join("188:0/device")).expect("a folder");
        fs::create_dir_all(devices.join("240:1")).expect("a folder");
        // A device behind the number of a pseudo-terminal would be one that was put there.
        fs::create_dir_all(devices.join("136:0/device")).expect("a folder");
        let doubt = |major, minor| Doubt::of_number(Path::new("/dev/board"), major, minor, &devices);
        let port = || PathBuf::from("/dev/board");
        assert_eq!(doubt(188, 0), None, "an adapter");
        assert_eq!(doubt(188, 1), Some(Doubt::PortWithoutDevice(port())), "no such adapter");
        assert_eq!(doubt(240, 1), Some(Doubt::PortWithoutDevice(port())), "a driver without a device");
        assert_eq!(doubt(5, 0), Some(Doubt::PortWithoutDevice(port())), "whatever terminal the process has");
        for slave in [2, 3, 128, 135, 136, 143] {
            assert_eq!(doubt(slave, 0), Some(Doubt::PseudoTerminal(port())), "{slave}");
        }
        fs::remove_dir_all(&devices).expect("the folder");
    }

    #[test]
    fn a_link_of_any_name_leads_to_the_pseudo_terminal() {
        let pty = nix::pty::openpty(None, None).expect("a pseudo-terminal");
        let name = nix::unistd::ttyname(&pty.slave).expect("its name");
        let link = std::env::temp_dir().join(format!("gnc-doubt-link-{}", std::process::id()));
        let _ = fs::remove_file(&link);
        std::os::unix::fs::symlink(&name, &link).expect("a link");
        assert_eq!(Doubt::of_port(&name), Some(Doubt::PseudoTerminal(name.clone())));
        assert_eq!(Doubt::of_port(&link), Some(Doubt::PseudoTerminal(link.clone())));
        // The name is gone, and the open device is still what it is.
        fs::remove_file(&link).expect("the link");
        assert_eq!(Doubt::of_port(&link), None, "nothing is there");
        assert_eq!(Doubt::of_open_port(&link, &pty.slave), Some(Doubt::PseudoTerminal(link.clone())));
        assert!(Doubt::of_open_port(&link, &pty.master).is_some(), "the other end as well");
    }
}
