//! A plan, a run and its events for tests.

use chrono::{DateTime, FixedOffset, TimeDelta};

use crate::event::{
    AttemptError, BenchInfo, BoardInfo, EVENTS_SCHEMA, ErrorRecord, Event, EventKind, NoteLevel, PlanInfo, Power,
    ProgramVersion, RunHeader,
};
use crate::job::{BenchAbilities, Job, Next};
use crate::measurement::{Measurement, Value};
use crate::outcome::Outcome;
use crate::plan::{Plan, PlanItem};
use crate::quantity::Unit;
use crate::state::RunState;
use crate::verdict::Verdict;

pub(crate) const FUNCTIONAL: &str = include_str!("fixture/functional.toml");

pub(crate) const EVERYTHING: BenchAbilities = BenchAbilities { rs422: true, can: true, operator: true };

/// Reads a plan without includes.
pub(crate) fn plan(text: &str) -> Plan {
    let plan = Plan::read("plan.toml", text.into(), &mut |name| Err(format!("{name} is not there")));
    plan.unwrap_or_else(|mistakes| panic!("{mistakes}"))
}

pub(crate) fn job(text: &str) -> Job {
    Job::new(plan(text), EVERYTHING, None).unwrap_or_else(|mistakes| panic!("{mistakes}"))
}

/// A run that applies its events as they are made.
pub(crate) struct TestRun {
    pub(crate) state: RunState,
    pub(crate) events: Vec<Event>,
}

impl TestRun {
    pub(crate) fn new(job: &Job, header: RunHeader) -> Self {
        let mut run = Self { state: RunState::new(), events: Vec::new() };
        run.emit(EventKind::RunStarted { header: Box::new(header), items: job.planned() });
        run
    }

    pub(crate) fn emit(&mut self, kind: EventKind) {
        let seq = self.state.next_seq();
        // 0.25 s between events, so that times are easy to calculate by hand.
        let elapsed_us = seq * 250_000;
        let at = start() + TimeDelta::microseconds(elapsed_us.try_into().unwrap());
        let event = Event { seq, at, elapsed_us, kind };
        self.state.apply(&event).unwrap();
        self.events.push(event);
    }

    pub(crate) fn attempt(&mut self, item: &PlanItem, attempt: u32, values: &[(&str, Value)]) -> Outcome {
        self.emit(EventKind::ItemStarted { item: item.name.clone(), attempt });
        let measurements: Vec<Measurement> =
            values.iter().map(|(name, value)| item.judge(name, value, 1, "DEMO-1")).collect();
        for measurement in &measurements {
            let measurement = measurement.clone();
            self.emit(EventKind::Measured { item: item.name.clone(), attempt, measurement });
        }
        let outcome = item.attempt_outcome(&measurements);
        self.emit(EventKind::AttemptEnded { item: item.name.clone(), attempt, outcome, error: None });
        outcome
    }

    /// Applies the job's steps until it asks for an attempt or is done; returns that step.
    pub(crate) fn settle(&mut self, job: &Job) -> Next {
        loop {
            let (item, outcome, cause) = match job.next(&self.state) {
                Next::End { item, outcome } => (item, outcome, None),
                Next::Skip { item, cause } => (item, Outcome::Skipped, Some(cause)),
                Next::Done { verdict } => {
                    self.emit(EventKind::RunEnded(verdict));
                    return Next::Done { verdict };
                }
                other => return other,
            };
            let item = job.item(item).unwrap().name.clone();
            self.emit(EventKind::ItemEnded { item, outcome, cause });
        }
    }
}

pub(crate) fn start() -> DateTime<FixedOffset> {
    "2026-11-22T14:30:15+08:00".parse().unwrap()
}

pub(crate) fn header() -> RunHeader {
    RunHeader {
        schema: EVENTS_SCHEMA.to_owned(),
        serial_number: "DEMO-1".to_owned(),
        part: None,
        numbers: Vec::new(),
        operator: Some("Li Wei".to_owned()),
        station: "line-2".to_owned(),
        program: ProgramVersion { name: "gnc-station".to_owned(), version: "0.1.0".to_owned(), build: None },
        bench: BenchInfo { port: Some("/dev/ttyUSB0".to_owned()), rate_bps: Some(921_600), ..BenchInfo::real() },
        plan: PlanInfo { name: "small".to_owned(), version: "1.0".to_owned(), sha256: "00".repeat(32) },
        site: None,
        recomputed: None,
        resumed: None,
        selection: None,
        looped: None,
    }
}

