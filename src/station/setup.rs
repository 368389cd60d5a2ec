//! Makes a bench from the command line: a real one from its file, or the simulated one.

#[cfg(feature = "sim")]
mod simulated;

use std::path::{Path, PathBuf};

use chrono::{Local, NaiveTime};
use gnc_bench::fixture::Fixture;
use gnc_bench::service::{CheckedPlan, Equipment};
use gnc_executive::bench::{
    BenchFile, BenchSite, DrawPictures, OperatorHabit, PinnedPlans, ScannerSettings, TestSocket,
};
use gnc_executive::event::{BenchInfo, BenchKind};
use gnc_executive::job::BenchAbilities;
use gnc_executive::numbers::NumberField;
use gnc_executive::serial_number::SerialNumberPattern;
use gnc_executive::standing::{PlanAsked, Question, Standing};
use gnc_files::Reach;
use gnc_link::Target;
use gnc_link::can::CanTarget;
use gnc_records::standing;
use gnc_records::store::{PublicKey, StationKey, StoreError};

use crate::args::{RunArgs, SimLink};
use crate::files::{self, ReadFile};
use crate::hook::HookProgram;
use crate::outputs::may_hold_records;
use crate::refusal::CommandRefusal;

/// The bench file that is used when none is named.
pub(crate) const BENCH_FILE: &str = "bench.toml";
/// The records folder that is used when none is named.
pub(crate) const RECORDS: &str = "records";

/// A bench that is ready to be used.
#[derive(Debug)]
pub(crate) struct Setup {
    pub equipment: Equipment,
    /// Keeps the simulated bench alive.
    pub simulation: Simulation,
}

#[cfg(feature = "sim")]
pub(crate) type Simulation = Option<hw_mocks::RunningBench>;
#[cfg(not(feature = "sim"))]
pub(crate) type Simulation = Option<std::convert::Infallible>;

/// A bench whose files are read and checked, but whose devices are not opened. A file that changes later does not
/// change the bench.
#[derive(Debug, Clone)]
pub(crate) struct CheckedBench {
    pub station: String,
    pub records: PathBuf,
    /// The bench as records name it. A simulated bench is without its port here, since each module gets another port.
    pub bench: BenchInfo,
    /// What the bench can do with an operator.
    pub abilities: BenchAbilities,
    /// The file that describes it, unless it is built in.
    pub text: Option<ReadFile>,
    /// What it does around its runs.
    pub habits: BenchHabits,
    /// What the serial number of each module must match.
    pub serial_number: Option<SerialNumberPattern>,
    /// Numbers beside it that each run is asked for.
    pub numbers: Vec<NumberField>,
    /// The scanner at a serial port, if there is one.
    pub scanner: Option<ScannerSettings>,
    /// The plans that it runs, if it does not run any.
    pub plans: PinnedPlans,
    /// Whether a person says that the clock is right.
    clock_is_right: bool,
    site: Option<BenchSite>,
    kind: Kind,
}

/// What a bench does around its runs, with the paths of its file resolved.
#[derive(Debug, Clone, Default)]
pub(crate) struct BenchHabits {
    /// The plan with which the screen opens.
    pub plan: Option<PathBuf>,
    pub operator: OperatorHabit,
    /// Whether the terminal rings at each verdict and question.
    pub bell: bool,
    /// The program that is told each verdict.
    pub hook: Option<HookProgram>,
    /// How the screen draws the pictures of questions.
    pub pictures: DrawPictures,
    /// When shifts begin, in the order of the day.
    pub shifts: Vec<NaiveTime>,
}

impl BenchHabits {
    fn of(file: &BenchFile, folder: Option<&Path>) -> Self {
        Self {
            plan: file.plan.as_ref().map(|plan| folder.unwrap_or_else(|| Path::new("")).join(plan)),
            operator: file.operator.clone(),
            bell: file.verdict.bell,
            hook: file.verdict.hook.as_ref().and_then(|hook| HookProgram::new(hook, folder)),
            pictures: file.pictures,
            shifts: file.shifts.clone(),
        }
    }

    /// The operator of a run: the one who is named, or the one of the bench file.
    pub(crate) fn operator(&self, named: Option<&str>) -> Result<Option<String>, CommandRefusal> {
        let named = named.map(str::trim).filter(|name| !name.is_empty());
        let name = named.map(str::to_owned).or_else(|| self.operator.name.clone());
        if name.is_none() && self.operator.required {
            let what = "no operator is named, and the bench file requires one";
            return Err(CommandRefusal::new(what, "name the operator with --operator NAME"));
        }
        Ok(name)
    }
}

#[derive(Debug, Clone)]
enum Kind {
    Real(Box<Lines>),
    #[cfg(feature = "sim")]
    Simulated(Box<simulated::SimulatedModule>),
}

/// What a real bench has to open.
#[derive(Debug, Clone)]
struct Lines {
    key: Option<StationKey>,
    /// The key's own public half and those of other stations.
    trusted_keys: Vec<PublicKey>,
    target: Target,
    can: Option<CanTarget>,
}

