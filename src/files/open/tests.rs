use std::fs;
use std::os::unix::fs::symlink;
use std::os::unix::net::UnixListener;

use super::*;

fn why<T>(result: io::Result<T>) -> Option<Refused> {
    result.err().as_ref().and_then(is_refused)
}

/// What is not a regular file is refused at once: the test would wait for ever at the pipe.
#[test]
fn only_regular_files_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    nix::unistd::mkfifo(&at("pipe"), Mode::S_IRWXU).unwrap();
    let _socket = UnixListener::bind(at("socket")).unwrap();
    fs::create_dir(at("folder")).unwrap();
    fs::write(at("file"), "content").unwrap();
    symlink("file", at("link")).unwrap();
    symlink("/dev/zero", at("zeros")).unwrap();
    assert_eq!(why(read(&at("pipe"), 9)), Some(Refused::Pipe));
    assert_eq!(why(read(&at("socket"), 9)), Some(Refused::Socket));
    assert_eq!(why(read(&at("folder"), 9)), Some(Refused::Folder));
    assert_eq!(why(read(&at("zeros"), 9)), Some(Refused::Device));
    assert_eq!(read(&at("link"), 9).unwrap(), b"content", "a path that a person chose may be a link");
    assert_eq!(read(&at("none"), 9).unwrap_err().kind(), io::ErrorKind::NotFound);
}

/// A device of the kernel claims no size and has no end; a file of `/proc` claims no size and has an end.
#[test]
fn bytes_count_and_not_the_size() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    fs::write(&path, [7; 100]).unwrap();
    assert_eq!(read(&path, 100).unwrap().len(), 100);
    assert_eq!(why(read(&path, 99)), Some(Refused::TooLong { limit: 99 }));
    assert_eq!(read_beginning(&path, 9).unwrap(), [7; 9]);
    let own = Path::new("/proc/self/status");
    assert_eq!(own.metadata().unwrap().len(), 0);
    assert_eq!(why(read(own, 20)), Some(Refused::TooLong { limit: 20 }));
}

#[test]
fn below_a_root_no_link_is_followed() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("root");
    fs::create_dir_all(root.join("day/run")).unwrap();
    fs::write(folder.path().join("outside"), "outside").unwrap();
    fs::write(root.join("day/run/file"), "inside").unwrap();
    symlink("day", root.join("other")).unwrap();
    symlink("file", root.join("day/run/link")).unwrap();
    symlink("../../../outside", root.join("day/run/out")).unwrap();
    symlink("root", folder.path().join("chosen")).unwrap();
    nix::unistd::mkfifo(&root.join("pipe"), Mode::S_IRWXU).unwrap();
    let read = |path: &str| read_below(&root, Path::new(path), 99);
    assert_eq!(read("day/run/file").unwrap(), b"inside");
    assert_eq!(read_below(&folder.path().join("chosen"), Path::new("day/run/file"), 99).unwrap(), b"inside");
    assert_eq!(why(read("other/run/file")), Some(Refused::Link));
    assert_eq!(why(read("day/run/link")), Some(Refused::Link));
    assert_eq!(why(read("day/run/out")), Some(Refused::Link));
    assert_eq!(why(read("../outside")), Some(Refused::Outside));
    assert_eq!(why(read("/etc/hostname")), Some(Refused::Outside));
    assert_eq!(why(read("day/run")), Some(Refused::Folder));
    assert_eq!(why(read("pipe")), Some(Refused::Pipe));
    assert_eq!(read("day/none/file").unwrap_err().kind(), io::ErrorKind::NotFound);
    assert_eq!(why(read_below(&root, Path::new("day/run/file"), 5)), Some(Refused::TooLong { limit: 5 }));
}

