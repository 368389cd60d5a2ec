//! An adapter whose plug can be pulled: a pseudo-terminal behind a symbolic link, as udev names a serial adapter.

use std::fs::{File, OpenOptions};
use std::io::{Read as _, Write as _};
use std::os::fd::{AsFd as _, OwnedFd};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::JoinHandle;

use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::pty::{grantpt, posix_openpt, ptsname_r, unlockpt};
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};

/// Time between two looks for a cable that was plugged in.
const LOOK_EVERY_MS: u16 = 5;

/// One end of the cable, non-blocking.
struct End {
    file: File,
    /// Without an open slave end the master hangs up whenever the station closes its own.
    _slave: Option<File>,
    /// Bytes that this end has not taken yet.
    waiting: Vec<u8>,
}

#[derive(Default)]
struct Ends {
    board: Option<End>,
    adapter: Option<End>,
}

/// An action on the cable, and the channel that reports when it is done.
type Order = (Box<dyn FnOnce(&mut Ends) + Send>, Sender<()>);

/// The cable, the adapter and the link that names it.
pub(crate) struct Cable {
    link: PathBuf,
    orders: Option<Sender<Order>>,
    thread: Option<JoinHandle<()>>,
}

impl Cable {
    /// A cable from a board's port to an adapter that is plugged in; the station finds it at `link`.
    pub(crate) fn new(board_port: &str, link: &Path) -> Self {
        let (orders, receiver) = channel();
        let thread = std::thread::spawn(move || carry(&receiver));
        let cable = Self { link: link.to_owned(), orders: Some(orders), thread: Some(thread) };
        cable.wire(board_port);
        cable.plug();
        cable
    }

    /// Connects the cable to another board.
    pub(crate) fn wire(&self, board_port: &str) {
        let file = File::options().read(true).write(true).open(board_port).expect("the board's port");
        let end = End { file: without_blocking(file), _slave: None, waiting: Vec::new() };
        self.order(|ends| ends.board = Some(end));
    }

    /// Plugs the adapter in: it gets another device, and the link is moved to it.
    pub(crate) fn plug(&self) {
        // Closed in programs that start meanwhile: otherwise they would keep the plug in.
        let flags = OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_CLOEXEC | OFlag::O_NONBLOCK;
        let master = posix_openpt(flags).expect("a pseudo-terminal");
        grantpt(&master).and_then(|()| unlockpt(&master)).expect("a pseudo-terminal");
        let name = ptsname_r(&master).expect("its name");
        let slave = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(OFlag::O_NOCTTY.bits())
            .open(&name)
            .expect("its slave");
        let mut settings = tcgetattr(&slave).expect("a terminal");
        cfmakeraw(&mut settings);
        tcsetattr(&slave, SetArg::TCSANOW, &settings).expect("a terminal");
        let end = End { file: File::from(OwnedFd::from(master)), _slave: Some(slave), waiting: Vec::new() };
        self.order(|ends| ends.adapter = Some(end));
        std::os::unix::fs::symlink(name, &self.link).expect("a link");
    }

    /// Unplugs the adapter: the link disappears, and the device with all bytes that it held.
    pub(crate) fn unplug(&self) {
        std::fs::remove_file(&self.link).expect("the link");
        self.order(|ends| ends.adapter = None);
    }

    fn order(&self, what: impl FnOnce(&mut Ends) + Send + 'static) {
        let (done, heard) = channel();
        self.orders.as_ref().expect("the thread").send((Box::new(what), done)).expect("the thread");
        heard.recv().expect("the thread");
    }
}

impl Drop for Cable {
    fn drop(&mut self) {
        self.orders = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn without_blocking(file: File) -> File {
    let flags = OFlag::from_bits_truncate(fcntl(&file, FcntlArg::F_GETFL).expect("flags"));
    fcntl(&file, FcntlArg::F_SETFL(flags | OFlag::O_NONBLOCK)).expect("flags");
    file
}

/// Moves bytes and carries out orders, until the sender of orders is gone.
fn carry(orders: &Receiver<Order>) {
    let mut ends = Ends::default();
    loop {
        match orders.try_recv() {
            Ok((what, done)) => {
                what(&mut ends);
                let _ = done.send(());
            }
            Err(TryRecvError::Empty) => move_or_wait(&mut ends),
            Err(TryRecvError::Disconnected) => return,
        }
    }
}

fn move_or_wait(ends: &mut Ends) {
    let Ends { board, adapter } = ends;
    {
        let mut waits: Vec<PollFd<'_>> = Vec::new();
        for (from, to) in [(&*board, &*adapter), (&*adapter, &*board)] {
            let Some(from) = from else { continue };
            let mut events = PollFlags::empty();
            // A board sends even if its output is not read.
            events.set(PollFlags::POLLIN, to.as_ref().is_none_or(|to| to.waiting.is_empty()));
            events.set(PollFlags::POLLOUT, !from.waiting.is_empty());
            waits.push(PollFd::new(from.file.as_fd(), events));
        }
        let _ = poll(&mut waits, PollTimeout::from(LOOK_EVERY_MS));
    }
    move_bytes(board, adapter);
    move_bytes(adapter, board);
}

fn move_bytes(from: &mut Option<End>, to: &mut Option<End>) {
    let Some(from) = from else { return };
    let mut bytes = [0; 4096];
    if to.as_ref().is_none_or(|to| to.waiting.is_empty()) {
        // A board that died gives no bytes.
        let count = from.file.read(&mut bytes).unwrap_or(0);
        if let Some(to) = to.as_mut() {
            to.waiting.extend_from_slice(&bytes[..count]);
        }
    }
    if let Some(to) = to
        && let Ok(count) = to.file.write(&to.waiting)
    {
        to.waiting.drain(..count);
    }
}
