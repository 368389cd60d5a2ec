//! Measures what the screen costs: drawing, idling, a stream that is shown, its first picture, and the time to answer a
//! key. Prints figures with their bounds.
//!
//!     cargo bench -p gnc-station --bench screen

#![expect(clippy::expect_used, clippy::print_stdout, reason = "a benchmark prints, and ends where it cannot go on")]

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::num::NonZero;
use std::os::fd::{AsFd as _, OwnedFd};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use gnc_station::{Lang, Scene};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::pty::{Winsize, openpty};
use nix::time::{ClockId, clock_gettime};
use nix::unistd::{SysconfVar, sysconf};

/// Drawing of 160 x 50: the slowest of a hundred.
const DRAW_MS: f64 = 2.0;
/// Samples of a spin for which the picture keeps the largest number of points.
const POINTS: u32 = 4095;
/// Samples of a capture.
const SAMPLES: u32 = 1_000_000;
/// What a picture may cost for each sample that it takes: a tenth of a percent of a core at 1 kHz.
const SAMPLE_US: f64 = 1.0;
/// Share of a core while nothing happens.
const IDLE_SHARE: f64 = 0.01;
/// Share of a core of the program, station included, while a stream is shown.
const STREAM_SHARE: f64 = 0.10;
/// Time from the start of the program to its first picture.
const FIRST_MS: f64 = 100.0;
/// Time from a key to the change on the screen, while a run is on.
const KEY_MS: f64 = 50.0;
/// How long shares of a core are measured.
const MEASURED: Duration = Duration::from_secs(8);
/// Ten seconds of the sensors at 1 kHz.
const FAST_PLAN: &str = "name = \"fast\"\nversion = \"1\"\n[[item]]\nid = \"imu\"\n\
                         params = { samples = 10000, rate = \"1000 Hz\" }\nlimits.gyro_x = \"0 +- 5 deg/s\"\n";

fn main() {
    drawing();
    pictures();
    program();
}

fn verdict(what: &str, value: f64, bound: f64, unit: &str) {
    let word = if value <= bound { "within" } else { "ABOVE" };
    println!("{what:<46} {value:>10.4} {unit:<4} {word} the bound of {bound} {unit}");
}

/// Draws every page of a run at work, with curves that go on, and the pictures of captures.
fn drawing() {
    let size = (160, 50);
    let scene = |scene: std::io::Result<Scene>| scene.expect("a screen in memory");
    let pages: [(&str, Scene, usize); 6] = [
        ("tests", scene(Scene::at_work(Lang::En, size.0, size.1)), 0),
        ("live", scene(Scene::at_work(Lang::En, size.0, size.1)), 1),
        ("captures, tests", scene(Scene::capturing(Lang::En, size, "six-position", 3)), 0),
        ("captures, turn", scene(Scene::capturing(Lang::En, size, "rotation", 3)), 1),
        ("captures, field", scene(Scene::spinning(Lang::En, size, POINTS)), 1),
        ("captures, Allan", scene(Scene::resting(Lang::En, size, 200_000)), 1),
    ];
    for (page, mut scene, turns) in pages {
        (0..turns).for_each(|_| scene.next_page());
        let mut times: Vec<f64> = (0..3000)
            .map(|_| {
                scene.next_sample();
                let began = own_time();
                scene.draw().expect("memory");
                (own_time() - began).as_secs_f64() * 1e3
            })
            .collect();
        times.sort_by(f64::total_cmp);
        println!("drawing 160 x 50, {page}, median                 {:>10.4} ms", times[times.len() / 2]);
        verdict(&format!("drawing 160 x 50, {page}, p99 of 3000"), times[times.len() * 99 / 100], DRAW_MS, "ms");
    }
}

/// Measures what pictures cost for each sample: most of the work of such a scene is to take samples.
fn pictures() {
    type Play = fn(Lang, (u16, u16), u32) -> std::io::Result<Scene>;
    let plays: [(&str, Play); 2] = [("field", Scene::spinning), ("Allan deviations", Scene::resting)];
    for (what, play) in plays {
        let took = |samples: u32| {
            let began = own_time();
            play(Lang::En, (80, 24), samples).expect("a screen in memory");
            (own_time() - began).as_secs_f64() * 1e6
        };
        let us = (took(SAMPLES) - took(1)) / f64::from(SAMPLES);
        verdict(&format!("{what} of a sample, with its simulation"), us, SAMPLE_US, "us");
    }
}

/// Processor time of this thread: on a busy machine wall time includes the work of other programs.
fn own_time() -> Duration {
    let time = clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID).expect("a clock");
    Duration::from(time)
}

