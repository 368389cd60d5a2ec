//! A CAN interface of the kernel: there, up, without a short queue.

use nix::errno::Errno;
use nix::sys::socket::{AddressFamily, SockFlag, SockType, socket};

use super::{Finding, Sys};

/// ARPHRD_CAN: the kind of a network interface.
const KIND_CAN: i64 = 280;
/// IFF_UP.
const UP: i64 = 1;
/// The kernel's default of 10 frames is full after one ISO-TP message of 70 bytes.
const SHORT_QUEUE: i64 = 64;

pub(super) fn look(interface: &str, sys: &Sys) -> Vec<Finding> {
    let probe = socket(AddressFamily::Can, SockType::Raw, SockFlag::empty(), None);
    if matches!(probe, Err(Errno::EAFNOSUPPORT)) {
        let what = format!("this kernel has no CAN, so {interface} cannot be");
        return vec![Finding::bad(
            what,
            "sudo modprobe can can_raw; or use an slcan adapter: port = \"slcan:/dev/ttyACM0\"",
        )];
    }
    state(interface, sys)
}

/// What the kernel tells of an interface.
pub(super) fn state(interface: &str, sys: &Sys) -> Vec<Finding> {
    // A name with a slash is none, and must not lead out of the folder.
    let folder = format!("net/{}", interface.replace('/', "_"));
    let (Some(kind), Some(flags)) = (sys.number(format!("{folder}/type")), sys.number(format!("{folder}/flags")))
    else {
        let mend = "plug the adapter in; `ip -br link` lists what is there";
        return vec![Finding::bad(format!("there is no interface {interface}"), mend)];
    };
    if kind != KIND_CAN {
        let mend = "correct [can] port in the bench file; `ip -br link type can` lists CAN interfaces";
        return vec![Finding::bad(format!("{interface} is no CAN interface"), mend)];
    }
    let mut findings = Vec::new();
    if flags & UP == 0 {
        let rate = gnc_protocol::can::BIT_RATE;
        let mend = format!("sudo ip link set {interface} up type can bitrate {rate}");
        findings.push(Finding::bad(format!("{interface} is down"), mend));
    } else {
        findings.push(Finding::good(format!("{interface} is up")));
    }
    if let Some(length) = sys.number(format!("{folder}/tx_queue_len"))
        && length < SHORT_QUEUE
    {
        let what = format!("{interface} has a transmit queue of {length} frames, which one long message fills");
        findings.push(Finding::warning(what, format!("sudo ip link set {interface} txqueuelen 1000")));
    }
    findings
}
