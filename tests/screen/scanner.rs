//! Barcode readers: one that types as a keyboard does, and one at a serial port.

use std::fs::File;
use std::io::Write as _;
use std::path::Path;

use gnc_tests::Place;
use nix::fcntl::{OFlag, open as open_file};
use nix::pty::{PtyMaster, grantpt, posix_openpt, ptsname_r, unlockpt};
use nix::sys::stat::Mode;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};

use crate::terminal::Terminal;
use crate::{F1, F2, F5, F7, F9, F10, STATION, mock, open, outcomes};

const PLAN: &str =
    "name = \"short\"\nversion = \"1\"\n[[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"<= 0\"\n";

/// A key, and what the screen shows then.
type Step = (&'static [u8], &'static str);

fn screen(place: &Place, plan: &str) -> Terminal {
    place.write("p.toml", PLAN);
    let mut terminal = open(place, &["--sim", "--sim-speed", "max", "--plan", plan], 80, 24);
    terminal.wait_for("short 1");
    terminal
}

fn leaves(mut terminal: Terminal) {
    terminal.types(F10);
    let (status, restored) = terminal.end();
    assert!(restored && status.code() == Some(0), "{status}");
}

/// From every page and every layer the scan is the serial number, whatever frame it has, and nothing else happens.
#[test]
fn scans_reach_the_number_from_every_page() {
    let place = Place::new(STATION);
    let mut terminal = screen(&place, "p.toml");
    let ways: [(&[Step], &[u8]); 8] = [
        (&[], b"]C1SN-0001\r\n"),
        (&[(F9, "[Live]")], b"\x02SN-0002\x03"),
        (&[(F9, "[Live]"), (F9, "[Records]")], b"SN-0003\t"),
        (&[(F9, "[Live]"), (F9, "[Records]")], b"\xef\xbb\xbfSN-0004\n\r"),
        (&[(F1, "Help ─")], b"\x1dSN-0005\r"),
        (&[(F9, "[Live]"), (F1, "Help ─")], b"\x1b[15~SN-0006\r"),
        (&[(F9, "[Live]"), (F9, "[Records]"), (F1, "Help ─")], b"SN-0007\x1b[21~\r"),
        (&[], b"SN-0008\0\r"),
    ];
    for (index, (way, code)) in ways.into_iter().enumerate() {
        for (key, seen) in way {
            terminal.types(key);
            terminal.wait_for(seen);
        }
        terminal.types(code);
        terminal.wait_for(&format!(" SN-000{}: F5 starts the test.", index + 1));
    }
    // Not from within a form either, where it falls into no field and does not take the form.
    terminal.types(F2);
    terminal.wait_for("Rounds");
    terminal.types(b"SN-0009\r");
    terminal.wait_for("SN-0009 was scanned as the serial number.");
    assert!(terminal.text().contains("p.toml_"), "{}", terminal.text());
    terminal.types(b"\x1b");
    terminal.wait_until("the form is gone", |screen| !screen.contents().contains("p.toml_"));
    assert!(place.runs().is_empty(), "a scan started a run");
    leaves(terminal);
}

/// What is no number, or none of this plan, is told and takes nothing.
#[test]
fn bad_scans_are_told() {
    let place = Place::new(STATION);
    place.write("q.toml", &PLAN.replace("version", "serial_number = \"SN-[0-9]{4}\"\nversion"));
    let mut terminal = screen(&place, "q.toml");
    for (code, told) in [
        ("ЫТ-0001\r", "the scanner types in another layout"),
        ("ＳＮ－０００１\r", "Switch to English, scan again."),
        // A field that fits the pattern would be taken.
        ("]d221XN-0001\u{1d}10LOT5\r", "several fields: 21XN-0"),
        ("SN-00011\r", "SN-00011 is no serial number here, it must fit SN-[0-9]{4}"),
        ("SN\x1b[15~01\r", "control characters"),
    ] {
        terminal.types(code.as_bytes());
        terminal.wait_for(told);
        assert!(terminal.text().contains("scan the label"), "{}", terminal.text());
    }
    leaves(terminal);
    assert!(place.runs().is_empty());
    let run = |number: &str| place.run(["--auto", "q.toml", "--sim", "--sim-speed", "max", "--serial-number", number]);
    let refused = run("SN-00011");
    assert_eq!(refused.code, Some(2), "{}", refused.stderr);
    assert!(
        refused.stderr.contains("\"SN-00011\" does not fit the pattern SN-[0-9]{4} of the plan"),
        "{}",
        refused.stderr
    );
    assert!(place.runs().is_empty());
    assert_eq!(run("SN-0001").code, Some(0));
}

