//! From the command line to a bench: a real one by its file, or the simulated one.

use std::path::{Path, PathBuf};

use gnc_bench::fixture::Fixture;
use gnc_executive::bench::{BenchFile, Site, Socket};
use gnc_executive::event::Bench;
use gnc_executive::job::BenchAbilities;
use gnc_link::Target;
use gnc_link::can::CanTarget;
use gnc_records::store::StationKey;

use crate::args::RunArgs;
#[cfg(feature = "sim")]
use crate::args::SimLink;
use crate::files;
use crate::refusal::Refusal;

/// The bench file that is taken where none is named.
pub(crate) const BENCH_FILE: &str = "bench.toml";
/// Where records go if nobody says otherwise.
pub(crate) const RECORDS: &str = "records";

/// A bench that is ready to be used.
#[derive(Debug)]
pub(crate) struct Setup {
    pub station: String,
    pub records: PathBuf,
    /// Signs the runs that are closed.
    pub key: Option<StationKey>,
    pub bench: Bench,
    pub target: Target,
    pub can: Option<CanTarget>,
    pub abilities: BenchAbilities,
    pub fixture: Fixture,
    pub site: Option<Site>,
    /// Keeps the simulated bench alive.
    pub simulation: Simulation,
}

#[cfg(feature = "sim")]
pub(crate) type Simulation = Option<hw_mocks::RunningBench>;
#[cfg(not(feature = "sim"))]
pub(crate) type Simulation = Option<std::convert::Infallible>;

/// `operator` is asked only for a real bench: the simulated one turns its module by itself.
pub(crate) fn from_args(
    args: &RunArgs,
    serial_number: &str,
    operator: impl FnOnce() -> Result<Fixture, Refusal>,
) -> Result<Setup, Refusal> {
    match &args.sim {
        Some(personality) => simulated(args, personality, serial_number),
        None => real(args, operator),
    }
}

fn real(args: &RunArgs, operator: impl FnOnce() -> Result<Fixture, Refusal>) -> Result<Setup, Refusal> {
    let path = match &args.bench {
        Some(path) => path.clone(),
        None if Path::new(BENCH_FILE).exists() => BENCH_FILE.into(),
        None => {
            let what = format!("no bench: there is no {BENCH_FILE} here");
            return Err(Refusal::new(
                what,
                "name a bench file with --bench FILE, or test a simulated module with --sim",
            ));
        }
    };
    let file = files::bench(&path)?;
    let Some(socket) = file.socket.clone() else {
        let what = format!("{} names no port: it has no [socket]", path.display());
        return Err(Refusal::new(what, "add [socket] with port and rate; `gnc-station ports` lists what is there"));
    };
    let fixture = operator()?;
    let can = file.can.as_ref().map(|can| CanTarget::parse(&can.port));
    let target = match (socket, &can) {
        (Socket::Rs422 { port, rate_bps }, _) => Target::Serial { port: port.into(), rate_baud: rate_bps },
        (Socket::Can, Some(can)) => Target::Can(can.clone()),
        (Socket::Can, None) => {
            // A checked bench file has both or neither.
            return Err(Refusal::new("the board is reached by CAN and there is no CAN bus", "add [can] with its port"));
        }
    };
    let bench = Bench {
        port: Some(target.port()),
        rate_bps: Some(target.rate_bps()),
        site: file.site.as_ref().and_then(|site| site.name.clone()),
        ..Bench::real()
    };
    Ok(Setup {
        station: station(args, &file),
        records: records(args, &file, path.parent()),
        key: key(&file, path.parent())?,
        bench,
        target,
        can,
        abilities: abilities(&file, fixture.is_there()),
        fixture,
        site: file.site,
        simulation: None,
    })
}

/// What a real bench can do. With somebody at it: that is known only when a plan is run. Where the board is reached by
/// CAN, nobody knows of an RS-422 line.
pub(crate) fn abilities(file: &BenchFile, operator: bool) -> BenchAbilities {
    BenchAbilities { rs422: file.socket != Some(Socket::Can), can: file.can.is_some(), operator }
}

/// What the simulated bench can do.
pub(crate) const SIMULATED: BenchAbilities = BenchAbilities { rs422: true, can: true, operator: true };

#[cfg(not(feature = "sim"))]
fn simulated(_: &RunArgs, _: &Path, _: &str) -> Result<Setup, Refusal> {
    Err(Refusal::new("this program was built without the simulated bench", "build it with the feature `sim`"))
}

