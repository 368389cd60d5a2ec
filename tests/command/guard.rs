//! Inputs that may not hang the program, files that lead elsewhere, limits of the system, and signals that end it.

use std::fs::{self, File, Permissions};
use std::io::{BufRead as _, BufReader};
use std::os::unix::fs::{PermissionsExt as _, symlink};
use std::process::{Command, Stdio};

use gnc_tests::{Place, functional_plan};
use nix::sys::signal::{Signal, kill};
use nix::sys::stat::Mode;
use nix::unistd::{Pid, Uid};

use super::{STATION, check};

/// User and group without any other process.
const LONELY: &str = "65531";
/// Another user of that kind: tests run at the same time.
const ALONE: &str = "65532";
/// Fewer threads than a run takes.
const FEW: &str = "--nproc=6";

/// A pipe without a writer would hang each of these commands, and a device has no end. Each says at once what it was given.
#[test]
fn what_is_no_file_is_refused_at_once() {
    let place = Place::new(STATION);
    nix::unistd::mkfifo(&place.path().join("pipe"), Mode::S_IRWXU).expect("a pipe");
    symlink("/dev/zero", place.path().join("device")).expect("a link");
    fs::create_dir(place.path().join("folder")).expect("a folder");
    let plan = functional_plan().to_string_lossy().into_owned();
    for (file, what) in [("pipe", "it is a pipe"), ("device", "it is a device"), ("folder", "it is a folder")] {
        place.write("includes.toml", &format!("name = \"n\"\nversion = \"1\"\ninclude = [\"{file}\"]\n"));
        let sim = format!("--sim={file}");
        place.write("board.toml", &format!("description = \"d\"\n[gnss]\nplayback = \"{file}\"\n"));
        let commands: [&[&str]; 9] = [
            &["--auto", file, "--sim", "--serial-number", "A"],
            &["--auto", &plan, "--bench", file, "--serial-number", "A"],
            &["--auto", &plan, &sim, "--serial-number", "A"],
            &["--auto", &plan, "--sim=board.toml", "--allow-outside", "--serial-number", "A"],
            &["plan", "check", file],
            &["plan", "check", "includes.toml", "--allow-outside"],
            &["compute", "allan", file, "--rate", "100", "--column", "x"],
            &["compute", "tilt-budget", file],
            &["records", "list", "--bench", file],
        ];
        for command in commands {
            let run = place.run(command);
            check(&run, 2, &[what]);
        }
        check(&place.run(["doctor", "--bench", file]), 1, &[what]);
    }
}

/// Includes, pictures and playbacks lie in the folder of the file that names them, unless the command line allows more. A link
/// counts by its end.
#[test]
fn a_plan_stays_in_its_folder() {
    let place = Place::new(STATION);
    let item = "[[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"<= 0\"\n";
    let head = "name = \"n\"\nversion = \"1\"\n";
    for folder in ["plans", "plans/below"] {
        fs::create_dir(place.path().join(folder)).expect("a folder");
    }
    for file in ["other.toml", "plans/beside.toml", "plans/below/deep.toml"] {
        place.write(file, &format!("name = \"i\"\nversion = \"1\"\n{item}"));
    }
    symlink("../other.toml", place.path().join("plans/out.toml")).expect("a link");
    symlink("below/deep.toml", place.path().join("plans/in.toml")).expect("a link");
    let outside = "outside of the plan's folder, and only --allow-outside allows that";
    for (include, stays) in [
        ("beside.toml", true),
        ("below/deep.toml", true),
        ("in.toml", true),
        ("out.toml", false),
        ("../other.toml", false),
    ] {
        place.write("plans/plan.toml", &format!("{head}include = [\"{include}\"]\n"));
        let run = place.run(["plan", "check", "plans/plan.toml", "--sim"]);
        if stays {
            check(&run, 0, &["no mistake"]);
        } else {
            check(&run, 2, &[outside]);
        }
        let args = ["--auto", "plans/plan.toml", "--sim", "--sim-speed", "max", "--serial-number", "A"];
        let run = place.run(args);
        if stays {
            check(&run, 0, &[]);
        } else {
            check(&run, 2, &[outside]);
        }
        check(&place.run(["plan", "check", "plans/plan.toml", "--sim", "--allow-outside"]), 0, &["no mistake"]);
        check(&place.run(args.into_iter().chain(["--allow-outside"])), 0, &[]);
    }
    let ask =
        "[[item]]\nid = \"prompt\"\nname = \"p\"\n[[item.ask]]\nname = \"lid\"\nen = \"Close.\"\nkind = \"done\"\n";
    place.write("lid.png", "picture");
    place.write("plans/plan.toml", &format!("{head}{ask}picture = \"../lid.png\"\n"));
    check(&place.run(["plan", "check", "plans/plan.toml"]), 2, &["which lies outside of the plan's folder"]);
    check(&place.run(["plan", "check", "plans/plan.toml", "--allow-outside"]), 0, &["no mistake"]);
}

