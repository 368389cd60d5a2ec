//! A run is killed, and a person writes in its folder before the next start.

use std::fs;
use std::io::Cursor;
use std::path::PathBuf;

use chrono::{DateTime, FixedOffset};
use gnc_analysis::capture::{Capture, CaptureHead, HostView, Pose, ReceiverCapture, Said, Timing};
use gnc_executive::event::{BenchKind, ProgramVersion};
use gnc_executive::plan::Plan;
use gnc_protocol::stream::Losses;
use serde_json::{Value, json};

use super::*;
use crate::raw::{RawWriter, pieces};
use crate::resume::{Like, ResumeError, Resumed};
use crate::store::chain::Scribe;
use crate::store::recovery::tests::close_as;
use crate::store::{RecordWriter, RunFolder, Sealer, StationKey, seal_interrupted};

const TEXT: &str = "name = \"p\"\nversion = \"1\"\n[[item]]\nid = \"io\"\nlimits.wrong_reads = \"<= 0\"\n";
const FILE: &str = "01-six-position/attempt-1.mcap";

fn at() -> DateTime<FixedOffset> {
    "2026-11-28T14:30:00+08:00".parse().unwrap()
}

/// A capture in which the receiver said whose it is.
fn capture(label: &str, whose: &str) -> Capture {
    let pose = Pose::Still { up: [0.0, 0.0, 1.0], heading_deg: 0.0 };
    let said = vec![Said { board_time_us: 5, bytes: whose.as_bytes().to_vec() }];
    Capture {
        about: CaptureHead { label: label.into(), series: 0, pose, rate_hz: 100 },
        first_us: 0,
        samples: Vec::new(),
        compensated: Vec::new(),
        losses: Losses::default(),
        receiver: ReceiverCapture { said, pulses_ns: Vec::new() },
        timing: Timing { host: HostView::Nothing("short".into()), ..Timing::new(100) },
    }
}

/// A records folder with one run that was killed.
struct Killed {
    records: tempfile::TempDir,
    run: PathBuf,
    key: Option<StationKey>,
}

impl Killed {
    /// It has made captures of these labels. The next one was under way, or its file has got its end.
    fn new(key: Option<StationKey>, labels: &[&str], is_ended: bool) -> Self {
        let records = tempfile::tempdir().unwrap();
        let plan = Plan::read("p.toml", TEXT.into(), &mut |_| Err(String::new())).unwrap();
        let folder = RunFolder::create(records.path(), at(), "GOOD", "p").unwrap().signed_with(key.clone());
        let run = folder.path().to_owned();
        let writer = RecordWriter::without_thread(folder, &plan, Vec::new()).unwrap();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(write(&writer, labels, is_ended));
        drop(writer);
        Self { records, run, key }
    }

    fn file(&self) -> PathBuf {
        self.run.join(FILE)
    }

    fn resume(&self) -> Result<Resumed, ResumeError> {
        self.resume_at(&self.run)
    }

    /// Names the run, or a copy of it, by this path.
    fn resume_at(&self, run: &Path) -> Result<Resumed, ResumeError> {
        let header = super::super::reader::fold(&self.run).unwrap().header().unwrap().clone();
        Resumed::read(run, Like::header(&header, 7, at(), self.records.path()).with_key(self.key.as_ref()))
    }

    /// The captures that a run takes over, as what the receiver said in each, and what is said of them.
    fn resumed(&self) -> (Vec<String>, Vec<String>) {
        let taken = self.resume().unwrap().captures("six-position", 1).unwrap();
        let said = |capture: &Capture| String::from_utf8(capture.receiver.said[0].bytes.clone()).unwrap();
        (taken.captures.iter().map(said).collect(), taken.doubts)
    }

    /// What the next start says.
    fn start(&self) -> Vec<String> {
        let program = ProgramVersion { name: "gnc-station".into(), version: "1".into(), build: None };
        let (station, kind) = ("bench 1", BenchKind::Real);
        let sealer = Sealer { station, kind, program: &program, at: at(), key: self.key.as_ref() };
        seal_interrupted(self.records.path(), &sealer)
    }

    /// What `verify` finds of the run, with the public key if there is one.
    fn found(&self) -> Vec<String> {
        let mut found = super::super::as_written::verify(&self.run);
        let keys: Vec<PublicKey> = self.key.iter().map(StationKey::public).collect();
        found.extend(super::super::as_written::verify_captured(&self.run, &keys));
        found
    }

