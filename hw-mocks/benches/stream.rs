//! Measures how many samples of the IMU the board makes, frames and writes in a second of wall time at maximum speed,
//! on one core. A whole acceptance in a minute needs 250,000.

#![allow(clippy::print_stdout, reason = "a benchmark prints its figures")]

use std::io::Read;
use std::time::{Duration, Instant};

use gnc_protocol::frame::{Flags, Frame, Header, Kind};
use gnc_protocol::message::{HostHello, MAGIC, ModulePower, StreamStart};
use gnc_protocol::serial::{FrameDecoder, encode};
use gnc_protocol::wire::Wire;
use gnc_protocol::{Call, Payload};
use hw_mocks::devices::inertial::{SensorFaults, SensorModels, Sensors};
use hw_mocks::world::World;
use hw_mocks::{BenchOptions, ModuleAxis, RunningBench, SimulatedBench, Speed};
use nix::time::{ClockId, clock_gettime};

const SAMPLES: u32 = 1_000_000;
const KEEP_ALIVE: Duration = Duration::from_millis(400);

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

fn options() -> BenchOptions {
    BenchOptions { speed: Speed::Max, ..BenchOptions::default() }
}

/// Wall time, and the time of all processors for this program: on a busy machine only the second shows the cost.
struct Clock {
    wall: Instant,
    processor: Duration,
}

fn processor() -> Duration {
    clock_gettime(ClockId::CLOCK_PROCESS_CPUTIME_ID).map_or(Duration::ZERO, Duration::from)
}

impl Clock {
    fn start() -> Self {
        Self { wall: Instant::now(), processor: processor() }
    }

    fn say(&self, what: &str) {
        let rate = |span: Duration| f64::from(SAMPLES) / span.as_secs_f64();
        let (wall, used) = (rate(self.wall.elapsed()), rate(processor() - self.processor));
        println!("{what:<40} {wall:>9.0} samples/s of wall time, {used:>9.0} of processor time");
    }
}

/// Requests that start a stream, each with the kind of its answer.
fn conversation(rate_hz: u16) -> [(Vec<u8>, Kind); 3] {
    [
        (hello(), Kind::Hello),
        (request(1, &ModulePower { on: 1 }), Kind::Result),
        (request(2, &start(rate_hz)), Kind::Accept),
    ]
}

fn hears(decoder: &mut FrameDecoder, mut bytes: &[u8], wanted: Kind) -> bool {
    let mut came = false;
    while let Some(outcome) = decoder.next(&mut bytes) {
        came |= outcome.is_ok_and(|frame| frame.header.kind == wanted);
    }
    came
}

/// The sensors alone.
fn sensors(rate_hz: u16, turning: bool) {
    let mut world = World::new(BenchOptions::default().site, Duration::ZERO, 23.0);
    if turning {
        world.set_turn(ModuleAxis::Z, 200.0, 0.0);
    }
    let mut sensors = Sensors::new(SensorModels::default(), SensorFaults::default(), 1);
    sensors.power_on(0.0);
    let started = Clock::start();
    let mut sum = 0_i64;
    for index in 1..=SAMPLES {
        let now_s = f64::from(index) / f64::from(rate_hz);
        sum += i64::from(sensors.sample(&world.influence(now_s), now_s, f64::from(rate_hz)).gyro[0]);
    }
    std::hint::black_box(sum);
    started.say(&format!("sensors, {rate_hz} Hz, {}", if turning { "turning" } else { "still" }));
}

/// The whole board with its line, without a reader.
fn board(rate_hz: u16, turning: bool) {
    let mut bench = SimulatedBench::new(&options());
    let clock = Instant::now();
    let mut decoder = FrameDecoder::default();
    for (bytes, answer) in conversation(rate_hz) {
        if answer == Kind::Accept && turning {
            bench.set_turn(ModuleAxis::Z, 200.0);
        }
        bench.receive(&bytes, clock.elapsed());
        let mut came = false;
        while !came {
            bench.advance(clock.elapsed());
            let out = bench.output(clock.elapsed()).to_vec();
            bench.consume(out.len());
            came = hears(&mut decoder, &out, answer);
        }
    }
    let keep_alive = frame(Kind::Event, 0, 2, Payload::new());
    let started = Clock::start();
    let (mut bytes, mut quiet) = (0_u64, 0);
    let mut fed = clock.elapsed();
    // The stream has ended when no bytes come for some turns.
    while quiet < 50 {
        let now = clock.elapsed();
        if now - fed > KEEP_ALIVE {
            fed = now;
            bench.receive(&keep_alive, now);
        }
        bench.advance(now);
        let count = bench.output(now).len();
        bench.consume(count);
        bytes += count as u64;
        quiet = if count == 0 { quiet + 1 } else { 0 };
    }
    let label = format!("board, {rate_hz} Hz, {}", if turning { "turning" } else { "still" });
    started.say(&label);
    println!("    {:.1} bytes a sample", bytes as f64 / f64::from(SAMPLES));
}

/// Over a pseudo-terminal, to a thread that reads and discards.
fn pty(rate_hz: u16) -> std::io::Result<()> {
    let bench = RunningBench::start(&options())?;
    let mut port = std::fs::OpenOptions::new().read(true).write(true).open(bench.port())?;
    let mut writer = port.try_clone()?;
    let mut decoder = FrameDecoder::default();
    for (bytes, answer) in conversation(rate_hz) {
        std::io::Write::write_all(&mut writer, &bytes)?;
        let mut came = false;
        while !came {
            let mut buffer = [0; 64];
            let count = port.read(&mut buffer)?;
            came = hears(&mut decoder, &buffer[..count], answer);
        }
    }
    let keep_alive = frame(Kind::Event, 0, 2, Payload::new());
    let started = Clock::start();
    let mut fed = Instant::now();
    let (mut bytes, mut reads) = (0_usize, 0);
    let mut buffer = vec![0; 65_536];
    // A sample takes 42 bytes or more, so only a frame or two are left at the end.
    while bytes < SAMPLES as usize * 42 {
        bytes += port.read(&mut buffer)?;
        reads += 1;
        if fed.elapsed() > KEEP_ALIVE {
            fed = Instant::now();
            std::io::Write::write_all(&mut writer, &keep_alive)?;
        }
    }
    started.say(&format!("over a pseudo-terminal, {rate_hz} Hz, still"));
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
