//! Measures the cost of raw captures: samples a second written and read on one core, and bytes on disk.
//!
//! `cargo bench -p gnc-records --bench raw`; the bounds are 250,000 samples/s written and 50 MB a million.

use std::io::Cursor;
use std::time::Instant;

use gnc_analysis::capture::{CaptureHead, HostView, Pose};
use gnc_protocol::stream::{ImuSample, Losses};
use gnc_records::raw::{Piece, RawWriter, read};

const SAMPLES: u32 = 1_000_000;
/// Samples of a frame.
const FRAME: u32 = 12;

fn main() {
    // Noise of a part: 0.03 deg/s, 1 mg and 2 milligauss at 200 Hz, in counts. Each value is a sum of four uniform
    // ones.
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut noise = |deviation: f64| {
        let mut sum = 0.0;
        for _ in 0..4 {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            sum += (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5;
        }
        (sum * 3f64.sqrt() * deviation).round() as i32
    };
    let mut sample = || ImuSample {
        gyro: [1800, -900, 1100].map(|mean| mean + noise(600.0)),
        accel: [400, -1100, 160_300].map(|mean| mean + noise(160.0)),
        mag: [-509_000, 379_000, 40_000].map(|mean| mean + noise(2500.0)),
        gyro_temperature: 2381,
        accel_temperature: 2355,
    };
    let samples: Vec<ImuSample> = (0..SAMPLES).map(|_| sample()).collect();
    let pose = Pose::Still { up: [0.0, 0.0, 1.0], heading_deg: 0.0 };
    let rate_hz = 200;
    let about = CaptureHead { label: "z+".into(), series: 1, pose, rate_hz };
    let pieces = samples.chunks(FRAME as usize).enumerate().map(|(index, part)| {
        let first = index as u32 * FRAME;
        let board_time_us = u64::from(first) * 5000;
        Piece::Imu { first, board_time_us, rate_hz, samples: part.to_vec() }
    });
    let pieces: Vec<Piece> = pieces.collect();

    let began = Instant::now();
    let file = (|| {
        let mut out = RawWriter::new(Cursor::new(Vec::new()), None)?;
        out.write(Piece::Begin { about, board_time_us: 0 })?;
        pieces.into_iter().try_for_each(|piece| out.write(piece))?;
        let losses = Losses { received: SAMPLES, ..Losses::default() };
        out.write(Piece::End { losses, host: HostView::default(), board_time_us: 0 })?;
        out.finish()
    })();
    let written_s = began.elapsed().as_secs_f64();
    let bytes = file.map(Cursor::into_inner).unwrap_or_default();

    let began = Instant::now();
    let found = read(bytes.as_slice()).map(|record| record.captures).unwrap_or_default();
    let read_s = began.elapsed().as_secs_f64();
    let same = found.first().is_some_and(|capture| capture.samples == samples);

    let rate = |span_s: f64| f64::from(SAMPLES) / span_s;
    say(&format!("written: {:.0} samples/s (bound 250000)", rate(written_s)));
    say(&format!("read:    {:.0} samples/s, the same: {same}", rate(read_s)));
    say(&format!("on disk: {:.1} MB per million samples (bound 50)", bytes.len() as f64 * 1e-6));
}

fn say(text: &str) {
    use std::io::Write as _;
    let _ = writeln!(std::io::stdout(), "{text}");
}
