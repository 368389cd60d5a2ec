use std::cell::RefCell;
use std::io::{self, Cursor, Seek, SeekFrom, Write};
use std::rc::Rc;

use gnc_analysis::capture::{Capture, CaptureHead, HostView, Pose, ReceiverCapture, Said, Timing};
use gnc_protocol::calibration::CompensatedSample;
use gnc_protocol::stream::{ImuSample, Losses, SATURATION};
use gnc_rig::Along;

use super::*;

/// Noise of a live sensor around its output, by a separate generator (xorshift64*, Vigna 2016).
fn samples(count: usize, seed: u64) -> Vec<ImuSample> {
    let mut state = seed | 1;
    let mut noise = |span: i64| {
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        (state.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) as i64 % span - span / 2
    };
    let mut sample = || ImuSample {
        gyro: [0; 3].map(|_| (84 + noise(2000)) as i32),
        accel: [12_000, -3_000, 160_000].map(|mean: i64| (mean + noise(600)) as i32),
        mag: [350_000, -20_000, 410_000].map(|mean: i64| (mean + noise(3000)) as i32),
        gyro_temperature: 2512 + noise(4) as i16,
        accel_temperature: -40,
    };
    (0..count).map(|_| sample()).collect()
}

/// Every kind of pose, extreme codes, a gap, a receiver, and a heading that has no exact decimal text.
fn captures() -> Vec<Capture> {
    let mut rails = samples(3, 9);
    rails[1].gyro = [SATURATION, -SATURATION - 1, 0];
    rails[2] = ImuSample { gyro: [i32::MIN; 3], mag: [i32::MAX; 3], accel_temperature: i16::MIN, ..rails[2] };
    let still = |label: &str, heading_deg| CaptureHead {
        label: label.to_owned(),
        series: 1,
        pose: Pose::Still { up: [-0.0, 1.0 / 3.0, f64::MIN_POSITIVE], heading_deg },
        rate_hz: 200,
    };
    let turn = Pose::Rotating { axis: 2, angle_deg: -1080.0, span_s: 5.0, along: Along::Polar };
    let spin = Pose::Spinning { axis: 1, rate_dps: 5400.0, along: Along::North };
    let no_receiver = ReceiverCapture::default();
    let compared = HostView::Compared { error_ppm: -3.25, u_ppm: 29.5 };
    let received = |received, on_board, on_line| Losses { received, on_board, on_line };
    vec![
        Capture {
            about: still("x+", 0.1 + 0.2),
            first_us: 123_456_789,
            compensated: Vec::new(),
            samples: samples(500, 7),
            losses: received(500, 0, 0),
            receiver: no_receiver.clone(),
            timing: Timing { host: compared, ..Timing::even(200, 123_456_789, 500) },
        },
        Capture {
            about: CaptureHead { label: "z- \u{3b1}".into(), series: 6, pose: turn, rate_hz: 1000 },
            first_us: 223_456_789,
            compensated: Vec::new(),
            samples: rails,
            losses: received(3, 4, 5),
            receiver: no_receiver.clone(),
            timing: Timing { host: HostView::Nothing("a reason \u{3b1}".into()), ..Timing::even(1000, 223_456_789, 3) },
        },
        Capture {
            about: still("z+ compensated", 0.0),
            first_us: 323_456_789,
            compensated: (0..2500)
                .map(|k| CompensatedSample {
                    rate: [k, -k, i32::MIN],
                    force: [i32::MAX, 9_806_650, k * k],
                    field: [-1, 0, 1],
                    roll: -314_159_265 + k,
                    saturated: (k % 512) as u16,
                    gyro_temperature: i16::MIN,
                    accel_temperature: i16::MAX,
                })
                .collect(),
            samples: Vec::new(),
            losses: received(2500, 0, 0),
            receiver: no_receiver.clone(),
            timing: Timing::even(200, 323_456_789, 2500),
        },
        Capture {
            about: CaptureHead { label: "spin".into(), series: 2, pose: spin, rate_hz: 1000 },
            first_us: 0,
            compensated: Vec::new(),
            samples: Vec::new(),
            losses: Losses::default(),
            receiver: no_receiver,
            timing: Timing::new(1000),
        },
        Capture {
            about: still("sky", -0.0),
            first_us: u64::from(u32::MAX) * 1000,
            compensated: Vec::new(),
            samples: Vec::new(),
            losses: received(6, 0, 0),
            receiver: ReceiverCapture {
                said: vec![
                    Said { board_time_us: 7, bytes: b"$GP\0\xff".to_vec() },
                    Said { board_time_us: 8, bytes: vec![b'\n'] },
                ],
                pulses_ns: vec![1_000_000_010, 2_000_000_020],
            },
            timing: Timing::new(200),
        },
    ]
}