    fn journal(&self) -> String {
        fs::read_to_string(self.run.join(JOURNAL)).unwrap()
    }

    /// Captures of another module in a file of the same run, in the place of its own.
    fn exchange(&self) {
        let own = crate::raw::read(fs::File::open(self.file()).unwrap()).unwrap();
        let mut out = RawWriter::new(Cursor::new(Vec::new()), own.origin.as_ref()).unwrap();
        let labels = own.captures.iter().map(|capture| capture.about.label.clone());
        for label in labels.collect::<Vec<_>>() {
            pieces(&capture(&label, &format!("of another module {}", "x".repeat(5000))))
                .for_each(|piece| out.write(piece).unwrap());
        }
        fs::write(self.file(), out.finish().unwrap().into_inner()).unwrap();
    }

    /// Edits the lines of the journal. Those about the raw file are made to fit, as far as that needs no key.
    fn edit(&self, change: impl Fn(&mut Value), fits: bool) {
        let file = fs::read(self.file()).unwrap();
        let mut journal = String::new();
        for line in self.journal().lines() {
            let mut event: Value = serde_json::from_str(line).unwrap();
            change(&mut event);
            if fits && event["kind"] == "captured" {
                event["bytes"] = file.len().into();
                event["sha256"] = digest::of_bytes(&file).into();
                event["journal_sha256"] = digest::of_bytes(journal.as_bytes()).into();
            }
            // In the order in which the station writes them.
            let event: Event = serde_json::from_value(event).unwrap();
            journal.push_str(&gnc_executive::journal::line(&event).unwrap());
        }
        fs::write(self.run.join(JOURNAL), journal).unwrap();
    }
}

async fn write(writer: &RecordWriter, labels: &[&str], is_ended: bool) {
    let sha256 = digest::of_plan([("p.toml", TEXT.as_bytes())].into_iter());
    let header = json!({
        "schema": "gnc-events/1", "serial_number": "GOOD", "operator": null, "station": "bench 1",
        "program": { "name": "gnc-station", "version": "1" }, "bench": { "kind": "real" }, "selection": null,
        "loop": null, "plan": { "name": "p", "version": "1", "sha256": sha256 },
    });
    let items = json!([{
        "name": "six-position", "id": "six-position", "title": "six", "phase": "test", "optional": false,
        "selected": true,
    }]);
    emit(writer, json!({ "kind": "run_started", "header": header, "items": items })).await;
    emit(writer, json!({ "kind": "item_started", "item": "six-position", "attempt": 1 })).await;
    emit(writer, json!({ "kind": "note", "level": "info", "text": "all is well", "item": null })).await;
    let mut raw = writer.raw("six-position", 1, 1).await.unwrap();
    for label in labels {
        for piece in pieces(&capture(label, label)) {
            raw.write(piece).await.unwrap();
        }
        let part = raw.settled().await.unwrap();
        captured(writer, part).await;
    }
    if is_ended {
        captured(writer, raw.finish().await.unwrap()).await;
    } else {
        // Begun, and not ended.
        let next: Vec<_> = pieces(&capture("next", "next")).take(2).collect();
        for piece in next {
            raw.write(piece).await.unwrap();
        }
        let bytes = raw.settled().await.unwrap().bytes;
        drop(raw);
        writer.raw_files_ended().await;
        // A file that is given up gets its end; a kill leaves none.
        let file = fs::OpenOptions::new().write(true).open(writer.folder().join(FILE)).unwrap();
        file.set_len(bytes).unwrap();
    }
    writer.raw_files_ended().await;
}

async fn captured(writer: &RecordWriter, part: crate::store::RawPart) {
    let crate::store::RawPart { file, bytes, sha256 } = part;
    let body = json!({
        "kind": "captured", "item": "six-position", "attempt": 1, "file": file, "bytes": bytes, "sha256": sha256,
        "journal_sha256": "",
    });
    emit(writer, body).await;
}

async fn emit(writer: &RecordWriter, mut body: Value) {
    let place = writer.place().await.unwrap();
    let state = writer.state();
    body["seq"] = state.lock().unwrap().next_seq().into();
    body["at"] = at().to_rfc3339().into();
    body["elapsed_us"] = 1.into();
    let event: Event = serde_json::from_value(body).unwrap();
    state.lock().unwrap().apply(&event).unwrap();
    place.write(event, true).synced().await.unwrap();
}

