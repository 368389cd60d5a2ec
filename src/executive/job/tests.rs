use proptest::prelude::*;

use super::*;
use crate::event::EventKind;
use crate::measurement::Value;
use crate::plan::MAX_ITEMS;
use crate::test_run::{EVERYTHING, FUNCTIONAL, TestRun, header, job, plan};

/// Runs a job with given outcomes, one for each attempt, and writes down what happened.
fn play(job: &Job, outcomes: &[(&str, &[Outcome])], stop: Option<(usize, StopHow)>) -> String {
    let mut header = header();
    header.selection = job.selection().map(<[String]>::to_vec);
    let mut run = TestRun::new(job, header);
    let mut story = String::new();
    let mut begun = 0;
    loop {
        let (item, attempt) = match job.next(&run.state) {
            Next::Run { item, attempt } => (job.item(item).unwrap().name.clone(), attempt),
            Next::End { item, outcome } => {
                let item = job.item(item).unwrap().name.clone();
                story.push_str(&format!("{item} {outcome}\n"));
                run.emit(EventKind::ItemEnded { item, outcome, cause: None });
                continue;
            }
            Next::Skip { item, cause } => {
                let item = job.item(item).unwrap().name.clone();
                story.push_str(&format!("{item} skipped: {cause}\n"));
                run.emit(EventKind::ItemEnded { item, outcome: Outcome::Skipped, cause: Some(cause) });
                continue;
            }
            Next::Wait => panic!("waits with nothing in flight:\n{story}"),
            Next::Done { verdict } => {
                run.emit(EventKind::RunEnded(verdict));
                story.push_str(&format!("run {verdict}"));
                return story;
            }
        };
        begun += 1;
        assert!(begun < 1000, "does not end:\n{story}");
        run.emit(EventKind::ItemStarted { item: item.clone(), attempt });
        let mut outcome = outcomes
            .iter()
            .find(|(name, _)| *name == item)
            .and_then(|(_, outcomes)| outcomes.get(attempt as usize - 1))
            .copied()
            .unwrap_or(Outcome::Passed);
        if let Some((at, how)) = stop
            && at == begun
        {
            run.emit(EventKind::StopRequested { how, by: "ctrl-C".to_owned() });
            outcome = Outcome::Aborted;
        }
        story.push_str(&format!("{item} attempt {attempt}\n"));
        run.emit(EventKind::AttemptEnded { item, attempt, outcome, error: None });
    }
}

const PHASES: &str = r#"
name = "phases"
version = "1"
[[item]]
id = "sci"
phase = "teardown"
requires = ["cpu"]
[[item]]
id = "identity"
phase = "setup"
[[item]]
id = "cpu"
attempts = 3
[item.limits]
"*" = "== 0"
[[item]]
id = "io"
requires = ["cpu"]
attempts = 2
retry_failed = true
[item.limits]
wrong_reads = "== 0"
[[item]]
id = "spi"
requires = ["io"]
[item.limits]
out_bit_errors = "== 0"
[[item]]
id = "internal-flash"
phase = "teardown"
"#;

