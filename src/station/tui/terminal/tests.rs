use std::io::ErrorKind;
use std::num::NonZero;
use std::os::fd::OwnedFd;
use std::process::{Command, Stdio};

use nix::pty::{Winsize, openpty};
use nix::sys::termios::tcgetattr;

use super::*;
use crate::tui::lang::Lang;
use crate::tui::scene::Scene;
use crate::tui::view;

/// The environment variable that makes this test program panic on a terminal; its value is the thread.
const GRIEF: &str = "GNC_TEST_PANIC_ON";
/// The message of the panic.
const LAST_WORDS: &str = "the sky fell on the bench";
/// Longest time for the program to come to its end on a machine under load.
const DEADLINE: Duration = Duration::from_secs(60);

/// Shows the screen of a run, then panics. Does nothing if the variable is not set.
#[test]
fn comes_to_grief_if_asked() {
    let Ok(place) = std::env::var(GRIEF) else { return };
    let guard = Guard::new();
    let mut screen = guard.take().expect("a terminal");
    let model = Scene::at_work(Lang::En, 80, 24).expect("memory").model;
    screen.draw(|frame| view::draw(&model, frame)).expect("a terminal");
    if place == "another thread" {
        let runner = std::thread::Builder::new().name("runner".into());
        assert!(runner.spawn(|| panic!("{LAST_WORDS}")).expect("a thread").join().is_err());
        assert!(!guard.is_taken(), "the screen would draw over the message");
        return;
    }
    panic!("{LAST_WORDS}");
}

/// A panic leaves the terminal with its settings as before, its own screen, the cursor, and a message that can be read.
#[test]
fn a_panic_gives_the_terminal_back() {
    for place in ["this thread", "another thread"] {
        let size = Winsize { ws_row: 24, ws_col: 80, ws_xpixel: 0, ws_ypixel: 0 };
        let pty = openpty(&size, None).expect("a pseudo-terminal");
        let before = tcgetattr(&pty.slave).expect("settings");
        let end = || Stdio::from(pty.slave.try_clone().expect("its end"));
        let mut child = Command::new(std::env::current_exe().expect("this program"))
            .args(["--exact", "tui::terminal::tests::comes_to_grief_if_asked", "--nocapture", "--test-threads=1"])
            .env(GRIEF, place)
            .env("TERM", "xterm-256color")
            .env("RUST_BACKTRACE", "0")
            .stdin(end())
            .stdout(end())
            .stderr(end())
            .spawn()
            .expect("this program once more");
        let seen = watch(pty.master);
        let status = child.wait().expect("its end");
        assert_eq!(status.success(), place == "another thread", "{status}");
        let after = tcgetattr(&pty.slave).expect("settings");
        drop(pty.slave);
        let (drew, screen) = seen.join().expect("somebody who watches");
        assert!(drew, "the screen was never there");
        assert!(after == before, "{place}: the line discipline is not as it was");
        let whole = !screen.alternate_screen() && !screen.hide_cursor() && !screen.bracketed_paste();
        assert!(whole, "{place}: the terminal is not as it was:\n{}", screen.contents());
        // The message is at the left edge only if the line discipline turns a line feed into a line end again.
        let said = screen.rows(0, 80).any(|row| row.starts_with(LAST_WORDS));
        assert!(said, "{place}: nobody can read what happened:\n{}", screen.contents());
    }
}

/// Reads what is written to a terminal until its other end is closed. Returns whether the whole screen was drawn
/// meanwhile, and the screen at the end.
fn watch(master: OwnedFd) -> std::thread::JoinHandle<(bool, vt100::Screen)> {
    std::thread::spawn(move || {
        let mut master = File::from(master);
        let cells = |count| NonZero::new(count).expect("more than none");
        let mut parser = vt100::Parser::new(cells(24), cells(80), 0);
        let (mut drew, mut bytes) = (false, [0; 4096]);
        let began = Instant::now();
        while began.elapsed() < DEADLINE {
            match master.read(&mut bytes) {
                Ok(0) => break,
                Ok(count) => {
                    // Byte by byte: the screen and its end may come at once.
                    for byte in &bytes[..count] {
                        parser.process(&[*byte]);
                        drew |= parser.screen().alternate_screen() && parser.screen().contents().contains("F10 Leave");
                    }
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                // All other ends are closed.
                Err(_) => break,
            }
        }
        (drew, parser.screen().clone())
    })
}
