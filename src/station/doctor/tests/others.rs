//! Other programs on a port or interface.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use gnc_executive::bench::ScannerSettings;
use nix::fcntl::{FcntlArg, FdFlag, fcntl};

use crate::doctor::holders::{Holder, Proc};
use crate::doctor::{Health, scanner};
use crate::phrases::english;

/// A folder as the kernel shows a process, with the files that it has open.
pub(super) fn process(proc: &Path, number: u32, command: &str, open: &[&Path]) {
    let fd = proc.join(number.to_string()).join("fd");
    fs::create_dir_all(&fd).expect("a folder");
    for (place, file) in open.iter().enumerate() {
        symlink(file, fd.join(place.to_string())).expect("a link");
    }
    fs::write(proc.join(number.to_string()).join("cmdline"), command).expect("a file");
}

/// A process of another user: its files cannot be listed.
fn hidden(proc: &Path, number: u32) {
    fs::create_dir_all(proc.join(number.to_string())).expect("a folder");
}

pub(super) fn pseudo_terminal() -> (nix::pty::OpenptyResult, PathBuf) {
    let pty = nix::pty::openpty(None, None).expect("a pseudo-terminal");
    let port = nix::unistd::ttyname(&pty.slave).expect("its name");
    (pty, port)
}

#[test]
fn a_program_with_the_port_open_is_named() {
    let (_pty, port) = pseudo_terminal();
    let folder = tempfile::tempdir().expect("a folder");
    // The same device under another name, as udev makes it.
    let by_id = folder.path().join("usb-FTDI");
    symlink(&port, &by_id).expect("a link");
    let proc = folder.path().join("proc");
    process(&proc, 901, "minicom\0-D\0/dev/ttyUSB0\0", &[Path::new("/dev/null"), &by_id]);
    process(&proc, 77, "cat\0\x1b[2J\0", &[&port]);
    process(&proc, 5, "editor\0", &[Path::new("/dev/null"), Path::new("/gone")]);
    process(&proc, std::process::id(), "doctor\0", &[&port]);
    hidden(&proc, 1);
    let holders = Proc(proc).holders(&by_id);
    let holder = |process, command: &str| Holder { process, command: command.to_owned() };
    assert_eq!(holders.found, [holder(77, "cat \\u{1b}[2J"), holder(901, "minicom -D /dev/ttyUSB0")]);
    assert_eq!(holders.hidden, 1);
}

/// A real program on a real port.
#[test]
fn the_kernels_own_folder_names_a_program() {
    let (pty, port) = pseudo_terminal();
    // A program that is started must not get the board's end.
    fcntl(&pty.master, FcntlArg::F_SETFD(FdFlag::FD_CLOEXEC)).expect("a descriptor");
    let end = fs::File::open(&port).expect("the port");
    // The kernel shows the words of a program a moment after its start. This one says when it runs.
    let mut reader = Command::new("sh");
    reader.args(["-c", "echo; read line"]).stdin(Stdio::from(end)).stdout(Stdio::piped());
    let mut reader = reader.spawn().expect("a shell");
    let said = reader.stdout.take().expect("its output");
    std::io::BufRead::read_line(&mut std::io::BufReader::new(said), &mut String::new()).expect("a line");
    let holders = Proc::default().holders(&port);
    reader.kill().expect("alive");
    reader.wait().expect("its end");
    assert_eq!(holders.found, [Holder { process: reader.id(), command: "sh -c echo; read line".to_owned() }]);
    drop(pty);
}

/// The program behind a pseudo-terminal is the board and not a second reader.
#[test]
fn the_other_end_of_a_pseudo_terminal_is_no_second_reader() {
    let (_pty, port) = pseudo_terminal();
    let index = port.file_name().and_then(|name| name.to_str()).expect("a number").to_owned();
    let folder = tempfile::tempdir().expect("a folder");
    for (number, told) in [(20, index.as_str()), (21, "99999")] {
        process(folder.path(), number, "board\0", &[&port, Path::new("/dev/null")]);
        let info = folder.path().join(number.to_string()).join("fdinfo");
        fs::create_dir_all(&info).expect("a folder");
        fs::write(info.join("1"), format!("pos:\t0\nflags:\t02\ntty-index:\t{told}\n")).expect("a file");
    }
    let found: Vec<u32> =
        Proc(folder.path().to_owned()).holders(&port).found.iter().map(|holder| holder.process).collect();
    assert_eq!(found, [21]);
}

/// Lists as kernel 6.1 shows them.
#[test]
fn receivers_on_a_can_interface_are_counted() {
    let folder = tempfile::tempdir().expect("a folder");
    let can = folder.path().join("net/can");
    fs::create_dir_all(&can).expect("a folder");
    let none = "\nreceive list 'rx_fil':\n  (any: no entry)\n  (can0: no entry)\n";
    let two = "\nreceive list 'rx_all':\n  (any: no entry)\n  device   can_id   can_mask  function  userdata   matches  ident\n   can0   \
               00000000  00000000  0000000000000000  0000000000000000         3  raw\n   can1   00000000  00000000  0000000000000000  \
               0000000000000000         3  raw\n   can0   00000000  00000000  0000000000000000  0000000000000000         9  raw\n";
    fs::write(can.join("rcvlist_fil"), none).expect("a file");
    fs::write(can.join("rcvlist_all"), two).expect("a file");
    let proc = Proc(folder.path().to_owned());
    assert_eq!(["can0", "can1", "can2"].map(|name| proc.can_receivers(name)), [2, 1, 0]);
}

