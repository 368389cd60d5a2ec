//! `export` says what it leaves out, and leaves nothing that is half an export.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use gnc_tests::{Place, Run, repository};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::{STATION, check};

/// A run with raw samples of two items, and its folder.
fn with_captures() -> (Place, PathBuf) {
    let place = Place::new(STATION);
    let plan = repository().join("tests/raw/short.toml");
    let plan = plan.to_string_lossy();
    let run = place.run(["--auto", &plan, "--sim", "--sim-speed", "max", "--serial-number", "T-1"]);
    check(&run, 0, &[]);
    let folder = place.runs().remove(0);
    (place, folder)
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder");
    let mut names: Vec<String> =
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

fn export(place: &Place, run: &Path, out: &str) -> Run {
    place.run(["export", &run.to_string_lossy(), "--out", out])
}

/// A file that is gone, is of another run, is a link, or cannot be read leaves the other one, and a script sees it.
#[test]
fn what_is_left_out_is_told() {
    let (place, run) = with_captures();
    check(&export(&place, &run, "whole"), 0, &["01-six-position-attempt-1.csv", "02-rotation-attempt-1.csv"]);
    assert_eq!(names(&place.path().join("whole")), ["01-six-position-attempt-1.csv", "02-rotation-attempt-1.csv"]);

    let (first, second) = (run.join("01-six-position/attempt-1.mcap"), run.join("02-rotation/attempt-1.mcap"));
    let (kept, bytes) = (place.path().join("kept.mcap"), fs::read(&second).expect("raw samples"));
    fs::rename(&first, &kept).expect("the same disk");
    // The last captures are not in it as a whole.
    let cut = bytes.len() * 9 / 10;
    let attacks: [(&str, &dyn Fn(), &str); 4] = [
        ("missing", &|| {}, "01-six-position/attempt-1.mcap is missing, so its samples are left out"),
        ("link", &|| symlink(&kept, &first).expect("a link"), "cannot be used"),
        ("text", &|| fs::write(&first, "no samples").expect("a file"), "it is damaged"),
        ("folder", &|| fs::create_dir(&first).expect("a folder"), "01-six-position/attempt-1.mcap is missing"),
    ];
    for (name, attack, why) in attacks {
        attack();
        let left = export(&place, &run, name);
        check(&left, 3, &[why, "left out", "02-rotation-attempt-1.csv", "try: "]);
        assert_eq!(names(&place.path().join(name)), ["02-rotation-attempt-1.csv"], "{name}");
        let _ = fs::remove_file(&first);
        let _ = fs::remove_dir(&first);
    }
    fs::copy(&kept, &first).expect("raw samples");
    fs::write(&second, &bytes[..cut]).expect("raw samples");
    check(&export(&place, &run, "cut"), 3, &["was cut off; the samples before the cut are exported"]);

    for file in [&first, &second] {
        fs::remove_file(file).expect("raw samples");
    }
    check(&export(&place, &run, "none"), 2, &["is missing", "holds no raw samples that can be exported"]);
    assert!(!place.path().join("none").exists() && !place.path().join("none.part").exists());
}

/// A full disk, here a limit on the size of files, and what is in the way leave nothing.
#[test]
fn a_failed_export_leaves_nothing() {
    let (place, run) = with_captures();
    for format in ["csv", "parquet"] {
        let script = "trap '' XFSZ; ulimit -f 64; exec \"$@\"";
        let mut limited = Command::new("bash");
        limited.args(["-c", script, "bash", STATION, "export", &run.to_string_lossy()]);
        limited.args(["--format", format, "--out", "new/out"]).current_dir(place.path()).env("LC_ALL", "C.UTF-8");
        let failed = limited.output().expect("bash");
        let said = String::from_utf8_lossy(&failed.stderr);
        assert_eq!(failed.status.code(), Some(2), "{said}");
        assert!(said.contains("new/out/01-six-position-attempt-1"), "{said}");
        assert!(!place.path().join("new").exists());
    }
    fs::create_dir(place.path().join("out.part")).expect("a folder");
    check(&export(&place, &run, "out"), 2, &["out.part is there: an export was killed, or another one goes on"]);
    assert!(!place.path().join("out").exists() && place.path().join("out.part").exists());
}

/// Another program has the raw samples on loan, so that the export waits for them while the signal comes.
const LENDER: &str = "import fcntl, signal, sys\n\
    held = open(sys.argv[1], 'r+b')\n\
    signal.signal(signal.SIGIO, lambda *_: print('asked', flush=True))\n\
    fcntl.fcntl(held, fcntl.F_SETLEASE, fcntl.F_WRLCK)\n\
    print('held', flush=True)\n\
    sys.stdin.readline()\n\
    fcntl.fcntl(held, fcntl.F_SETLEASE, fcntl.F_UNLCK)\n";

#[test]
fn an_interrupted_export_leaves_nothing() {
    let (place, run) = with_captures();
    for signal in [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP] {
        // The second file: that of the first one is written by then.
        let mut lender = Command::new("python3");
        lender.args(["-c", LENDER]).arg(run.join("02-rotation/attempt-1.mcap"));
        let mut lender = lender.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("python3");
        let mut told = BufReader::new(lender.stdout.take().expect("its output")).lines().map_while(Result::ok);
        assert_eq!(told.next().as_deref(), Some("held"));
        // Tests that run behind a shell may be started without the signal, and so would be the station.
        let mut export = Command::new("env");
        export.args(["--default-signal", STATION, "export", &run.to_string_lossy(), "--out", "out"]);
        export.current_dir(place.path()).env("LC_ALL", "C.UTF-8").stdout(Stdio::piped()).stderr(Stdio::piped());
        let export = export.spawn().expect("env of coreutils");
        assert_eq!(told.next().as_deref(), Some("asked"));
        assert_eq!(names(&place.path().join("out.part")), ["01-six-position-attempt-1.csv"]);
        kill(Pid::from_raw(i32::try_from(export.id()).expect("a process")), signal).expect("alive");
        drop(lender.stdin.take());
        let ended = export.wait_with_output().expect("the station");
        lender.wait().expect("python3");
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(4), "{signal}: {said}");
        assert!(said.contains("the export was interrupted, and nothing of it is left"), "{said}");
        assert!(ended.stdout.is_empty() && !place.path().join("out").exists(), "{signal}");
        assert!(!place.path().join("out.part").exists(), "{signal}");
    }
}
