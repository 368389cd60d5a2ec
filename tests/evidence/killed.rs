//! A run that was killed, and the next start that closes it.

use std::path::{Path, PathBuf};

use chrono::{DateTime, FixedOffset};
use gnc_analysis::capture::{Capture, CaptureHead, Pose, ReceiverCapture, Said, Timing};
use gnc_executive::event::{BenchKind, Event, ProgramVersion};
use gnc_protocol::stream::Losses;
use gnc_records::raw::pieces;
use gnc_records::store::{RawPart, RecordWriter, Sealer, StationKey, seal_interrupted};
use serde_json::json;

use crate::day::{self, event, events};

/// Writes the beginning of a run that captures, and leaves it as a kill does.
pub(crate) fn killed(records: &Path, key: &StationKey) -> PathBuf {
    let (started, serial_number) = ("2026-11-29T09:00:00+08:00", "T-4");
    let at: DateTime<FixedOffset> = started.parse().expect("a time");
    let (path, writer) = day::new(records, key, at, serial_number);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    runtime.block_on(async {
        for (seq, body) in events(serial_number, 0.0).into_iter().take(3).enumerate() {
            emit(&writer, event(seq, at, body)).await;
        }
        let mut raw = writer.raw("cpu", 1, 1).await.expect("a raw file");
        for piece in pieces(&capture("of its own module")) {
            raw.write(piece).await.expect("room");
        }
        let RawPart { file, bytes, sha256 } = raw.finish().await.expect("room");
        let captured = json!({
            "kind": "captured", "item": "cpu", "attempt": 1, "file": file, "bytes": bytes, "sha256": sha256,
            "journal_sha256": "",
        });
        emit(&writer, event(3, at, captured)).await;
        writer.raw_files_ended().await;
    });
    path
}

async fn emit(writer: &RecordWriter, event: Event) {
    writer.state().lock().expect("a state").apply(&event).expect("in order");
    writer.place().await.expect("a record").write(event, true).synced().await.expect("an event on disk");
}

/// A capture in which the receiver said something.
pub(crate) fn capture(said: &str) -> Capture {
    let pose = Pose::Still { up: [0.0, 0.0, 1.0], heading_deg: 0.0 };
    let said = vec![Said { board_time_us: 5, bytes: said.as_bytes().to_vec() }];
    Capture {
        about: CaptureHead { label: "z+".into(), series: 0, pose, rate_hz: 100 },
        first_us: 0,
        samples: Vec::new(),
        compensated: Vec::new(),
        losses: Losses::default(),
        receiver: ReceiverCapture { said, pulses_ns: Vec::new() },
        timing: Timing::new(100),
    }
}

/// The next start of the station, which closes what was left.
pub(crate) fn start(records: &Path, key: &StationKey) -> Vec<String> {
    let at: DateTime<FixedOffset> = "2026-11-29T10:00:00+08:00".parse().expect("a time");
    let program = ProgramVersion { name: "gnc-station".to_owned(), version: "0.1.0".to_owned(), build: None };
    let (station, kind) = ("bench 1", BenchKind::Real);
    seal_interrupted(records, &Sealer { station, kind, program: &program, at, key: Some(key) })
}