#[test]
fn all_good() {
    insta::assert_snapshot!(play(&job(PHASES), &[], None), @r#"
    identity attempt 1
    identity passed
    cpu attempt 1
    cpu passed
    io attempt 1
    io passed
    spi attempt 1
    spi passed
    sci attempt 1
    sci passed
    internal-flash attempt 1
    internal-flash passed
    run passed
    "#);
}

#[test]
fn errored_items_are_tried_again_and_failed_ones_only_if_the_plan_says_so() {
    use Outcome::{Errored, Failed, Passed};
    let job = job(PHASES);
    let outcomes: &[(&str, &[Outcome])] = &[("cpu", &[Errored, Errored, Passed]), ("io", &[Failed, Passed])];
    insta::assert_snapshot!(play(&job, outcomes, None), @r#"
    identity attempt 1
    identity passed
    cpu attempt 1
    cpu attempt 2
    cpu attempt 3
    cpu passed
    io attempt 1
    io attempt 2
    io passed
    spi attempt 1
    spi passed
    sci attempt 1
    sci passed
    internal-flash attempt 1
    internal-flash passed
    run passed
    "#);
    // The fourth attempt of cpu does not happen, and a failed attempt is not repeated.
    insta::assert_snapshot!(play(&job, &[("cpu", &[Errored, Errored, Errored])], None), @r#"
    identity attempt 1
    identity passed
    cpu attempt 1
    cpu attempt 2
    cpu attempt 3
    cpu errored
    io skipped: requires cpu, which errored
    spi skipped: requires io, which was skipped
    sci skipped: requires cpu, which errored
    internal-flash attempt 1
    internal-flash passed
    run errored
    "#);
    insta::assert_snapshot!(play(&job, &[("cpu", &[Failed])], None), @r#"
    identity attempt 1
    identity passed
    cpu attempt 1
    cpu failed
    io skipped: requires cpu, which failed
    spi skipped: requires io, which was skipped
    sci skipped: requires cpu, which failed
    internal-flash attempt 1
    internal-flash passed
    run failed
    "#);
}

#[test]
fn a_bad_setup_skips_every_test() {
    insta::assert_snapshot!(play(&job(PHASES), &[("identity", &[Outcome::Failed])], None), @r#"
    identity attempt 1
    identity failed
    cpu skipped: the setup item identity failed
    io skipped: the setup item identity failed
    spi skipped: the setup item identity failed
    sci skipped: requires cpu, which was skipped
    internal-flash attempt 1
    internal-flash passed
    run failed
    "#);
}

#[test]
fn a_stop_in_order_leaves_only_teardown_and_one_at_once_nothing() {
    let job = job(PHASES);
    insta::assert_snapshot!(play(&job, &[], Some((2, StopHow::InOrder))), @r#"
    identity attempt 1
    identity passed
    cpu attempt 1
    cpu aborted
    sci skipped: requires cpu, which was aborted
    internal-flash attempt 1
    internal-flash passed
    run aborted
    "#);
    insta::assert_snapshot!(play(&job, &[], Some((3, StopHow::InOrder))), @r#"
    identity attempt 1
    identity passed
    cpu attempt 1
    cpu passed
    io attempt 1
    io aborted
    sci attempt 1
    sci passed
    internal-flash attempt 1
    internal-flash passed
    run aborted
    "#);
    insta::assert_snapshot!(play(&job, &[], Some((3, StopHow::AtOnce))), @r#"
    identity attempt 1
    identity passed
    cpu attempt 1
    cpu passed
    io attempt 1
    io aborted
    run aborted
    "#);
}

#[test]
fn a_plan_can_stop_at_the_first_bad_item() {
    let job = job(&PHASES.replace("version = \"1\"", "version = \"1\"\non_fail = \"stop\""));
    insta::assert_snapshot!(play(&job, &[("cpu", &[Outcome::Failed])], None), @r#"
    identity attempt 1
    identity passed
    cpu attempt 1
    cpu failed
    io skipped: the plan stops at the first bad item, and cpu failed
    spi skipped: the plan stops at the first bad item, and cpu failed
    sci skipped: requires cpu, which failed
    internal-flash attempt 1
    internal-flash passed
    run failed
    "#);
}

#[test]
fn a_selection_runs_its_items_with_setup_and_teardown() {
    let only = ["io".to_owned()];
    let job = Job::new(plan(PHASES), EVERYTHING, Some(&only)).unwrap();
    // io requires cpu, which was not chosen.
    insta::assert_snapshot!(play(&job, &[], None), @r#"
    identity attempt 1
    identity passed
    io attempt 1
    io passed
    sci attempt 1
    sci passed
    internal-flash attempt 1
    internal-flash passed
    run partial
    "#);
}

#[test]
fn a_bench_that_lacks_devices() {
    let bench = BenchAbilities { rs422: true, can: false, operator: false };
    let job = Job::new(plan(FUNCTIONAL), bench, None).unwrap();
    insta::assert_snapshot!(play(&job, &[], None), @r#"
    identity attempt 1
    identity passed
    cpu attempt 1
    cpu passed
    timers attempt 1
    timers passed
    sdram attempt 1
    sdram passed
    imu attempt 1
    imu passed
    ad skipped: the bench has no operator
    can skipped: the bench has no CAN link
    run passed
    "#);
    let strict = FUNCTIONAL.replace("optional = true", "optional = false");
    insta::assert_snapshot!(Job::new(plan(&strict), bench, None).unwrap_err(), @r#"
    plan.toml:50:6: "ad" cannot run: this bench has no operator
     50 | id = "ad"
        |      ^^^^
        = try: run the plan on a terminal, or make the item optional with optional = true

    plan.toml:58:6: "can" cannot run: this bench has no CAN link
     58 | id = "can"
        |      ^^^^^
        = try: connect a CAN adapter, or make the item optional with optional = true
    "#);
    // An item that is not selected needs no device.
    let only = ["cpu".to_owned()];
    assert!(Job::new(plan(&strict), bench, Some(&only)).is_ok());
    let nothing = BenchAbilities { rs422: false, can: false, operator: false };
    assert_eq!(Job::new(plan(FUNCTIONAL), nothing, None).unwrap_err().count(), 5);
}

#[test]
fn selections_that_are_refused() {
    let only = ["idnetity".to_owned(), "cpu".to_owned(), "\u{1b}".to_owned()];
    insta::assert_snapshot!(Job::new(plan(FUNCTIONAL), EVERYTHING, Some(&only)).unwrap_err(), @r#"
    the plan has no item "idnetity"
      try: did you mean "identity"?

    the plan has no item "\u{1b}"
      try: its items are identity, cpu, timers, sdram, imu, ad, can
    "#);
    insta::assert_snapshot!(Job::new(plan(FUNCTIONAL), EVERYTHING, Some(&[])).unwrap_err(), @r#"
    no item is selected
      try: name at least one item, or leave the selection out
    "#);
}

#[test]
fn what_shares_nothing_runs_at_once() {
    let job = job(FUNCTIONAL);
    let mut run = TestRun::new(&job, header());
    let begin = |run: &mut TestRun| {
        let mut begun = Vec::new();
        while let Next::Run { item, attempt } = job.next_overlapping(&run.state) {
            let item = job.item(item).unwrap().name.clone();
            run.emit(EventKind::ItemStarted { item: item.clone(), attempt });
            begun.push(item);
        }
        assert_eq!((job.next_overlapping(&run.state), job.next(&run.state)), (Next::Wait, Next::Wait));
        begun
    };
    let outcome = Outcome::Passed;
    // The supply settles during identity, so no other item runs beside it.
    assert_eq!(begin(&mut run), ["identity"]);
    run.emit(EventKind::AttemptEnded { item: "identity".to_owned(), attempt: 1, outcome, error: None });
    run.emit(EventKind::ItemEnded { item: "identity".to_owned(), outcome, cause: None });
    // cpu takes the processor, which timers and sdram need too. ad would turn the module, which imu needs still.
    assert_eq!(begin(&mut run), ["cpu", "imu", "can"]);
    run.emit(EventKind::AttemptEnded { item: "imu".to_owned(), attempt: 1, outcome, error: None });
    assert_eq!(job.next_overlapping(&run.state), Next::End { item: 4, outcome });
    run.emit(EventKind::ItemEnded { item: "imu".to_owned(), outcome, cause: None });
    assert_eq!(job.next_overlapping(&run.state), Next::Run { item: 5, attempt: 1 });
}

#[test]
fn nothing_measured_is_never_a_pass() {
    let job = job("name = \"p\"\nversion = \"1\"\n[[item]]\nid = \"io\"\n[item.limits]\nwrong_reads = \"== 0\"\n");
    let mut run = TestRun::new(&job, header());
    assert_eq!(run.settle(&job), Next::Run { item: 0, attempt: 1 });
    run.attempt(job.item(0).unwrap(), 1, &[("faulty_pairs", Value::text("none"))]);
    assert_eq!(run.settle(&job), Next::Done { verdict: Verdict::Module(Outcome::Errored) });
}

fn any_outcome() -> impl Strategy<Value = Outcome> {
    proptest::sample::select(vec![Outcome::Passed, Outcome::Marginal, Outcome::Failed, Outcome::Errored])
}

proptest! {
    /// In every case the run ends, overlapping or not. It ends good only if every required item is good.
    #[test]
    fn every_run_ends(
        seed in proptest::collection::vec(any_outcome(), 40),
        stop in proptest::option::of((1usize..12, any::<bool>())),
        picks in proptest::collection::vec(any::<proptest::sample::Index>(), 200),
        overlapping in any::<bool>(),
    ) {
        let job = job(if seed[0] == Outcome::Passed { FUNCTIONAL } else { PHASES });
        let mut run = TestRun::new(&job, header());
        let mut flying: Vec<(String, u32)> = Vec::new();
        let mut attempts = 0;
        let mut steps = picks.iter().cycle();
        let outcome = loop {
            prop_assert!(run.events.len() < 500);
            let next = if overlapping { job.next_overlapping(&run.state) } else { job.next(&run.state) };
            match next {
                Next::Run { item, attempt } => {
                    attempts += 1;
                    let item = job.item(item).unwrap();
                    for (other, _) in &flying {
                        let other = run.state.row(other).unwrap().planned.id;
                        prop_assert!(!other.excludes(item.id));
                    }
                    run.emit(EventKind::ItemStarted { item: item.name.clone(), attempt });
                    flying.push((item.name.clone(), attempt));
                    if let Some((at, in_order)) = stop
                        && at == attempts
                    {
                        let how = if in_order { StopHow::InOrder } else { StopHow::AtOnce };
                        run.emit(EventKind::StopRequested { how, by: "test".to_owned() });
                    }
                }
                Next::End { item, outcome } => {
                    let item = job.item(item).unwrap().name.clone();
                    run.emit(EventKind::ItemEnded { item, outcome, cause: None });
                }
                Next::Skip { item, cause } => {
                    let item = job.item(item).unwrap().name.clone();
                    run.emit(EventKind::ItemEnded { item, outcome: Outcome::Skipped, cause: Some(cause) });
                }
                Next::Wait => {
                    prop_assert!(!flying.is_empty(), "waits for nothing");
                    let (item, attempt) = flying.remove(steps.next().unwrap().index(flying.len()));
                    let outcome = seed[run.events.len() % seed.len()];
                    run.emit(EventKind::AttemptEnded { item, attempt, outcome, error: None });
                }
                Next::Done { verdict } => break verdict.of_items(),
            }
        };
        prop_assert!(flying.is_empty());
        let good = run.state.rows().iter().all(|row| {
            let missing = matches!(row.outcome, Outcome::Skipped | Outcome::NotRun);
            row.outcome.is_good() || row.planned.optional && missing
        });
        prop_assert_eq!(outcome.is_good(), good && run.state.stop().is_none());
        if run.state.stop().is_none() {
            prop_assert!(run.state.rows().iter().all(crate::state::Row::is_over));
        }
    }
}

#[test]
fn an_attempt_that_others_spoilt_does_not_count() {
    let job = job("name = \"p\"\nversion = \"1\"\n[[item]]\nid = \"io\"\n[item.limits]\nwrong_reads = \"== 0\"\n");
    let mut run = TestRun::new(&job, header());
    let outcome = Outcome::Errored;
    for attempt in 1..=4 {
        // The plan grants one try. Tries that another item spoilt come on top, up to three.
        assert_eq!(run.settle(&job), Next::Run { item: 0, attempt });
        run.emit(EventKind::ItemStarted { item: "io".to_owned(), attempt });
        let error = crate::event::AttemptError { text: String::new(), hint: String::new(), again: attempt < 4 };
        run.emit(EventKind::AttemptEnded { item: "io".to_owned(), attempt, outcome, error: Some(error) });
    }
    assert_eq!(job.next(&run.state), Next::End { item: 0, outcome });
}

/// identity 0.2, then processor items 0.5 + 1.0, imu 2.0 and ad 0.3 (which exclude each other), gnss 1.9.
#[test]
fn the_critical_path_is_the_longest_chain_or_the_fullest_resource() {
    let plan = "name = \"p\"\nversion = \"1\"\n\
        [[item]]\nid = \"identity\"\nlimits.part = \"== X\"\n\
        [[item]]\nid = \"timers\"\nrequires = [\"identity\"]\nlimits.timer0_interrupts_missing = \"== 0\"\n\
        [[item]]\nid = \"sdram\"\nrequires = [\"identity\"]\nlimits.mismatches_solid = \"== 0\"\n\
        [[item]]\nid = \"imu\"\nrequires = [\"identity\"]\nlimits.gyro_x = \"0 +- 1 deg/s\"\n\
        [[item]]\nid = \"ad\"\nrequires = [\"identity\"]\nlimits.ad4_on = \"5 V +- 2 %\"\n\
        [[item]]\nid = \"gnss\"\nrequires = [\"identity\"]\nlimits.fix_type = \"== 3D\"\n";
    let job = job(plan);
    let path = |times: [f64; 6]| job.critical_path(&|at| times.get(at).copied()).unwrap();
    let imu_and_ad = path([0.2, 0.5, 1.0, 2.0, 0.3, 1.9]);
    assert!((imu_and_ad.span_s - 2.5).abs() < 1e-12, "{imu_and_ad:?}");
    let gnss = path([0.2, 0.5, 1.0, 2.0, 0.3, 2.4]);
    assert_eq!((gnss.items.as_slice(), (gnss.span_s * 10.0).round()), ([0, 5].as_slice(), 26.0));
    let processor = path([0.2, 1.5, 1.0, 2.0, 0.1, 1.9]);
    assert_eq!((processor.items.as_slice(), (processor.span_s * 10.0).round()), ([0, 1, 2].as_slice(), 27.0));
    assert_eq!(job.critical_path(&|_| None), None);
}

/// With a list for each of its items, such a chain took 1.6 GB.
#[test]
fn the_longest_chain_that_a_plan_may_hold_is_found() {
    let mut text = "name = \"p\"\nversion = \"1\"\n".to_owned();
    for index in 0..MAX_ITEMS {
        let requires = if index == 0 { String::new() } else { format!("requires = [\"i{}\"]\n", index - 1) };
        text += &format!("[[item]]\nid = \"io\"\nname = \"i{index}\"\n{requires}limits.wrong_reads = \"== 0\"\n");
    }
    let path = job(&text).critical_path(&|_| Some(0.5)).unwrap();
    assert_eq!((path.span_s, path.items), (MAX_ITEMS as f64 * 0.5, (0..MAX_ITEMS).collect()));
}