/// Reads and checks the bench that the command line names.
pub(crate) fn check(args: &RunArgs) -> Result<CheckedBench, CommandRefusal> {
    let bench = match &args.sim {
        #[cfg(feature = "sim")]
        Some(personality) => simulated::check(args, personality),
        #[cfg(not(feature = "sim"))]
        Some(_) => Err(without_simulation()),
        None => real(args),
    }?;
    may_hold_records(&bench.records)?;
    Ok(bench)
}

impl CheckedBench {
    /// Opens the bench. `operator` is called only for a real bench: the simulated bench turns its module by itself.
    #[cfg_attr(not(feature = "sim"), expect(unused_variables, reason = "a real module has its number without us"))]
    pub(crate) fn open(
        &self,
        serial_number: &str,
        operator: impl FnOnce() -> Result<Fixture, CommandRefusal>,
    ) -> Result<Setup, CommandRefusal> {
        match &self.kind {
            Kind::Real(lines) => {
                let Lines { key, trusted_keys, target, can } = (**lines).clone();
                let fixture = operator()?;
                let equipment = Equipment {
                    station: self.station.clone(),
                    records: self.records.clone(),
                    key,
                    trusted_keys,
                    bench: self.bench.clone(),
                    target,
                    can,
                    abilities: BenchAbilities { operator: fixture.is_there(), ..self.abilities },
                    fixture,
                    site: self.site.clone(),
                    serial_number: self.serial_number.clone(),
                    numbers: self.numbers.clone(),
                    plans: self.plans.clone(),
                    clock_is_right: self.clock_is_right,
                };
                Ok(Setup { equipment, simulation: None })
            }
            #[cfg(feature = "sim")]
            Kind::Simulated(module) => module.start(self, serial_number),
        }
    }

    /// The keys whose signatures count where a plan requires another one; none on a bench without a key.
    pub(crate) fn trusted_keys(&self) -> &[PublicKey] {
        match &self.kind {
            Kind::Real(lines) => &lines.trusted_keys,
            #[cfg(feature = "sim")]
            Kind::Simulated(_) => &[],
        }
    }

    /// The way to the board, as far as it is known before a module is scanned.
    pub(crate) fn link(&self) -> Option<&Target> {
        match &self.kind {
            Kind::Real(lines) => Some(&lines.target),
            #[cfg(feature = "sim")]
            Kind::Simulated(_) => None,
        }
    }
}

/// The way to a board, for a command that needs nothing else of the bench.
#[derive(Debug)]
pub(crate) struct BoardLine {
    pub target: Target,
    /// Keeps the simulated bench alive.
    _simulation: Simulation,
}

/// Finds the way to the board of a bench file, or starts a simulated board at true speed: its file, its link, and how far files
/// may lie that it names.
pub(crate) fn board_line(
    bench: Option<&Path>,
    sim: Option<(&Path, SimLink, Reach)>,
) -> Result<BoardLine, CommandRefusal> {
    match sim {
        #[cfg(feature = "sim")]
        Some((personality, link, reach)) => {
            let (target, running) = simulated::board_line(personality, link, reach)?;
            Ok(BoardLine { target, _simulation: Some(running) })
        }
        #[cfg(not(feature = "sim"))]
        Some(_) => Err(without_simulation()),
        None => {
            let path = bench_path(bench)?;
            let file = files::bench(&path)?;
            Ok(BoardLine { target: target(&path, &file)?.0, _simulation: None })
        }
    }
}

#[cfg(not(feature = "sim"))]
fn without_simulation() -> CommandRefusal {
    CommandRefusal::new("this program was built without the simulated bench", "build it with the feature `sim`")
}

/// The bench file that is named, or the one of this folder.
fn bench_path(named: Option<&Path>) -> Result<PathBuf, CommandRefusal> {
    match named {
        Some(path) => Ok(path.to_owned()),
        None if files::is_there(Path::new(BENCH_FILE)) => Ok(BENCH_FILE.into()),
        None => {
            let what = format!("no bench file is named, and there is no {BENCH_FILE} in this folder");
            Err(CommandRefusal::new(what, "name a bench file with --bench FILE, or test a simulated module with --sim"))
        }
    }
}

/// The way to the board, and the CAN bus of the bench.
fn target(path: &Path, file: &BenchFile) -> Result<(Target, Option<CanTarget>), CommandRefusal> {
    let Some(socket) = file.socket.clone() else {
        let what = format!("{} names no port: it has no [socket]", gnc_text::shown_path(path));
        return Err(CommandRefusal::new(what, "add [socket] with port and rate; `gnc-station ports` lists the ports"));
    };
    let can = file.can.as_ref().map(|can| CanTarget::parse(&can.port));
    let target = match (socket, &can) {
        (TestSocket::Rs422 { port, rate_bps }, _) => Target::Serial { port: port.into(), rate_baud: rate_bps },
        (TestSocket::Can, Some(can)) => Target::Can(can.clone()),
        (TestSocket::Can, None) => {
            // A checked bench file has both or neither.
            return Err(CommandRefusal::new(
                "the board is reached by CAN and there is no CAN bus",
                "add [can] with its port",
            ));
        }
    };
    Ok((target, can))
}

