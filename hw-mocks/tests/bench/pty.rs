//! The bench on a real pseudo-terminal, and the program. Real time: every wait has a deadline.

use std::io::{BufRead, BufReader, Read, Write};
use std::os::fd::AsFd;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};

use gnc_protocol::Call;
use gnc_protocol::frame::{Flags, Frame, Header, Kind, Payload};
use gnc_protocol::message::{HostHello, Identity, IoTest, MAGIC, ModulePower, RamTest, ResultHead, StreamStart, event};
use gnc_protocol::serial::{FrameDecoder, encode};
use gnc_protocol::timing::KEEP_ALIVE_EVERY;
use gnc_protocol::wire::Wire;
use hw_mocks::noise::{Dice, RandomStream};
use hw_mocks::{RunningBench, Speed};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

use crate::host::options;

const PATIENCE: Duration = Duration::from_secs(20);

struct PtyHost {
    port: std::fs::File,
    decoder: FrameDecoder,
    request: u16,
    came: Vec<Frame>,
    keep_alive_at: Instant,
}

impl PtyHost {
    fn open(path: &std::path::Path) -> Self {
        let port = std::fs::OpenOptions::new().read(true).write(true).open(path).unwrap();
        let mut host = Self {
            port,
            decoder: FrameDecoder::default(),
            request: 0,
            came: Vec::new(),
            keep_alive_at: Instant::now(),
        };
        host.hello();
        host
    }

    fn hello(&mut self) {
        let hello = HostHello { magic: MAGIC, lowest: 1, highest: 1, nonce: 5 };
        self.send(Kind::Hello, 0, 0, hello.to_payload().unwrap());
        self.wait(|frame| frame.header.kind == Kind::Hello);
    }

    fn send(&mut self, kind: Kind, request: u16, message: u16, payload: Payload) {
        let version = u8::from(kind != Kind::Hello);
        let header = Header { version, kind, flags: Flags::default(), request, message, sequence: 0 };
        self.port.write_all(&encode(&Frame { header, payload })).unwrap();
    }

    fn wait(&mut self, wanted: impl Fn(&Frame) -> bool) -> Frame {
        let end = Instant::now() + PATIENCE;
        loop {
            if Instant::now() >= self.keep_alive_at {
                self.keep_alive_at = Instant::now() + KEEP_ALIVE_EVERY;
                self.send(Kind::Event, 0, event::KEEP_ALIVE, Payload::new());
            }
            if let Some(index) = self.came.iter().position(&wanted) {
                return self.came.remove(index);
            }
            let left = end.saturating_duration_since(Instant::now());
            assert!(!left.is_zero(), "nothing came within {PATIENCE:?}");
            let mut fds = [PollFd::new(self.port.as_fd(), PollFlags::POLLIN)];
            if poll(&mut fds, PollTimeout::try_from(left.min(KEEP_ALIVE_EVERY)).unwrap()).unwrap() == 0 {
                continue;
            }
            let mut buffer = [0; 4096];
            let count = self.port.read(&mut buffer).unwrap();
            let mut rest = &buffer[..count];
            while let Some(frame) = self.decoder.next(&mut rest) {
                self.came.extend(frame);
            }
        }
    }

    /// Status and body.
    fn call<C: Call>(&mut self, call: &C) -> (u16, Vec<u8>) {
        self.request += 1;
        let request = self.request;
        self.send(Kind::Request, request, C::ID, call.to_payload().unwrap());
        let frame = self.wait(move |f| f.header.request == request && f.header.kind == Kind::Result);
        let (head, body) = frame.payload.split_at(6);
        (ResultHead::from_payload(head).unwrap().status as u16, body.to_vec())
    }
}

/// The answers of a module do not depend on the speed of the bench.
#[test]
fn both_speeds_give_the_same_answers() {
    let answers = |speed| {
        let bench = RunningBench::start(&options("io-shorted", speed)).unwrap();
        let mut host = PtyHost::open(bench.port());
        let mut answers = vec![host.call(&ModulePower { on: 1 }), host.call(&Identity {})];
        answers.push(host.call(&RamTest { ram: 0, pattern: 4 }));
        for reader in 1..4 {
            answers.push(host.call(&IoTest { driver: 0, reader, level: 1 }));
        }
        host.call(&StreamStart { stream: 1, rate_hz: 200, count: 40, samples_per_frame: 10 });
        let samples = (0..4).flat_map(|_| {
            let frame = host.wait(|f| f.header.kind == Kind::Stream);
            frame.payload[20..].chunks(40).map(<[u8]>::to_vec).collect::<Vec<_>>()
        });
        (answers, samples.collect::<Vec<_>>())
    };
    let (at_max, samples_at_max) = answers(Speed::Max);
    let (at_true, samples_at_true) = answers(Speed::Times(1.0));
    assert_eq!(at_max, at_true);
    // The noise is the same; temperature and slow biases had a few wall milliseconds longer to move.
    let count = |sample: &[u8], field: usize| i32::from_le_bytes(sample[4 * field..4 * field + 4].try_into().unwrap());
    for (a, b) in samples_at_max.iter().zip(&samples_at_true) {
        assert!((0..3).all(|field| count(a, field).abs_diff(count(b, field)) < 150));
    }
}