/// A file that another file names lies beside it or below; a link counts by its end.
#[test]
fn a_named_file_stays_in_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("plans");
    fs::create_dir_all(root.join("below")).unwrap();
    for file in ["outside", "plans/inside", "plans/below/deep", "plans-of-others"] {
        fs::write(folder.path().join(file), file).unwrap();
    }
    symlink("below/deep", root.join("link")).unwrap();
    symlink("../outside", root.join("out")).unwrap();
    symlink("..", root.join("up")).unwrap();
    symlink("/dev/zero", root.join("zeros")).unwrap();
    nix::unistd::mkfifo(&root.join("pipe"), Mode::S_IRWXU).unwrap();
    let read = |path: &str, reach| named_beginning(&root, &root.join(path), reach, 99);
    for inside in ["inside", "below/deep", "below/../inside", "link"] {
        assert!(read(inside, Reach::Folder).is_ok(), "{inside}");
    }
    for outside in ["out", "up/outside", "../outside", "../plans-of-others", "below/../../outside"] {
        assert_eq!(why(read(outside, Reach::Folder)), Some(Refused::Outside), "{outside}");
        assert!(read(outside, Reach::Anywhere).is_ok(), "{outside}");
    }
    assert_eq!(why(read("zeros", Reach::Folder)), Some(Refused::Outside));
    assert_eq!(why(read("zeros", Reach::Anywhere)), Some(Refused::Device));
    assert_eq!(why(read("pipe", Reach::Folder)), Some(Refused::Pipe));
}

/// While a thread exchanges a folder for a link that leads out, no read gets what lies outside.
#[test]
fn no_exchange_leads_a_named_file_out() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    for folder in ["plans/sub", "outside"] {
        fs::create_dir_all(at(folder)).unwrap();
    }
    fs::write(at("plans/sub/file"), "inside").unwrap();
    fs::write(at("outside/file"), "outside").unwrap();
    symlink("../outside", at("plans/link")).unwrap();
    let over = std::sync::atomic::AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !over.load(std::sync::atomic::Ordering::Relaxed) {
                for (from, to) in [("sub", "away"), ("link", "sub"), ("sub", "link"), ("away", "sub")] {
                    fs::rename(at("plans").join(from), at("plans").join(to)).unwrap();
                }
            }
        });
        let mut reads = 0;
        let wrong = (0..40_000).find_map(|_| {
            let read = named_beginning(&at("plans"), &at("plans/sub/file"), Reach::Folder, 99).ok()?;
            reads += 1;
            (read != b"inside").then_some(read)
        });
        over.store(true, std::sync::atomic::Ordering::Relaxed);
        assert_eq!(wrong, None);
        assert!(reads > 0, "the file was there in between");
    });
}

type Reading = fn(&Path) -> io::Result<Vec<u8>>;

/// A file server lends a file to a program elsewhere (an oplock, a delegation); it comes back when it is asked for.
#[test]
fn a_file_on_loan_is_read_when_it_is_given_back() {
    use std::io::{BufRead as _, BufReader, Write as _};
    use std::process::{Command, Stdio};
    // The other program gives the file back at the signal of the kernel.
    const HOLDER: &str = "import fcntl, os, signal, sys\n\
        held = os.open(sys.argv[1], os.O_RDWR)\n\
        signal.signal(signal.SIGIO, lambda *_: fcntl.fcntl(held, fcntl.F_SETLEASE, fcntl.F_UNLCK))\n\
        fcntl.fcntl(held, fcntl.F_SETLEASE, fcntl.F_WRLCK)\n\
        print('held', flush=True)\n\
        sys.stdin.read()\n";
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("file");
    let reads: [Reading; 3] = [
        |path| read(path, 99),
        |path| read_below(path.parent().unwrap(), Path::new("file"), 99),
        |path| {
            crate::append(path)?.write_all(b"!")?;
            read(path, 99)
        },
    ];
    for (read, expected) in reads.into_iter().zip(["content", "content", "content!"]) {
        fs::write(&path, "content").unwrap();
        let mut holder = Command::new("python3")
            .args(["-c", HOLDER])
            .arg(&path)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("python3");
        let mut said = String::new();
        BufReader::new(holder.stdout.take().unwrap()).read_line(&mut said).unwrap();
        assert_eq!(said, "held\n");
        assert_eq!(read(&path).unwrap(), expected.as_bytes());
        drop(holder.stdin.take());
        assert!(holder.wait().unwrap().success());
    }
}
