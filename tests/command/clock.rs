//! A clock that cannot be right is told before a run, not after it.

use std::fs;

use gnc_tests::Place;

use super::STATION;

/// There are records of a day that has not come: the clock is behind, or that day is wrong.
#[test]
fn a_clock_behind_the_records_is_refused_unless_a_person_says_that_it_is_right() {
    let place = Place::new(STATION);
    fs::create_dir_all(place.path().join("records/2999-01-01/X")).expect("a folder");
    let run = |more: &[&str]| {
        let fixed = ["--sim-speed", "max", "--only", "cpu", "--events"];
        place.functional("--sim", &fixed.iter().chain(more).copied().collect::<Vec<_>>())
    };
    let refused = run(&[]);
    assert_eq!(refused.code, Some(2), "{}{}", refused.stdout, refused.stderr);
    assert!(refused.stdout.is_empty() && place.runs().is_empty(), "the module got power: {}", refused.stdout);
    for word in ["the clock says ", "but there are records of 2999-01-01", "timedatectl", "--clock-is-right"] {
        assert!(refused.stderr.contains(word), "{word}: {}", refused.stderr);
    }
    let doctor = place.run(["doctor"]);
    assert!(
        doctor.stdout.lines().any(|line| line.starts_with("BAD") && line.contains("2999-01-01")),
        "{}",
        doctor.stdout
    );
    let right = run(&["--clock-is-right"]);
    assert_eq!(right.code, Some(5), "{}", right.stderr);
    assert_eq!(place.runs().len(), 1);
}
