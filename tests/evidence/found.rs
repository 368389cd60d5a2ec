//! What the station finds in a records folder with the public key and the head of the chain, without a process for each look.

use std::path::{Path, PathBuf};

use gnc_records::store::chain::{Against, Head, Place, verify_against};
use gnc_records::store::{PublicKey, reader, as_written};

/// What an auditor has who does not trust the folder.
#[derive(Debug)]
pub(crate) struct Witness {
    keys: Vec<PublicKey>,
    heads: Vec<Head>,
}

impl Witness {
    /// The public key, and the head of the chain as it is now.
    pub(crate) fn of(records: &Path, public_key: &PathBuf) -> Self {
        let counter = std::fs::read_to_string(records.join("COUNTER")).expect("a counter");
        let place = Place::parse(&counter).expect("number and link");
        let keys = vec![PublicKey::read(public_key).expect("a key")];
        Self { keys, heads: vec![Head { kept: "--head".to_owned(), place }] }
    }
}

/// All problems, a sentence each.
pub(crate) fn problems(records: &Path, witness: &Witness) -> Vec<String> {
    let against = Against { keys: &witness.keys, heads: &witness.heads };
    let mut problems = match verify_against(records, &against) {
        Ok((checked, _)) => [checked.problems, checked.incomplete].concat(),
        Err(error) => vec![gnc_text::with_causes(&error)],
    };
    for run in reader::paths(records).unwrap_or_default() {
        problems.extend(as_written::verify(&run));
        problems.extend(as_written::verify_signature(&run, &witness.keys));
    }
    problems
}
