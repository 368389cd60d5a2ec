//! Each kind of file that a person names or the station keeps, each in every wrong state: the message names the file and the cause,
//! and the hint fits. A person reads the snapshots.

use std::fs;
use std::os::unix::fs::{PermissionsExt as _, chown, symlink};
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};

use gnc_tests::{Place, UNPRIVILEGED, without_rights};
use insta::assert_snapshot;

use super::STATION;

/// A file that no reader should read to its end.
const SPARSE_BYTES: u64 = 2 << 30;
/// No message is longer.
const LONGEST: usize = 16_000;

const PLAN: &str =
    "name = \"p\"\nversion = \"1\"\n[[item]]\nid = \"cpu\"\n[item.limits]\ncore1_register_errors = \"== 0\"\n";
const BENCH: &str = "[station]\nid = \"a\"\nrecords = \"records\"\n";
const SOCKET: &str = "[socket]\nport = \"/dev/ttyNOWHERE\"\n";
const SIM: [&str; 6] = ["--sim-speed", "max", "--serial-number", "T-1", "--only", "cpu"];

/// What is wrong with a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wrong {
    Missing,
    Folder,
    Pipe,
    Device,
    Circle,
    Denied,
    Empty,
    Rubbish,
    Sparse,
}

use Wrong::{Circle, Denied, Device, Empty, Folder, Missing, Pipe, Rubbish, Sparse};

const ALL: [Wrong; 9] = [Missing, Folder, Pipe, Device, Circle, Denied, Empty, Rubbish, Sparse];

impl Wrong {
    /// Brings the file into this state.
    fn make(self, path: &Path) {
        if self != Denied && path.symlink_metadata().is_ok() {
            let removed = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
            removed.expect("nothing in the way");
        }
        match self {
            Missing => Ok(()),
            Folder => fs::create_dir(path),
            Pipe => nix::unistd::mkfifo(path, nix::sys::stat::Mode::S_IRWXU).map_err(Into::into),
            Device => symlink("/dev/zero", path),
            Circle => symlink(path.file_name().expect("a name"), path),
            Denied => fs::set_permissions(path, fs::Permissions::from_mode(0o000)),
            Empty => fs::write(path, ""),
            Rubbish => fs::write(path, (0..=255).cycle().take(10_000).collect::<Vec<u8>>()),
            Sparse => fs::File::create(path).and_then(|file| file.set_len(SPARSE_BYTES)),
        }
        .expect("a file in this state");
    }
}

/// Gives the folder and all in it to the user without rights.
fn give_away(folder: &Path) {
    if let Ok(entries) = fs::read_dir(folder) {
        for entry in entries.flatten() {
            give_away(&entry.path());
        }
    }
    if !folder.is_symlink() {
        chown(folder, Some(UNPRIVILEGED), Some(UNPRIVILEGED)).expect("the rights of root");
    }
}

/// Runs a command; `denied`: without the rights of root.
fn run(place: &Place, args: &[&str], denied: bool) -> Output {
    if !denied {
        return place.station(args).output().expect("the station");
    }
    let mut command = without_rights(STATION, place.path());
    command.args(args).current_dir(place.path()).stdin(Stdio::null()).env("NO_COLOR", "1").env("LC_ALL", "C.UTF-8");
    command.output().expect("the station")
}

/// The run's folder and its day.
fn only_run(place: &Place) -> (String, String) {
    let runs = place.runs();
    let run = runs[0].strip_prefix(place.path()).expect("below").to_owned();
    let day = run.components().nth(1).expect("a day").as_os_str().to_string_lossy().into_owned();
    (run.to_string_lossy().into_owned(), day)
}

/// A kind of file: how its place is made and where it lies in it, and the commands that come to it.
struct Kind<'k> {
    make: &'k dyn Fn(&Place) -> PathBuf,
    commands: &'k [&'k [&'k str]],
    /// The lines that speak of it.
    about: &'k [&'k str],
    wrong: &'k [Wrong],
}