/// Four items: one good, one bad with an error record, one that errs twice, one skipped.
pub(crate) const SMALL: &str = r#"
name = "small"
version = "1.0"
[[item]]
id = "identity"
[item.limits]
serial_number = "== $serial_number"
supply_current = { limit = "0.49 A +- 5 %", marginal = "5 mA" }
[[item]]
id = "sdram"
params = { patterns = ["solid"] }
[item.limits]
mismatches_solid = "== 0"
test_time = "<= 2 s"
[[item]]
id = "imu"
attempts = 2
[item.limits]
gyro_x = "0 +- 2 deg/s"
[[item]]
id = "io"
requires = ["sdram"]
[item.limits]
wrong_reads = "== 0"
"#;

/// A run of [`SMALL`] with every kind of event except a stop.
pub(crate) fn small_run(header: RunHeader) -> TestRun {
    let job = job(SMALL);
    let item = |position: usize| job.item(position).unwrap();
    let mut run = TestRun::new(&job, header);
    run.emit(EventKind::BoardFound(BoardInfo {
        board_serial: "SB-7".to_owned(),
        firmware: "1.4.0".to_owned(),
        protocol: 1,
        boot_id: "5f3a9c01".to_owned(),
        link: "/dev/ttyUSB0 at 921600 bit/s".to_owned(),
    }));
    run.emit(EventKind::Power(Power {
        on: true,
        supply: "slave board".to_owned(),
        voltage_v: Some(5.01),
        current_a: None,
        calibration: None,
    }));
    assert_eq!(run.settle(&job), Next::Run { item: 0, attempt: 1 });
    let values = [
        ("serial_number", Value::text("DEMO-1")),
        ("firmware", Value::text("2.1\u{1b}[31m")),
        ("supply_current", Value::number(468.0, Unit::Milliampere)),
    ];
    assert_eq!(run.attempt(item(0), 1, &values), Outcome::Marginal);
    assert_eq!(run.settle(&job), Next::Run { item: 1, attempt: 1 });
    let name = "sdram".to_owned();
    run.emit(EventKind::ItemStarted { item: name.clone(), attempt: 1 });
    let record = ErrorRecord {
        what: "mismatch".to_owned(),
        location: "0x80001000".to_owned(),
        expected: "0xffffffff".to_owned(),
        got: "0xfffffffe".to_owned(),
        board_time_us: 1_234_567,
    };
    run.emit(EventKind::ErrorRecord { item: name.clone(), attempt: 1, record });
    let measurements = [
        item(1).judge("mismatches_solid", &Value::count(4096), 1, "DEMO-1"),
        item(1).judge("words_tested", &Value::count(33_554_432), 1, "DEMO-1"),
        item(1).judge("test_time", &Value::number(2.000_000_4, Unit::Second), 1, "DEMO-1"),
    ];
    for measurement in measurements.clone() {
        run.emit(EventKind::Measured { item: name.clone(), attempt: 1, measurement });
    }
    let details = serde_json::json!({ "equation": "f = Ka N + nabla", "residual_mps2": [0.1, -1.0 / 3.0] }).into();
    run.emit(EventKind::Found { item: name.clone(), attempt: 1, details });
    let outcome = item(1).attempt_outcome(&measurements);
    assert_eq!(outcome, Outcome::Failed);
    run.emit(EventKind::AttemptEnded { item: name, attempt: 1, outcome, error: None });
    assert_eq!(run.settle(&job), Next::Run { item: 2, attempt: 1 });
    assert_eq!(
        run.attempt(item(2), 1, &[("gyro_x", Value::number(f64::NAN, Unit::DegreePerSecond))]),
        Outcome::Errored
    );
    assert_eq!(run.settle(&job), Next::Run { item: 2, attempt: 2 });
    run.emit(EventKind::ItemStarted { item: "imu".to_owned(), attempt: 2 });
    run.emit(EventKind::BoardRebooted { item: Some("imu".to_owned()), boot_id: "77".to_owned() });
    let error = AttemptError {
        text: "the slave board restarted during the request".to_owned(),
        hint: "check its supply".to_owned(),
        again: false,
    };
    run.emit(EventKind::AttemptEnded {
        item: "imu".to_owned(),
        attempt: 2,
        outcome: Outcome::Errored,
        error: Some(error),
    });
    run.emit(EventKind::Note { level: NoteLevel::Info, text: "supply off\u{7}".to_owned(), item: None });
    let verdict = Verdict::new(Outcome::Errored, run.state.is_selection());
    assert_eq!(run.settle(&job), Next::Done { verdict });
    run
}
