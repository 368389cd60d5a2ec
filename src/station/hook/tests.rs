use std::os::unix::fs::PermissionsExt as _;

use gnc_executive::outcome::Outcome;

use super::*;

/// Runs until it is killed. Whoever reads the pipe learns that it began, and that all of it has ended.
const HANGS: &str = "#!/bin/sh\nexec 3>pipe\necho began >&3\ntail -f /dev/null & wait\n";

/// The operator does not want to wait for a printer that hangs: the hook and what it started are killed at once, and the
/// verdicts behind it are counted.
#[test]
fn an_interrupt_kills_the_hook() {
    let folder = tempfile::tempdir().expect("a folder");
    let (script, pipe) = (folder.path().join("hangs.sh"), folder.path().join("pipe"));
    std::fs::write(&script, HANGS).expect("a script");
    std::fs::set_permissions(&script, std::fs::Permissions::from_mode(0o755)).expect("permissions");
    nix::unistd::mkfifo(&pipe, nix::sys::stat::Mode::S_IRWXU).expect("a pipe");
    let hook = Hook { command: vec!["./hangs.sh".into()], limit_s: 3600.0 };
    let program = HookProgram::new(&hook, Some(folder.path())).expect("a program");
    let hooks = Hooks::start(program, |what| panic!("{what}")).expect("a thread");
    for _ in 0..3 {
        hooks.tell(folder.path(), "T-1", Verdict::Module(Outcome::Passed)).expect("a place");
    }
    let (thread_began, began) = oneshot::channel();
    let reads = std::thread::spawn(move || {
        use std::io::Read as _;
        let mut pipe = std::fs::File::open(pipe).expect("the pipe");
        let mut first = [0; 6];
        pipe.read_exact(&mut first).expect("it began");
        thread_began.send(()).expect("a test that waits");
        let mut rest = Vec::new();
        pipe.read_to_end(&mut rest).expect("its end");
        rest
    });
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    runtime.block_on(hooks.finish(async { began.await.expect("it began") }));
    // All that held the pipe is gone, and no second program has written to it.
    assert_eq!(reads.join().expect("the reader"), Vec::<u8>::new());
}
