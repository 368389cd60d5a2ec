//! The simulated bench as a program. It serves a board on a pseudo-terminal or a serial port and takes an operator's
//! commands on standard input, so that station and board run as two processes.

use std::collections::VecDeque;
use std::ffi::OsString;
use std::io::{self, BufRead, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::mpsc::{self, Sender};
use std::time::Duration;

use clap::Parser;
use gnc_files::{Reach, Refused, is_refused};
use gnc_rig::Along;
use nix::sys::signal::{SigSet, Signal};

use crate::bench::{BenchOptions, Speed, Truth};
use crate::driver::{BenchGone, RunningBench, TurntableError};
use crate::personality::{LARGEST_FILE, Personality, beside, boards};
use crate::world::{ModuleAxis, Sign};

const HELP: &str = "\
switch N on|off   set DIP switch N (1 to 5) on or off
heading DEG       point the reference axis (X if Z is up) to DEG, clockwise from north
up AXIS           lay the module with this axis up: x+ x- y+ y- z+ z-
turn AXIS DPS     turn steadily about x, y or z, in deg/s
orient WHERE AXIS DEG  turntable: point AXIS (x+ ..) up, north or polar, the next axis at DEG
rotate DEG S      turntable: turn by DEG degrees in S seconds
spin DPS          turntable: turn at DPS deg/s without end
stop              turntable: stop any motion
sleep T s|ms      wait for T of bench time; later commands wait too
truth             print the true state of board and module
can               print where the CAN bus is: slcan:PATH or an interface
quit              end the program";

/// Serves a simulated slave board with a module in its socket on a pseudo-terminal or a serial port.
///
/// The first line on standard output is `port PATH`. Commands are read from standard input; `help` lists them. Each
/// is answered by a line that begins with `ok` or `error`.
#[derive(Debug, Parser)]
#[command(name = "hw-mocks", version)]
struct Arguments {
    /// The board with its module: a file, or the name of a board that comes with the program.
    #[arg(value_name = "BOARD", default_value = "good")]
    board: String,
    /// Serial number of the module, unless the board's file fixes one.
    #[arg(long, value_name = "SN")]
    serial_number: Option<String>,
    /// Seed of all random numbers.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// How fast the time of the board passes: a multiple of wall time, or `max`.
    #[arg(long, value_name = "N|max", default_value = "1", value_parser = parse_speed)]
    speed: Speed,
    /// Rate of the link.
    #[arg(long, value_name = "BAUD", default_value_t = 921_600, value_parser = clap::value_parser!(u32).range(1200..=12_000_000))]
    rate: u32,
    /// Serve this serial port of the computer instead of a pseudo-terminal.
    #[arg(long, value_name = "DEVICE")]
    port: Option<PathBuf>,
    /// Also create a symbolic link to the pseudo-terminal at this path.
    #[arg(long, value_name = "PATH", conflicts_with = "port")]
    link: Option<PathBuf>,
    /// Put the CAN bus on this kernel interface; by default the bus is an slcan adapter on a pseudo-terminal.
    #[arg(long, value_name = "INTERFACE")]
    can: Option<String>,
    /// Read also playbacks that lie outside of the folder of the board's file.
    #[arg(long)]
    allow_outside: bool,
    /// List the boards that come with the program, and end.
    #[arg(long)]
    boards: bool,
    /// End when standard input ends.
    #[arg(long)]
    until_eof: bool,
}

/// Reads `--speed`.
///
/// # Errors
/// A text for people if it is neither `max` nor a positive number.
pub(crate) fn parse_speed(text: &str) -> Result<Speed, String> {
    if text == "max" {
        return Ok(Speed::Max);
    }
    match text.parse::<f64>() {
        Ok(times) if (0.001..=1000.0).contains(&times) => Ok(Speed::Times(times)),
        _ => Err("it must be max or a number from 0.001 to 1000".to_owned()),
    }
}

/// Why the program ended with an error.
#[derive(Debug, thiserror::Error)]
enum ProgramError {
    #[error("cannot read {}", path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("{} is larger than {LARGEST_FILE} bytes, so it is not a board", path.display())]
    Large { path: PathBuf },
    #[error("there is no file {name}, and no built-in board of this name; --boards lists the built-in boards")]
    Unknown { name: String },
    #[error(transparent)]
    Personality(#[from] gnc_config::Mistakes),
    #[error("cannot open the ports")]
    Start(#[source] io::Error),
    #[error("cannot serve {} at {rate_baud} baud", port.display())]
    Port { port: PathBuf, rate_baud: u32, source: io::Error },
    #[error("cannot put a link at {}", path.display())]
    Link { path: PathBuf, source: io::Error },
    #[error("cannot wait for signals")]
    Signals(#[source] io::Error),
    #[error("cannot write to standard output")]
    Output(#[source] io::Error),
    #[error(transparent)]
    Gone(#[from] BenchGone),
}

/// Runs the program with its command line, which begins with the program's name.
#[must_use]
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version go to standard output and are not mistakes.
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
        }
    };
    match serve(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(io::stderr(), "error: {}", gnc_text::with_causes(&error));
            ExitCode::from(2)
        }
    }
}

enum Event {
    Line(String),
    InputEnded,
    Slept(Result<(), BenchGone>),
    Signal,
}

fn serve(arguments: &Arguments) -> Result<(), ProgramError> {
    if arguments.boards {
        return list_boards();
    }
    let options = BenchOptions {
        personality: load(&arguments.board, if arguments.allow_outside { Reach::Anywhere } else { Reach::Folder })?,
        serial_number: arguments.serial_number.clone(),
        seed: arguments.seed,
        speed: arguments.speed,
        rate_baud: arguments.rate,
        ..BenchOptions::default()
    };
    // Blocked before any thread starts, so that only the waiting thread gets them.
    let mut signals = SigSet::empty();
    signals.add(Signal::SIGINT);
    signals.add(Signal::SIGTERM);
    signals.thread_block().map_err(|error| ProgramError::Signals(error.into()))?;
    let can = arguments.can.as_deref();
    let bench = match &arguments.port {
        None => RunningBench::start_with(&options, can).map_err(ProgramError::Start)?,
        Some(port) => RunningBench::start_on(&options, port, can).map_err(|source| {
            let (port, rate_baud) = (port.clone(), arguments.rate);
            ProgramError::Port { port, rate_baud, source }
        })?,
    };
    let link = arguments.link.as_deref().map(|path| Link::put(path, bench.port())).transpose()?;
    say(&format!("port {}", bench.port().display()))?;
    let (events, received) = mpsc::channel();
    watch_signals(signals, events.clone());
    read_lines(events.clone());
    let mut waiting = VecDeque::new();
    let mut asleep = false;
    while let Ok(event) = received.recv() {
        match event {
            Event::Signal => break,
            Event::InputEnded if arguments.until_eof && !asleep && waiting.is_empty() => break,
            Event::InputEnded if arguments.until_eof => waiting.push_back("quit".to_owned()),
            Event::InputEnded => {}
            Event::Line(line) => waiting.push_back(line),
            Event::Slept(outcome) => {
                outcome?;
                asleep = false;
                say("ok")?;
            }
        }
        while !asleep && let Some(line) = waiting.pop_front() {
            match obey(&line, &bench) {
                Ok(Answer::Text(text)) => say(&text)?,
                Ok(Answer::Sleep(span)) => {
                    asleep = true;
                    let (control, events) = (bench.control(), events.clone());
                    // The receiver is gone only when the program ends.
                    std::thread::spawn(move || events.send(Event::Slept(control.sleep(span))));
                }
                Ok(Answer::Quit) => return Ok(()),
                Err(why) => say(&format!("error {why}"))?,
            }
        }
    }
    drop(link);
    Ok(())
}

enum Answer {
    Text(String),
    Sleep(Duration),
    Quit,
}

fn obey(line: &str, bench: &RunningBench) -> Result<Answer, String> {
    let control = bench.control();
    let words: Vec<&str> = line.split_whitespace().collect();
    let done = |outcome: Result<(), BenchGone>| {
        outcome.map(|()| Answer::Text("ok".to_owned())).map_err(|error| error.to_string())
    };
    let moved = |outcome: Result<(), TurntableError>| {
        outcome.map(|()| Answer::Text("ok".to_owned())).map_err(|error| error.to_string())
    };
    match words.as_slice() {
        [] => Ok(Answer::Text("ok".to_owned())),
        ["quit"] => Ok(Answer::Quit),
        ["help"] => Ok(Answer::Text(format!("ok\n{HELP}"))),
        ["can"] => Ok(Answer::Text(format!("ok {}", bench.can_port()))),
        ["truth"] => control.truth().map(|truth| Answer::Text(describe(&truth))).map_err(|error| error.to_string()),
        ["switch", number, state @ ("on" | "off")] => match number.parse() {
            Ok(number @ 1..=5_u8) => done(control.set_switch(number, *state == "on")),
            _ => Err(format!("switch {number} is not one of 1 to 5")),
        },
        ["heading", heading] => done(control.set_heading_deg(parse_number(heading)?)),
        ["up", axis] => {
            let (axis, sign) = parse_signed_axis(axis)?;
            done(control.set_axis_up(axis, sign))
        }
        ["turn", axis, rate] => {
            let (axis, _) = parse_signed_axis(&format!("{axis}+"))?;
            done(control.set_turn(axis, parse_number(rate)?))
        }
        ["orient", along, axis, heading] => {
            let along = match *along {
                "up" => Along::Up,
                "north" => Along::North,
                "polar" => Along::Polar,
                other => return Err(format!("\"{other}\" is not one of up, north, polar")),
            };
            let (axis, sign) = parse_signed_axis(axis)?;
            moved(control.orient(along, axis, sign, parse_number(heading)?))
        }
        ["rotate", angle, span] => moved(control.rotate(parse_number(angle)?, parse_number(span)?)),
        ["spin", rate] => moved(control.spin(parse_number(rate)?)),
        ["stop"] => moved(control.stop()),
        ["sleep", span, unit @ ("s" | "ms")] => {
            let span_s = parse_number(span)? * if *unit == "s" { 1.0 } else { 1e-3 };
            Duration::try_from_secs_f64(span_s).map(Answer::Sleep).map_err(|error| error.to_string())
        }
        _ => Err(format!("\"{}\" is not a command; help lists the commands", line.trim().escape_default())),
    }
}

fn parse_number(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|number: &f64| number.is_finite()).ok_or_else(|| format!("\"{text}\" is not a number"))
}

fn parse_signed_axis(text: &str) -> Result<(ModuleAxis, Sign), String> {
    match text {
        "x+" => Ok((ModuleAxis::X, Sign::Plus)),
        "x-" => Ok((ModuleAxis::X, Sign::Minus)),
        "y+" => Ok((ModuleAxis::Y, Sign::Plus)),
        "y-" => Ok((ModuleAxis::Y, Sign::Minus)),
        "z+" => Ok((ModuleAxis::Z, Sign::Plus)),
        "z-" => Ok((ModuleAxis::Z, Sign::Minus)),
        _ => Err(format!("\"{text}\" is not one of x+ x- y+ y- z+ z-")),
    }
}

fn describe(truth: &Truth) -> String {
    let vector = |vector: &nalgebra::Vector3<f64>| format!("{:.6} {:.6} {:.6}", vector.x, vector.y, vector.z);
    format!(
        "ok\nboard_time_us {}\nutc_s {:.3}\npowered {}\nrestarts {}\nhas_fix {}\nswitches {:?}\nspi_flash_erases {}\nforce {}\nrate_dps \
         {}\nfield_gauss {}\ntemperature_c {:.2}",
        truth.board_time_us,
        truth.utc_s,
        truth.powered,
        truth.restarts,
        truth.has_fix,
        truth.switches,
        truth.spi_flash_erases,
        vector(&truth.influence.force),
        vector(&truth.influence.rate_rps.map(f64::to_degrees)),
        vector(&truth.influence.field_gauss),
        truth.influence.temperature_c,
    )
}

fn load(name: &str, reach: Reach) -> Result<Personality, ProgramError> {
    let path = Path::new(name);
    if !path.exists() {
        return Personality::named(name).ok_or_else(|| ProgramError::Unknown { name: name.to_owned() });
    }
    let unreadable = |source| ProgramError::Read { path: path.to_owned(), source };
    let text = gnc_files::text(path, LARGEST_FILE).map_err(|error| match is_refused(&error) {
        Some(Refused::TooLong { .. }) => ProgramError::Large { path: path.to_owned() },
        _ => unreadable(error),
    })?;
    let stem = path.file_stem().map_or_else(|| name.to_owned(), |stem| stem.to_string_lossy().into_owned());
    Ok(Personality::with_files(&stem, &text, &mut beside(path, reach))?)
}

fn list_boards() -> Result<(), ProgramError> {
    let width = boards().iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    for (name, text) in boards() {
        say(&format!("{name:width$}  {}", Personality::from_toml(name, text)?.description))?;
    }
    Ok(())
}

fn say(text: &str) -> Result<(), ProgramError> {
    let mut out = io::stdout().lock();
    writeln!(out, "{text}").and_then(|()| out.flush()).map_err(ProgramError::Output)
}

fn watch_signals(signals: SigSet, events: Sender<Event>) {
    std::thread::spawn(move || {
        if signals.wait().is_ok() {
            let _ = events.send(Event::Signal);
        }
    });
}

fn read_lines(events: Sender<Event>) {
    std::thread::spawn(move || {
        for line in io::stdin().lock().lines() {
            let Ok(line) = line else { break };
            if events.send(Event::Line(line)).is_err() {
                return;
            }
        }
        let _ = events.send(Event::InputEnded);
    });
}

/// A symbolic link that is removed when the program ends.
struct Link(PathBuf);

impl Link {
    fn put(path: &Path, port: &Path) -> Result<Self, ProgramError> {
        // A link left over from a killed run may be replaced; any other file there is kept.
        if path.is_symlink() {
            let _ = std::fs::remove_file(path);
        }
        std::os::unix::fs::symlink(port, path)
            .map_err(|source| ProgramError::Link { path: path.to_owned(), source })?;
        Ok(Self(path.to_owned()))
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}
