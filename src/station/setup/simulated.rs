//! The simulated bench: a module that a file describes, or one that is built in.

use std::io;
use std::path::Path;
use std::sync::Arc;

use gnc_bench::fixture::Fixture;
use gnc_bench::service::Equipment;
use gnc_config::did_you_mean;
use gnc_executive::bench::BenchFile;
use gnc_executive::event::BenchInfo;
use gnc_executive::job::BenchAbilities;
use gnc_files::Reach;
use gnc_link::Target;
use gnc_link::can::CanTarget;
use hw_mocks::{BenchOptions, Personality, RunningBench, Speed};

use super::{BenchHabits, CheckedBench, Kind, SIMULATED, Setup, records, station};
use crate::args::{RunArgs, SimLink};
use crate::files::{self, ReadFile};
use crate::refusal::CommandRefusal;

/// A simulated module that waits for its serial number.
#[derive(Debug, Clone)]
pub(super) struct SimulatedModule {
    options: BenchOptions,
    link: SimLink,
    /// Interfaces of the kernel for the simulated CAN bus: the station's and the board's.
    interfaces: Option<(String, String)>,
}

pub(super) fn check(args: &RunArgs, personality: &Path) -> Result<CheckedBench, CommandRefusal> {
    let name = personality.to_string_lossy().into_owned();
    let (personality, text) = read(personality, &name, args.reach())?;
    let speed = speed(&args.sim_speed)?;
    let file = BenchFile::read("the simulated bench's file", hw_mocks::BENCH_FILE.as_bytes().to_vec())
        .map_err(|mistakes| CommandRefusal::new(mistakes, ""))?;
    let interfaces = args.sim_can.as_deref().map(|names| names.split_once(',').unwrap_or((names, names)));
    if let Some((_, board)) = interfaces {
        // Check here, since this error about a missing interface is better than that of the simulated board.
        let open = gnc_link::can::check_interface(board);
        open.map_err(|error| CommandRefusal::new(&error, error.try_this()))?;
    }
    let bench = BenchInfo {
        site: file.site.as_ref().and_then(|site| site.name.clone()),
        ..BenchInfo::simulated(name, args.sim_speed.clone(), args.seed)
    };
    let interfaces = interfaces.map(|(host, board)| (host.to_owned(), board.to_owned()));
    let options = BenchOptions { seed: args.seed, speed, personality, ..BenchOptions::default() };
    Ok(CheckedBench {
        station: station(args, &file),
        records: records(args, &file, None),
        bench,
        abilities: BenchAbilities { rs422: args.sim_link == SimLink::Rs422, ..SIMULATED },
        text,
        habits: BenchHabits::default(),
        serial_number: file.serial_number,
        numbers: file.numbers,
        plans: file.plans,
        scanner: file.scanner,
        clock_is_right: args.clock_is_right,
        site: file.site,
        kind: Kind::Simulated(Box::new(SimulatedModule { options, link: args.sim_link, interfaces })),
    })
}

/// Starts a simulated board at true speed, for a command that needs nothing else.
pub(super) fn board_line(
    personality: &Path,
    link: SimLink,
    reach: Reach,
) -> Result<(Target, RunningBench), CommandRefusal> {
    let (personality, _) = read(personality, &gnc_text::shown_path(personality), reach)?;
    let options = BenchOptions { personality, speed: Speed::Times(1.0), ..BenchOptions::default() };
    let running = start(&options, None)?;
    let target = match link {
        SimLink::Can => Target::Can(CanTarget::parse(running.can_port())),
        SimLink::Rs422 => Target::Serial { port: running.port().to_owned(), rate_baud: options.rate_baud },
    };
    Ok((target, running))
}

fn start(options: &BenchOptions, interface: Option<&str>) -> Result<RunningBench, CommandRefusal> {
    RunningBench::start_with(options, interface).map_err(|error| {
        CommandRefusal::new(format!("cannot start the simulated bench: {error}"), "check that /dev/pts is mounted")
    })
}

/// The module and its file; no file if the module is built in.
fn read(path: &Path, name: &str, reach: Reach) -> Result<(Personality, Option<ReadFile>), CommandRefusal> {
    let (personality, text) = match hw_mocks::boards().iter().find(|(built_in, _)| *built_in == name) {
        Some((_, text)) if !path.exists() => (Personality::from_toml(name, text), None),
        _ => {
            let text = gnc_files::text(path, hw_mocks::LARGEST_FILE).map_err(|error| {
                let what = format!("cannot read the board {name}: {error}");
                let built_in = || {
                    let all = "start from a board in hw-mocks/boards/, or name a built-in board: `hw-mocks --boards` lists them";
                    did_you_mean(name, hw_mocks::boards().iter().map(|(name, _)| *name), || all.to_owned())
                };
                let is_missing = gnc_files::is_refused(&error).is_none() && error.kind() == io::ErrorKind::NotFound;
                let try_this = if is_missing { built_in() } else { files::how_to_read(&error).to_owned() };
                CommandRefusal::new(what, &try_this)
            })?;
            let personality = Personality::with_files(name, &text, &mut hw_mocks::beside(path, reach));
            (personality, Some(ReadFile { path: path.to_owned(), bytes: text.into_bytes() }))
        }
    };
    let personality = personality.map_err(|error| {
        CommandRefusal::new(
            error,
            "compare it with the boards in hw-mocks/boards/; hw-mocks/personality.rs lists all keys",
        )
    })?;
    Ok((personality, text))
}

fn speed(text: &str) -> Result<Speed, CommandRefusal> {
    if text == "max" {
        return Ok(Speed::Max);
    }
    match text.parse::<f64>() {
        Ok(factor) if factor.is_finite() && factor > 0.0 => Ok(Speed::Times(factor)),
        _ => {
            let shown = gnc_text::quoted(text);
            Err(CommandRefusal::new(
                format!("{shown} is not a speed of simulated time"),
                "use a factor such as 10, or max",
            ))
        }
    }
}

impl SimulatedModule {
    pub(super) fn start(&self, checked: &CheckedBench, serial_number: &str) -> Result<Setup, CommandRefusal> {
        let options = BenchOptions { serial_number: Some(serial_number.to_owned()), ..self.options.clone() };
        let board = self.interfaces.as_ref().map(|(_, board)| board.as_str());
        let running = start(&options, board)?;
        let can = CanTarget::parse(self.interfaces.as_ref().map_or(running.can_port(), |(host, _)| host));
        let target = match self.link {
            SimLink::Can => Target::Can(can.clone()),
            SimLink::Rs422 => Target::Serial { port: running.port().to_owned(), rate_baud: options.rate_baud },
        };
        let (port, rate_bps) = (Some(target.port()), Some(target.rate_bps()));
        let equipment = Equipment {
            station: checked.station.clone(),
            records: checked.records.clone(),
            // A simulated run is never evidence, and needs no signature.
            key: None,
            trusted_keys: Vec::new(),
            bench: BenchInfo { port, rate_bps, ..checked.bench.clone() },
            target,
            can: Some(can),
            abilities: checked.abilities,
            fixture: Fixture::Driven(Arc::new(running.control())),
            site: checked.site.clone(),
            serial_number: checked.serial_number.clone(),
            numbers: checked.numbers.clone(),
            plans: checked.plans.clone(),
            clock_is_right: checked.clock_is_right,
        };
        Ok(Setup { equipment, simulation: Some(running) })
    }
}