fn real(args: &RunArgs) -> Result<CheckedBench, CommandRefusal> {
    let path = bench_path(args.bench.as_deref())?;
    let (file, text) = files::bench_and_text(&path)?;
    let (target, can) = target(&path, &file)?;
    let bench = BenchInfo {
        port: Some(target.port()),
        rate_bps: Some(target.rate_bps()),
        site: file.site.as_ref().and_then(|site| site.name.clone()),
        ..BenchInfo::real()
    };
    // The run looks again: the port may be another one by then.
    let doubt = target.doubt().or_else(|| can.as_ref().and_then(CanTarget::doubt));
    let bench = bench.in_doubt(doubt.map(|doubt| doubt.to_string()));
    let key = key(&file, path.parent())?;
    let trusted_keys = trusted_keys(&file, path.parent(), key.as_ref())?;
    Ok(CheckedBench {
        station: station(args, &file),
        records: records(args, &file, path.parent()),
        bench,
        abilities: abilities(&file, true),
        text: Some(text),
        habits: BenchHabits::of(&file, path.parent()),
        clock_is_right: args.clock_is_right,
        kind: Kind::Real(Box::new(Lines { key, trusted_keys, target, can })),
        serial_number: file.serial_number,
        numbers: file.numbers,
        plans: file.plans,
        scanner: file.scanner,
        site: file.site,
    })
}

/// What a real bench can do. The caller says whether an operator is there, since that is known only when a plan is run.
/// A bench that reaches its board by CAN is taken to have no RS-422 line.
pub(crate) fn abilities(file: &BenchFile, operator: bool) -> BenchAbilities {
    BenchAbilities { rs422: file.socket != Some(TestSocket::Can), can: file.can.is_some(), operator }
}

/// What the simulated bench can do.
pub(crate) const SIMULATED: BenchAbilities = BenchAbilities { rs422: true, can: true, operator: true };

fn station(args: &RunArgs, file: &BenchFile) -> String {
    args.station.clone().unwrap_or_else(|| file.station_id.clone())
}

/// Returns the records folder, as far as it is known without starting anything.
pub(crate) fn records_folder(args: &RunArgs) -> PathBuf {
    let path = args.bench.clone().unwrap_or_else(|| BENCH_FILE.into());
    match files::bench(&path) {
        Ok(file) if args.sim.is_none() => records(args, &file, path.parent()),
        _ => args.records.clone().unwrap_or_else(|| RECORDS.into()),
    }
}

/// What the records say of a module by a plan, now.
pub(crate) fn standing(
    records: &Path,
    serial_number: &str,
    plan: &CheckedPlan,
    bench: BenchKind,
    trusted_keys: &[PublicKey],
) -> Result<Standing, StoreError> {
    let (info, valid_days) = (plan.info(), plan.plan().valid_days);
    let (plan, now) = (PlanAsked::This(&info), Local::now().fixed_offset());
    standing::read(records, &Question { serial_number, plan, valid_days, bench, now }, trusted_keys)
}

/// Reads the station's key. Its path is relative to the folder of the bench file.
pub(crate) fn key(file: &BenchFile, folder: Option<&Path>) -> Result<Option<StationKey>, CommandRefusal> {
    let Some(key) = &file.key else { return Ok(None) };
    let path = folder.unwrap_or_else(|| Path::new("")).join(key);
    StationKey::read(&path)
        .map(Some)
        .map_err(|error| CommandRefusal::new(gnc_text::with_causes(&error), error.try_this()))
}

/// The public keys whose signatures count where a plan requires another one: that of the bench and those that its file names. None:
/// signatures are not looked at.
fn trusted_keys(
    file: &BenchFile,
    folder: Option<&Path>,
    own: Option<&StationKey>,
) -> Result<Vec<PublicKey>, CommandRefusal> {
    let others = file.trusted_keys.iter().map(|key| trusted_key(key, folder));
    own.map(|key| Ok(key.public())).into_iter().chain(others).collect()
}

/// Reads one of the public keys that a bench file names. Its path is relative to the folder of that file.
pub(crate) fn trusted_key(named: &str, folder: Option<&Path>) -> Result<PublicKey, CommandRefusal> {
    let path = folder.unwrap_or_else(|| Path::new("")).join(named);
    PublicKey::read(&path).map_err(|error| {
        let try_this = "put the public half of the other station's key there, or correct trusted_keys under [station] of the bench file";
        CommandRefusal::new(gnc_text::with_causes(&error), try_this)
    })
}

/// Returns the records folder. A relative path in a bench file starts at the folder of that file.
fn records(args: &RunArgs, file: &BenchFile, folder: Option<&Path>) -> PathBuf {
    args.records.clone().or_else(|| records_of(file, folder)).unwrap_or_else(|| RECORDS.into())
}

/// The records folder that a bench file names. A relative path starts at the folder of that file.
pub(crate) fn records_of(file: &BenchFile, folder: Option<&Path>) -> Option<PathBuf> {
    file.records.as_ref().map(|records| folder.unwrap_or_else(|| Path::new("")).join(records))
}