/// While the module waits for the operator, scans answer nothing. F7 says that it cannot be done.
#[test]
fn a_scan_answers_no_question() {
    let place = Place::new(STATION);
    let board = mock("good");
    place.write("bench.toml", &board.bench_file("line-2"));
    place.write("p.toml", &PLAN.replace("limits", "prompt = \"Close the lid.\"\nlimits"));
    let mut terminal = open(&place, &["--plan", "p.toml"], 80, 24);
    terminal.wait_for("short 1");
    terminal.types(b"T-1\r");
    terminal.types(F5);
    terminal.wait_for("Close the lid.");
    for (code, next) in [("SN-0002\r\n", "SN-0002"), ("\x02SN-0003\x03\r", "SN-0003"), ("SN-0004\x1b[18~\r", "SN-0004")]
    {
        terminal.types(code.as_bytes());
        terminal.wait_for(&format!("{next} comes next"));
        assert!(terminal.text().contains("Close the lid."), "{}", terminal.text());
    }
    terminal.types(F7);
    terminal.wait_for("the operator could not do this: Close the lid.");
    terminal.wait_for("F4 Repeat");
    leaves(terminal);
    assert_eq!(outcomes(&place), ["errored"]);
}

/// A scanner at a serial port: a pseudo-terminal behind a link, as udev makes one.
struct Scanner {
    master: PtyMaster,
    /// Keeps the other end, so that the station is not the only one that holds it.
    _slave: std::os::fd::OwnedFd,
}

impl Scanner {
    fn plugged_in(link: &Path) -> Self {
        let flags = OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_CLOEXEC;
        let master = posix_openpt(flags).expect("a pseudo-terminal");
        grantpt(&master).expect("its other end");
        unlockpt(&master).expect("its other end");
        let name = ptsname_r(&master).expect("its name");
        let slave = open_file(name.as_str(), flags, Mode::empty()).expect("its other end");
        let mut raw = tcgetattr(&slave).expect("settings");
        cfmakeraw(&mut raw);
        tcsetattr(&slave, SetArg::TCSANOW, &raw).expect("settings");
        let _ = std::fs::remove_file(link);
        std::os::unix::fs::symlink(name, link).expect("a link");
        Self { master, _slave: slave }
    }

    fn scans(&self, code: &[u8]) {
        let fd = nix::unistd::dup(&self.master).expect("its end");
        File::from(fd).write_all(code).expect("the station reads");
    }
}

/// It is read beside the keyboard, and is told once when it goes and once when it is back.
#[test]
fn a_scanner_at_a_serial_port() {
    let place = Place::new(STATION);
    let board = mock("good");
    let link = place.path().join("scanner");
    let port = link.display();
    place.write("bench.toml", &format!("{}\n[scanner]\nport = \"{port}\"\n", board.bench_file("line-2")));
    place.write("p.toml", PLAN);
    let mut terminal = open(&place, &["--plan", "p.toml"], 80, 24);
    terminal.wait_for("short 1");
    terminal.wait_for("The scanner is not there, so type the number: there is no port");
    let scanner = Scanner::plugged_in(&link);
    terminal.wait_for("is there again.");
    scanner.scans(b"]C1SN-0001\r\n");
    terminal.wait_for("SN-0001: F5 starts the test.");
    terminal.types(b"T-2\r");
    terminal.wait_for("T-2: F5 starts the test.");
    // On another page, and without a line end: the number waits for F5 or Enter.
    terminal.types(F9);
    scanner.scans(b"\x02SN-0003\x03");
    terminal.wait_for("SN-0003: F5 starts the test.");
    scanner.scans(b"SN-00");
    terminal.wait_for("This scan has no line end, those before had: compare SN-00");
    drop(scanner);
    terminal.wait_for("The scanner is not there");
    let scanner = Scanner::plugged_in(&link);
    terminal.wait_for("is there again.");
    scanner.scans(b"T-1\r");
    terminal.wait_for("T-1: F5 starts the test.");
    assert!(place.runs().is_empty(), "a scan started a run");
    leaves(terminal);
}
