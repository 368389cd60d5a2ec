//! Small files that ask for much, made here and read by both readers.

use std::io::Cursor;

use mcap::records::op;
use mcap::{Compression, WriteOptions};

use super::*;
use crate::raw::{Survey, read};

/// A file whose chunks hold what `write` puts into one channel.
fn packed(compression: Option<Compression>, write: impl Fn(&mut mcap::Writer<Cursor<Vec<u8>>>, u16)) -> Vec<u8> {
    let options = WriteOptions::new().compression(compression).chunk_size(Some(32 << 20)).compression_threads(0);
    let mut out = options.create(Cursor::new(Vec::new())).unwrap();
    let schema = out.add_schema("gnc.ImuSample", "protobuf", b"").unwrap();
    let channel = out.add_channel(schema, "/imu", "protobuf", &std::collections::BTreeMap::new()).unwrap();
    write(&mut out, channel);
    out.finish().unwrap();
    out.into_inner().into_inner()
}

fn messages(count: u32, bytes: usize) -> impl Fn(&mut mcap::Writer<Cursor<Vec<u8>>>, u16) {
    move |out, channel_id| {
        let data = vec![0; bytes];
        for sequence in 0..count {
            let header = mcap::records::MessageHeader { channel_id, sequence, log_time: 0, publish_time: 0 };
            out.write_to_known_channel(&header, &data).unwrap();
        }
    }
}

/// A record of a file.
fn record(opcode: u8, data: &[u8]) -> Vec<u8> {
    [&[opcode][..], &(data.len() as u64).to_le_bytes(), data].concat()
}

/// A chunk that claims a size.
fn chunk(claimed: u64, compression: &str, records: &[u8]) -> Vec<u8> {
    let mut data = [0; 16].to_vec();
    data.extend(claimed.to_le_bytes());
    data.extend([0; 4]);
    data.extend((compression.len() as u32).to_le_bytes());
    data.extend(compression.as_bytes());
    data.extend((records.len() as u64).to_le_bytes());
    data.extend(records);
    record(op::CHUNK, &data)
}

#[track_caller]
fn is_swollen(file: &[u8]) {
    let found = read(file).map(|found| found.captures.len());
    assert!(matches!(found, Err(RawError::Swollen { .. })), "{found:?}");
    let found = Survey::of(file);
    assert!(matches!(found, Err(RawError::Swollen { .. })), "{found:?}");
}

#[test]
fn a_file_that_unpacks_to_much_is_refused() {
    // 480 MB. Messages of another channel are left out, and must be unpacked all the same.
    let file = packed(Some(Compression::Zstd), |out, _| {
        let other = out.add_channel(0, "/other", "", &std::collections::BTreeMap::new()).unwrap();
        messages(480, 1_000_000)(out, other);
    });
    assert!(file.len() < 1_000_000, "{} bytes", file.len());
    is_swollen(&file);
}

#[test]
fn many_small_records_cost_more_than_their_bytes() {
    // 5 million records of nothing in 45 MB.
    let file = packed(Some(Compression::Zstd), |out, _| {
        for _ in 0..5_000_000 {
            out.write_private_record(0x90, &[], mcap::write::PrivateRecordOptions::IncludeInChunks.into()).unwrap();
        }
    });
    assert!(file.len() < 100_000, "{} bytes", file.len());
    is_swollen(&file);
}

#[test]
fn a_size_is_counted_before_a_chunk_is_opened() {
    let claims = chunk(60 << 20, "zstd", b"no frame");
    let file = [mcap::MAGIC, &claims].concat();
    assert!(matches!(read(file.as_slice()), Err(RawError::Damaged { .. })));
    let claims = chunk(u64::MAX, "lz4", b"no frame");
    is_swollen(&[mcap::MAGIC, &claims].concat());
}

/// A sensor that hangs gives the record that packs best. It must still be read.
#[test]
fn no_record_of_the_station_is_refused() {
    let packs_to = |samples: u32| {
        packed(Some(Compression::Zstd), move |out, channel_id| {
            let data = vec![0x11; 48];
            for sequence in 0..samples {
                let log_time = u64::from(sequence) * 5_000_000;
                let header = mcap::records::MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
                out.write_to_known_channel(&header, &data).unwrap();
            }
        })
    };
    let (few, many) = (packs_to(20_000).len() as u64, packs_to(120_000).len() as u64);
    let for_each_byte = 100_000 * 80 / (many - few);
    assert!(for_each_byte < FOR_EACH_BYTE / 2, "{for_each_byte} bytes for each byte of the file");
}

#[test]
fn a_record_with_more_names_than_any_is_damaged() {
    let names: Vec<u8> = (0..150_000_u32).flat_map(|k| [1_u32.to_le_bytes(), k.to_le_bytes()].concat()).collect();
    let file = [mcap::MAGIC.to_vec(), record(op::METADATA, &names)].concat();
    let found = read(file.as_slice()).unwrap_err();
    assert!(gnc_text::with_causes(&found).contains("length exceeds limit"), "{found}");
}
