//! Boards and modules with faults that are no breach of the document, and those that are.

use hw_mocks::Personality;

use super::rig::{Breach, Wire, checked};
use super::{failed, show};

#[track_caller]
fn fails(name: &str, expected: &[&str]) {
    let (ended, _) = checked(Personality::named(name).unwrap(), Wire::Rs422, None, Breach::default());
    let ended = ended.unwrap();
    let came = failed(&ended);
    if came != expected {
        show(&ended);
    }
    assert_eq!(came, expected, "{name}");
}

/// A board that tells the truth of a bad module keeps the document.
#[test]
fn what_a_module_does_wrong_is_no_breach() {
    for name in [
        "accel-clips",
        "gyro-stuck",
        "internal-ram-stuck-cell",
        "supply-low",
        "no-sky",
        "starts-late",
        "spi-flash-slow",
    ] {
        fails(name, &[]);
    }
}

/// What the checks compare with the module's answers needs a good module.
#[test]
fn a_module_that_answers_wrong_fails_the_checks_of_its_answers() {
    fails("core-2-multiplier", &["cpu.integers"]);
    fails("timer-fast", &["timer"]);
    fails("spi-flash-bad-sector", &["flash.pattern"]);
    fails("sci-loses-bytes", &["sci"]);
}

#[test]
fn samples_at_a_pace_of_their_own_fail_the_grid() {
    for name in ["sample-clock-fast", "sample-clock-slow"] {
        fails(name, &["stream.grid", "calibration.stream"]);
    }
    // Its step comes later than a short run of 200 Hz ends.
    fails("sample-times-step", &["stream.grid"]);
}

/// A restart is named where it is seen.
#[test]
fn a_board_that_restarts() {
    let (ended, _) =
        checked(Personality::named("reboots-in-sdram").unwrap(), Wire::Rs422, Some("ram"), Breach::default());
    let ended = ended.unwrap();
    assert_eq!(failed(&ended), ["ram.sdram"]);
    let said = ended.findings.iter().find(|finding| finding.demand.id == "ram.sdram").unwrap();
    assert!(said.measured.contains("did the board restart?"), "{}", said.measured);
}
