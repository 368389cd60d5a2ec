use gnc_analysis::capture::Capture;
use mcap::Summary;
use mcap::read::Options;
use mcap::records::Statistics;

use super::*;
use crate::raw::tests::{Shared, cut, file, short_captures, write};
use crate::raw::{RawOrigin, RawRecord, read};

/// Captures with few samples each, so that every length can be tried.
fn few() -> Vec<Capture> {
    short_captures().into_iter().map(|capture| cut(capture, 13)).collect()
}

fn origin() -> RawOrigin {
    RawOrigin { serial_number: "SN-1".into(), journal_sha256: "a".repeat(64), ..RawOrigin::default() }
}

/// A file after a kill: flushed after each capture, without an end.
fn killed() -> Vec<u8> {
    let shared = Shared::default();
    let mut out = RawWriter::new(mcap::write::NoSeek::new(shared.clone()), Some(&origin())).unwrap();
    out.flush().unwrap();
    for capture in few() {
        write(&[capture], &mut out);
        out.flush().unwrap();
    }
    // Dropping the writer would write an end; a kill does not.
    std::mem::forget(out);
    shared.0.borrow().clone()
}

fn was(bytes: &[u8]) -> CutOff {
    CutOff { original_bytes: bytes.len() as u64, original_sha256: "f".repeat(64) }
}

/// The bytes of a file that stay, with the end behind them.
fn completed(bytes: &[u8]) -> Vec<u8> {
    let survey = Survey::of(bytes).unwrap().expect("it has no end");
    let kept = usize::try_from(survey.kept_bytes()).unwrap();
    let mut whole = bytes[..kept].to_vec();
    whole.extend(survey.end(&was(bytes)).unwrap());
    whole
}

/// Log times of all messages, found by the indexes alone: from the summary to the chunks, and to the messages in each.
fn by_the_indexes(file: &[u8], summary: &Summary) -> Vec<(u16, u64)> {
    let mut found = Vec::new();
    for chunk in summary.chunk_indexes.iter().filter(|chunk| chunk.message_index_length > 0) {
        for (channel, entries) in summary.read_message_indexes(file, chunk).unwrap() {
            for entry in entries {
                let message = summary.seek_message(file, chunk, &entry).unwrap();
                assert_eq!((message.channel.id, message.log_time), (channel.id, entry.log_time));
                found.push((channel.id, entry.log_time));
            }
        }
    }
    found.sort_unstable();
    found
}

/// Log times of all messages, read from the first byte to the last.
fn in_a_row(file: &[u8]) -> Vec<(u16, u64)> {
    // A file that is shorter than its magic bytes holds no message.
    let messages = mcap::read::MessageStream::new_with_options(file, Options::IgnoreEndMagic.into());
    let mut found: Vec<_> =
        messages.into_iter().flatten().map_while(Result::ok).map(|one| (one.channel.id, one.log_time)).collect();
    found.sort_unstable();
    found
}

/// Checks with the reader of the format that all checksums are right, and that indexes and a full read find the same.
fn check_by_others(file: &[u8], before: &[u8]) {
    let options = LinearReaderOptions::default()
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true)
        .with_prevalidate_chunk_crcs(true)
        .with_check_finishes_after_end_magic(true);
    let sums = each_record(file, options, &mut 0, |_, _| Ok(()));
    assert!(sums.is_ok(), "{} bytes: other sums", before.len());
    let summary = Summary::read(file).unwrap().expect("a summary");
    let all = in_a_row(file);
    assert!(all == by_the_indexes(file, &summary), "{} bytes: other messages by the indexes", before.len());
    assert!(all == in_a_row(before), "{} bytes: other messages", before.len());
    let statistics = summary.stats.expect("statistics");
    assert_eq!(statistics.message_count, all.len() as u64);
    let notes: Vec<_> =
        summary.metadata_indexes.iter().map(|index| mcap::read::metadata(file, index).unwrap()).collect();
    assert_eq!(statistics.metadata_count as usize, notes.len());
    let (note, of_the_run) = notes.split_last().expect("a note");
    assert_eq!(note.name, "gnc.cut_off");
    // What was cut off within its head begins anew, without it.
    assert!(of_the_run.iter().all(|named| named.name == "gnc.run") && of_the_run.len() <= 1);
    assert_eq!(of_the_run.is_empty(), all.is_empty() && read(file).unwrap().origin.is_none(), "{} bytes", before.len());
    assert_eq!(note.metadata["original_bytes"], before.len().to_string());
    assert_eq!(note.metadata["original_sha256"], "f".repeat(64));
}

/// All content is read as before, by this crate and by the indexes, and the file says that it was cut off.
#[test]
fn an_end_can_be_written_wherever_a_file_was_cut_off() {
    let whole = killed();
    let mut begun_anew = 0;
    let mut kept = Vec::new();
    for length in 0..=whole.len() {
        let before = &whole[..length];
        let after = completed(before);
        // The bytes that stay are the same from the end of one record to the next.
        let stays = Survey::of(before).unwrap().map(|survey| survey.kept_bytes());
        if kept.last() != Some(&stays) {
            kept.push(stays);
            check_by_others(&after, before);
        }
        match read(before) {
            Ok(expected) => {
                assert!(expected.cut_off);
                assert!(read(after.as_slice()).unwrap() == expected, "{length} bytes: other samples");
            }
            // Before the channels are there, the file is not valid; now it is an empty one.
            Err(_) => {
                begun_anew += 1;
                let nothing = RawRecord { cut_off: true, ..RawRecord::default() };
                assert!(read(after.as_slice()).unwrap() == nothing, "{length} bytes: not empty");
            }
        }
        assert!(Survey::of(after.as_slice()).unwrap().is_none(), "it has an end");
    }
    assert!(begun_anew > 0 && kept.len() > 10, "{begun_anew} begun anew, {} places", kept.len());
    assert!(read(completed(&whole).as_slice()).unwrap().captures == few());
}

/// If a file was cut off in its own end, the new end says what the old end said.
#[test]
fn the_end_says_what_the_writer_of_the_format_says() {
    let whole = file(&short_captures());
    let summary = |file: &[u8]| Summary::read(file).unwrap().expect("a summary");
    let expected = summary(&whole);
    let summary_bytes = 5000;
    let mut seen = 0;
    for length in (whole.len() - summary_bytes..whole.len()).step_by(7) {
        let found = summary(&completed(&whole[..length]));
        if found.chunk_indexes != expected.chunk_indexes {
            continue;
        }
        seen += 1;
        assert_eq!((&found.schemas, &found.channels), (&expected.schemas, &expected.channels));
        let statistics = Statistics { metadata_count: 0, ..found.stats.expect("statistics") };
        assert_eq!(Some(statistics), expected.stats);
    }
    assert!(seen > 300, "{seen} in the summary");
}

#[test]
fn what_is_damaged_gets_no_end() {
    let whole = killed();
    // One damaged place is in samples, the other in an index.
    for at in [whole.len() / 3, whole.len() / 2] {
        let mut damaged = whole.clone();
        damaged[at] ^= 1;
        let refused = Survey::of(damaged.as_slice()).unwrap_err();
        assert!(refused.to_string().starts_with("it is damaged behind byte "), "{refused}");
    }
    assert!(Survey::of(&b"time,x,y,z\n0,1,2,3\n"[..]).is_err());
    let zeros = [whole.as_slice(), &[0; 100]].concat();
    assert!(Survey::of(zeros.as_slice()).is_err(), "whoever knows the length leaves them out");
    assert!(Survey::of(file(&short_captures()).as_slice()).unwrap().is_none(), "it has an end");
}
