//! The simulated board keeps the document, on both links, and a board that breaks a rule fails the check of that rule.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a test may end with a panic and says what it saw")]

mod breaches;
mod bus;
mod command;
mod modules;
mod personalities;
mod rig;
mod samples;

use std::cell::Cell;
use std::rc::Rc;
use std::time::Duration;

use gnc_conformance::{Ended, Outcome, TAKES, demands};
use gnc_protocol::message::ModulePower;
use gnc_protocol::serial::encode;
use gnc_protocol::{Call as _, Kind};
use hw_mocks::Personality;

use rig::{Breach, Wire, checked, checked_until};

/// The names of the checks that failed.
fn failed(ended: &Ended) -> Vec<&'static str> {
    let bad = ended.findings.iter().filter(|finding| finding.outcome == Outcome::Failed);
    bad.map(|finding| finding.demand.id).collect()
}

fn show(ended: &Ended) {
    for finding in &ended.findings {
        println!("{:4} {:28} {}", finding.outcome.word(), finding.demand.id, finding.measured);
    }
}

/// Checks the good board; the number of checks that bind it.
fn good(wire: Wire) -> usize {
    let (ended, took) = checked(Personality::good(), wire, None, Breach::default());
    let ended = ended.unwrap();
    show(&ended);
    assert_eq!(failed(&ended), Vec::<&str>::new());
    assert!(ended.safe && !ended.stopped);
    assert_eq!(ended.findings.len(), demands().count());
    let said = TAKES.as_secs_f64();
    assert!((0.8 * said..1.1 * said).contains(&took.as_secs_f64()), "{took:?} of link time, {TAKES:?} is said");
    ended.findings.iter().filter(|finding| finding.outcome == Outcome::Passed).count()
}

/// All but the checks of section 17, the commit, and what needs a calibration.
#[test]
fn the_simulated_board_passes_over_rs422() {
    let passed = good(Wire::Rs422);
    assert!(passed >= 130, "{passed} checks bind it");
}

/// All but the checks of section 3 and of echoes, and the commit.
#[test]
fn the_simulated_board_passes_over_can() {
    let passed = good(Wire::Can);
    assert!(passed >= 125, "{passed} checks bind it");
}

/// A page tells how often.
#[test]
fn the_module_is_switched_on_about_thirty_times() {
    let count = Rc::new(Cell::new(0));
    let counted = Rc::clone(&count);
    let watched = Breach::to_board(move |frame, _| {
        let header = frame.header;
        let on = header.kind == Kind::Request && header.message == ModulePower::ID && frame.payload.as_slice() == [1];
        counted.set(counted.get() + u32::from(on));
        vec![(Duration::ZERO, encode(&frame).to_vec())]
    });
    let (ended, _) = checked(Personality::good(), Wire::Rs422, None, watched);
    assert!(ended.is_ok());
    assert!((25..35).contains(&count.get()), "{} times", count.get());
}

#[test]
fn names_are_given_once_and_stand_in_the_order_of_the_document() {
    let all: Vec<_> = demands().collect();
    for (index, demand) in all.iter().enumerate() {
        assert!(all[..index].iter().all(|before| before.id != demand.id), "{} twice", demand.id);
    }
    assert!(all.is_sorted_by_key(|demand| demand.section));
}

#[test]
fn a_person_stops_the_checks_and_the_board_is_safe() {
    let (ended, _) = checked_until(Personality::good(), Wire::Rs422, Some("cpu"), Breach::default(), 2);
    let ended = ended.unwrap();
    assert_eq!((ended.findings.len(), ended.stopped, ended.safe), (2, true, true));
}

#[test]
fn a_line_without_a_board_is_told_in_seconds() {
    let deaf = Breach::to_host(|_, _| Vec::new());
    let (ended, took) = checked(Personality::good(), Wire::Rs422, None, deaf);
    let no_board = ended.unwrap_err();
    assert_eq!(no_board.gone, None);
    assert!(no_board.to_string().contains("no heartbeat"), "{no_board}");
    assert!(took < Duration::from_secs(4), "{took:?}");
}