#[test]
fn nothing_is_lost_when_the_host_reads_slowly() {
    let bench = RunningBench::start(&options("good", Speed::Max)).unwrap();
    let mut host = PtyHost::open(bench.port());
    host.call(&ModulePower { on: 1 });
    host.call(&StreamStart { stream: 1, rate_hz: 1000, count: 20_000, samples_per_frame: 12 });
    // The board's clock stands still while the port is full: a bench sleep does not let it run away.
    let mut next = 0;
    while next < 20_000 {
        let frame = host.wait(|f| f.header.kind == Kind::Stream);
        let count = u32::from(u16::from_le_bytes([frame.payload[2], frame.payload[3]]));
        let first = u32::from_le_bytes(frame.payload[4..8].try_into().unwrap());
        let dropped = u32::from_le_bytes(frame.payload[16..20].try_into().unwrap());
        assert_eq!((first, dropped), (next, 0));
        next += count;
    }
    assert_eq!(next, 20_000);
    assert_eq!(host.decoder.counters().bad_checksum, 0);
}

#[test]
fn hostile_bytes_never_end_the_bench() {
    let bench = RunningBench::start(&options("good", Speed::Max)).unwrap();
    let mut host = PtyHost::open(bench.port());
    let mut dice = Dice::new(4, RandomStream::Line);
    let mut bytes = Vec::new();
    for round in 0..400_u16 {
        let mut payload: Vec<u8> = (0..dice.word() % 60).map(|_| dice.word() as u8).collect();
        if round % 3 == 0 {
            payload.extend((0..dice.word() % 200).map(|_| dice.word() as u8));
        }
        // Well-formed frames with random ids and payloads pass the checksum; all other bytes are noise.
        let header = Header {
            version: 1,
            kind: Kind::ALL[(dice.word() % 8) as usize],
            flags: Flags(dice.word() as u8),
            request: 1000 + round,
            message: (dice.word() % 0x28) as u16,
            sequence: dice.word() as u16,
        };
        bytes.extend(encode(&Frame { header, payload: Payload::from_slice(&payload).unwrap() }));
        bytes.extend((0..dice.word() % 40).map(|_| dice.word() as u8));
    }
    for chunk in bytes.chunks(512) {
        host.port.write_all(chunk).unwrap();
    }
    host.port.write_all(&[0]).unwrap();
    // Whatever these frames started, a new session and a call still work.
    host.came.clear();
    let hello = HostHello { magic: MAGIC, lowest: 1, highest: 1, nonce: 99 };
    host.send(Kind::Hello, 0, 0, hello.to_payload().unwrap());
    host.wait(|f| f.header.kind == Kind::Hello && f.payload[7..11] == 99_u32.to_le_bytes());
    assert_eq!(host.call(&ModulePower { on: 1 }).0, 0);
    assert_eq!(host.call(&Identity {}).0, 0);
}

#[test]
fn control_moves_switches_and_time() {
    let bench = RunningBench::start(&options("good", Speed::Max)).unwrap();
    let control = bench.control();
    control.set_switch(4, true).unwrap();
    control.set_heading_deg(90.0).unwrap();
    let before = control.truth().unwrap();
    assert_eq!(before.switches, [false, false, false, true, false]);
    let started = Instant::now();
    control.sleep(Duration::from_secs(3600)).unwrap();
    assert!(started.elapsed() < PATIENCE);
    let after = control.truth().unwrap();
    assert_eq!(after.bench_time_ns - before.bench_time_ns, 3_600_000_000_000);
    drop(bench);
    assert!(control.truth().is_err());
    assert_eq!(control.sleep(Duration::from_secs(1)).unwrap_err().to_string(), "the simulated bench has ended");
}

struct Program {
    child: Child,
    lines: Receiver<String>,
}

