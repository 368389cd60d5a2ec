//! A program on its own pseudo-terminal, and what a person would see of it.

use std::fs::File;
use std::io::{ErrorKind, Read as _, Write as _};
use std::num::NonZero;
use std::os::fd::{AsFd as _, OwnedFd};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use nix::fcntl::OFlag;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::pty::{grantpt, posix_openpt, ptsname_r, unlockpt};
use nix::sys::signal::{Signal, kill};
use nix::sys::stat::Mode;
use nix::sys::termios::{Termios, tcgetattr};
use nix::unistd::Pid;

/// Longest time of a whole test. A busy machine is slow, but a good test never waits for this.
const DEADLINE: Duration = Duration::from_secs(120);
/// Time between two keys of a fast hand.
const HAND: Duration = Duration::from_millis(80);

/// Counts how often the terminal rings.
#[derive(Debug, Default)]
struct Bells(usize);

impl vt100::Callbacks for Bells {
    fn audible_bell(&mut self, _: &mut vt100::Screen) {
        self.0 += 1;
    }
}

pub(crate) struct Terminal {
    master: Option<File>,
    slave: OwnedFd,
    before: Termios,
    parser: vt100::Parser<Bells>,
    /// All that the program wrote.
    sent: Vec<u8>,
    ended: mpsc::Receiver<ExitStatus>,
    pid: Pid,
    deadline: Instant,
}

impl Terminal {
    /// Starts a program with this as its controlling terminal.
    pub(crate) fn start(mut command: Command, columns: u16, rows: u16) -> Self {
        // Closed in child programs: otherwise a lost terminal would stay open in the programs of other tests.
        let flags = OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_CLOEXEC;
        let master = posix_openpt(flags | OFlag::O_NONBLOCK).expect("a pseudo-terminal");
        grantpt(&master).expect("its other end");
        unlockpt(&master).expect("its other end");
        let path = ptsname_r(&master).expect("its name");
        let slave = nix::fcntl::open(path.as_str(), flags, Mode::empty()).expect("its other end");
        set_size(&slave, columns, rows);
        let before = tcgetattr(&slave).expect("its settings");
        let end = || Stdio::from(slave.try_clone().expect("its end"));
        command.stdin(end()).stdout(end()).stderr(end());
        let mut child = command.spawn().expect("setsid of util-linux, and the station");
        let pid = Pid::from_raw(child.id().cast_signed());
        let (ended_in, ended) = mpsc::channel();
        std::thread::spawn(move || ended_in.send(child.wait().expect("the station's end")));
        let parser = vt100::Parser::new_with_callbacks(at_least_one(rows), at_least_one(columns), 0, Bells::default());
        let deadline = Instant::now() + DEADLINE;
        let master = File::from(OwnedFd::from(master));
        Self { master: Some(master), slave, before, parser, sent: Vec::new(), ended, pid, deadline }
    }

    pub(crate) fn text(&self) -> String {
        self.parser.screen().contents()
    }

    /// How often it has rung so far.
    pub(crate) fn bells(&self) -> usize {
        self.parser.callbacks().0
    }

    /// Waits until the screen shows this text.
    pub(crate) fn wait_for(&mut self, what: &str) {
        self.wait_until(what, |screen| screen.contents().contains(what));
    }

    pub(crate) fn wait_until(&mut self, what: &str, mut seen: impl FnMut(&vt100::Screen) -> bool) {
        while !seen(self.parser.screen()) {
            self.read(what);
        }
    }

    /// All that the program wrote so far.
    pub(crate) fn sent(&self) -> &[u8] {
        &self.sent
    }

    /// Waits until the program has written something.
    pub(crate) fn wait_for_bytes(&mut self, what: &str, mut seen: impl FnMut(&[u8]) -> bool) {
        while !seen(&self.sent) {
            self.read(what);
        }
    }