/// The command that names the option has it.
#[test]
fn a_board_stays_in_its_folder() {
    let place = Place::new(STATION);
    fs::create_dir(place.path().join("boards")).expect("a folder");
    place.write("boards/board.toml", "description = \"d\"\n[gnss]\nplayback = \"../fix.nmea\"\n");
    place.write("fix.nmea", include_str!("../../hw-mocks/receivers/no-fix.nmea"));
    let plan = functional_plan().to_string_lossy().into_owned();
    let check_board = ["board", "check", "--sim=boards/board.toml", "--only", "hello"];
    let auto = [
        "--auto",
        &plan,
        "--sim=boards/board.toml",
        "--serial-number",
        "A",
        "--only",
        "identity",
        "--sim-speed",
        "max",
    ];
    let outside = "it lies outside of the folder of the board's file, and only --allow-outside allows that";
    check(&place.run(check_board), 2, &[outside]);
    check(&place.run(auto), 2, &[outside]);
    check(&place.run(check_board.into_iter().chain(["--allow-outside"])), 0, &["passed, 0 failed"]);
    check(&place.run(auto.into_iter().chain(["--allow-outside"])), 5, &[]);
    let russian = place.station(check_board).env("LC_ALL", "ru_RU.UTF-8").output().expect("the station");
    let said = String::from_utf8_lossy(&russian.stderr).into_owned();
    assert!(said.contains("он лежит вне папки файла платы"), "{said}");
}

/// The run is stopped, and waits for the lock of the records, which another program holds. Two signals end it if it hears nothing
/// while it waits; if it heard them and closes its record, it says so, and a third one ends it. Otherwise it would end by
/// itself some seconds later, with exit code 3.
#[test]
fn signals_end_a_run_that_waits() {
    let place = Place::new(STATION);
    let records = place.path().join("records");
    fs::create_dir(&records).expect("a folder");
    let plan = functional_plan().to_string_lossy().into_owned();
    let args = ["--auto", &plan, "--sim", "--sim-speed", "max", "--serial-number", "A", "--events"];
    let mut station = place.station(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the station");
    let mut events = BufReader::new(station.stdout.take().expect("its output")).lines();
    assert!(events.any(|line| line.is_ok_and(|line| line.contains("run_started"))));
    let lock = File::open(&records).expect("a folder");
    lock.lock().expect("a lock");
    let pid = Pid::from_raw(i32::try_from(station.id()).expect("a process"));
    // Two signals of one kind at the same moment are one.
    for signal in [Signal::SIGINT, Signal::SIGTERM] {
        kill(pid, signal).expect("alive");
    }
    let mut said = Vec::new();
    for line in BufReader::new(station.stderr.take().expect("its errors")).lines().map_while(Result::ok) {
        if line.contains("the run is stopped, and its record is being closed") {
            kill(pid, Signal::SIGINT).expect("not waited for yet");
        }
        said.push(line);
    }
    let ended = station.wait().expect("its end");
    drop(lock);
    assert_eq!(ended.code(), Some(4), "{said:?}");
}

/// What has no run ends at the first signal.
#[test]
fn one_signal_ends_a_command_without_a_run() {
    use std::os::unix::process::ExitStatusExt as _;
    let place = Place::new(STATION);
    let mut compute = place
        .station(["compute", "allan", "-", "--rate", "100", "--column", "x"])
        .stdin(Stdio::piped())
        .spawn()
        .expect("the station");
    let pid = Pid::from_raw(i32::try_from(compute.id()).expect("a process"));
    // A shell may have programs behind it pass over SIGINT.
    kill(pid, Signal::SIGTERM).expect("alive");
    assert_eq!(compute.wait().expect("its end").signal(), Some(15));
}

/// The system has too few threads for the end of a run: that is said before anything is switched on.
#[test]
fn too_few_threads_refuse_the_run() {
    let place = Place::new(STATION);
    fs::set_permissions(place.path(), Permissions::from_mode(0o777)).expect("rights");
    let plan = functional_plan().to_string_lossy().into_owned();
    let mut command = if Uid::effective().is_root() {
        // The limit does not hold for root.
        let mut command = Command::new("setpriv");
        command.args(["--reuid", LONELY, "--regid", LONELY, "--clear-groups", "prlimit"]);
        command
    } else {
        Command::new("prlimit")
    };
    command.args([FEW, STATION, "--auto", &plan, "--sim", "--sim-speed", "max", "--serial-number", "A"]);
    let ended = command.current_dir(place.path()).env("LC_ALL", "C").output().expect("setpriv and prlimit");
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(2), "{said}");
    assert!(said.contains("threads that a run takes") && !said.contains("panicked"), "{said}");
    assert!(!place.path().join("records").exists());
}

