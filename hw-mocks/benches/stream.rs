//! How many samples of the IMU the board makes, frames and writes in a second of wall time at maximum speed, on one
//! core: what a whole acceptance in a minute needs is 250,000.

#![allow(clippy::print_stdout, reason = "a benchmark prints its figures")]

use std::io::Read;
use std::time::{Duration, Instant};

use gnc_protocol::frame::{Flags, Frame, Header, Kind};
use gnc_protocol::message::{HostHello, MAGIC, ModulePower, StreamStart};
use gnc_protocol::serial::{Decoder, encode};
use gnc_protocol::wire::Wire;
use gnc_protocol::{Call, Payload};
use hw_mocks::devices::inertial::{SensorFaults, SensorModels, Sensors};
use hw_mocks::world::World;
use hw_mocks::{Axis, Bench, Direction, Options, RunningBench, Sign, Speed};

const SAMPLES: u32 = 1_000_000;

fn frame(kind: Kind, request: u16, message: u16, payload: Payload) -> Vec<u8> {
    let version = u8::from(kind != Kind::Hello);
    let header = Header { version, kind, flags: Flags::default(), request, message, sequence: 0 };
    encode(&Frame { header, payload }).to_vec()
}

fn hello() -> Vec<u8> {
    let hello = HostHello { magic: MAGIC, lowest: 1, highest: 1, nonce: 9 };
    frame(Kind::Hello, 0, 0, hello.to_payload().unwrap_or_default())
}

fn request<C: Call>(number: u16, call: &C) -> Vec<u8> {
    frame(Kind::Request, number, C::ID, call.to_payload().unwrap_or_default())
}

fn start(rate_hz: u16) -> StreamStart {
    StreamStart { stream: 1, rate_hz, count: SAMPLES, samples_per_frame: 12 }
}

fn options() -> Options {
    Options { speed: Speed::Max, ..Options::default() }
}

fn say(what: &str, samples: u32, span: Duration) {
    let rate = f64::from(samples) / span.as_secs_f64();
    println!("{what:<44} {rate:>10.0} samples/s   {:.3} us each", 1e6 / rate);
}

/// The sensors alone.
fn sensors(rate_hz: u16, turning: bool) {
    let mut world = World::new(Options::default().site, Duration::ZERO, 23.0);
    if turning {
        world.set_turn(Axis::Z, 200.0, 0.0);
    }
    let mut sensors = Sensors::new(SensorModels::default(), SensorFaults::default(), 1);
    sensors.power_on(0.0);
    let started = Instant::now();
    let mut sum = 0_i64;
    for index in 1..=SAMPLES {
        let now_s = f64::from(index) / f64::from(rate_hz);
        sum += i64::from(sensors.sample(&world.influence(now_s), now_s, f64::from(rate_hz)).gyro[0]);
    }
    std::hint::black_box(sum);
    say(&format!("sensors, {rate_hz} Hz, {}", if turning { "turning" } else { "still" }), SAMPLES, started.elapsed());
}

/// The whole board with its line, and nobody who reads what it says.
fn board(rate_hz: u16, turning: bool) {
    let mut bench = Bench::new(&options());
    let clock = Instant::now();
    let mut started = None;
    for bytes in [hello(), request(1, &ModulePower { on: 1 }), request(2, &start(rate_hz))] {
        bench.receive(&bytes, clock.elapsed());
        for _ in 0..20 {
            bench.advance(clock.elapsed());
            let count = bench.output(clock.elapsed()).len();
            bench.consume(count);
            if started.is_some() {
                break;
            }
        }
        if turning {
            let _ = bench.orient(Direction::Up, Axis::Z, Sign::Plus, 0.0);
        }
        started = Some(Instant::now());
    }
    if turning {
        bench.set_turn(Axis::Z, 200.0);
    }
    let keep_alive = frame(Kind::Event, 0, 2, Payload::new());
    let started = Instant::now();
    let (mut bytes, mut quiet) = (0_u64, 0);
    let mut fed = started;
    // The stream has ended when nothing comes for some turns.
    while quiet < 50 {
        let now = clock.elapsed();
        if fed.elapsed() > Duration::from_millis(400) {
            fed = Instant::now();
            bench.receive(&keep_alive, now);
        }
        bench.advance(now);
        let count = bench.output(now).len();
        bench.consume(count);
        bytes += count as u64;
        quiet = if count == 0 { quiet + 1 } else { 0 };
    }
    let label = format!("board, {rate_hz} Hz, {}", if turning { "turning" } else { "still" });
    say(&label, SAMPLES, started.elapsed());
    println!("    {:.1} bytes a sample", bytes as f64 / f64::from(SAMPLES));
}

/// Over a pseudo-terminal, to a thread that reads and throws away.
fn pty(rate_hz: u16) -> std::io::Result<()> {
    let bench = RunningBench::start(&options())?;
    let mut port = std::fs::OpenOptions::new().read(true).write(true).open(bench.port())?;
    let mut writer = port.try_clone()?;
    let mut decoder = Decoder::default();
    for (bytes, answer) in [
        (hello(), Kind::Hello),
        (request(1, &ModulePower { on: 1 }), Kind::Result),
        (request(2, &start(rate_hz)), Kind::Accept),
    ] {
        std::io::Write::write_all(&mut writer, &bytes)?;
        let mut came = false;
        while !came {
            let mut buffer = [0; 64];
            let count = port.read(&mut buffer)?;
            let mut rest = &buffer[..count];
            while let Some(outcome) = decoder.next(&mut rest) {
                came |= outcome.is_ok_and(|frame| frame.header.kind == answer);
            }
        }
    }
    let keep_alive = frame(Kind::Event, 0, 2, Payload::new());
    let started = Instant::now();
    let mut fed = started;
    let (mut bytes, mut reads) = (0_usize, 0);
    let mut buffer = vec![0; 65_536];
    // 42 bytes a sample and more: what is left at the end is a frame or two.
    while bytes < SAMPLES as usize * 42 {
        bytes += port.read(&mut buffer)?;
        reads += 1;
        if fed.elapsed() > Duration::from_millis(400) {
            fed = Instant::now();
            std::io::Write::write_all(&mut writer, &keep_alive)?;
        }
    }
    say(&format!("over a pseudo-terminal, {rate_hz} Hz, still"), SAMPLES, started.elapsed());
    println!("    {} bytes a read", bytes / reads);
    Ok(())
}

fn main() -> std::io::Result<()> {
    for (rate_hz, turning) in [(200, false), (1000, false), (1000, true)] {
        sensors(rate_hz, turning);
    }
    for (rate_hz, turning) in [(200, false), (1000, false), (1000, true)] {
        board(rate_hz, turning);
    }
    pty(200)?;
    pty(1000)
}