fn key() -> StationKey {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("key");
    StationKey::create(&path).unwrap();
    StationKey::read(&path).unwrap()
}

/// With a key and without one; the file with its end and without one.
fn each(case: impl Fn(&dyn Fn(&[&str]) -> Killed, bool, bool)) {
    for has_key in [false, true] {
        for is_ended in [false, true] {
            case(&|labels| Killed::new(has_key.then(key), labels, is_ended), has_key, is_ended);
        }
    }
}

const NOT_TAKEN: &str = "captures of the run to resume are not taken over and are made again: ";

/// What was captured is taken over before and after the next start, and nothing is found.
#[test]
fn an_untouched_run_is_taken_up() {
    each(|killed, has_key, is_ended| {
        let run = killed(&["x+", "x-"]);
        let all = (vec!["x+".to_owned(), "x-".to_owned()], Vec::new());
        assert_eq!(run.resumed(), all, "{has_key} {is_ended}");
        assert_eq!(run.journal().matches("\"signature\"").count(), if has_key { 2 + usize::from(is_ended) } else { 0 });
        let said = run.start();
        assert!(
            said.len() == 1 && said[0].contains("sealed as interrupted") && !said[0].contains("captured"),
            "{said:?}"
        );
        assert_eq!(run.found(), Vec::<String>::new(), "{has_key} {is_ended}");
        assert_eq!(run.resumed(), all, "{has_key} {is_ended}");
        let log = fs::read_to_string(run.run.join("log.txt")).unwrap();
        assert!(!log.contains("not as the journal says"), "{log}");
    });
}

/// The samples of another module in a file that says that it is of this run.
#[test]
fn an_exchanged_file_is_not_taken_over() {
    each(|killed, _, _| {
        let run = killed(&["x+", "x-"]);
        run.exchange();
        let (captures, doubts) = run.resumed();
        assert_eq!(captures, Vec::<String>::new());
        let what = format!("{FILE} is not the one that was captured: ");
        assert!(doubts.len() == 1 && doubts[0].starts_with(&format!("{NOT_TAKEN}{what}")), "{doubts:?}");
        let said = run.start();
        assert!(said.len() == 1 && said[0].contains(&what), "{said:?}");
        let found = run.found();
        assert!(found.len() == 1 && found[0].starts_with(&what), "{found:?}");
        assert!(fs::read_to_string(run.run.join("log.txt")).unwrap().contains(&what));
        // A closed run that is not as it was written is not taken up at all.
        let refused = run.resume().unwrap_err().to_string();
        assert!(refused.contains(&what), "{refused}");
    });
}

/// Who has no key can make the lines of the journal fit, but not sign them.
#[test]
fn lines_that_were_made_to_fit_need_the_key() {
    each(|killed, has_key, _| {
        let run = killed(&["x+"]);
        run.exchange();
        run.edit(|_| {}, true);
        let (captures, doubts) = run.resumed();
        run.start();
        let found = run.found();
        if !has_key {
            assert_eq!((captures.len(), doubts, found), (1, Vec::new(), Vec::new()), "nothing shows it");
            return;
        }
        let what = format!("the line of the journal that says what {FILE} holds is not signed with ");
        assert_eq!((captures, doubts), (Vec::new(), vec![format!("{NOT_TAKEN}{what}the key of this station")]));
        assert_eq!(found, [format!("{what}this key")]);
    });
}

/// A result before the capture is edited: the line about the file does not fit any more.
#[test]
fn what_stands_before_a_capture_cannot_be_edited() {
    let change = |event: &mut Value| {
        if event["kind"] == "note" {
            event["text"] = "all is bad".into();
        }
    };
    each(|killed, has_key, is_ended| {
        let run = killed(&["x+"]);
        run.edit(change, false);
        let (captures, doubts) = run.resumed();
        let what = format!("the journal was changed before its line that says what {FILE} holds");
        assert_eq!((captures, doubts), (Vec::new(), vec![format!("{NOT_TAKEN}{what}")]));
        run.start();
        assert_eq!(run.found(), [what]);
        // Made to fit, the key finds it. The file was cut off, so its bytes are named by hand.
        let run = killed(&["x+"]);
        run.edit(change, is_ended);
        if is_ended {
            assert_eq!(run.resumed().0.len(), usize::from(!has_key));
            run.start();
            assert_eq!(run.found().len(), usize::from(has_key), "{:?}", run.found());
        }
    });
}