/// With few files a command does its work, or ends with a sentence and its own exit code: the libraries below it would panic.
#[test]
fn a_limit_of_files_is_told() {
    let place = Place::new(STATION);
    let plan = functional_plan().to_string_lossy().into_owned();
    place.write("values.csv", "t,x\n0,1\n1,2\n");
    let commands: [&[&str]; 7] = [
        &["--version"],
        &["doctor"],
        &["records", "list", "--records", "."],
        &["plan", "check", &plan, "--sim"],
        &["compute", "allan", "values.csv", "--column", "x"],
        &["board", "check", "--sim", "--only", "hello"],
        &["--auto", &plan, "--sim", "--sim-speed", "max", "--serial-number", "A"],
    ];
    // Three are the standard streams, and the loader of programs takes one.
    for limit in 4..=24 {
        for command in commands {
            let mut limited = Command::new("prlimit");
            limited.arg(format!("--nofile={limit}")).arg(STATION).args(command);
            let limited = limited.current_dir(place.path()).env("LC_ALL", "C").stdin(Stdio::null());
            let ended = limited.output().expect("prlimit");
            let said = String::from_utf8_lossy(&ended.stderr).into_owned();
            let code = ended.status.code();
            assert!(matches!(code, Some(0..=3)), "{command:?} with {limit} files: {code:?}: {said}");
            assert!(!said.contains("panicked"), "{command:?} with {limit} files: {said}");
            if command[0] == "doctor" {
                let found = String::from_utf8_lossy(&ended.stdout);
                assert!(
                    code == Some(1) && found.contains("files that a run takes"),
                    "{limit} files: {code:?}: {found}"
                );
                continue;
            }
            // What `doctor` finds is its output; the others say on standard error why they end.
            assert!(code == Some(0) || !said.trim().is_empty(), "{command:?} with {limit} files: {code:?}");
            if command[0] == "--auto" {
                assert!(code == Some(2) && said.contains("files that a run takes"), "{limit} files: {code:?}: {said}");
                assert!(!place.path().join("records").exists());
            }
        }
    }
}

/// Where the system has no thread left, `compute` does the work on the one that it has, with the same result.
#[test]
fn a_computation_needs_no_second_thread() {
    let place = Place::new(STATION);
    // More than a piece of the table, so that threads would take the next ones.
    let rows: String = (0..250_000_u64).map(|row| format!("{}\n", row * row % 9973)).collect();
    place.write("values.csv", &format!("x\n{rows}"));
    let args = ["compute", "allan", "values.csv", "--column", "x", "--rate", "100", "--json"];
    let with_threads = place.run(args);
    check(&with_threads, 0, &[]);
    let mut command = if Uid::effective().is_root() {
        fs::set_permissions(place.path(), Permissions::from_mode(0o777)).expect("its folder");
        let mut command = Command::new("setpriv");
        command.args(["--reuid", ALONE, "--regid", ALONE, "--clear-groups", "prlimit"]);
        command
    } else {
        Command::new("prlimit")
    };
    command.args(["--nproc=1", STATION]).args(args);
    let alone = command.current_dir(place.path()).env("LC_ALL", "C").output().expect("setpriv and prlimit");
    let said = String::from_utf8_lossy(&alone.stderr);
    assert_eq!(alone.status.code(), Some(0), "{said}");
    assert_eq!(String::from_utf8_lossy(&alone.stdout), with_threads.stdout);
    assert!(!said.contains("panicked"), "{said}");
}
