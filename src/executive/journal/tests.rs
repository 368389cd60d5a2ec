use proptest::prelude::*;

use super::*;
use crate::event::{EventKind, NoteLevel, RunHeader};
use crate::measurement::Value;
use crate::outcome::Outcome;
use crate::quantity::Unit;
use crate::record::RunRecord;
use crate::test_run::{SMALL, TestRun, header, job, small_run};
use crate::text::log_txt;
use crate::uncertainty::Uncertainty;
use crate::verdict::Verdict;

fn stored() -> (Vec<u8>, RunState, Vec<Event>) {
    let run = small_run(header());
    let text: String = run.events.iter().map(|event| line(event).unwrap()).collect();
    (text.into_bytes(), run.state, run.events)
}

#[test]
fn the_stored_run_is_the_live_run() {
    let (bytes, live, events) = stored();
    let journal = fold(&bytes).unwrap();
    assert_eq!(journal.state, live);
    assert!(!journal.state.is_interrupted());
    assert_eq!((journal.good_bytes, journal.cut_bytes), (bytes.len(), 0));
    for event in events {
        let back: Event = serde_json::from_str(&line(&event).unwrap()).unwrap();
        assert_eq!(back, event);
        assert!(line(&event).unwrap().contains(&format!("\"kind\":\"{}\"", event.kind.name())));
    }
}