/// What is said of the file in each wrong state.
fn said(kind: &Kind<'_>) -> String {
    let mut all = String::new();
    for wrong in kind.wrong {
        let place = Place::new(STATION);
        let path = place.path().join((kind.make)(&place));
        let names = if place.path().join("records/COUNTER").exists() { Some(only_run(&place)) } else { None };
        wrong.make(&path);
        if *wrong == Denied && nix::unistd::geteuid().is_root() {
            give_away(place.path());
        }
        for args in kind.commands {
            let output = run(&place, args, *wrong == Denied);
            let text =
                [&output.stdout[..], &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned()).concat();
            assert!(text.len() < LONGEST && !text.contains("panicked"), "{wrong:?} {args:?}: {text}");
            let code = output.status.code().unwrap_or_else(|| panic!("{wrong:?} {args:?} was killed: {text}"));
            let mut text = text.replace(&*place.path().to_string_lossy(), "PLACE");
            if let Some((run, day)) = &names {
                text = text.replace(run, "RUN").replace(run.trim_start_matches("records/"), "RUN").replace(day, "DAY");
            }
            // The day of a run that was not begun, YYYY-MM-DD.
            while let Some(at) = text.find("records/20") {
                let day = at + "records/".len();
                text.replace_range(day..(day + 10).min(text.len()), "DAY");
            }
            let lines = text.lines().filter(|line| {
                kind.about.is_empty()
                    || line.starts_with("  try: ")
                    || kind.about.iter().any(|word| line.contains(word))
            });
            all.push_str(&format!("# {wrong:?}: {} -> {code}\n", args.join(" ")));
            lines.for_each(|line| all.push_str(&format!("{}\n", line.trim_end())));
        }
        if *wrong == Denied {
            // The folder can be removed again.
            let _ = fs::set_permissions(&path, fs::Permissions::from_mode(0o700));
        }
    }
    all
}

fn with_plan(place: &Place, plan: &str) -> PathBuf {
    place.write("p.toml", plan);
    PathBuf::from("p.toml")
}

#[test]
fn files_of_plans() {
    let auto = [&["--auto", "p.toml", "--sim"][..], &SIM].concat();
    let plan = Kind {
        make: &|place| with_plan(place, PLAN),
        commands: &[&["plan", "check", "p.toml"], &auto],
        about: &[],
        wrong: &ALL,
    };
    assert_snapshot!("file-plan", said(&plan));
    let include = Kind {
        make: &|place| {
            with_plan(place, &format!("include = [\"i.toml\"]\n{PLAN}"));
            place.write("i.toml", "");
            "i.toml".into()
        },
        commands: &[&["plan", "check", "p.toml"]],
        about: &[],
        wrong: &ALL,
    };
    assert_snapshot!("file-include", said(&include));
    let outside = Kind {
        make: &|place| {
            fs::create_dir(place.path().join("d")).expect("a folder");
            place.write("d/p.toml", &format!("include = [\"../i.toml\"]\n{PLAN}"));
            place.write("i.toml", "");
            "i.toml".into()
        },
        commands: &[&["plan", "check", "d/p.toml"]],
        about: &[],
        wrong: &[Missing, Pipe, Circle, Empty],
    };
    assert_snapshot!("file-include-outside", said(&outside));
    let picture = Kind {
        make: &|place| {
            let ask = "[[item.ask]]\nname = \"lid\"\nen = \"Look.\"\nkind = \"done\"\npicture = \"lid.png\"\n";
            with_plan(place, &format!("name = \"p\"\nversion = \"1\"\n[[item]]\nid = \"prompt\"\n{ask}"));
            place.write("lid.png", "x");
            "lid.png".into()
        },
        commands: &[&["plan", "check", "p.toml"]],
        about: &["lid.png", "   = try:", "no mistake"],
        wrong: &ALL,
    };
    assert_snapshot!("file-picture", said(&picture));
}

