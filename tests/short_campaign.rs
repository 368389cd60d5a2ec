//! A few runs of a campaign; `cargo run --release -p gnc-tests --bin campaign` makes two thousand.

use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::time::Duration;

use gnc_tests::campaign::{
    AT_ONCE, Campaign, Case, Disturbance, Link, Over, Ran, carry_out, differs, run, table, violations,
};

/// Another seed gives other runs.
const SEED: u64 = 7;

/// Runs over pseudo-terminals go by the clock, and so does what a board may take: beside a hundred runs in memory, a good board on the
/// same computer is late.
static COMPUTER: RwLock<()> = RwLock::new(());

fn alone() -> RwLockWriteGuard<'static, ()> {
    COMPUTER.write().unwrap_or_else(PoisonError::into_inner)
}

/// Beside other runs in memory, which have a clock of their own.
fn shared() -> RwLockReadGuard<'static, ()> {
    COMPUTER.read().unwrap_or_else(PoisonError::into_inner)
}

fn campaign(over: Over, runs: std::ops::Range<u64>) {
    let campaign = Campaign { seed: SEED, runs, over, twice: false, at_once: AT_ONCE, keep: None };
    let all = carry_out(&campaign, &|_, _| {});
    eprintln!("seed {SEED}\n{}", table(&all));
    let wrong: Vec<String> = all
        .iter()
        .filter(|judged| !judged.violations.is_empty())
        .map(|judged| format!("{}\n{:?}\n{}", judged.violations.join("\n"), judged.case, judged.case.command(over)))
        .collect();
    assert!(wrong.is_empty(), "{} of {} runs:\n\n{}", wrong.len(), all.len(), wrong.join("\n\n"));
}

#[test]
fn thirty_runs_over_pseudo_terminals_hold_what_every_run_must() {
    let _computer = alone();
    campaign(Over::Pty, 0..30);
}

#[test]
fn sixty_runs_in_memory_hold_what_every_run_must() {
    let _computer = shared();
    campaign(Over::Memory, 30..90);
}

/// In memory a case gives the same run each time, to the byte: twelve cases with faults on both links, stops and pulled
/// cables.
#[test]
fn a_case_is_the_same_run_each_time_in_memory() {
    let _computer = shared();
    let mut disturbed = 0;
    for number in 0..12 {
        let case = Case::drawn(SEED, number);
        let ran = run(&case, Over::Memory, None);
        assert!(ran.journal.len() > 1000, "{case:?}");
        assert_eq!(differs(&case, &ran), None, "{case:?}");
        disturbed += u32::from(ran.since_disturbed.is_some());
    }
    assert!(disturbed > 2, "only {disturbed} of the runs were disturbed");
    let (one, other) = (Case::drawn(SEED, 1), Case::drawn(SEED, 2));
    assert!(differs(&one, &run(&other, Over::Memory, None)).is_some(), "another case is another run");
}

/// An undisturbed run on a clean line.
fn calm(board: &'static str, faults: &str) -> Case {
    Case {
        seed: SEED,
        number: 0,
        board,
        link: Link::Rs422,
        faults: faults.to_owned(),
        kinds: if faults.is_empty() { Vec::new() } else { vec!["lost_frames_per_million"] },
        breach: "",
        disturbance: Disturbance::None,
        moment: (1, Duration::ZERO),
    }
}

fn check(case: &Case, ran: &Ran, expected: &str) {
    let found = violations(case, ran);
    assert!(found.iter().any(|violation| violation.contains(expected)), "no \"{expected}\" in {found:?}");
}

/// Over CAN the answer that ends a stream overtakes the bytes of the stream that still wait for the bus: the lower id
/// wins. These bytes are late and not lost, so a receiver without sky fails at once and never errs.
#[test]
fn an_answer_that_overtakes_the_receivers_bytes_is_no_loss() {
    let _computer = shared();
    for seed in [SEED, 830_417, 1128] {
        let case = Case { seed, link: Link::Can, ..calm("no-sky", "") };
        let ran = run(&case, Over::Memory, None);
        assert_eq!(violations(&case, &ran), Vec::<String>::new(), "{case:?}");
        let record = ran.record.expect("a record");
        let gnss = record.items.iter().find(|item| item.name == "gnss").expect("the item");
        let ended: Vec<String> = gnss.attempts.iter().map(|attempt| attempt.outcome.to_string()).collect();
        assert_eq!(ended, ["failed"], "{case:?}");
    }
}

/// The campaign finds each violation that it looks for: real runs, checked against the conditions of other cases.
#[test]
fn violations_are_seen() {
    let _computer = alone();
    let (good, bad) = (calm("good", ""), calm("pps-missing", ""));
    let (passed, failed) = (run(&good, Over::Pty, None), run(&bad, Over::Pty, None));
    assert_eq!((violations(&good, &passed), violations(&bad, &failed)), (Vec::new(), Vec::new()));
    check(&good, &failed, "gnss failed, but nothing is wrong with it");
    check(&good, &failed, "a good module failed");
    check(&bad, &passed, "gnss is passed, but it is bad");
    check(&bad, &passed, "a bad module is passed");
    check(&calm("supply-low", ""), &failed, "gnss failed");
    check(&good, &Ran { off_after: None, ..passed.clone() }, "still on");
    check(&good, &Ran::default(), "no record");

    let stopped = Case { disturbance: Disturbance::Stop { again: None }, ..calm("good", "") };
    let slow = Ran { in_memory: true, off_since_disturbed: Some(Duration::from_millis(301)), ..passed };
    check(&stopped, &slow, "not within 300ms");

    let lossy = calm("good", "[wire.to_host]\nlost_frames_per_million = 2e4\n");
    let mut ran = run(&lossy, Over::Pty, None);
    assert_eq!(violations(&lossy, &ran), Vec::<String>::new());
    assert!(ran.line.to_host.missable > 0, "{:?}", ran.line);
    ran.line.to_host.missable += 3;
    check(&lossy, &ran, "missing frames");
    ran.line = Default::default();
    check(&lossy, &ran, "the line spoilt nothing");
}

/// A seed repeats the drawn cases, and another seed draws other cases.
#[test]
fn a_seed_repeats_its_runs() {
    for number in 0..100 {
        assert_eq!(Case::drawn(SEED, number), Case::drawn(SEED, number));
        assert_eq!(Case::drawn(SEED, number).text(), Case::drawn(SEED, number).text());
    }
    let differs = (0..100).filter(|number| Case::drawn(SEED, *number).text() != Case::drawn(SEED + 1, *number).text());
    assert!(differs.count() > 50);
}
