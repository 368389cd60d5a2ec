//! Sub-units that are already built into another module.

use std::collections::HashSet;
use std::path::Path;

use gnc_executive::event::RunHeader;
use gnc_executive::numbers::{GivenNumber, NumberKind};
use gnc_executive::verdict::Verdict;

use crate::store::head::RunHead;
use crate::store::reader;

/// Most runs that are searched, from the newest back: the modules of a line in some weeks. Of each, a few kilobytes are read.
const MAX_SEARCHED: usize = 5_000;

/// A sub-unit that another module has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reused {
    /// The sub-unit.
    pub number: GivenNumber,
    /// The other module.
    pub serial_number: String,
    /// Its newest passed run, as a path below the records folder.
    pub run: String,
}

/// The sub-units of a run that the newest pass of another module names too. Simulated runs count for simulated runs only. A
/// module that passed with another sub-unit since then does not have this one any more.
#[must_use]
pub fn of(records: &Path, run: &RunHeader) -> Vec<Reused> {
    let wanted: Vec<&GivenNumber> = run.numbers.iter().filter(|number| number.kind == NumberKind::Subunit).collect();
    let mut reused: Vec<Reused> = Vec::new();
    if wanted.is_empty() {
        return reused;
    }
    // Module and key of which the newest pass is known.
    let mut known: HashSet<(String, String)> = HashSet::new();
    for folder in reader::newest(records, MAX_SEARCHED) {
        let Some(record) = RunHead::read(&folder).filter(|head| !head.numbers.is_empty()) else { continue };
        let counts = matches!(record.verdict, Verdict::Module(outcome) if outcome.is_good())
            && !record.rejudged
            && !record.is_other_module;
        if !counts || record.bench != run.bench.kind || record.serial_number == run.serial_number {
            continue;
        }
        for number in record.numbers.iter().filter(|number| number.kind == NumberKind::Subunit) {
            let is_newest = known.insert((record.serial_number.clone(), number.key.clone()));
            let same = wanted.iter().find(|wanted| wanted.key == number.key && is_same(&wanted.value, &number.value));
            if let Some(same) = same.filter(|_| is_newest) {
                let place = folder.strip_prefix(records).unwrap_or(&folder).display().to_string();
                let serial_number = record.serial_number.clone();
                reused.push(Reused { number: (*same).clone(), serial_number, run: place });
            }
        }
    }
    reused
}

/// Labels and keyboards differ in large and small letters.
fn is_same(a: &str, b: &str) -> bool {
    a.to_uppercase() == b.to_uppercase()
}
