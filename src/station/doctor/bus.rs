//! Checks a CAN interface of the kernel: it exists, is up, has the bit rate, is on the bus, and has no short queue.

use std::process::{Command, Stdio};

use nix::errno::Errno;
use nix::sys::socket::{AddressFamily, SockFlag, SockType, socket};
use serde_json::Value;

use super::{Finding, Health, Sys};

/// ARPHRD_CAN: the kind of a network interface.
const KIND_CAN: i64 = 280;
/// IFF_UP.
const UP: i64 = 1;
/// The kernel's default of 10 frames is full after one ISO-TP message of 70 bytes.
const SHORT_QUEUE: i64 = 64;

pub(super) fn look(interface: &str, sys: &Sys) -> Vec<Finding> {
    let probe = socket(AddressFamily::Can, SockType::Raw, SockFlag::empty(), None);
    if matches!(probe, Err(Errno::EAFNOSUPPORT)) {
        let what = format!("this kernel has no support for CAN, so {interface} cannot exist");
        return vec![Finding::bad(
            what,
            "sudo modprobe can can_raw; or use an slcan adapter: port = \"slcan:/dev/ttyACM0\"",
        )];
    }
    let mut findings = state(interface, sys);
    if findings.iter().all(|finding| finding.health != Health::Bad) {
        findings.extend(asked(interface).iter().flat_map(|told| controller(interface, told)));
    }
    findings
}

/// Asks iproute2 about an interface, since the files of the kernel do not show the controller. `None` without that
/// program.
fn asked(interface: &str) -> Option<Value> {
    let arguments = ["-json", "-details", "link", "show", "dev", interface];
    let output = Command::new("ip").args(arguments).stdin(Stdio::null()).stderr(Stdio::null()).output().ok()?;
    serde_json::from_slice(&output.stdout).ok()
}

/// Checks the controller's bit rate, its state, and its restart after bus-off. An interface without a controller (vcan)
/// has none of these.
pub(super) fn controller(interface: &str, told: &Value) -> Vec<Finding> {
    let data = &told[0]["linkinfo"]["info_data"];
    let mut findings = Vec::new();
    let rate = gnc_protocol::can::BIT_RATE;
    let set =
        |more: &str| format!("sudo ip link set {interface} down; sudo ip link set {interface} up type can {more}");
    match data["bittiming"]["bitrate"].as_u64() {
        Some(got) if got == u64::from(rate) => {
            findings.push(Finding::good(format!("{interface} runs at {rate} bit/s")));
        }
        Some(got) => {
            let what = format!("{interface} runs at {got} bit/s instead of {rate}");
            findings.push(Finding::bad(what, set(&format!("bitrate {rate}"))));
        }
        None => {}
    }
    match data["state"].as_str() {
        Some("BUS-OFF") => {
            let what = format!("the controller of {interface} left the bus after too many errors (bus-off)");
            let mend = format!("sudo ip link set {interface} type can restart; then check cable and termination");
            findings.push(Finding::bad(what, mend));
        }
        Some(state @ ("ERROR-PASSIVE" | "ERROR-WARNING")) => {
            let what = format!("the controller of {interface} saw many errors ({state})");
            let mend = "measure 60 ohm between CAN_H and CAN_L with the power off; check the cable";
            findings.push(Finding::warning(what, mend));
        }
        _ => {}
    }
    let has_controller = data["bittiming"].is_object();
    if has_controller && data["restart_ms"].as_u64().unwrap_or(0) == 0 {
        let what = format!("{interface} stays off the bus after too many errors, until an operator restarts it");
        findings.push(Finding::warning(what, set(&format!("bitrate {rate} restart-ms 100"))));
    }
    findings
}

/// Checks what the kernel's files show of an interface.
pub(super) fn state(interface: &str, sys: &Sys) -> Vec<Finding> {
    // A name with a slash is not an interface, and must not lead out of the folder.
    let folder = format!("net/{}", interface.replace('/', "_"));
    let (Some(kind), Some(flags)) = (sys.number(format!("{folder}/type")), sys.number(format!("{folder}/flags")))
    else {
        let mend = "plug the adapter in; `ip -br link` lists the interfaces";
        return vec![Finding::bad(format!("there is no interface {interface}"), mend)];
    };
    if kind != KIND_CAN {
        let mend = "correct [can] port in the bench file; `ip -br link type can` lists CAN interfaces";
        return vec![Finding::bad(format!("{interface} is not a CAN interface"), mend)];
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