/// The scanner's port is opened if no process has it. Else its holder is named, and its modes stay as they are.
#[test]
fn the_port_of_the_scanner_is_looked_at() {
    let (pty, port) = pseudo_terminal();
    let folder = tempfile::tempdir().expect("a folder");
    let settings = |port: &Path| ScannerSettings { port: port.display().to_string(), rate_bps: 9600 };
    let look = |port: &Path, proc: &Path| {
        let found = scanner::look(&settings(port), &Proc(proc.to_owned()));
        let names = format!("{} {} minicom /opt/gnc-station --plan p.toml", port.display(), proc.display());
        super::speak_all(&found, &english::latin(&names).collect::<Vec<_>>());
        found
    };
    let modes = || nix::sys::termios::tcgetattr(&pty.slave).expect("modes").local_flags;
    let before = modes();
    for (number, command, health, told) in [
        (77, "minicom\0", Health::Warning, "another program has the port, process 77 (minicom)"),
        (
            78,
            "/opt/gnc-station\0--plan\0p.toml\0",
            Health::Good,
            "the station listens to it, process 78 (/opt/gnc-station",
        ),
    ] {
        let proc = folder.path().join(number.to_string());
        process(&proc, number, command, &[&port]);
        let found = look(&port, &proc);
        assert_eq!((found.len(), found[0].health), (1, health), "{}", found[0]);
        assert!(found[0].what.contains(told) && found[0].what.contains("not opened"), "{}", found[0]);
        assert_eq!(found[0].mend.is_empty(), health == Health::Good, "{}", found[0]);
        assert_eq!(modes(), before, "the port was opened");
    }
    let no_process = folder.path().join("no_process");
    let found = look(&port, &no_process);
    assert_eq!(
        (found[0].health, found[0].what.as_str()),
        (Health::Good, format!("scanner at {}, 9600 bit/s", port.display()).as_str())
    );
    assert_ne!(modes(), before, "the port was not opened");
    // Modules can be tested without a scanner.
    let gone = look(Path::new("/dev/ttyNOWHERE"), &no_process);
    assert_eq!(
        (gone[0].health, gone[0].what.as_str()),
        (Health::Warning, "scanner: port /dev/ttyNOWHERE is not there")
    );
    let file = look(&folder.path().join("77"), &no_process);
    assert!(file[0].mend.starts_with("correct [scanner] port"), "{}", file[0]);
}

/// `doctor` looks at the scanner that the bench file names.
#[test]
fn a_bench_with_a_scanner_is_looked_at() {
    let folder = tempfile::tempdir().expect("a folder");
    let bench = folder.path().join("bench.toml");
    let text = "[station]\nid = \"line-2\"\n[scanner]\nport = \"/dev/ttyNOWHERE\"\n";
    fs::write(&bench, text).expect("a file");
    let no_process = Proc(folder.path().join("no_process"));
    let found = crate::doctor::look(Some(&bench), Some(folder.path()), &crate::doctor::Sys::default(), &no_process);
    assert!(found.iter().any(|finding| finding.what == "scanner: port /dev/ttyNOWHERE is not there"), "{found:?}");
}

/// A port that another program has is not opened: that would set its modes. A lock names its holder, as a run would.
#[test]
fn a_port_in_use_is_not_opened() {
    let (pty, port) = pseudo_terminal();
    let folder = tempfile::tempdir().expect("a folder");
    let text =
        format!("[station]\nid = \"line-2\"\n[socket]\nport = \"{}\"\nrate = \"921600 bit/s\"\n", port.display());
    let bench = gnc_executive::bench::BenchFile::read("bench.toml", text.into_bytes()).expect("a bench");
    let modes = || nix::sys::termios::tcgetattr(&pty.slave).expect("modes").local_flags;
    let before = modes();
    let proc = folder.path().join("proc");
    process(&proc, 901, "minicom\0", &[&port]);
    let found = crate::doctor::lines::look(&bench, &crate::doctor::Sys::default(), &Proc(proc));
    assert_eq!(modes(), before, "the port was opened");
    assert_eq!(found[0].health, Health::Bad, "{found:?}");
    assert!(found[0].what.contains("is open in another program too: process 901 (minicom)"), "{found:?}");
    assert!(found.iter().any(|finding| finding.what.starts_with("the board was not asked")), "{found:?}");

    let held = fs::File::open(&port).expect("the port");
    held.lock().expect("a lock");
    let no_process = Proc(folder.path().join("no_process"));
    let found = crate::doctor::lines::look(&bench, &crate::doctor::Sys::default(), &no_process);
    assert_eq!(modes(), before, "the port was opened");
    assert_eq!(found[0].health, Health::Warning, "{found:?}");
    let holder = format!("(process {})", std::process::id());
    assert!(found[0].what.contains("is in use by ") && found[0].what.ends_with(&holder), "{found:?}");
}
