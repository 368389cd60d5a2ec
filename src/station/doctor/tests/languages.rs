//! Findings that the other tests do not bring out, in every language.

use std::fs;
use std::path::Path;
use std::time::Duration;

use gnc_protocol::message::{BoardHello, Heartbeat, MAGIC};
use gnc_protocol::wire::Text;

use super::others::{process, pseudo_terminal};
use super::speak_all;
use crate::doctor::board::{self, Heard};
use crate::doctor::holders::Proc;
use crate::doctor::{Sys, look, place};

/// All that may be heard on a serial line and on a CAN bus.
#[test]
fn what_is_heard_of_a_board() {
    for is_can in [false, true] {
        let line = if is_can { "CAN interface can0" } else { "port /dev/ttyUSB0" }.to_owned();
        let heard = Heard { line, is_can, listened: Duration::from_millis(3500), ..Heard::default() };
        let hello = |capabilities| BoardHello {
            magic: MAGIC,
            chosen: 1,
            lowest: 1,
            highest: 2,
            nonce: 1,
            boot_id: 0xb007_1dea,
            capabilities,
            serial: Text::try_from("SB-17").expect("short"),
            firmware: Text::try_from("2.1").expect("short"),
        };
        // Each capability alone, all of them, and one that a later version has.
        let answers = (0..32).map(|bits| (hello(bits), Duration::from_millis(7)));
        let beat = Heartbeat { boot_id: 0xb007_1dea, board_time_us: 5, state: 0 };
        let mut all: Vec<Heard> = answers.map(|answer| Heard { answer: Some(answer), ..heard.clone() }).collect();
        for asked in [0, 10] {
            let heard = Heard { asked, ..heard.clone() };
            all.extend([
                Heard { broke: Some("it went away".to_owned()), ..heard.clone() },
                Heard { unreadable: true, ..heard.clone() },
                Heard { foreign_version: Some(2), ..heard.clone() },
                Heard { beat: Some(beat.clone()), ..heard.clone() },
                Heard { came: 48, ..heard.clone() },
                Heard { came: 48, frames: 3, damaged: 5, ..heard.clone() },
                Heard { came: 48, damaged: 5, ..heard.clone() },
                heard,
            ]);
        }
        for heard in all {
            speak_all(&board::findings(&heard), &["can0", "CAN_H", "CAN_L", "RS-422"]);
        }
    }
}

/// Folders of records that are missing, full of open runs, or closed to this user; clocks; disks.
#[test]
fn what_is_around_a_bench() {
    let folder = tempfile::tempdir().expect("a folder");
    let names = format!("{0} {0}/none", folder.path().display());
    let names: Vec<&str> = crate::phrases::english::latin(&names).collect();
    let mut found = place::records(&folder.path().join("none"));
    found.extend(place::records(Path::new("/proc/none/records")));
    found.extend(place::records(folder.path()));
    fs::create_dir_all(folder.path().join("2026-11-22/DEMO-1/140500-functional")).expect("a folder");
    found.extend(place::records(folder.path()));
    found.extend(place::disk(folder.path()));
    found.push(place::clock(folder.path()));
    fs::create_dir_all(folder.path().join("2999-01-01/SN-1")).expect("a folder");
    found.push(place::clock(folder.path()));
    found.push(place::terminal());
    speak_all(&found, &[&names[..], &["none", "proc/none/records", "proc", "records", "DEMO-1"]].concat());
}

/// A bench file with mistakes, one that names nothing, and ports of all kinds with programs on them.
#[test]
fn what_is_wrong_with_a_bench() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_pty, device) = pseudo_terminal();
    let shown = device.display().to_string();
    let proc = folder.path().join("proc");
    process(&proc, 901, "minicom\0-D\0", &[&device]);
    let proc = Proc(proc);
    let text = |port: &str| {
        format!(
            "[station]\nid = \"line-2\"\n[socket]\nport = \"{port}\"\nrate = 921600\n[can]\nport = \"can9\"\n[scanner]\nport = \"{port}\"\n"
        )
    };
    let nothing = "[station]\nid = \"line-2\"\n".to_owned();
    let wrong = "[station]\nname = 1\n[socket]\nrate = \"fast\"\nport = 7\n".to_owned();
    let path = folder.path().join("bench.toml");
    let place = format!("{} {1} {1}/none.toml", path.display(), folder.path().display());
    let mut names: Vec<&str> = crate::phrases::english::latin(&place).collect();
    names.extend(crate::phrases::english::latin(&shown));
    names.extend([
        "can9",
        "minicom",
        "line-2",
        "id",
        "key",
        "plan",
        "records",
        "serial_number",
        "trusted_keys",
        "port",
        "rate",
        "latitude",
        "longitude",
        "height",
        "dev/ttyNOWHERE",
        "dev/null",
        "tmp",
        "none.toml",
    ]);
    for text in [text("/dev/ttyNOWHERE"), text("/dev/null"), text("/tmp"), text(&shown), nothing, wrong] {
        fs::write(&path, &text).expect("a file");
        speak_all(&look(Some(&path), Some(folder.path()), &Sys::default(), &proc), &names);
    }
    speak_all(&look(Some(&folder.path().join("none.toml")), Some(folder.path()), &Sys::default(), &proc), &names);
}
