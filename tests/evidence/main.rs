//! What the records prove: for every file of a closed day, any change, removal, rename, swap or insertion is found with the
//! station's public key and the head of the chain, whatever else the attacker makes anew.

#![expect(clippy::expect_used, reason = "what cannot be set up fails the test that needs it")]

mod attack;
mod day;

use std::path::Path;

use attack::{attack, plant, tree};
use gnc_records::store::{PublicKey, StationKey, chain, reader};
use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Another seed makes other attacks.
const SEED: u64 = 20_261_130;
/// Attacks in a run of the tests; `EVIDENCE_ATTACKS` asks for more.
const ATTACKS: usize = 400;
/// Longest script: all choices of its steps.
const SCRIPT_BYTES: usize = 48;

fn found(records: &Path, key: &PublicKey) -> Vec<String> {
    let mut problems = match chain::verify(records) {
        Ok(checked) => checked.problems,
        Err(error) => vec![error.to_string()],
    };
    for run in reader::paths(records).unwrap_or_default() {
        problems.extend(reader::verify(&run));
        problems.extend(reader::verify_signature(&run, key));
    }
    problems
}

#[test]
fn every_attack_without_the_key_is_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let key_file = folder.path().join("station.key");
    let public = StationKey::create(&key_file).expect("a key");
    let (key, public) = (StationKey::read(&key_file).expect("a key"), PublicKey::read(&public).expect("a key"));
    let records = folder.path().join("records");
    std::fs::create_dir(&records).expect("a folder");
    day::write(&records, &key);
    assert_eq!(found(&records, &public), Vec::<String>::new(), "as written");
    let written = tree(&records).expect("a tree");

    let attacks = std::env::var("EVIDENCE_ATTACKS").ok().and_then(|many| many.parse().ok()).unwrap_or(ATTACKS);
    println!("seed {SEED}, {attacks} attacks");
    let mut dice = ChaCha8Rng::seed_from_u64(SEED);
    let mut missed = Vec::new();
    for number in 0..attacks {
        let mut script = [0; SCRIPT_BYTES];
        dice.fill_bytes(&mut script);
        let place = tempfile::tempdir().expect("a folder");
        let attacked = place.path().join("records");
        plant(&written, &attacked).expect("a copy");
        // A step that the system refuses ends an attack; what was done until then counts.
        let done = attack(&attacked, &script);
        if tree(&attacked).expect("a tree") != written && found(&attacked, &public).is_empty() {
            missed.push(format!("attack {number}: {done:?}"));
        }
    }
    assert!(missed.is_empty(), "{} attacks were not found:\n{}", missed.len(), missed.join("\n"));
}
