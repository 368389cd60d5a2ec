//! Journals: what can be folded can be written again and shown, and cut off anywhere it folds up to the last whole event.

#![no_main]

use gnc_executive::event::Event;
use gnc_executive::journal::{self, JournalError};
use gnc_executive::record::RunRecord;
use gnc_executive::state::RunState;
use gnc_executive::text;
use gnc_records::{passport, report};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let whole = match journal::fold(bytes) {
        Ok(whole) => whole,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    assert_eq!(whole.good_bytes + whole.cut_bytes, bytes.len());
    written_again(&bytes[..whole.good_bytes], &whole.state);
    // At the end of a line, and in the middle.
    let lines = bytes.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(at, _)| at);
    for cut in lines.take(4).flat_map(|end| [end, end + 1, end + 2]).chain([bytes.len() / 2]) {
        match journal::fold(&bytes[..cut.min(bytes.len())]) {
            Ok(part) => assert!(part.state.next_seq() <= whole.state.next_seq()),
            // Without what follows it, a torn line may be a whole event of a later version.
            Err(JournalError::Newer { .. }) => {}
            Err(error) => panic!("a part of what could be folded: {error}"),
        }
    }
    if let Some(record) = RunRecord::from_state(&whole.state) {
        shown(&record);
    }
});

/// The same events give the same run, and the same lines.
fn written_again(good: &[u8], state: &RunState) {
    let events: Vec<Event> =
        serde_json::Deserializer::from_slice(good).into_iter().map(|event| event.expect("it was folded")).collect();
    let lines: String = events.iter().map(|event| journal::line(event).expect("it is written")).collect();
    let again = journal::fold(lines.as_bytes()).expect("what was written is read");
    assert_eq!(again.cut_bytes, 0);
    assert_eq!(&again.state, state);
}

fn shown(record: &RunRecord) {
    let _ = (text::log_txt(record), text::verdict_line(record), text::failing_rows(record));
    let passport = passport::of_run(record, "0", None);
    if let Ok(passport) = &passport {
        passport::xml(passport).expect("a passport as XML");
    }
    let mut page = Vec::new();
    report::html(&mut page, record, &passport, &[], None, None).expect("a page in memory");
    let page = String::from_utf8(page).expect("a page is text");
    assert!(!page.contains("<script"));
    let written = serde_json::to_string(record).expect("a record is written");
    assert_eq!(&serde_json::from_str::<RunRecord>(&written).expect("and read"), record);
}