#[test]
fn files_of_benches() {
    let bench = Kind {
        make: &|place| {
            with_plan(place, PLAN);
            place.write("bench.toml", BENCH);
            "bench.toml".into()
        },
        commands: &[&["--auto", "p.toml", "--serial-number", "T"], &["doctor"], &["plan", "check", "p.toml"]],
        about: &["bench", "bytes"],
        wrong: &[Folder, Pipe, Device, Circle, Denied, Empty, Rubbish, Sparse],
    };
    assert_snapshot!("file-bench", said(&bench));
    let auto = [&["--auto", "p.toml", "--sim=b.toml"][..], &SIM].concat();
    let board = Kind {
        make: &|place| {
            with_plan(place, PLAN);
            place.write("b.toml", "");
            "b.toml".into()
        },
        commands: &[&auto],
        about: &["b.toml"],
        wrong: &ALL,
    };
    assert_snapshot!("file-board", said(&board));
    let playback = Kind {
        make: &|place| {
            with_plan(place, PLAN);
            place.write("b.toml", "[gnss]\nplayback = \"x.nmea\"\n");
            place.write("x.nmea", "");
            "x.nmea".into()
        },
        commands: &[&auto],
        about: &["x.nmea", "   = try:"],
        wrong: &[Missing, Folder, Pipe, Device, Circle, Denied, Empty, Sparse],
    };
    assert_snapshot!("file-playback", said(&playback));
    let hook = Kind {
        make: &|place| {
            place.write("bench.toml", &format!("{BENCH}[verdict]\nhook = [\"./light.sh\"]\n"));
            let hook = place.write("light.sh", "#!/bin/sh\n");
            fs::set_permissions(hook, fs::Permissions::from_mode(0o755)).expect("rights");
            "light.sh".into()
        },
        commands: &[&["doctor"]],
        about: &["hook"],
        wrong: &ALL,
    };
    assert_snapshot!("file-hook", said(&hook));
}

/// A built-in board that is spelled wrong.
#[test]
fn a_board_of_another_name_is_guessed() {
    let place = Place::new(STATION);
    with_plan(&place, PLAN);
    let run = place.run([&["--auto", "p.toml", "--sim=gyro-stuk"][..], &SIM].concat());
    assert_snapshot!("file-board-name", run.stderr);
}

fn with_key(place: &Place) {
    with_plan(place, PLAN);
    place.write("bench.toml", &format!("{BENCH}key = \"k\"\n{SOCKET}"));
    assert_eq!(place.run(["records", "key", "k"]).code, Some(0));
    fs::create_dir(place.path().join("records")).expect("a folder");
}

#[test]
fn files_of_keys() {
    let key = Kind {
        make: &|place| {
            with_key(place);
            "k".into()
        },
        commands: &[&["--auto", "p.toml", "--serial-number", "T"], &["doctor"]],
        about: &["key"],
        wrong: &ALL,
    };
    assert_snapshot!("file-key", said(&key));
    let public = Kind {
        make: &|place| {
            with_key(place);
            "k.pub".into()
        },
        commands: &[&["doctor"], &["records", "verify", "--key", "k.pub"]],
        about: &["k.pub"],
        wrong: &ALL,
    };
    assert_snapshot!("file-public-key", said(&public));
}