impl Program {
    fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_hw-mocks"))
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let out = BufReader::new(child.stdout.take().unwrap());
        let (sender, lines) = mpsc::channel();
        std::thread::spawn(move || out.lines().map_while(Result::ok).try_for_each(|line| sender.send(line)));
        Self { child, lines }
    }

    fn line(&self) -> String {
        self.lines.recv_timeout(PATIENCE).unwrap()
    }

    fn say(&mut self, line: &str) -> String {
        writeln!(self.child.stdin.as_mut().unwrap(), "{line}").unwrap();
        self.line()
    }

    /// Waits until standard output ends, which happens when the program ends.
    fn code(mut self) -> Option<i32> {
        while self.lines.recv_timeout(PATIENCE).is_ok() {}
        self.child.wait().unwrap().code()
    }
}

#[test]
fn program_serves_takes_commands_and_ends() {
    let link = std::env::temp_dir().join(format!("hw-mocks-test-{}", std::process::id()));
    let mut program =
        Program::start(&["good", "--speed", "max", "--serial-number", "A-7", "--link", link.to_str().unwrap()]);
    let first = program.line();
    let port = first.strip_prefix("port ").unwrap();
    assert_eq!(std::fs::read_link(&link).unwrap().to_str(), Some(port));
    let mut host = PtyHost::open(&link);
    host.call(&ModulePower { on: 1 });
    let (_, body) = host.call(&Identity {});
    assert_eq!(&body[..4], b"\x03A-7");
    assert_eq!(program.say("switch 1 on"), "ok");
    assert_eq!(program.say("switch 9 on"), "error switch 9 is not one of 1 to 5");
    assert_eq!(program.say("up y-"), "ok");
    assert_eq!(program.say("orient polar z+ 0"), "ok");
    assert_eq!(program.say("rotate 1080 5"), "error the turntable is moving; stop it first");
    assert_eq!(program.say("sleep 1000 s"), "ok");
    assert_eq!(program.say("rotate 1080 5"), "ok");
    assert_eq!(program.say("stop"), "ok");
    assert_eq!(program.say("orient down z+ 0"), "error \"down\" is not one of up, north, polar");
    assert_eq!(program.say("heading north"), "error \"north\" is not a number");
    assert_eq!(program.say("jump"), "error \"jump\" is not a command; help lists the commands");
    writeln!(program.child.stdin.as_mut().unwrap(), "quit").unwrap();
    assert_eq!(program.code(), Some(0));
    assert!(!link.is_symlink());
}

#[test]
fn program_ends_on_a_signal_and_with_its_input_when_told() {
    let program = Program::start(&[]);
    program.line();
    let pid = nix::unistd::Pid::from_raw(i32::try_from(program.child.id()).unwrap());
    nix::sys::signal::kill(pid, nix::sys::signal::Signal::SIGTERM).unwrap();
    assert_eq!(program.code(), Some(0));
    let mut program = Program::start(&["--until-eof", "--speed", "max"]);
    program.line();
    drop(program.child.stdin.take());
    assert_eq!(program.code(), Some(0));
    assert_eq!(Program::start(&["no-such-board"]).code(), Some(2));
    assert_eq!(Program::start(&["--speed", "-3"]).code(), Some(2));
}

/// A cable is pulled out and plugged in again: the host's port is gone and the board goes on. When the host finds it
/// behind another port, the board's watchdog has switched the module off.
#[test]
fn a_cable_comes_out_and_goes_in_again() {
    let bench = RunningBench::start(&options("good", Speed::Times(1.0))).unwrap();
    let control = bench.control();
    let mut host = PtyHost::open(bench.port());
    assert_eq!(host.call(&ModulePower { on: 1 }).0, 0);
    assert!(control.truth().unwrap().powered);
    control.unplug(hw_mocks::Cable::Serial).unwrap();
    let gone = Instant::now();
    let mut byte = [0];
    assert!(matches!(host.port.read(&mut byte), Ok(0) | Err(_)), "a port without a device says nothing");
    assert!(!control.wait_off(Duration::ZERO).unwrap());
    assert!(control.wait_off(PATIENCE).unwrap(), "the watchdog sleeps");
    assert!(gone.elapsed() > Duration::from_millis(1000), "not the cable but the silence switches it off");
    let mut host = PtyHost::open(&control.plug_in(hw_mocks::Cable::Serial).unwrap());
    assert_eq!(host.call(&ModulePower { on: 1 }).0, 0);
    assert_eq!(control.truth().unwrap().restarts, 0);
}
