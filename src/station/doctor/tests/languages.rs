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
use crate::doctor::{Health, Sys, look, place};

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
    // Root may write in /proc, and can make nothing there.
    let nowhere = place::records(Path::new("/proc/none/records"));
    assert_eq!(nowhere[0].health, Health::Bad, "{nowhere:?}");
    assert!(
        nowhere[0].what.starts_with("records cannot go to /proc/none/records: /proc is not writable ("),
        "{nowhere:?}"
    );
    assert!(!nowhere[0].mend.is_empty());
    found.extend(nowhere);
    let fresh = folder.path().join("none");
    assert_eq!(place::records(&fresh)[0].health, Health::Good);
    assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 0, "doctor leaves nothing behind");
    found.extend(place::records(folder.path()));
    fs::create_dir_all(folder.path().join("2026-11-22/DEMO-1/140500-functional")).expect("a folder");
    found.extend(place::records(folder.path()));
    found.extend(place::disk(folder.path()));
    found.push(place::clock(Some(folder.path())));
    fs::create_dir_all(folder.path().join("2999-01-01/SN-1")).expect("a folder");
    found.push(place::clock(Some(folder.path())));
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
            "[station]\nid = \"line-2\"\n[socket]\nport = \"{port}\"\nrate = \"921600 bit/s\"\n[can]\nport = \"can9\"\n[scanner]\nport = \"{port}\"\n"
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

/// A bench file that cannot be read decides where records go: no other folder is called good in its place.
#[test]
fn an_unreadable_bench_file_leaves_the_records_unknown() {
    let folder = tempfile::tempdir().expect("a folder");
    let no_process = Proc(folder.path().join("no_process"));
    let bench = folder.path().join("bench.toml");
    let told = |records: Option<&Path>| look(Some(&bench), records, &Sys::default(), &no_process);
    let goes =
        |found: &[crate::doctor::Finding]| found.iter().any(|finding| finding.what.starts_with("records go to "));
    for text in ["[station]\nid = 7\n", "no TOML ["] {
        fs::write(&bench, text).expect("a file");
        let found = told(None);
        assert!(!goes(&found), "{found:?}");
        let unknown = "where records go was not checked since the bench file decides that and could not be read";
        assert!(found.iter().any(|finding| finding.what == unknown && !finding.mend.is_empty()), "{found:?}");
        // The command line names the folder whatever the bench file says.
        assert!(goes(&told(Some(folder.path()))), "{found:?}");
    }
    fs::write(&bench, "[station]\nid = \"line-2\"\nrecords = \"here\"\n").expect("a file");
    let found = told(None);
    let here = format!("records go to {}, which the first run creates", folder.path().join("here").display());
    assert!(found.iter().any(|finding| finding.what == here), "{found:?}");
}

/// A key of another station that is missing or broken is found before the gate finds it, in each language.
#[test]
fn the_keys_that_a_bench_trusts_are_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let bench = "[station]\nid = \"line-2\"\ntrusted_keys = [\"a.pub\", \"b.pub\", \"c.pub\"]\n";
    let bench: gnc_executive::bench::BenchFile =
        gnc_executive::bench::BenchFile::read("bench.toml", bench.as_bytes().to_vec()).expect("a bench");
    fs::write(folder.path().join("b.pub"), "no key").expect("a file");
    // An Ed25519 key as RFC 8410 writes it.
    let der = [&b"\x30\x2a\x30\x05\x06\x03\x2b\x65\x70\x03\x21\x00"[..], &RFC_8410_KEY].concat();
    fs::write(folder.path().join("c.pub"), der).expect("a file");
    let found = crate::doctor::key::trusted(&bench, folder.path());
    let health: Vec<Health> = found.iter().map(|finding| finding.health).collect();
    assert_eq!(health, [Health::Bad, Health::Bad, Health::Good], "{found:?}");
    assert!(found[0].what.contains("a.pub") && found[1].what.contains("b.pub"), "{found:?}");
    assert!(found[..2].iter().all(|finding| !finding.mend.is_empty()), "{found:?}");
    let names = ["a.pub", "b.pub", "c.pub"].map(|name| folder.path().join(name).display().to_string()).join(" ");
    let names: Vec<&str> = crate::phrases::english::latin(&names).collect();
    let fingerprints = found[2].what.clone();
    let more: Vec<&str> = crate::phrases::english::latin(&fingerprints).filter(|word| word.len() > 12).collect();
    let own = ["Ed25519", "trusted_keys", "station", "DER"];
    speak_all(&found, &[&names[..], &more, &own].concat());
}

/// The public key of the example in RFC 8410, section 10.1.
const RFC_8410_KEY: [u8; 32] = [
    0x19, 0xbf, 0x44, 0x09, 0x69, 0x84, 0xcd, 0xfe, 0x85, 0x41, 0xba, 0xc1, 0x67, 0xdc, 0x3b, 0x96, 0xc8, 0x50, 0x86,
    0xaa, 0x30, 0xb6, 0xb6, 0xcb, 0x0c, 0x5c, 0x38, 0xad, 0x70, 0x31, 0x66, 0xe1,
];
