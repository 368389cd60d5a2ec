//! Makes of a record what an earlier version of the station would have left: a chain without lines of beginnings, stations,
//! times and signatures, and raw files that do not name their run.

use std::fs::{self, File};
use std::path::Path;

use gnc_records::raw::{self, RawWriter};
use gnc_records::store::{digest, reader};
use sha2::{Digest as _, Sha256};

/// Writes the chain anew as version 1 wrote it, with the digests as they are now.
///
/// # Panics
/// The records cannot be read or written.
pub fn rechain(records: &Path) {
    let (mut number, mut before) = (0, "0".repeat(64));
    for day in reader::days(records).expect("records") {
        fs::write(records.join(&day.0).join("CHAIN"), "").expect("a chain");
    }
    let mut runs = reader::paths(records).expect("records");
    runs.retain(|run| reader::is_sealed(run));
    runs.sort();
    for run in runs {
        let name = run.strip_prefix(records).expect("below").to_string_lossy().into_owned();
        let sums = digest::of_file(&run.join("SHA256SUMS")).expect("digests");
        number += 1;
        let link: String = Sha256::digest(format!("{number} {before} {sums} {name}"))
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        let chain = run.ancestors().nth(2).expect("a day").join("CHAIN");
        let line = format!("{number} {before} {sums} {link} {name}\n");
        let lines = fs::read_to_string(&chain).expect("a chain") + &line;
        fs::write(&chain, lines).expect("a chain");
        before = link;
    }
    fs::write(records.join("COUNTER"), format!("{number} {before}\n")).expect("a counter");
}

/// Takes the name of the run out of its raw files, and what the journal says of these, and updates the digests.
///
/// # Panics
/// A file cannot be read or written.
pub fn unname(run: &Path) {
    uncapture(run);
    for path in gnc_records::store::captures::files(run).expect("a run") {
        let record = raw::read(File::open(&path).expect("a raw file")).expect("a whole raw file");
        let was = digest::of_file(&path).expect("a digest");
        let mut out = RawWriter::new(File::create(&path).expect("room"), None).expect("a head");
        for piece in record.captures.iter().flat_map(raw::pieces) {
            out.write(piece).expect("room");
        }
        out.finish().expect("room");
        let sums = fs::read_to_string(run.join("SHA256SUMS")).expect("digests");
        let is = digest::of_file(&path).expect("a digest");
        fs::write(run.join("SHA256SUMS"), sums.replace(&was, &is)).expect("digests");
    }
}

/// Takes the lines about raw files out of the journal.
fn uncapture(run: &Path) {
    let path = run.join("events.jsonl");
    let was = digest::of_file(&path).expect("a digest");
    let text = fs::read_to_string(&path).expect("a journal");
    let kept = text.lines().filter(|line| !line.contains("\"kind\":\"captured\""));
    let numbered: String = kept
        .enumerate()
        .map(|(number, line)| {
            let (_, rest) = line.split_once(',').expect("a number first");
            format!("{{\"seq\":{number},{rest}\n")
        })
        .collect();
    fs::write(&path, numbered).expect("room");
    let sums = fs::read_to_string(run.join("SHA256SUMS")).expect("digests");
    let is = digest::of_file(&path).expect("a digest");
    fs::write(run.join("SHA256SUMS"), sums.replace(&was, &is)).expect("digests");
}
