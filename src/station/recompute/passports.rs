//! Compares the passport that was filed with a run with that of the run judged again.

use std::io;
use std::path::Path;

use gnc_executive::record::RunRecord;
use gnc_executive::state::RunState;
use gnc_records::passport::{self, NoPassport, PASSPORT, PASSPORT_XML, Passport};
use gnc_records::store::digest::FileDigests;
use gnc_records::store::{StoreError, pretty, reader};

use super::differences;
use super::source::RunError;

/// The differences, and a few words for the summary.
pub(super) struct PassportCheck {
    pub(super) differences: Vec<String>,
    pub(super) summary: String,
}

/// Compares the files in a run's folder with what its events say now.
pub(super) fn check(folder: &Path, state: &RunState) -> Result<PassportCheck, RunError> {
    let mut checked = PassportCheck { differences: Vec::new(), summary: String::new() };
    let Some(record) = RunRecord::from_state(state).filter(|_| reader::is_sealed(folder)) else {
        return Ok(checked);
    };
    let (sums, _) = FileDigests::read(folder)?;
    let is_missing = |error: io::Error| error.kind() == io::ErrorKind::NotFound;
    let is_filed = |name: &str| sums.get(name).is_some() || !reader::paper(folder, name).is_err_and(is_missing);
    let filed = is_filed(PASSPORT) || is_filed(PASSPORT_XML);
    // The place in the chain is no result: the filed passport has it.
    let stored = reader::paper(folder, PASSPORT).ok();
    let stored = stored.and_then(|bytes| serde_json::from_slice::<Passport>(&bytes).ok());
    let chain = stored.and_then(|passport| passport.origin.chain);
    match passport::of_run(&record, &sums.of_record(), chain.as_deref()) {
        Ok(passport) if filed => {
            checked.differences = compare(folder, &passport)?;
            if checked.differences.is_empty() {
                checked.summary = "; the passport too".to_owned();
            }
        }
        // The program that recorded the run wrote no passports.
        Ok(_) => checked.summary = "; the record has no passport".to_owned(),
        Err(why) if filed => {
            checked.differences.push(format!("the record has a passport, but the recomputed run earns none: {why}"));
        }
        Err(NoPassport::NoCalibration) => {}
        Err(why) => checked.summary = format!("; no passport: {why}"),
    }
    Ok(checked)
}

/// Longest passport whose values are compared one by one. One has some 100 kB, and its values take many times that.
const MOST_COMPARED: usize = 16 << 20;

fn compare(folder: &Path, passport: &Passport) -> Result<Vec<String>, RunError> {
    let mut found = Vec::new();
    let mut json = Vec::new();
    let memory = |source: io::Error| StoreError::File { what: "write", path: PASSPORT.into(), source };
    pretty(&mut json, passport).map_err(memory)?;
    let xml = passport::xml(passport).map_err(StoreError::from)?;
    for (name, now) in [(PASSPORT, json), (PASSPORT_XML, xml)] {
        match reader::paper(folder, name) {
            Err(error) => found.push(format!("{name} cannot be read: {error}")),
            Ok(was) if was == now => {}
            Ok(was) if was.len() > MOST_COMPARED => found.push(format!("{name} differs from the recomputed one")),
            Ok(was) => {
                let values = [was, now].map(|bytes| serde_json::from_slice::<serde_json::Value>(&bytes).ok());
                let places = match values {
                    [Some(was), Some(now)] => differences::of_values(name, &was, &now),
                    _ => Vec::new(),
                };
                if places.is_empty() {
                    found.push(format!("{name} differs from the recomputed one"));
                }
                found.extend(places);
            }
        }
    }
    Ok(found)
}