/// Other programs read the form of the lines: a change here is a change of the schema.
#[test]
fn lines_have_their_form() {
    let (bytes, _, _) = stored();
    let text = String::from_utf8(bytes).unwrap();
    let some: Vec<&str> = text.lines().take(6).collect();
    insta::assert_snapshot!(some.join("\n"), @r#"
    {"seq":0,"at":"2026-11-22T14:30:15+08:00","elapsed_us":0,"kind":"run_started","header":{"schema":"gnc-events/1","serial_number":"DEMO-1","operator":"Li Wei","station":"line-2","program":{"name":"gnc-station","version":"0.1.0"},"bench":{"kind":"real","port":"/dev/ttyUSB0","rate_bps":921600},"plan":{"name":"small","version":"1.0","sha256":"0000000000000000000000000000000000000000000000000000000000000000"},"selection":null,"loop":null},"items":[{"name":"identity","id":"identity","title":"Identity and supply","phase":"test","optional":false,"selected":true},{"name":"sdram","id":"sdram","title":"SDRAM","phase":"test","optional":false,"selected":true},{"name":"imu","id":"imu","title":"IMU at rest","phase":"test","optional":false,"selected":true},{"name":"io","id":"io","title":"IO lines","phase":"test","optional":false,"selected":true}]}
    {"seq":1,"at":"2026-11-22T14:30:15.250+08:00","elapsed_us":250000,"kind":"board_found","board_serial":"SB-7","firmware":"1.4.0","protocol":1,"boot_id":"5f3a9c01","link":"/dev/ttyUSB0 at 921600 bit/s"}
    {"seq":2,"at":"2026-11-22T14:30:15.500+08:00","elapsed_us":500000,"kind":"power","on":true,"supply":"slave board","voltage_v":5.01,"current_a":null}
    {"seq":3,"at":"2026-11-22T14:30:15.750+08:00","elapsed_us":750000,"kind":"item_started","item":"identity","attempt":1}
    {"seq":4,"at":"2026-11-22T14:30:16+08:00","elapsed_us":1000000,"kind":"measured","item":"identity","attempt":1,"measurement":{"name":"serial_number","value":"DEMO-1","unit":null,"low":null,"high":null,"expected":"DEMO-1","outcome":"passed"}}
    {"seq":5,"at":"2026-11-22T14:30:16.250+08:00","elapsed_us":1250000,"kind":"measured","item":"identity","attempt":1,"measurement":{"name":"firmware","value":"2.1\u001b[31m","unit":null,"low":null,"high":null,"expected":null,"outcome":null}}
    "#);
}

/// Power may fail at any byte. The journal then reads as the run up to its last whole event.
#[test]
fn a_journal_may_be_cut_anywhere() {
    let (bytes, _, events) = stored();
    for cut in 0..bytes.len() {
        let journal = fold(&bytes[..cut]).unwrap();
        let mut expected = RunState::new();
        // Whole lines, and a last line that may lack only its line feed.
        let ends: Vec<usize> = bytes.iter().enumerate().filter(|(_, b)| **b == b'\n').map(|(at, _)| at).collect();
        for event in &events[..ends.iter().filter(|end| **end <= cut).count()] {
            expected.apply(event).unwrap();
        }
        assert_eq!(journal.state, expected, "cut at {cut}");
        assert_eq!(journal.good_bytes + journal.cut_bytes, cut);
        assert!(journal.state.verdict().is_none() || cut + 1 == bytes.len());
        // A file system that had no time for the data leaves zero bytes. Every 16th place suffices for this test.
        if cut % 16 == 0 {
            let mut zeros = bytes[..cut].to_vec();
            zeros.extend([0; 100]);
            assert_eq!(fold(&zeros).unwrap().state, expected, "zeros from {cut}");
        }
    }
}

#[test]
fn damaged_journals_are_refused() {
    let (bytes, _, _) = stored();
    let text = String::from_utf8(bytes).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let mut out = String::new();
    let mut show = |text: String| {
        let error = fold(text.as_bytes()).unwrap_err();
        let source = std::error::Error::source(&error).unwrap();
        out.push_str(&format!("{error}: {source}\n"));
    };
    show(format!("{}\ngarbage\n{}\n", lines[0], lines[1]));
    show(format!("{}\n{}\n", lines[0], lines[2]));
    show(format!("{}\n{}\n", lines[0], lines[0]));
    show(lines[1].replace("\"seq\":1", "\"seq\":0") + "\n");
    show(format!("{text}{}\n", lines[1]));
    show(format!("{text}{}\n", lines[1].replace("\"seq\":1,", &format!("\"seq\":{},", lines.len()))));
    let started = |item: &str, attempt: u32| {
        let line = lines.iter().find(|line| line.contains("item_started")).unwrap();
        let line = line.replace("\"seq\":3,", "\"seq\":1,").replace("identity", item);
        format!("{}\n{}\n", lines[0], line.replace("\"attempt\":1", &format!("\"attempt\":{attempt}")))
    };
    show(started("\\u001b[2J", 1));
    show(started("identity", 2));
    show(format!("{}\n{}\n", lines[0], lines[4].replace("\"seq\":4,", "\"seq\":1,")));
    let twice = lines[0].replace("\"name\":\"sdram\"", "\"name\":\"io\"");
    show(format!("{twice}\n"));
    insta::assert_snapshot!(out, @r#"
    line 2 of the journal is not an event: expected value at line 1 column 1
    line 2 of the journal contradicts the lines before it: event 1 is due, but event 2 comes
    line 2 of the journal contradicts the lines before it: event 1 is due, but event 0 comes
    line 1 of the journal contradicts the lines before it: event 0 is board_found before run_started
    line 28 of the journal contradicts the lines before it: event 27 is due, but event 1 comes
    line 28 of the journal contradicts the lines before it: event 27 is board_found after run_ended
    line 2 of the journal contradicts the lines before it: event 1 is item_started of the item "\u{1b}[2J", which is not planned
    line 2 of the journal contradicts the lines before it: event 1 is item_started of "identity", which is due for another attempt
    line 2 of the journal contradicts the lines before it: event 1 is measured of "identity", which has no attempt that runs
    line 1 of the journal contradicts the lines before it: item "io" is planned twice
    "#);
}

/// Content of a later version is told from damage at every place. The error names the line by its number in the file.
#[test]
fn a_newer_journal_is_not_damage() {
    let (bytes, _, _) = stored();
    let text = String::from_utf8(bytes).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let last = lines.len() - 1;
    // Each case replaces one name in one line.
    let told = |at: usize, from: &str, to: &str| {
        assert!(lines[at].contains(from), "{from} is not in {}", lines[at]);
        let changed = lines[at].replacen(from, to, 1);
        let all: Vec<&str> =
            lines.iter().enumerate().map(|(i, line)| if i == at { &*changed } else { *line }).collect();
        match fold((all.join("\n") + "\n").as_bytes()) {
            Err(error @ JournalError::Newer { line, .. }) => format!("line {line}: {error}"),
            other => format!("{other:?}"),
        }
    };
    let newer = |line: usize, what: &str| format!("line {line}: written by a newer version of the station ({what})");
    assert_eq!(told(0, "\"run_started\"", "\"run_ordered\""), newer(1, "event `run_ordered`"));
    assert_eq!(told(4, "\"measured\"", "\"weighed\""), newer(5, "event `weighed`"));
    assert_eq!(told(last, "\"run_ended\"", "\"run_sealed\""), newer(last + 1, "event `run_sealed`"));
    assert_eq!(told(0, "gnc-events/1", "gnc-events/3"), newer(1, "schema `gnc-events/3`"));
    // A new schema counts whatever else is new in the line.
    assert_eq!(
        told(0, "gnc-events/1\",\"serial_number\"", "gnc-events/12\",\"number\""),
        newer(1, "schema `gnc-events/12`")
    );
    assert_eq!(
        told(0, "\"id\":\"sdram\"", "\"id\":\"thermal-vacuum\""),
        newer(1, "value `thermal-vacuum` in event `run_started`")
    );
    assert_eq!(
        told(last, "\"outcome\":\"", "\"outcome\":\"nearly_"),
        newer(last + 1, "value `nearly_errored` in event `run_ended`")
    );
    assert_eq!(told(4, "\"unit\":null", "\"unit\":\"parsec\""), newer(5, "value `parsec` in event `measured`"));
    // The text is from outside, so it may hold anything.
    assert_eq!(told(4, "\"measured\"", "\"\\u001b[2J\""), newer(5, "event `\\u{1b}[2J`"));
}

/// A line that no version would write is damage, whatever its kind.
#[test]
fn damage_is_not_a_newer_version() {
    let (bytes, _, _) = stored();
    let text = String::from_utf8(bytes).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let refused = |changed: &str| {
        let error = fold(format!("{}\n{changed}\n", lines[0]).as_bytes()).unwrap_err();
        assert!(!matches!(error, JournalError::Newer { .. }), "{changed}: {error}");
    };
    let unknown = lines[1].replace("board_found", "weighed");
    refused(&unknown.replace("\"seq\":1", "\"seq\":2"));
    refused(&unknown.replace("\"seq\":1,", ""));
    refused(&unknown.replace("\"elapsed_us\":250000", "\"elapsed_us\":\"soon\""));
    refused(&unknown[..unknown.len() - 1]);
    refused(&lines[1].replace("\"board_serial\"", "\"board_number\""));
    refused(&lines[1].replace("\"protocol\":1", "\"protocol\":\"one\""));
    refused("\"weighed\"");
    for schema in ["gnc-events/0", "gnc-events/one", "gnc-events", "gnc-runs/2", ""] {
        let error = fold(lines[0].replace("gnc-events/1", schema).as_bytes()).unwrap_err();
        let expected = format!(
            "line 1 of the journal has the schema {schema:?}, and this program reads gnc-events/1 and gnc-events/2"
        );
        assert_eq!(error.to_string(), expected);
    }
}

/// A line that was cut off is ignored, known or not. A whole line is read even if its end is missing.
#[test]
fn an_unknown_event_may_be_cut_off() {
    let (bytes, _, events) = stored();
    let text = String::from_utf8(bytes).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let unknown = lines[1].replace("board_found", "weighed");
    for cut in 0..unknown.len() {
        let journal = fold(format!("{}\n{}", lines[0], &unknown[..cut]).as_bytes()).unwrap();
        assert_eq!(journal.state.next_seq(), events[0].seq + 1, "cut at {cut}");
    }
    let whole = fold(format!("{}\n{unknown}", lines[0]).as_bytes());
    assert!(matches!(whole, Err(JournalError::Newer { line: 2, .. })), "{whole:?}");
}

/// The list of known kinds is that of the parser, which names its list when it finds an unknown kind.
#[test]
fn the_list_of_kinds_is_whole() {
    let at = "2026-11-22T14:30:15+08:00";
    let text = format!("{{\"seq\":0,\"at\":\"{at}\",\"elapsed_us\":0,\"kind\":\"x\"}}");
    let told = serde_json::from_str::<Event>(&text).unwrap_err().to_string();
    let names = EventKind::NAMES.map(|name| format!("`{name}`")).join(", ");
    assert_eq!(told.split(" at line").next(), Some(&*format!("unknown variant `x`, expected one of {names}")));
}

fn any_value() -> impl Strategy<Value = Value> {
    prop_oneof![
        (any::<f64>(), proptest::sample::select(Unit::ALL.to_vec()))
            .prop_map(|(number, unit)| Value::number(number, unit)),
        (any::<f64>(), any::<f64>(), any::<f64>(), proptest::sample::select(Unit::ALL.to_vec())).prop_map(
            |(number, low, high, unit)| Value::estimate(number, unit, Uncertainty::interval(low, high, 0.95))
        ),
        any::<String>().prop_map(Value::Text),
        any::<String>().prop_map(Value::NotAvailable),
    ]
}

proptest! {
    /// For any measured values and any texts from outside, the journal gives back the same run.
    #[test]
    fn fold_of_the_file_is_the_live_fold(
        values in proptest::collection::vec((0usize..7, any_value()), 0..12),
        serial_number in any::<String>(),
        note in any::<String>(),
    ) {
        let job = job(SMALL);
        let item = job.item(0).unwrap();
        let mut run = TestRun::new(&job, RunHeader { serial_number, ..header() });
        run.emit(EventKind::Note { level: NoteLevel::Warning, text: note.clone(), item: Some(note) });
        let names = item.id.spec().measurements;
        let values: Vec<(&str, Value)> = values.into_iter().map(|(name, value)| (names[name].name, value)).collect();
        run.attempt(item, 1, &values);
        let text: String = run.events.iter().map(|event| line(event).unwrap()).collect();
        prop_assert_eq!(text.lines().count(), run.events.len());
        let journal = fold(text.as_bytes()).unwrap();
        prop_assert_eq!(&journal.state, &run.state);
        // The log of it holds no control character.
        let log = log_txt(&RunRecord::from_state(&journal.state).unwrap());
        prop_assert!(!log.chars().any(|c| c.is_control() && c != '\n'));
    }

    #[test]
    fn any_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let _ = fold(&bytes);
    }

    #[test]
    fn any_damage_never_panics(at in 0usize..6000, piece in "\\PC{0,6}") {
        let (mut bytes, _, _) = stored();
        let at = at % bytes.len();
        bytes.splice(at..(at + 3).min(bytes.len()), piece.bytes());
        let _ = fold(&bytes);
    }
}

/// After each event: the items that have ended and have details, and no other.
#[test]
fn what_was_found_is_known_from_the_end_of_its_item_on() {
    let (_, _, events) = stored();
    let mut state = RunState::new();
    let mut known = 0;
    for event in events {
        state.apply(&event).unwrap();
        let found: Vec<&str> = state.found().map(|row| row.planned.name.as_str()).collect();
        let rows = state.rows().iter().filter(|row| row.is_over());
        let expected = rows.filter(|row| row.attempts.iter().any(|attempt| !attempt.details.is_empty()));
        assert_eq!(found, expected.map(|row| row.planned.name.as_str()).collect::<Vec<_>>());
        known = known.max(found.len());
    }
    assert_eq!(known, 1, "sdram");
}

/// Earlier versions filed the end of a selection as that of a module. Read today, it is one of chosen items alone, in the
/// journal and in `run.json`.
#[test]
fn a_selection_of_an_earlier_version_is_no_pass() {
    let mut header = header();
    header.selection = Some(vec!["identity".to_owned()]);
    let run = small_run(header);
    let lines: Vec<String> = run.events.iter().map(|event| line(event).unwrap()).collect();
    let now = lines.concat();
    let end = r#""kind":"run_ended","outcome":null,"selection_outcome":"errored"}"#;
    assert!(now.ends_with(&format!("{end}\n")), "{}", lines[lines.len() - 1]);
    let before = now.replace(end, r#""kind":"run_ended","outcome":"passed"}"#);
    let state = fold(before.as_bytes()).unwrap().state;
    assert_eq!(state.verdict(), Some(Verdict::Selection(Outcome::Passed)));
    let record = RunRecord::from_state(&state).unwrap();
    let json = serde_json::to_string(&record).unwrap();
    let old = json
        .replace(r#""outcome":null,"selection_outcome":"passed","interrupted""#, r#""outcome":"passed","interrupted""#);
    assert_ne!(old, json);
    assert_eq!(serde_json::from_str::<RunRecord>(&old).unwrap(), record);
}

/// The fold of a journal that is in memory as a whole, by another way: lines are cut from the text, and zeros at its end.
fn fold_at_once(bytes: &[u8]) -> Result<(RunState, usize), String> {
    let whole = bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    let mut state = RunState::new();
    let mut good_bytes = 0;
    for (index, piece) in bytes[..whole].split_inclusive(|byte| *byte == b'\n').enumerate() {
        let Ok(event) = serde_json::from_slice::<Event>(piece) else {
            if piece.ends_with(b"\n") {
                return Err(format!("line {}", index + 1));
            }
            break;
        };
        state.apply(&event).map_err(|_| format!("line {}", index + 1))?;
        good_bytes += piece.len();
    }
    Ok((state, good_bytes))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// However the pieces come from the disk, the fold is that of the whole.
    #[test]
    fn the_fold_of_pieces_is_that_of_the_whole(
        cut in any::<prop::sample::Index>(),
        holes in prop::collection::vec((any::<prop::sample::Index>(), prop::sample::select(b"\0\0\n{x".to_vec())), 0..3),
        zeros in prop_oneof![Just(0_usize), 0..2000_usize],
        buffer in 1..300_usize,
    ) {
        let (mut bytes, _, _) = stored();
        for (at, byte) in holes {
            // Most journals stay good up to their end.
            let at = bytes.len() - 1 - at.index(bytes.len()).pow(2) / bytes.len();
            bytes[at] = byte;
        }
        bytes.truncate(cut.index(bytes.len() * 2).max(1));
        bytes.resize(bytes.len() + zeros, 0);
        let of_pieces = fold_from(std::io::BufReader::with_capacity(buffer, bytes.as_slice()));
        match (of_pieces, fold_at_once(&bytes)) {
            (Ok(journal), Ok((state, good_bytes))) => {
                prop_assert_eq!(&journal.state, &state);
                prop_assert_eq!((journal.good_bytes, journal.cut_bytes), (good_bytes, bytes.len() - good_bytes));
            }
            // What another version wrote is told before anything else; its tests stand above.
            (Err(FoldError::Journal(JournalError::Newer { .. } | JournalError::OtherSchema { .. })), _) => {}
            (Err(error), Err(line)) => prop_assert!(error.to_string().starts_with(&line), "{error}, {line}"),
            (of_pieces, at_once) => prop_assert!(false, "{of_pieces:?} {at_once:?}"),
        }
    }
}

#[test]
fn a_line_without_an_end_is_refused() {
    let endless = std::io::Read::take(std::io::repeat(b'x'), 1 << 40);
    let refused = fold_from(std::io::BufReader::with_capacity(1 << 20, endless)).unwrap_err();
    assert_eq!(refused.to_string(), "line 1 of the journal is longer than 33554432 bytes");
    // Zeros are what a file system leaves behind a journal, any number of them.
    let zeros = std::io::Read::take(std::io::repeat(0), 1 << 30);
    let journal = fold_from(std::io::BufReader::with_capacity(1 << 20, zeros)).unwrap();
    assert_eq!((journal.good_bytes, journal.cut_bytes), (0, 1 << 30));
}

/// Lines that are made when they are asked for.
struct Made<F> {
    rest: io::Cursor<Vec<u8>>,
    next: F,
}

impl<F: FnMut() -> Vec<u8>> io::Read for Made<F> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.rest.position() == self.rest.get_ref().len() as u64 {
            self.rest = io::Cursor::new((self.next)());
        }
        self.rest.read(buffer)
    }
}

/// A journal without an end is refused before it fills the memory. Notes that the state does not keep cost nothing.
#[test]
fn a_journal_that_would_fill_the_memory_is_refused() {
    let (_, _, events) = stored();
    let first = events.iter().position(|event| event.kind.name() == "measured").unwrap();
    let endless = |kind: EventKind| {
        let mut events = events[..first].to_vec();
        let mut model = events[first - 1].clone();
        model.kind = kind;
        let mut count = 0_usize;
        events.reverse();
        let next = move || {
            let event = events.pop().unwrap_or_else(|| {
                model.seq += 1;
                model.clone()
            });
            count += usize::from(events.is_empty());
            if count > 2000 { Vec::new() } else { line(&event).unwrap().into_bytes() }
        };
        fold_from(io::BufReader::new(Made { rest: io::Cursor::new(Vec::new()), next }))
    };
    let mut measured = events[first].kind.clone();
    if let EventKind::Measured { measurement, .. } = &mut measured {
        measurement.value = crate::measurement::Reading::Text("x".repeat(16 << 20));
    }
    let refused = endless(measured).unwrap_err();
    // 16 MiB cost twice as much, and 12 of them are all.
    let last = first + 12;
    assert!(matches!(&refused, FoldError::Journal(JournalError::TooMuch { line }) if *line == last), "{refused}");
    assert_eq!(refused.to_string(), format!("up to line {last} the journal would take more than 384 MiB of memory"));

    let note = EventKind::Note { level: NoteLevel::Info, text: "x".repeat(100_000), item: None };
    assert_eq!(endless(note).unwrap().state.notes().len(), 1000);
}
