//! What the station finds in a records folder with the public key and the head of the chain.

use std::path::Path;

use gnc_records::store::{PublicKey, chain, reader};

/// What an auditor has who does not trust the folder.
#[derive(Debug)]
pub(crate) struct Witness {
    pub(crate) key: PublicKey,
}

/// All problems, a sentence each.
pub(crate) fn problems(records: &Path, witness: &Witness) -> Vec<String> {
    let mut problems = match chain::verify(records) {
        Ok(checked) => checked.problems,
        Err(error) => vec![gnc_text::with_causes(&error)],
    };
    for run in reader::paths(records).unwrap_or_default() {
        problems.extend(reader::verify(&run));
        problems.extend(reader::verify_signature(&run, &witness.key));
    }
    problems
}
