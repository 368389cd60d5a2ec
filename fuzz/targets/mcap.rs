//! Raw captures: refused, or held in bounds and the same when written and read again. What does not begin as a file does
//! is put into one, as messages, so that chance need not find lengths and checksums.

#![no_main]

use std::io::Cursor;

use gnc_records::raw::{self, RawRecord, RawWriter};
use libfuzzer_sys::fuzz_target;

/// By which a file is known.
const MAGIC: &[u8] = b"\x89MCAP0\r\n";
const TOPICS: [&str; 6] = ["/capture", "/imu", "/gnss", "/pps", "/compensated", "/other"];

fuzz_target!(|bytes: &[u8]| {
    if bytes.starts_with(&MAGIC[..5]) {
        file(bytes);
    } else {
        file(&with_messages(bytes));
    }
});

fn file(bytes: &[u8]) {
    match raw::read(bytes) {
        Ok(record) => {
            let samples: usize =
                record.captures.iter().map(|capture| capture.samples.len() + capture.compensated.len()).sum();
            // A packer repeats a message of its 31 bytes at the price of a few bits.
            assert!(samples <= bytes.len().saturating_mul(20_000), "{samples} samples in {} bytes", bytes.len());
            written_again(&record);
        }
        Err(error) => assert!(!error.to_string().is_empty() && !error.try_this().is_empty()),
    }
}

/// A file of messages that are each told by topic, second and length, one byte each.
fn with_messages(mut told: &[u8]) -> Vec<u8> {
    let mut file = MAGIC.to_vec();
    record(&mut file, 0x01, &[&[0; 8]]);
    for (id, topic) in (0u16..).zip(TOPICS) {
        let id = id.to_le_bytes();
        record(&mut file, 0x04, &[&id, &[0; 2], &text(topic), &text("protobuf"), &[0; 4]]);
    }
    while let [topic, second, length, rest @ ..] = told {
        let (data, rest) = rest.split_at(usize::from(*length).min(rest.len()));
        let id = (u16::from(*topic) % (TOPICS.len() as u16 + 1)).to_le_bytes();
        let time = (u64::from(*second) * 1_000_000_000).to_le_bytes();
        record(&mut file, 0x05, &[&id, &[0; 4], &time, &time, data]);
        told = rest;
    }
    record(&mut file, 0x0f, &[&[0; 4]]);
    record(&mut file, 0x02, &[&[0; 20]]);
    file.extend_from_slice(MAGIC);
    file
}

fn record(file: &mut Vec<u8>, opcode: u8, parts: &[&[u8]]) {
    file.push(opcode);
    let length: usize = parts.iter().map(|part| part.len()).sum();
    file.extend_from_slice(&(length as u64).to_le_bytes());
    parts.iter().for_each(|part| file.extend_from_slice(part));
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
}

fn written_again(record: &RawRecord) {
    let mut writer = RawWriter::new(Cursor::new(Vec::new()), None).expect("a file in memory");
    for piece in record.captures.iter().flat_map(raw::pieces) {
        writer.write(piece).expect("a file in memory");
    }
    let file = writer.finish().expect("a file in memory").into_inner();
    let mut again = raw::read(&file[..]).expect("what was written is read");
    assert!(!again.cut_off && again.unfinished.is_none());
    // Samples are written on their grid, and stamps off it are those of the first file.
    for (again, first) in again.captures.iter_mut().zip(&record.captures) {
        again.timing.board = first.timing.board.clone();
    }
    // As text: a heading that is no number is not equal to itself.
    assert_eq!(format!("{:?}", again.captures), format!("{:?}", record.captures));
}
