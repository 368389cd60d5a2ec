//! Plans: refused with mistakes that can be shown, or fit to be run to an end, whatever their items come to. What stands
//! behind a zero byte is the text of every include; without one, the plan itself is.

#![no_main]

#[path = "shared/mistakes.rs"]
mod mistakes;

use chrono::DateTime;
use gnc_analysis::motion;
use gnc_executive::event::{BenchInfo, Event, EventKind, PlanInfo, ProgramVersion, RunHeader};
use gnc_executive::job::{BenchAbilities, Job, Next};
use gnc_executive::outcome::Outcome;
use gnc_executive::plan::{MAX_PLAN_FILES, Plan};
use gnc_executive::state::RunState;
use libfuzzer_sys::fuzz_target;

const OUTCOMES: [Outcome; 4] = [Outcome::Passed, Outcome::Failed, Outcome::Errored, Outcome::Marginal];

fuzz_target!(|bytes: &[u8]| {
    let mut parts = bytes.splitn(2, |byte| *byte == 0);
    let text = parts.next().unwrap_or_default();
    let included = parts.next().unwrap_or(text);
    let read = || {
        let mut load = |_: &str| Ok(included.to_vec());
        Plan::read("plan.toml", text.to_vec(), &mut load).and_then(|plan| plan.check(motion::mistakes))
    };
    let plan = match read() {
        Ok(plan) => plan,
        Err(mistakes) => return mistakes::can_be_shown(&mistakes),
    };
    assert_eq!(read().as_ref(), Ok(&plan));
    assert!((1..=MAX_PLAN_FILES).contains(&plan.files().count()));
    assert!(plan.files().all(|(_, file)| file == text || file == included));
    for (position, item) in plan.items().iter().enumerate() {
        assert!(item.requires.iter().all(|required| *required < position), "{item:?}");
        assert!((0.001..=86_400.0).contains(&item.timeout_s), "{item:?}");
        let _ = motion::program(item.id, &item.params);
    }
    let seed = bytes.iter().fold(0usize, |sum, byte| sum.wrapping_mul(31).wrapping_add(usize::from(*byte)));
    for there in [true, false] {
        match Job::new(plan.clone(), BenchAbilities { rs422: true, can: there, operator: there }, None) {
            Ok(job) => run(&job, seed),
            Err(mistakes) => mistakes::can_be_shown(&mistakes),
        }
    }
});

/// Runs to the end, one item after the other.
fn run(job: &Job, seed: usize) {
    let planned = job.planned();
    assert_eq!(planned.len(), job.plan().items().len());
    let mut state = RunState::new();
    apply(&mut state, EventKind::RunStarted { header: Box::new(header(job)), items: planned });
    // Attempts of an item, each with a beginning and an end, and the end of the item itself.
    let most: usize = job.plan().items().iter().map(|item| 2 * item.attempts as usize + 1).sum();
    for step in 0..=most {
        let name = |position: usize| job.item(position).map(|item| item.name.clone()).unwrap();
        match job.next(&state) {
            Next::Run { item: position, attempt } => {
                let item = name(position);
                apply(&mut state, EventKind::ItemStarted { item: item.clone(), attempt });
                let outcome = OUTCOMES[(seed >> (step % 48)) & 3];
                apply(&mut state, EventKind::AttemptEnded { item, attempt, outcome, error: None });
            }
            Next::End { item, outcome } => {
                apply(&mut state, EventKind::ItemEnded { item: name(item), outcome, cause: None });
            }
            Next::Skip { item, cause } => {
                let (item, outcome) = (name(item), Outcome::Skipped);
                apply(&mut state, EventKind::ItemEnded { item, outcome, cause: Some(cause) });
            }
            Next::Wait => panic!("nothing runs, and yet it waits"),
            Next::Done { verdict } => {
                apply(&mut state, EventKind::RunEnded(verdict));
                assert!(state.rows().iter().all(|row| row.is_over()));
                let _ = job.critical_path(&|position| Some(position as f64));
                return;
            }
        }
    }
    panic!("no end after {most} steps");
}

fn apply(state: &mut RunState, kind: EventKind) {
    let seq = state.next_seq();
    let event = Event { seq, at: DateTime::UNIX_EPOCH.fixed_offset(), elapsed_us: seq, kind };
    state.apply(&event).unwrap();
}

fn header(job: &Job) -> RunHeader {
    let plan = job.plan();
    RunHeader {
        schema: gnc_executive::event::EVENTS_SCHEMA.to_owned(),
        serial_number: "F-1".to_owned(),
        part: None,
        numbers: Vec::new(),
        operator: None,
        station: "fuzz".to_owned(),
        program: ProgramVersion { name: "fuzz".to_owned(), version: String::new(), build: None },
        bench: BenchInfo::real(),
        site: None,
        plan: PlanInfo { name: plan.name.clone(), version: plan.version.clone(), sha256: String::new() },
        recomputed: None,
        resumed: None,
        selection: None,
        looped: None,
    }
}