/// A file that can be read while it is written.
#[derive(Clone, Default)]
pub(super) struct Shared(pub(super) Rc<RefCell<Vec<u8>>>);

impl Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.borrow_mut().extend_from_slice(bytes);
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Shared {
    fn seek(&mut self, _: SeekFrom) -> io::Result<u64> {
        Err(io::Error::other("append only"))
    }
}

pub(super) fn write<W: Write + Seek>(captures: &[Capture], out: &mut RawWriter<W>) {
    for capture in captures {
        let (rate_hz, board_time_us) = (capture.about.rate_hz, capture.first_us);
        let mut pieces = vec![Piece::Begin { about: capture.about.clone(), board_time_us }];
        for (index, part) in capture.samples.chunks(12).enumerate() {
            let first = index as u32 * 12;
            let board_time_us = board_time_us + u64::from(first) * 1_000_000 / u64::from(rate_hz);
            pieces.push(Piece::Imu { first, board_time_us, rate_hz, samples: part.to_vec() });
        }
        for (index, part) in capture.compensated.chunks(10).enumerate() {
            let first = index as u32 * 10;
            let board_time_us = board_time_us + u64::from(first) * 1_000_000 / u64::from(rate_hz);
            pieces.push(Piece::Compensated { first, board_time_us, rate_hz, samples: part.to_vec() });
        }
        for Said { board_time_us, bytes } in capture.receiver.said.clone() {
            pieces.push(Piece::Gnss { board_time_us, bytes });
        }
        pieces.push(Piece::Pps(capture.receiver.pulses_ns.clone()));
        pieces.push(Piece::End { losses: capture.losses, host: capture.timing.host.clone(), board_time_us });
        for piece in pieces {
            out.write(piece).unwrap();
        }
    }
}

pub(super) fn file(captures: &[Capture]) -> Vec<u8> {
    let mut out = RawWriter::new(Cursor::new(Vec::new()), None).unwrap();
    write(captures, &mut out);
    out.finish().unwrap().into_inner()
}

#[test]
fn captures_come_back_bit_for_bit() {
    let captures = captures();
    let found = read(file(&captures).as_slice()).unwrap();
    assert!(
        found == RawRecord { captures: captures.clone(), unfinished: None, origin: None, cut_off: false },
        "other samples"
    );
    // Equality of floats takes -0 for 0, so the bits are compared too.
    let bits = |captures: &[Capture]| {
        let poses = captures.iter().map(|capture| capture.about.pose.clone());
        poses
            .flat_map(|pose| match pose {
                Pose::Still { up, heading_deg } => [up[0], up[1], up[2], heading_deg].map(f64::to_bits).to_vec(),
                _ => Vec::new(),
            })
            .collect::<Vec<u64>>()
    };
    assert_eq!(bits(&found.captures), bits(&captures));
}

/// A file that is flushed and not finished is like a file after a kill. Cut at every byte it gives the captures before
/// the cut, and never a sample that was not written.
#[test]
fn a_file_may_end_anywhere() {
    let captures = captures();
    let shared = Shared::default();
    let mut out = RawWriter::new(mcap::write::NoSeek::new(shared.clone()), None).unwrap();
    out.flush().unwrap();
    let head = shared.0.borrow().len();
    let mut ends = Vec::new();
    for capture in &captures {
        write(std::slice::from_ref(capture), &mut out);
        out.flush().unwrap();
        ends.push(shared.0.borrow().len());
    }
    // Dropping the writer would write an end; a kill does not.
    std::mem::forget(out);
    let bytes = shared.0.borrow().clone();
    let mut seen = vec![false; captures.len() + 1];
    // Every length near the ends, and many between them.
    let near = |length: usize| ends.iter().any(|end| length.abs_diff(*end) < 20);
    for length in (0..=bytes.len()).filter(|length| length % 97 == 0 || near(*length)) {
        match read(&bytes[..length]) {
            Ok(found) => {
                assert!(found.cut_off, "{length}");
                let flushed = ends.iter().filter(|end| **end <= length).count();
                let whole = found.captures.len();
                // The index behind the last capture's samples may be missing.
                assert!(whole >= flushed, "{length} bytes: {whole} of {flushed} captures");
                assert!(found.captures == captures[..whole], "{length} bytes: other samples");
                seen[whole] = true;
            }
            // Before the head is complete, the file is not valid.
            Err(error) => assert!(length < head, "{length}: {error}"),
        }
    }
    assert_eq!(seen, [true; 6], "every count of captures was seen");
}