/// Measures the program itself on a pseudo-terminal.
fn program() {
    let mut first: Vec<f64> = (0..10)
        .map(|_| {
            let began = Instant::now();
            let mut screen = Screen::open();
            screen.wait_for("GNC test station");
            let took = began.elapsed().as_secs_f64() * 1e3;
            screen.leave();
            took
        })
        .collect();
    first.sort_by(f64::total_cmp);
    verdict("first picture, slowest of 10", first[9], FIRST_MS, "ms");

    let mut screen = Screen::open();
    screen.wait_for("functional 1.0");
    screen.read_for(Duration::from_secs(1));
    verdict("idle, share of a core", screen.share(), IDLE_SHARE, "");

    screen.end();

    // A run that takes ten seconds of the sensors at 1 kHz, with its curves on the screen.
    let mut screen = Screen::open_with(FAST_PLAN);
    screen.wait_for("fast 1");
    screen.types(b"BENCH-1\r");
    screen.wait_for("BENCH-1: F5");
    screen.types(b"\x1b[15~\x1b[20~");
    screen.wait_for("deg/s");
    verdict("1 kHz stream shown, share of a core", screen.share(), STREAM_SHARE, "");
    screen.end();

    let mut screen = Screen::open();
    screen.wait_for("functional 1.0");

    // During a run: the cursor moves while items are at work.
    screen.types(b"BENCH-1\r");
    screen.types(b"\x1b[15~");
    screen.wait_for("Started   ");
    let mut keys: Vec<f64> = (0..20)
        .map(|index| {
            let key: &[u8] = if index % 2 == 0 { b"\x1bOP" } else { b"\x1b" };
            let shows = if index % 2 == 0 { "Start no more items" } else { "Elapsed " };
            let began = Instant::now();
            screen.types(key);
            screen.wait_for(shows);
            began.elapsed().as_secs_f64() * 1e3
        })
        .step_by(2)
        .collect();
    keys.sort_by(f64::total_cmp);
    verdict("key to picture during a run, slowest of 10", keys[keys.len() - 1], KEY_MS, "ms");
    screen.end();
}

/// The program on a terminal in memory.
struct Screen {
    child: Child,
    master: File,
    seen: vt100::Parser,
    _records: tempfile::TempDir,
}

impl Screen {
    fn open() -> Self {
        Self::open_with(include_str!("../../../test-plans/functional.toml"))
    }

    fn open_with(plan: &str) -> Self {
        let size = Winsize { ws_row: 50, ws_col: 160, ws_xpixel: 0, ws_ypixel: 0 };
        let pty = openpty(&size, None).expect("a pseudo-terminal");
        let end = |fd: &OwnedFd| Stdio::from(fd.try_clone().expect("its end"));
        let records = tempfile::TempDir::new().expect("a folder");
        let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
        let plan_path = records.path().join("plan.toml");
        std::fs::write(&plan_path, plan).expect("a plan");
        let child = Command::new(env!("CARGO_BIN_EXE_gnc-station"))
            .args(["--sim", "--records"])
            .arg(records.path())
            .arg("--plan")
            .arg(&plan_path)
            .current_dir(root)
            .env("TERM", "xterm-256color")
            .env("LC_ALL", "C.UTF-8")
            .stdin(end(&pty.slave))
            .stdout(end(&pty.slave))
            .stderr(Stdio::null())
            .spawn()
            .expect("the station");
        let cells = |count| NonZero::new(count).expect("more than none");
        let seen = vt100::Parser::new(cells(50), cells(160), 0);
        Self { child, master: File::from(pty.master), seen, _records: records }
    }

    fn types(&mut self, bytes: &[u8]) {
        self.master.write_all(bytes).expect("a terminal");
    }

    /// Reads the output that comes within a time.
    fn read(&mut self, time: Duration) {
        let wait = PollTimeout::try_from(time).unwrap_or(PollTimeout::MAX);
        let ready = poll(&mut [PollFd::new(self.master.as_fd(), PollFlags::POLLIN)], wait).expect("poll");
        let mut bytes = vec![0; 1 << 16];
        let count = if ready > 0 { self.master.read(&mut bytes).unwrap_or(0) } else { 0 };
        self.seen.process(&bytes[..count]);
    }

    fn read_for(&mut self, time: Duration) {
        let until = Instant::now() + time;
        while let Some(left) = until.checked_duration_since(Instant::now()) {
            self.read(left);
        }
    }

    /// Waits until a text is on the screen.
    fn wait_for(&mut self, text: &str) {
        let until = Instant::now() + Duration::from_secs(60);
        while !self.seen.screen().contents().contains(text) {
            assert!(Instant::now() < until, "{text} is not seen:\n{}", self.seen.screen().contents());
            self.read(Duration::from_secs(1));
        }
    }

    /// Share of a core that the program takes, its simulated board included.
    fn share(&mut self) -> f64 {
        let before = self.cpu_s();
        let began = Instant::now();
        self.read_for(MEASURED);
        (self.cpu_s() - before) / began.elapsed().as_secs_f64()
    }

    /// Processor time of all threads except those of the simulated board.
    fn cpu_s(&self) -> f64 {
        let ticks = sysconf(SysconfVar::CLK_TCK).ok().flatten().unwrap_or(100) as f64;
        let tasks = std::fs::read_dir(format!("/proc/{}/task", self.child.id())).expect("threads");
        let used = tasks.flatten().filter_map(|task| {
            let name = std::fs::read_to_string(task.path().join("comm")).ok()?;
            if name.starts_with("sim") || name.starts_with("bench") || name.starts_with("board") {
                return None;
            }
            let stat = std::fs::read_to_string(task.path().join("stat")).ok()?;
            let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
            Some(fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?)
        });
        used.sum::<f64>() / ticks
    }

    fn leave(mut self) {
        self.types(b"\x1b[21~");
        let _ = self.child.wait();
    }

    fn end(mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
