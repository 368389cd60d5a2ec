//! The simulated board keeps the document, on both links.

mod rig;

use gnc_conformance::{Ended, Outcome};

use rig::{Rig, Wire};

/// What was found, one line each, but for what is as it should be.
fn bad(ended: &Ended) -> Vec<String> {
    let bad = ended.findings.iter().filter(|finding| finding.outcome == Outcome::Failed);
    bad.map(|finding| format!("{}: {}", finding.demand.id, finding.measured)).collect()
}

fn check(wire: Wire) {
    let ended = Rig::new("").check(wire, std::env::var("ONLY").ok().as_deref());
    for finding in &ended.findings {
        println!("{:4} {:28} {}", finding.outcome.word(), finding.demand.id, finding.measured);
    }
    assert_eq!(bad(&ended), Vec::<String>::new());
    assert!(ended.safe && !ended.stopped && !ended.findings.is_empty());
}

#[test]
fn the_simulated_board_passes_over_rs422() {
    check(Wire::Rs422);
}

#[test]
fn the_simulated_board_passes_over_can() {
    check(Wire::Can);
}