#[test]
fn one_changed_bit_is_noticed() {
    let captures = captures();
    let bytes = file(&captures);
    let whole = read(bytes.as_slice()).unwrap();
    let data_end = bytes.len() - 1;
    let mut noticed = 0;
    for index in (0..data_end).step_by(101) {
        let mut damaged = bytes.clone();
        damaged[index] ^= 0x10;
        match read(damaged.as_slice()) {
            Err(error) => {
                noticed += 1;
                assert!(!error.try_this().is_empty());
            }
            // Bytes outside the checksum of a chunk do not hold samples.
            Ok(found) => {
                assert!(found.captures == whole.captures || found.cut_off || found.captures.is_empty(), "{index}");
            }
        }
    }
    assert!(noticed > bytes.len() / 101 / 2, "{noticed}");
}

#[test]
fn messages_say_what_and_where() {
    let check = |bytes: &[u8], expected: &str| {
        let error = read(bytes).unwrap_err();
        assert_eq!(gnc_text::with_causes(&error), expected);
    };
    check(b"", "it is damaged before the first capture: MCAP file ended in the middle of a record");
    check(b"time,x,y,z\n0,1,2,3\n", "it is damaged before the first capture: Bad magic number");
    let captures = captures();
    let mut bytes = file(&captures);
    let at = bytes.len() / 3;
    bytes[at] ^= 1;
    let error = gnc_text::with_causes(&read(bytes.as_slice()).unwrap_err());
    assert!(error.starts_with("it is damaged before the first capture: "), "{error}");
    let twice = [captures[0].clone(), captures[0].clone()];
    check(&file(&twice), "it is not a record of this station: `x+` comes twice after capture `x+`");
}

/// Found by fuzzing: the reader took the rest of the file for the chunk's own, or the station panicked.
#[test]
fn a_record_does_not_leave_its_chunk() {
    let record =
        |opcode: u8, length: usize, body: &[u8]| [&[opcode][..], &(length as u64).to_le_bytes(), body].concat();
    let chunk = |records: &[u8]| {
        // Times, unpacked size, no checksum, no packer, size.
        let size = (records.len() as u64).to_le_bytes();
        let body = [&[0; 16], &size[..], &[0; 8], &size, records].concat();
        let footer = record(2, 20, &[0; 20]);
        let start = [mcap::MAGIC, &record(1, 8, &[0; 8])].concat();
        [start, record(6, body.len(), &body), record(15, 4, &[0; 4]), footer, mcap::MAGIC.to_vec()].concat()
    };
    let error = |file: Vec<u8>| gnc_text::with_causes(&read(file.as_slice()).unwrap_err());
    let whole = error(chunk(&record(0x80, 3, &[0; 3])));
    assert_eq!(
        whole,
        "it is not a record of this station: it has none of the station's topics before the first capture"
    );
    for length in [4, 20, 1 << 40] {
        let broken = error(chunk(&record(0x80, length, &[0; 3])));
        assert_eq!(broken, "it is damaged before the first capture: Chunk ended in the middle of a record", "{length}");
    }
}

/// Captures with few samples each.
pub(super) fn short_captures() -> Vec<Capture> {
    captures().into_iter().map(|capture| cut(capture, 60)).collect()
}

/// The first samples of a capture.
pub(super) fn cut(mut capture: Capture, samples: usize) -> Capture {
    if capture.samples.len().max(capture.compensated.len()) > samples {
        capture.samples.truncate(samples);
        capture.compensated.truncate(samples);
        let even = Timing::even(capture.about.rate_hz, capture.first_us, samples);
        capture.timing = Timing { host: capture.timing.host, ..even };
    }
    capture
}

/// A file from the time before fields had explicit presence. The station no longer writes such files.
#[test]
fn files_of_earlier_versions_are_read() {
    let found = read(&include_bytes!("implicit-presence.mcap")[..]).unwrap();
    let mut captures = short_captures();
    for capture in &mut captures {
        // The clocks were not compared at that time.
        capture.timing.host = HostView::default();
    }
    assert!(found == RawRecord { captures, unfinished: None, origin: None, cut_off: false }, "other samples");
}