#[cfg(feature = "sim")]
fn simulated(args: &RunArgs, personality: &Path, serial_number: &str) -> Result<Setup, Refusal> {
    use hw_mocks::{Options, Personality, RunningBench};

    let name = personality.display().to_string();
    let personality = match hw_mocks::boards().iter().find(|(built_in, _)| *built_in == name) {
        Some((_, text)) if !personality.exists() => Personality::from_toml(&name, text),
        _ => {
            let text = std::fs::read_to_string(personality).map_err(|error| {
                let what = format!("cannot read the board {name}: {error}");
                Refusal::new(what, "hw-mocks/boards/ has boards to start from; `hw-mocks --boards` lists their names")
            })?;
            Personality::with_files(&name, &text, &mut hw_mocks::beside(personality))
        }
    };
    let personality = personality.map_err(|mistakes| {
        Refusal::new(
            mistakes,
            "compare it with the boards in hw-mocks/boards/; all keys stand in hw-mocks/personality.rs",
        )
    })?;
    let speed = speed(&args.sim_speed)?;
    let file = BenchFile::read("the simulated bench's file", hw_mocks::BENCH_FILE.as_bytes().to_vec())
        .map_err(|mistakes| Refusal::new(mistakes, ""))?;
    let options = Options {
        serial_number: Some(serial_number.to_owned()),
        seed: args.seed,
        speed,
        personality,
        ..Options::default()
    };
    let rate_baud = options.rate_baud;
    let interfaces = args.sim_can.as_deref().map(|names| names.split_once(',').unwrap_or((names, names)));
    if let Some((_, board)) = interfaces {
        // What it says of an interface that is not there is better than what the simulated board could.
        let open = gnc_link::can::check_interface(board);
        open.map_err(|error| Refusal::new(&error, error.try_this()))?;
    }
    let running = RunningBench::start_with(&options, interfaces.map(|(_, board)| board))
        .map_err(|error| Refusal::new(format!("cannot start the simulated bench: {error}"), "is /dev/pts there?"))?;
    let can = CanTarget::parse(interfaces.map_or(running.can_port(), |(host, _)| host));
    let target = match args.sim_link {
        SimLink::Can => Target::Can(can.clone()),
        SimLink::Rs422 => Target::Serial { port: running.port().to_owned(), rate_baud },
    };
    let bench = Bench {
        port: Some(target.port()),
        rate_bps: Some(target.rate_bps()),
        site: file.site.as_ref().and_then(|site| site.name.clone()),
        ..Bench::simulated(name, args.sim_speed.clone(), args.seed)
    };
    Ok(Setup {
        station: station(args, &file),
        records: records(args, &file, None),
        // Simulation is never evidence, and needs no signature.
        key: None,
        bench,
        target,
        can: Some(can),
        abilities: BenchAbilities { rs422: args.sim_link == SimLink::Rs422, ..SIMULATED },
        fixture: Fixture::Driven(std::sync::Arc::new(running.control())),
        site: file.site,
        simulation: Some(running),
    })
}

#[cfg(feature = "sim")]
fn speed(text: &str) -> Result<hw_mocks::Speed, Refusal> {
    if text == "max" {
        return Ok(hw_mocks::Speed::Max);
    }
    match text.parse::<f64>() {
        Ok(factor) if factor.is_finite() && factor > 0.0 => Ok(hw_mocks::Speed::Times(factor)),
        _ => {
            let shown = gnc_text::quoted(text);
            Err(Refusal::new(format!("{shown} is no speed of simulated time"), "use a factor such as 10, or max"))
        }
    }
}

fn station(args: &RunArgs, file: &BenchFile) -> String {
    args.station.clone().unwrap_or_else(|| file.station_id.clone())
}

/// Where records go, as far as can be said without starting anything.
pub(crate) fn records_folder(args: &RunArgs) -> PathBuf {
    let path = args.bench.clone().unwrap_or_else(|| BENCH_FILE.into());
    match files::bench(&path) {
        Ok(file) if args.sim.is_none() => records(args, &file, path.parent()),
        _ => args.records.clone().unwrap_or_else(|| RECORDS.into()),
    }
}

/// The station's key, by the folder of the bench file.
fn key(file: &BenchFile, folder: Option<&Path>) -> Result<Option<StationKey>, Refusal> {
    let Some(key) = &file.key else { return Ok(None) };
    let path = folder.unwrap_or_else(|| Path::new("")).join(key);
    StationKey::read(&path).map(Some).map_err(|error| Refusal::new(gnc_text::with_causes(&error), error.try_this()))
}

/// A folder in a bench file goes from the folder of that file.
fn records(args: &RunArgs, file: &BenchFile, folder: Option<&Path>) -> PathBuf {
    let named = file.records.as_ref().map(|records| folder.unwrap_or_else(|| Path::new("")).join(records));
    args.records.clone().or(named).unwrap_or_else(|| RECORDS.into())
}
