//! What a receiver says: the same epochs however its bytes are cut, every number in them one of the earth, and figures
//! from them or a reason why there are none.

#![no_main]

use std::sync::LazyLock;

use gnc_analysis::capture::{CaptureHead, Capture, Pose, ReceiverCapture, Said, Timing};
use gnc_analysis::figures::{AnalysisInput, analyse};
use gnc_executive::bench::{BenchSite, SitePlace};
use gnc_executive::catalogue::ItemId;
use gnc_executive::measurement::Value;
use gnc_executive::plan::{Params, Plan};
use gnc_nmea::{Counts, Epoch, Sentences};
use gnc_protocol::stream::Losses;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|input: (u16, &[u8])| {
    let (cut, bytes) = input;
    heard(cut, bytes);
    // Chance finds no checksum.
    let right = with_checksums(bytes);
    heard(cut, &right);
    figures(&right);
});

fn heard(cut: u16, bytes: &[u8]) {
    let (head, tail) = bytes.split_at(usize::from(cut).min(bytes.len()));
    let (whole, counts) = epochs(&[bytes]);
    whole.iter().for_each(plausible);
    assert_eq!((whole, counts), epochs(&[head, tail]));
}

fn epochs(pieces: &[&[u8]]) -> (Vec<Epoch>, (Counts, String)) {
    let mut sentences = Sentences::default();
    let epochs = pieces.iter().flat_map(|piece| sentences.push(piece)).collect();
    (epochs, (sentences.counts(), sentences.foreign()))
}

fn plausible(epoch: &Epoch) {
    assert!(!epoch.has_fix() || epoch.fix.is_fix(), "{epoch:?}");
    assert!(epoch.height_m.is_none() || epoch.altitude_m.is_some(), "{epoch:?}");
    assert!(epoch.latitude_deg.is_none_or(|deg| deg.abs() <= 90.0), "{epoch:?}");
    assert!(epoch.longitude_deg.is_none_or(|deg| deg.abs() <= 180.0), "{epoch:?}");
    assert!(epoch.height_m.is_none_or(f64::is_finite), "{epoch:?}");
    assert!(epoch.ground_speed_mps.is_none_or(|mps| mps.is_finite() && mps >= 0.0), "{epoch:?}");
    assert!(epoch.hdop.is_none_or(|hdop| hdop.is_finite() && hdop >= 0.0), "{epoch:?}");
    assert!(epoch.vdop.is_none_or(|vdop| vdop.is_finite() && vdop >= 0.0), "{epoch:?}");
}

/// Each line that ends as a sentence does gets the checksum that it should have.
fn with_checksums(bytes: &[u8]) -> Vec<u8> {
    let mut right = Vec::with_capacity(bytes.len());
    for line in bytes.split_inclusive(|byte| *byte == b'\n') {
        let start = line.iter().position(|byte| *byte == b'$').map_or(0, |at| at + 1);
        let star = line.iter().rposition(|byte| *byte == b'*');
        match star.filter(|star| (start..line.len().saturating_sub(2)).contains(star)) {
            Some(star) => {
                let sum = line[start..star].iter().fold(0, |sum, byte| sum ^ byte);
                right.extend_from_slice(&line[..=star]);
                right.extend_from_slice(format!("{sum:02X}").as_bytes());
                right.extend_from_slice(&line[star + 3..]);
            }
            None => right.extend_from_slice(line),
        }
    }
    right
}

static PARAMS: LazyLock<Params> = LazyLock::new(|| {
    let plan = "name = \"p\"\nversion = \"1\"\n[[item]]\nid = \"gnss-accuracy\"\nlimits = { epochs = \">= 1\" }\n";
    let plan = Plan::read("plan", plan.into(), &mut |_| Err("none".to_owned())).expect("a plan");
    plan.items()[0].params.clone()
});

/// What they measure is a number, or said not to be there.
fn figures(bytes: &[u8]) {
    let about = CaptureHead {
        label: "receiver".to_owned(),
        series: 1,
        pose: Pose::Still { up: [0.0, 0.0, 1.0], heading_deg: 0.0 },
        rate_hz: 200,
    };
    let said = bytes.chunks(200).map(|piece| Said { board_time_us: 0, bytes: piece.to_vec() }).collect();
    // Pulses at any time at all.
    let pulses_ns = bytes.chunks_exact(8).map(|time| u64::from_le_bytes(time.try_into().unwrap())).collect();
    let capture = Capture {
        about,
        first_us: 0,
        samples: Vec::new(),
        compensated: Vec::new(),
        losses: Losses::default(),
        receiver: ReceiverCapture { said, pulses_ns },
        timing: Timing::new(200),
    };
    let place = SitePlace { latitude_deg: 34.2321, longitude_deg: 108.9154, height_m: 412.0 };
    let site = BenchSite { place: Some(place), ..BenchSite::default() };
    let question = AnalysisInput { params: &PARAMS, site: Some(&site), captures: &[capture], earlier: &[] };
    match analyse(ItemId::GnssAccuracy, &question) {
        Ok(findings) => {
            for (name, value) in &findings.measured {
                if let Value::Number(quantity) | Value::Estimate(quantity, _) = value {
                    assert!(quantity.number.is_finite(), "{name} is {value:?}");
                }
            }
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}
