//! Records that were attacked or are garbage: the check of a small day ends, with sentences that can be shown, and finds
//! each attack of one who has no key.
//!
//! The first byte chooses: a script of attacks, or bytes in the place of one of the day's files.

#![no_main]

#[path = "../../tests/evidence/attack.rs"]
mod attack;
#[path = "../../tests/evidence/day.rs"]
mod day;
#[path = "../../tests/evidence/found.rs"]
mod found;

use std::sync::LazyLock;

use attack::{Tree, attack, plant, tree};
use found::Witness;
use libfuzzer_sys::fuzz_target;

static DAY: LazyLock<(Witness, Tree)> = LazyLock::new(|| {
    let place = tempfile::tempdir().expect("a folder");
    let public_key = day::write(place.path());
    let records = place.path().join("records");
    (Witness::of(&records, &public_key), tree(&records).expect("a tree"))
});

/// Files that a station reads although others may have written them, by the second byte.
const READ: [&str; 5] = ["COUNTER", "2026-11-28/CHAIN", "SHA256SUMS", "events.jsonl", "run.json"];

fuzz_target!(|bytes: &[u8]| {
    let [kind, which, script @ ..] = bytes else { return };
    let (witness, written) = &*DAY;
    let place = tempfile::tempdir().expect("a folder");
    let records = place.path().join("records");
    plant(written, &records).expect("a copy");
    if kind & 1 == 0 {
        // A step that the system refuses ends the attack; what was done until then counts.
        let _ = attack(&records, script);
    } else {
        let name = READ[usize::from(*which) % READ.len()];
        let path = written.keys().find(|path| path.ends_with(name)).expect("a file of the day");
        std::fs::write(records.join(path), script).expect("a file");
    }
    let problems = found::problems(&records, witness);
    assert!(problems.iter().all(|problem| !problem.contains(|c: char| c.is_control())), "{problems:?}");
    if tree(&records).expect("a tree") != *written {
        assert!(!problems.is_empty(), "not found");
    }
});
