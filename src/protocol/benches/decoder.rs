//! How fast one core takes frames off a serial line, checksum included.
//!
//! `cargo bench -p gnc-protocol`. The bound is far above a link (921,600 baud are 0.09 MB/s). It shows that sixteen
//! sockets and a replay of a day's capture cost next to nothing. The result is printed and not asserted, since machines
//! differ.
#![allow(clippy::print_stdout, reason = "its output is what it is for")]

use std::hint::black_box;
use std::time::{Duration, Instant};

use gnc_protocol::serial::{FrameDecoder, encode};
use gnc_protocol::{Flags, Frame, Header, Kind, PROTOCOL_VERSION, Payload};

/// What one core should manage, in MB (10^6 bytes) of the wire a second.
const BOUND_MB_PER_S: f64 = 200.0;
/// Bytes that a read from a port hands over at once.
const CHUNK: usize = 4096;
/// Number of rounds. The fastest one counts, since other programs may have used the core in the others.
const ROUNDS: usize = 15;

/// About a megabyte of bytes as on the wire.
fn wire(kind: Kind, payload: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut sequence = 0_u16;
    while bytes.len() < 1_000_000 {
        let header =
            Header { version: PROTOCOL_VERSION, kind, flags: Flags::default(), request: 0, message: 1, sequence };
        let payload = Payload::from_slice(payload).unwrap_or_default();
        bytes.extend_from_slice(&encode(&Frame { header, payload }));
        sequence = sequence.wrapping_add(1);
    }
    bytes
}

/// Bytes and frames a second of the fastest round.
fn fastest(bytes: &[u8]) -> (f64, f64) {
    let mut best = Duration::MAX;
    let mut frames = 0;
    for _ in 0..ROUNDS {
        let mut decoder = FrameDecoder::default();
        let start = Instant::now();
        for chunk in bytes.chunks(CHUNK) {
            let mut rest = chunk;
            while let Some(frame) = decoder.next(&mut rest) {
                let _ = black_box(frame);
            }
        }
        best = best.min(start.elapsed());
        frames = decoder.counters().frames;
    }
    (bytes.len() as f64 / best.as_secs_f64(), f64::from(frames) / best.as_secs_f64())
}

fn main() {
    let imu: Vec<u8> = [1, 1, 10, 0, 0x70, 0x11, 1, 0, 0x15, 0xCD, 0x5B, 7, 0, 0, 0, 0, 0, 0, 0, 0]
        .into_iter()
        .chain((0..400).map(|at: u32| if at % 4 == 3 { 0 } else { (at.wrapping_mul(2_654_435_761) >> 13) as u8 }))
        .collect();
    let cases = [
        ("IMU stream, 10 samples a frame", Kind::Stream, imu),
        ("512 bytes without a zero", Kind::Result, (0..512).map(|at| 1 + (at % 255) as u8).collect()),
        ("512 zeros", Kind::Result, vec![0; 512]),
        ("64 bytes", Kind::Result, (0..64).collect()),
        ("no payload", Kind::Event, Vec::new()),
    ];
    println!("serial decoder with CRC-32C, one core, bound {BOUND_MB_PER_S} MB/s");
    for (name, kind, payload) in cases {
        report(name, &wire(kind, &payload));
    }
    // Rubbish must not be slower: a board with a broken line sends nothing else.
    let rubbish: Vec<u8> = (0..1_000_000_u32).map(|at| (at.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    report("rubbish", &rubbish);
}

fn report(name: &str, wire: &[u8]) {
    let (bytes_per_s, frames_per_s) = fastest(wire);
    let verdict = if bytes_per_s >= BOUND_MB_PER_S * 1e6 { "PASS " } else { "BELOW" };
    println!("{verdict} {:6.0} MB/s {:7.2} million frames/s  {name}", bytes_per_s / 1e6, frames_per_s / 1e6);
}