/// Lines about files are taken away, as in the journal of an earlier version.
#[test]
fn a_file_that_no_line_names() {
    each(|killed, has_key, _| {
        let run = killed(&["x+"]);
        let kept: String = run.journal().split_inclusive('\n').filter(|line| !line.contains("captured")).collect();
        fs::write(run.run.join(JOURNAL), kept).unwrap();
        let what = format!("no line of the journal says what {FILE} holds");
        let (captures, doubts) = run.resumed();
        if has_key {
            assert_eq!((captures, doubts), (Vec::new(), vec![format!("{NOT_TAKEN}{what}")]));
        } else {
            let told = "captures of the run to resume are taken over, and nothing shows that they are its own: ";
            assert_eq!((captures, doubts), (vec!["x+".to_owned()], vec![format!("{told}{what}")]));
        }
    });
    // Killed in the first capture: there is nothing to say.
    each(|killed, _, _| assert_eq!(killed(&[]).resumed(), (Vec::new(), Vec::new())));
}

/// A file that is shorter, or gone.
#[test]
fn a_file_that_lacks_bytes_is_not_taken_over() {
    each(|killed, _, _| {
        let run = killed(&["x+", "x-"]);
        let bytes = fs::read(run.file()).unwrap();
        let named = run.journal().lines().rev().find(|line| line.contains("captured")).unwrap().to_owned();
        let named: Value = serde_json::from_str(&named).unwrap();
        let named = usize::try_from(named["bytes"].as_u64().unwrap()).unwrap();
        fs::write(run.file(), &bytes[..named - 1]).unwrap();
        let (captures, doubts) = run.resumed();
        assert!(captures.is_empty() && doubts[0].contains(&format!("it has {} bytes", named - 1)), "{doubts:?}");
        fs::remove_file(run.file()).unwrap();
        let (captures, doubts) = run.resumed();
        let what = format!("{FILE} is missing, and the journal says that it was captured");
        assert_eq!((captures, doubts), (Vec::new(), vec![format!("{NOT_TAKEN}{what}")]));
        run.start();
        assert_eq!(run.found(), [what]);
    });
}

/// Copies a run into the same day of other records.
fn copied(run: &Path, records: &Path) -> PathBuf {
    let copy = records.join("2026-11-28/GOOD").join(run.file_name().unwrap());
    for file in digest::files_below(run).unwrap() {
        fs::create_dir_all(copy.join(&file).parent().unwrap()).unwrap();
        fs::copy(run.join(&file), copy.join(&file)).unwrap();
    }
    copy
}

const NOT_BEGUN: &str = "no line of the chain says that it began";
const UNPROVEN: &str = "captures of the run to resume are taken over, and nothing shows whose they are: ";

fn verification(what: &str) -> String {
    format!("the run to resume fails its verification: {what}")
}

/// A run of elsewhere, with a chain there and without one, before and after it was closed.
#[test]
fn a_run_from_other_records_is_refused_with_a_key_and_doubted_without_one() {
    each(|killed, has_key, _| {
        for (is_closed, has_chain) in [(false, false), (false, true), (true, false), (true, true)] {
            let run = killed(&["x+"]);
            if is_closed {
                run.start();
            }
            let elsewhere = tempfile::tempdir().unwrap();
            let copy = copied(&run.run, elsewhere.path());
            if has_chain {
                fs::copy(run.records.path().join("2026-11-28/CHAIN"), elsewhere.path().join("2026-11-28/CHAIN"))
                    .unwrap();
            }
            // The same through `..` and through a link in the records folder.
            let around = copy.parent().unwrap().join("..").join("GOOD").join(copy.file_name().unwrap());
            let link = run.run.with_file_name("120000-p");
            std::os::unix::fs::symlink(&copy, &link).unwrap();
            for path in [&copy, &around, &link] {
                let resumed = run.resume_at(path);
                if has_key {
                    let refused = resumed.unwrap_err();
                    let records = gnc_text::shown_path(run.records.path());
                    let what = format!("the run to resume is not in the records folder of this station, {records}");
                    assert_eq!(refused.to_string(), what);
                    assert!(refused.try_this().starts_with("name a run in that folder"));
                    continue;
                }
                let taken = resumed.unwrap().captures("six-position", 1).unwrap();
                let doubt = format!("{UNPROVEN}the run is not in the records folder of this station");
                assert_eq!((taken.captures.len(), taken.doubts), (1, vec![doubt]));
            }
            // A way around to the station's own run is one to its own run.
            let around = run.run.join("../../GOOD").join(run.run.file_name().unwrap());
            assert!(run.resume_at(&around).unwrap().captures("six-position", 1).unwrap().doubts.is_empty());
        }
    });
}

