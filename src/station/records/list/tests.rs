//! Lists of records whose folders and journals hold any text.

use std::fs;
use std::path::PathBuf;

use chrono::DateTime;
use gnc_executive::event::{
    BenchInfo, EVENTS_SCHEMA, Event, EventKind, NoteLevel, PlanInfo, ProgramVersion, RunHeader,
};
use gnc_executive::{journal, text};
use gnc_text::is_hidden;
use proptest::prelude::*;

use super::*;
use crate::locale::Lang;

/// A line that looks like that of a run that passed.
const FORGED: &str =
    "\npassed      2026-11-28 14:30:15  SN-1             functional    2026-11-28/SN-1/143015-functional";

/// Texts that try to be what they are not.
fn hostile() -> impl Strategy<Value = String> {
    let pieces = [
        "SN-1",
        FORGED,
        "\r",
        "\n",
        "\u{1b}[2K",
        "\u{9b}31m",
        "\u{7f}",
        "\u{202e}",
        "\u{2066}",
        "\u{200b}",
        "\u{200d}",
        "\u{2028}",
        "\u{2029}",
        "\u{85}",
        "\u{feff}",
        "\u{ad}",
        "\u{fe0f}",
        "\u{e0041}",
        "\u{e000}",
        "\u{61c}",
        "\u{301}",
        "\t",
        "模",
        "Ж",
        "\\n",
    ];
    prop_oneof![
        any::<String>(),
        prop::collection::vec(prop::sample::select(pieces.to_vec()), 1..6).prop_map(|all| all.concat())
    ]
}

/// A name that a folder can have.
fn as_name(text: &str) -> String {
    let mut name = text.replace(['/', '\0'], "_");
    while name.len() > 200 {
        name.pop();
    }
    format!("x{name}")
}

fn events(said: &[String]) -> Vec<Event> {
    let at = DateTime::parse_from_rfc3339("2026-11-28T14:30:15+00:00").expect("a time");
    let header = RunHeader {
        schema: EVENTS_SCHEMA.into(),
        serial_number: said[0].clone(),
        part: None,
        numbers: Vec::new(),
        operator: Some(said[1].clone()),
        station: said[2].clone(),
        program: ProgramVersion { name: said[1].clone(), version: said[2].clone(), build: None },
        bench: BenchInfo::simulated(said[3].clone(), said[1].clone(), 1),
        site: None,
        recomputed: None,
        resumed: None,
        plan: PlanInfo { name: said[1].clone(), version: said[3].clone(), sha256: said[2].clone() },
        selection: None,
        looped: None,
    };
    let note = EventKind::Note { item: None, level: NoteLevel::Warning, text: said[3].clone() };
    let kinds = [EventKind::RunStarted { header: Box::new(header), items: Vec::new() }, note];
    let numbered = kinds.into_iter().zip(0..);
    numbered.map(|(kind, seq)| Event { seq, at, elapsed_us: 0, kind }).collect()
}

fn listed(records: &Path, lang: Lang) -> String {
    let place = RecordsPlace { path: records.to_owned(), why: "of a test".into() };
    let args = ListArgs::default();
    let runs = reader::wanted(records, args.wanted()).expect("a folder");
    let mut out = Vec::new();
    for_people(Lines::in_language(&mut out, lang), &place, &args, runs).expect("memory");
    String::from_utf8(out).expect("a text")
}

/// The lines of a text, each of which shows itself.
fn honest_lines(text: &str) -> Result<usize, TestCaseError> {
    let hidden = text.chars().find(|c| *c != '\n' && is_hidden(*c));
    prop_assert!(hidden.is_none(), "U+{:04X} in {text:?}", hidden.map_or(0, u32::from));
    Ok(text.matches('\n').count())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// One line for each run, whatever its folder, its journal or its plan are called.
    #[test]
    fn a_run_is_one_line(said in prop::collection::vec(hostile(), 4), names in prop::collection::vec((hostile(), hostile()), 1..4)) {
        let records = tempfile::tempdir().expect("a folder");
        let events = events(&said);
        let mut runs = 0;
        for (index, (module, run)) in names.iter().enumerate() {
            let folder: PathBuf = records.path().join("2026-11-28").join(as_name(module)).join(format!("{index}{}", as_name(run)));
            fs::create_dir_all(&folder).expect("a folder");
            // Every other journal is damaged.
            let text: String = match index % 2 {
                0 => events.iter().map(|event| journal::line(event).expect("a line")).collect(),
                _ => format!("{}\n", said[0]),
            };
            fs::write(folder.join("events.jsonl"), text).expect("a file");
            runs += 1;
        }
        for lang in Lang::ALL {
            let list = listed(records.path(), lang);
            prop_assert_eq!(honest_lines(&list)?, runs, "{}", list);
            prop_assert!(!list.lines().any(|line| line.starts_with("passed")), "{list}");
        }
    }

    /// The log has the same lines whatever the texts in it are.
    #[test]
    fn a_log_shows_itself(said in prop::collection::vec(hostile(), 4)) {
        let log = |said: &[String]| {
            let mut state = gnc_executive::state::RunState::new();
            events(said).iter().for_each(|event| state.apply(event).expect("in order"));
            text::log_txt(&gnc_executive::record::RunRecord::from_state(&state).expect("a run"))
        };
        let plain: Vec<String> = vec!["x".to_owned(); 4];
        prop_assert_eq!(honest_lines(&log(&said))?, honest_lines(&log(&plain))?);
    }
}

/// Two numbers that look alike are shown apart.
#[test]
fn numbers_that_differ_look_different() {
    let records = tempfile::tempdir().expect("a folder");
    for (index, number) in ["SN-1", "SN-1\u{200b}", "SN\u{a0}-1", "SN-1\\u{200b}"].into_iter().enumerate() {
        let folder = records.path().join("2026-11-28").join("SN-1").join(index.to_string());
        fs::create_dir_all(&folder).expect("a folder");
        let said = [number, "x", "x", "x"].map(str::to_owned);
        let text: String = events(&said).iter().map(|event| journal::line(event).expect("a line")).collect();
        fs::write(folder.join("events.jsonl"), text).expect("a file");
    }
    let list = listed(records.path(), Lang::En);
    for shown in ["  SN-1 ", "  SN-1\\u{200b} ", "  SN\\u{a0}-1 ", "  SN-1\\\\u{200b} "] {
        assert_eq!(list.matches(shown).count(), 1, "{shown}: {list}");
    }
}