/// `doctor` tries the key as a run would, says its fingerprint, and finds the halves of two keys.
#[test]
fn the_doctor_tries_the_key() {
    let place = Place::new(STATION);
    with_key(&place);
    let at = |name: &str| place.path().join(name);
    let doctor = || place.run(["doctor"]).stdout;
    let digest = std::process::Command::new("sha256sum").arg(at("k.pub")).output().expect("sha256sum").stdout;
    let digest = String::from_utf8_lossy(&digest).split(' ').next().unwrap_or_default().to_owned();
    assert!(
        doctor().contains(&format!("ok       the key k signs; the fingerprint of its public half is {digest}\n")),
        "{}",
        doctor()
    );
    let about = |said: String| {
        said.lines().filter(|line| line.contains('k')).map(|line| line.replace(&digest, "ITS")).collect::<Vec<_>>()
    };
    let line = |said: String, word: &str| {
        about(said).into_iter().find(|line| line.contains(word)).unwrap_or_else(|| panic!("no {word}"))
    };
    let mut all = Vec::new();
    // The public half in place of the private one; the private one in place of the public one; others may read it.
    place.write("bench.toml", &format!("{BENCH}key = \"k.pub\"\n{SOCKET}"));
    all.push(line(doctor(), "half"));
    place.write("bench.toml", &format!("{BENCH}key = \"k\"\n{SOCKET}"));
    fs::set_permissions(at("k"), fs::Permissions::from_mode(0o644)).expect("rights");
    all.push(line(doctor(), "chmod"));
    fs::set_permissions(at("k"), fs::Permissions::from_mode(0o600)).expect("rights");
    let public = fs::read(at("k.pub")).expect("a key");
    fs::copy(at("k"), at("k.pub")).expect("a key");
    all.push(line(doctor(), "k.pub"));
    // The public half of another key, made by another station.
    assert_eq!(place.run(["records", "key", "other"]).code, Some(0));
    fs::remove_file(at("k.pub")).expect("a key");
    assert!(!doctor().contains("k.pub"), "it may be kept elsewhere: {}", doctor());
    fs::copy(at("other.pub"), at("k.pub")).expect("a key");
    let other = line(doctor(), "another key");
    let (before, rest) = other.split_once('(').expect("a digest");
    all.push(format!("{before}(OTHER{}", &rest[64..]));
    fs::write(at("k.pub"), public).expect("a key");
    // A link to the key is followed, as a run does.
    fs::rename(at("k"), at("real")).expect("a key");
    symlink("real", at("k")).expect("a link");
    assert!(doctor().contains("the key k signs"), "{}", doctor());
    assert_snapshot!("doctor-key", all.join("\n"));
}

fn with_run(place: &Place) {
    with_plan(place, PLAN);
    let run = place.run([&["--auto", "p.toml", "--sim"][..], &SIM].concat());
    assert_eq!(run.code, Some(5), "{}{}", run.stdout, run.stderr);
}

#[test]
fn files_of_records() {
    let auto = [&["--auto", "p.toml", "--sim"][..], &SIM].concat();
    let hurt = [Folder, Pipe, Device, Circle, Denied, Sparse];
    let chain = Kind {
        make: &|place| {
            with_run(place);
            format!("records/{}/CHAIN", only_run(place).1).into()
        },
        commands: &[&["doctor"], &["records", "list"], &auto],
        about: &["CHAIN"],
        wrong: &hurt,
    };
    assert_snapshot!("file-chain", said(&chain));
    let counter = Kind {
        make: &|place| {
            with_run(place);
            "records/COUNTER".into()
        },
        commands: &[&["doctor"], &["records", "verify"], &auto],
        about: &["COUNTER"],
        wrong: &[Missing, Folder, Pipe, Device, Circle, Denied, Empty, Rubbish, Sparse],
    };
    assert_snapshot!("file-counter", said(&counter));
    let run_json = Kind {
        make: &|place| {
            with_run(place);
            format!("{}/run.json", only_run(place).0).into()
        },
        commands: &[&["records", "verify"]],
        about: &["run.json"],
        wrong: &[Missing, Pipe, Device, Circle, Denied, Empty, Rubbish],
    };
    assert_snapshot!("file-run-json", said(&run_json));
    let folder = Kind {
        make: &|place| {
            with_plan(place, PLAN);
            fs::create_dir(place.path().join("records")).expect("a folder");
            "records".into()
        },
        commands: &[&["doctor"], &["records", "list"], &auto],
        about: &["cannot go to", "records folder", "cannot create", "cannot read records"],
        wrong: &[Pipe, Device, Circle, Denied, Empty],
    };
    assert_snapshot!("file-records", said(&folder));
}

#[test]
fn files_of_tables() {
    let table = Kind {
        make: &|place| {
            place.write("t.csv", "a\n1\n");
            "t.csv".into()
        },
        commands: &[&["compute", "allan", "t.csv", "--rate", "100", "--column", "a"]],
        about: &[],
        wrong: &ALL,
    };
    assert_snapshot!("file-table", said(&table));
}