/// Chain and counter are taken away, as if an earlier version had made the records.
#[test]
fn a_run_whose_chain_was_taken_away_is_refused_with_a_key_and_doubted_without_one() {
    each(|killed, has_key, _| {
        for is_closed in [false, true] {
            let run = killed(&["x+"]);
            if is_closed {
                run.start();
            }
            fs::remove_file(run.records.path().join("2026-11-28/CHAIN")).unwrap();
            fs::remove_file(run.records.path().join("COUNTER")).unwrap();
            if has_key {
                assert_eq!(run.resume().unwrap_err().to_string(), verification(NOT_BEGUN));
            } else {
                assert_eq!(run.resumed(), (vec!["x+".to_owned()], vec![format!("{UNPROVEN}{NOT_BEGUN}")]));
            }
        }
    });
}

/// A closed run needs the signatures of its digests and of its line.
#[test]
fn a_closed_run_needs_the_signatures_of_its_station() {
    let closed = || {
        let run = Killed::new(Some(key()), &["x+"], true);
        run.start();
        assert_eq!(run.resumed(), (vec!["x+".to_owned()], Vec::new()));
        run
    };
    let run = closed();
    let signature = run.run.join("SHA256SUMS.sig");
    fs::write(&signature, [7; 64]).unwrap();
    let refused = |run: &Killed| run.resume().unwrap_err().to_string();
    assert_eq!(refused(&run), verification("SHA256SUMS.sig is not the signature of SHA256SUMS with this key"));
    fs::remove_file(&signature).unwrap();
    assert_eq!(refused(&run), verification("SHA256SUMS.sig is missing: the run is not signed"));
    let run = closed();
    let chain = run.records.path().join("2026-11-28/CHAIN");
    let lines = fs::read_to_string(&chain).unwrap();
    let unsigned = |line: &str| match line.contains(" close ") {
        true => format!("{}\n", line.split(" sig ").next().unwrap()),
        false => format!("{line}\n"),
    };
    fs::write(&chain, lines.lines().map(unsigned).collect::<String>()).unwrap();
    assert_eq!(refused(&run), verification("the line of its end is not signed with the key of this station"));
}

/// The lines about the file are taken away, and the killed run is made one that ended: its digests cover the file now.
#[test]
fn a_run_that_was_given_an_end_needs_its_lines_too() {
    each(|killed, has_key, _| {
        let run = killed(&["x+"]);
        let lines = run.journal();
        let kept = lines.lines().filter(|line| !line.contains("captured"));
        let mut events: Vec<Value> = kept.map(|line| serde_json::from_str(line).unwrap()).collect();
        let at = events[0]["at"].clone();
        let (seq, end) = (events.len(), "aborted");
        events.push(json!({ "seq": seq, "at": at, "elapsed_us": 9, "kind": "run_ended", "outcome": end }));
        let line = |(at, event): (usize, &Value)| match at {
            0 => format!("{}\n", lines.lines().next().unwrap()),
            _ => gnc_executive::journal::line(&serde_json::from_value::<Event>(event.clone()).unwrap()).unwrap(),
        };
        fs::write(run.run.join(JOURNAL), events.iter().enumerate().map(line).collect::<String>()).unwrap();
        let by = Scribe { station: "bench 1", at: super::tests::at(), key: run.key.as_ref(), late: None };
        close_as(&run.run, &by, run.key.as_ref(), None).unwrap();
        let what = format!("no line of the journal says what {FILE} holds");
        let expected = match has_key {
            true => (Vec::new(), vec![format!("{NOT_TAKEN}{what}")]),
            false => (vec!["x+".to_owned()], Vec::new()),
        };
        assert_eq!(run.resumed(), expected);
    });
}
