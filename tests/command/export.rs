//! `export` says what it leaves out, and leaves nothing that is half an export.

use std::fs::{self, File};
use std::io::{BufRead as _, BufReader, Write as _};
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
    check(&export(&place, &run, "cut"), 3, &["02-rotation/attempt-1.mcap", EXCHANGED, "left out"]);
    assert_eq!(names(&place.path().join("cut")), ["01-six-position-attempt-1.csv"]);

    for file in [&first, &second] {
        fs::remove_file(file).expect("raw samples");
    }
    check(&export(&place, &run, "none"), 2, &["is missing", "holds no raw samples that can be exported"]);
    assert!(!place.path().join("none").exists() && !place.path().join("none.part").exists());
}

/// What is said of a file that is not the one of the closed run.
const EXCHANGED: &str = "it is another file than the one whose digest stands in SHA256SUMS";

/// Copies a folder with all that it holds.
fn copy(from: &Path, to: &Path) {
    assert!(Command::new("cp").arg("-r").args([from, to]).status().expect("cp").success());
}

/// Another whole capture file of the same run in the place of one: nothing in it is damaged, and it names the right run.
#[test]
fn a_whole_file_that_was_exchanged_is_left_out() {
    let (place, run) = with_captures();
    let (first, second) = (run.join("01-six-position/attempt-1.mcap"), run.join("02-rotation/attempt-1.mcap"));
    // While the station is killed there are no digests, and nothing but the journal says what was captured.
    let killed = place.path().join("killed");
    copy(&run, &killed);
    fs::remove_file(killed.join("SHA256SUMS")).expect("digests");
    let in_killed = |file: &Path| killed.join(file.strip_prefix(&run).expect("a file of the run"));
    fs::copy(&second, &first).expect("raw samples");
    let said = ["01-six-position/attempt-1.mcap", EXCHANGED, "they are left out", "02-rotation-attempt-1.csv"];
    check(&export(&place, &run, "changed"), 3, &said);
    assert_eq!(names(&place.path().join("changed")), ["02-rotation-attempt-1.csv"]);
    // The same file is refused where figures are made of it.
    let first_file = first.to_string_lossy().into_owned();
    let computed = place.run(["compute", "six-position", &first_file, "--gravity", "9.8", "--json"]);
    check(&computed, 2, &[EXCHANGED]);

    // Its digest is made anew: the journal and the chain say otherwise.
    let sums = Command::new("sh").args(["-c", "grep -v '  01-six-position/attempt-1.mcap' SHA256SUMS > s; sha256sum 01-six-position/attempt-1.mcap >> s; sort -k 2 s > SHA256SUMS; rm s"]).current_dir(&run).status();
    assert!(sums.expect("sh").success());
    let none = export(&place, &run, "none");
    check(&none, 2, &["SHA256SUMS is not the one that stands in the chain", "no raw samples that can be exported"]);
    let alone = place.path().join("alone");
    copy(&run, &alone);
    let said = ["it is another file than the one whose digest stands in the journal"];
    check(&export(&place, &alone, "alone-out"), 3, &said);
    assert_eq!(names(&place.path().join("alone-out")), ["02-rotation-attempt-1.csv"]);

    // What lies behind the last whole capture of a killed run is not read, and the rest is.
    let mut behind = File::options().append(true).open(in_killed(&second)).expect("raw samples");
    behind.write_all(&fs::read(&first).expect("raw samples")).expect("raw samples");
    check(&export(&place, &killed, "whole"), 0, &["whole/02-rotation-attempt-1.csv"]);
    let rows = |out: &str| fs::read(place.path().join(out).join("02-rotation-attempt-1.csv")).expect("a table");
    assert_eq!(rows("whole"), rows("changed"));
    fs::copy(&second, in_killed(&first)).expect("raw samples");
    fs::create_dir(killed.join("03-more")).expect("a folder");
    fs::copy(&second, killed.join("03-more/attempt-1.mcap")).expect("raw samples");
    let said = ["whose digest stands in the journal", "03-more/attempt-1.mcap", "the journal does not name it"];
    check(&export(&place, &killed, "some"), 3, &said);
    assert_eq!(names(&place.path().join("some")), ["02-rotation-attempt-1.csv"]);
    fs::remove_file(in_killed(&second)).expect("raw samples");
    let none = export(&place, &killed, "gone");
    check(&none, 2, &["02-rotation/attempt-1.mcap is missing", "no raw samples that can be exported"]);
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
