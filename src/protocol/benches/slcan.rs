//! How fast one core reads slcan lines.
//!
//! `cargo bench -p gnc-protocol --bench slcan`. A full bus of 500 kbit/s carries some 4,500 frames a second. The bound
//! shows that many buses and a replay of a day's log cost next to nothing. The result is printed and not asserted,
//! since machines differ.
#![allow(clippy::print_stdout, reason = "its output is what it is for")]

use std::hint::black_box;
use std::time::{Duration, Instant};

use gnc_protocol::can::slcan::{SlcanDecoder, encode};
use gnc_protocol::can::{CanFrame, CanId};

/// Frames a second that one core should manage.
const BOUND_FRAMES_PER_S: f64 = 1_000_000.0;
/// Frames in a round.
const FRAMES: u32 = 100_000;
/// Bytes that a read from a port hands over at once.
const CHUNK: usize = 4096;
/// Number of rounds. The fastest one counts, since other programs may have used the core in the others.
const ROUNDS: usize = 15;

fn lines(frame: impl Fn(u32, [u8; 8]) -> Option<CanFrame>) -> Vec<u8> {
    let mixed = |number: u32| u64::from(number).wrapping_mul(0x9e37_79b9_7f4a_7c15).to_le_bytes();
    (0..FRAMES).filter_map(|number| frame(number, mixed(number))).flat_map(|frame| encode(&frame)).collect()
}

fn main() {
    let cases = [
        ("IMU stream", lines(|number, data| CanFrame::new(CanId::Standard(0x200 + number as u16 % 3), &data))),
        (
            "extended, 8 bytes",
            lines(|number, data| CanFrame::new(CanId::Extended(0x1abc_0000 + number % 65_536), &data)),
        ),
        ("0 to 8 bytes", lines(|number, data| CanFrame::new(CanId::Standard(0x700), &data[..number as usize % 9]))),
    ];
    println!("slcan parser, one core, bound {BOUND_FRAMES_PER_S} frames/s");
    for (name, bytes) in cases {
        let mut best = Duration::MAX;
        for _ in 0..ROUNDS {
            let mut decoder = SlcanDecoder::default();
            let start = Instant::now();
            for mut chunk in bytes.chunks(CHUNK) {
                while let Some(item) = decoder.next(&mut chunk) {
                    let _ = black_box(item);
                }
            }
            best = best.min(start.elapsed());
            assert_eq!((decoder.counters().frames, decoder.counters().bad_lines), (FRAMES, 0), "{name}");
        }
        let frames_per_s = f64::from(FRAMES) / best.as_secs_f64();
        let verdict = if frames_per_s >= BOUND_FRAMES_PER_S { "PASS " } else { "BELOW" };
        println!("{verdict} {:7.2} million frames/s  {name}", frames_per_s / 1e6);
    }
}
