//! This repository's ISO-TP as a program, for foreign peers. It sends each message of one id back under another.
//!
//!     isotp-under-test IDS [BLOCK_SIZE ST_MIN]            on a pseudo-terminal as an slcan adapter; names it: port PATH
//!     isotp-under-test IDS [BLOCK_SIZE ST_MIN] INTERFACE  on a CAN interface of the kernel
//!
//! IDS is RECEIVE:SEND in hexadecimal. The program ends when its standard input ends.

#![expect(clippy::print_stdout, reason = "the port is its answer")]

use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::os::fd::{AsFd, BorrowedFd};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use gnc_protocol::can::isotp::{FlowSettings, IsoTpReceived, IsoTpReceiver, IsoTpSender, MAX_PDU, is_flow_control};
use gnc_protocol::can::slcan::{self, SlcanDecoder, SlcanEvent};
use gnc_protocol::can::{CanFrame, CanId};
use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::pty::openpty;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::unistd::ttyname;
use socketcan::{CanSocket, EmbeddedFrame as _, Id, Socket as _, StandardId};

/// Longest sleep without a look at due events.
const LOOK_EVERY: Duration = Duration::from_millis(10);

fn main() -> ExitCode {
    match run(&std::env::args().skip(1).collect::<Vec<_>>()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(io::stderr(), "isotp-under-test: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &[String]) -> io::Result<()> {
    let usage = || io::Error::new(io::ErrorKind::InvalidInput, "usage: RECEIVE:SEND [BLOCK_SIZE ST_MIN] [INTERFACE]");
    let byte = |text: &String| text.parse::<u8>().map_err(|_| usage());
    let (ids, settings, interface) = match arguments {
        [ids] => (ids, FlowSettings::default(), None),
        [ids, interface] => (ids, FlowSettings::default(), Some(interface)),
        [ids, block, st_min] => (ids, FlowSettings { block_size: byte(block)?, st_min: byte(st_min)? }, None),
        [ids, block, st_min, interface] => {
            (ids, FlowSettings { block_size: byte(block)?, st_min: byte(st_min)? }, Some(interface))
        }
        _ => return Err(usage()),
    };
    let id = |text: &str| u16::from_str_radix(text, 16).ok().filter(|id| *id < 0x800);
    let ids = ids.split_once(':').and_then(|(from, to)| Some((id(from)?, id(to)?))).ok_or_else(usage)?;
    let mut bus = match interface {
        Some(name) => Bus::interface(name)?,
        None => Bus::slcan()?,
    };
    echo(&mut bus, ids, settings)
}

/// The two state machines, fed with the frames of the bus.
fn echo(bus: &mut Bus, (from, to): (u16, u16), settings: FlowSettings) -> io::Result<()> {
    let (mut sender, mut receiver) = (IsoTpSender::<MAX_PDU>::default(), IsoTpReceiver::<MAX_PDU>::new(settings));
    let (began, to) = (Instant::now(), CanId::Standard(to));
    let send = |bus: &mut Bus, data: &[u8]| CanFrame::new(to, data).map_or(Ok(()), |frame| bus.send(&frame));
    loop {
        let now = began.elapsed();
        // There are no timeouts here, however late a busy machine is: the peer has its own timeouts.
        while let Some(data) = sender.poll(now) {
            send(bus, &data)?;
        }
        let due = sender.next_due().map_or(LOOK_EVERY, |due| due.saturating_sub(now).min(LOOK_EVERY));
        if !bus.wait(due)? {
            return Ok(());
        }
        while let Some(frame) = bus.receive()? {
            let now = began.elapsed();
            if frame.id() != CanId::Standard(from) {
                continue;
            }
            if is_flow_control(frame.data()) {
                let _ = sender.flow(frame.data(), now);
                continue;
            }
            match receiver.receive(frame.data(), now) {
                IsoTpReceived::Flow(flow) => send(bus, &flow.to_bytes())?,
                IsoTpReceived::Complete => drop(sender.start(receiver.pdu())),
                IsoTpReceived::Nothing | IsoTpReceived::Failed(_) => {}
            }
        }
    }
}

enum Bus {
    Slcan { port: File, _slave: std::os::fd::OwnedFd, decoder: SlcanDecoder, incoming: Vec<u8> },
    Interface(CanSocket),
}

impl Bus {
    fn slcan() -> io::Result<Self> {
        let pty = openpty(None, None)?;
        let mut settings = tcgetattr(&pty.slave)?;
        cfmakeraw(&mut settings);
        tcsetattr(&pty.slave, SetArg::TCSANOW, &settings)?;
        println!("port {}", ttyname(&pty.slave)?.display());
        Ok(Self::Slcan {
            port: File::from(pty.master),
            _slave: pty.slave,
            decoder: SlcanDecoder::default(),
            incoming: Vec::new(),
        })
    }

    fn interface(name: &str) -> io::Result<Self> {
        let socket = CanSocket::open(name)?;
        socket.set_nonblocking(true)?;
        println!("interface {name}");
        Ok(Self::Interface(socket))
    }

    /// `false`: standard input has ended.
    fn wait(&self, at_most: Duration) -> io::Result<bool> {
        let input = io::stdin();
        let bus: BorrowedFd<'_> = match self {
            Self::Slcan { port, .. } => port.as_fd(),
            Self::Interface(socket) => socket.as_fd(),
        };
        let mut waits = [PollFd::new(bus, PollFlags::POLLIN), PollFd::new(input.as_fd(), PollFlags::POLLIN)];
        poll(&mut waits, PollTimeout::try_from(at_most).unwrap_or(PollTimeout::ZERO))?;
        let ended = waits[1].revents().is_some_and(|events| !events.is_empty());
        Ok(!(ended && io::stdin().read(&mut [0; 64])? == 0))
    }

    fn send(&mut self, frame: &CanFrame) -> io::Result<()> {
        loop {
            let socket = match self {
                Self::Slcan { port, .. } => return port.write_all(&slcan::encode(frame)),
                Self::Interface(socket) => socket,
            };
            let CanId::Standard(id) = frame.id() else { return Ok(()) };
            let raw = StandardId::new(id).and_then(|id| socketcan::CanFrame::new(id, frame.data()));
            match raw.map_or(Ok(()), |raw| socket.write_frame(&raw)) {
                Err(error) if is_full(&error) => {
                    poll(&mut [PollFd::new(socket.as_fd(), PollFlags::POLLOUT)], PollTimeout::from(1_u8))?;
                }
                done => return done,
            }
        }
    }

    fn receive(&mut self) -> io::Result<Option<CanFrame>> {
        match self {
            Self::Slcan { port, decoder, incoming, .. } => loop {
                let mut rest: &[u8] = incoming;
                let item = decoder.next(&mut rest);
                let consumed = incoming.len() - rest.len();
                incoming.drain(..consumed);
                match item {
                    Some(SlcanEvent::Frame(frame)) => return Ok(Some(frame)),
                    Some(_) => continue,
                    None => {}
                }
                let mut readable = [PollFd::new(port.as_fd(), PollFlags::POLLIN)];
                if poll(&mut readable, PollTimeout::ZERO)? == 0 {
                    return Ok(None);
                }
                let mut bytes = [0; 4096];
                let count = port.read(&mut bytes)?;
                incoming.extend_from_slice(&bytes[..count]);
            },
            Self::Interface(socket) => match socket.read_frame() {
                Ok(socketcan::CanFrame::Data(frame)) => Ok(match frame.id() {
                    Id::Standard(id) => CanFrame::new(CanId::Standard(id.as_raw()), frame.data()),
                    Id::Extended(_) => None,
                }),
                Ok(_) => Ok(None),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(None),
                Err(error) => Err(error),
            },
        }
    }
}

/// Whether the transmit queue is full now.
fn is_full(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::WouldBlock || error.raw_os_error() == Some(Errno::ENOBUFS as i32)
}