    /// Types bytes and reads output meanwhile, as a terminal does. They come at the pace of a hand behind what was typed
    /// before: keys that come closer belong to a scan, and the station takes them for its frame.
    pub(crate) fn types(&mut self, bytes: &[u8]) {
        let due = Instant::now() + HAND;
        while let Some(left) = due.checked_duration_since(Instant::now()).filter(|left| !left.is_zero()) {
            self.read_for(left);
        }
        let mut rest = bytes;
        while !rest.is_empty() {
            let written = self.master.as_ref().expect("a terminal").write(rest);
            match written {
                Ok(count) => rest = &rest[count..],
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    self.wait_ready(PollFlags::POLLIN | PollFlags::POLLOUT);
                    self.take();
                }
                Err(error) => panic!("typing: {error}"),
            }
        }
    }

    pub(crate) fn resize(&mut self, columns: u16, rows: u16) {
        set_size(&self.slave, columns, rows);
        self.parser.screen_mut().set_size(at_least_one(rows), at_least_one(columns));
    }

    pub(crate) fn signal(&self, signal: Signal) {
        kill(self.pid, signal).expect("the station runs");
    }

    /// Closes the terminal, as a lost connection does.
    pub(crate) fn close(&mut self) {
        self.master = None;
    }

    /// Waits for the program's end. Returns whether the terminal is restored: its settings, its screen, its cursor. For
    /// a closed terminal this is unknown.
    pub(crate) fn end(mut self) -> (ExitStatus, bool) {
        let status = loop {
            if self.master.is_some() && self.read_for(Duration::from_millis(50)) {
                continue;
            }
            let wait = if self.master.is_some() { Duration::from_millis(50) } else { self.left() };
            match self.ended.recv_timeout(wait) {
                Ok(status) => break status,
                Err(_) => assert!(self.left() > Duration::ZERO, "the station does not end:\n{}", self.text()),
            }
        };
        while self.master.is_some() && self.take() > 0 {}
        if self.master.is_none() {
            return (status, true);
        }
        let after = tcgetattr(&self.slave).expect("settings");
        let screen = self.parser.screen();
        let shown = !screen.alternate_screen() && !screen.hide_cursor() && !screen.bracketed_paste();
        (status, after == self.before && shown)
    }

    /// Waits for the program's end without reading its output.
    pub(crate) fn end_unread(self) -> ExitStatus {
        self.ended.recv_timeout(self.left()).expect("the station's end")
    }

    fn left(&self) -> Duration {
        self.deadline.saturating_duration_since(Instant::now())
    }

    /// Reads the next output.
    fn read(&mut self, wanted: &str) {
        let left = self.left();
        assert!(left > Duration::ZERO, "the time is over, {wanted:?} is not seen:\n{}", self.text());
        if !self.read_for(left)
            && let Ok(status) = self.ended.try_recv()
        {
            panic!("the station ended with {status}; this was seen:\n{}", self.text());
        }
    }

    fn read_for(&mut self, time: Duration) -> bool {
        let master = self.master.as_ref().expect("a terminal");
        let mut polled = [PollFd::new(master.as_fd(), PollFlags::POLLIN)];
        let time = PollTimeout::try_from(time.min(Duration::from_secs(30))).unwrap_or(PollTimeout::MAX);
        poll(&mut polled, time).expect("poll");
        self.take() > 0
    }

    fn wait_ready(&self, flags: PollFlags) {
        let left = self.left();
        assert!(left > Duration::ZERO, "the time is over; this is what is seen:\n{}", self.text());
        let master = self.master.as_ref().expect("a terminal");
        let time = PollTimeout::try_from(left.min(Duration::from_secs(30))).unwrap_or(PollTimeout::MAX);
        poll(&mut [PollFd::new(master.as_fd(), flags)], time).expect("poll");
    }

    /// Takes the available output.
    fn take(&mut self) -> usize {
        let mut bytes = [0; 1 << 16];
        match self.master.as_ref().expect("a terminal").read(&mut bytes) {
            Ok(count) => {
                self.parser.process(&bytes[..count]);
                self.sent.extend(&bytes[..count]);
                count
            }
            Err(_) => 0,
        }
    }
}

fn set_size(slave: &OwnedFd, columns: u16, rows: u16) {
    let size = rustix::termios::Winsize { ws_row: rows, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 };
    rustix::termios::tcsetwinsize(slave.as_fd(), size).expect("a size");
}

impl Drop for Terminal {
    fn drop(&mut self) {
        // A failed test leaves no program behind.
        if self.ended.try_recv() == Err(mpsc::TryRecvError::Empty) {
            let _ = kill(self.pid, Signal::SIGKILL);
        }
    }
}

fn at_least_one(cells: u16) -> NonZero<u16> {
    NonZero::new(cells).unwrap_or(NonZero::<u16>::MIN)
}
