//! The questions of a plan: who answers them, what is filed, and that no answer is made up.

#![cfg(feature = "sim")]
#![expect(clippy::expect_used, clippy::panic, reason = "a test says what it expected")]

#[path = "played/played.rs"]
mod played;

use std::sync::{Arc, Mutex};
use std::time::Duration;

use gnc_bench::fixture::{OperatorQuestion, Reply};
use gnc_bench::questions::{Answers, Person};
use gnc_bench::service::RunRequest;
use gnc_executive::event::{Event, EventKind};
use gnc_executive::measurement::Reading;
use gnc_executive::outcome::Outcome;
use gnc_executive::state::{Attempt, RunState};
use hw_mocks::{BenchControl, BenchOptions, Speed};
use played::{outcomes, request, run_plan, run_request};
use serde_json::{Value, json};
use tokio::sync::mpsc;

const PLAN: &str = r#"
name = "by-hand"
version = "1"
[[item]]
id = "prompt"
name = "by-hand"
[[item.ask]]
name = "tp4"
en = "What does the meter at TP4 read?"
kind = "number"
unit = "V"
[[item.ask]]
name = "gps_board"
en = "Scan the GPS board."
kind = "text"
pattern = "GPS-[0-9]{5}"
[[item.ask]]
name = "look"
en = "How does the housing look?"
kind = "choice"
choices = ["clean", "scratched"]
good = ["clean"]
[item.limits]
tp4 = "4.9 V .. 5.1 V"
"#;

/// Longer than the time limit of the item, 60 s, by three heartbeats, which are 100 s apart at this speed.
const AWAY_S: u64 = 300;
/// So fast passes the time while a person is away.
const SPEED: f64 = 100.0;

/// A run and its events.
struct Asked {
    attempt: Attempt,
    state: RunState,
    events: Vec<Event>,
}

fn options() -> BenchOptions {
    BenchOptions { speed: Speed::Max, ..BenchOptions::default() }
}

fn run(request: &RunRequest) -> Asked {
    run_at(request, &options(), |_| {})
}

/// The same; `started` hears of the bench before the run.
fn run_at(request: &RunRequest, options: &BenchOptions, started: impl FnOnce(BenchControl)) -> Asked {
    let events = Arc::new(Mutex::new(Vec::new()));
    let told = Arc::clone(&events);
    let state =
        run_request(request, options, move |event, _| told.lock().expect("a list").push(event.clone()), started);
    let attempts = &state.rows()[0].attempts;
    assert_eq!((outcomes(&state).len(), attempts.len()), (1, 1));
    let events = events.lock().expect("a list").clone();
    Asked { attempt: attempts[0].clone(), state, events }
}

fn given(answers: &[(&str, &str)]) -> Answers {
    let owned: Vec<(String, String)> =
        answers.iter().map(|(name, typed)| ((*name).to_owned(), (*typed).to_owned())).collect();
    Answers::given(&owned, request(PLAN).plan.plan()).expect("answers")
}

/// A run with a person at the screen who replies in this order, and then says no more.
fn with_person(given: Answers, replies: &[Reply]) -> Asked {
    with_person_by(PLAN, given, replies)
}

/// The same by another plan.
fn with_person_by(plan: &str, given: Answers, replies: &[Reply]) -> Asked {
    let (screen, mut questions) = mpsc::channel::<OperatorQuestion>(4);
    let replies = replies.to_vec();
    let person = std::thread::spawn(move || {
        for reply in replies {
            let question = questions.blocking_recv().expect("a question");
            question.answer.send(reply).expect("somebody waits");
        }
    });
    let asked = RunRequest {
        answers: given.with(Person::Screen(screen)),
        operator: Some("Chen Wei".to_owned()),
        ..request(plan)
    };
    let done = run(&asked);
    // A person who waits for one more question learns that none comes.
    drop(asked);
    person.join().expect("a person");
    done
}

fn text(typed: &str) -> Reply {
    Reply::Text(typed.to_owned())
}

/// What the attempt measured: name, value as it is shown, outcome.
fn measured(attempt: &Attempt) -> Vec<(&str, String, Option<Outcome>)> {
    let each = attempt.measurements.iter();
    each.map(|measured| (measured.name.as_str(), measured.value_text(), measured.outcome)).collect()
}

/// The answers of the details, without their dates.
fn details(attempt: &Attempt) -> Vec<Value> {
    let details = attempt.details.first().expect("details");
    let mut answers = details["answers"].as_array().expect("answers").clone();
    for answer in &mut answers {
        let at = answer.as_object_mut().expect("an answer").remove("at").expect("a date");
        assert!(at.as_str().is_some_and(|at| at.len() == "2026-01-01 00:00:00 +00:00".len()), "{at}");
    }
    answers
}

/// The journal's requests and answers of one question, in their order.
fn journal<'a>(events: &'a [Event], name: &str) -> Vec<&'a str> {
    let of = |event: &'a Event| match &event.kind {
        EventKind::Prompted { text, question, .. } if question.as_deref() == Some(name) => Some(text.as_str()),
        EventKind::Answered { answer, question, .. } if question.as_deref() == Some(name) => Some(answer.as_str()),
        _ => None,
    };
    events.iter().filter_map(of).collect()
}

#[test]
fn a_person_answers_and_the_record_has_it() {
    let replies = [text("5,01 V"), text(" GPS-00042\r"), text("1"), Reply::Done];
    let done = with_person(Answers::default(), &replies);
    let passed = Some(Outcome::Passed);
    let expected = [
        ("tp4", "5.01 V".to_owned(), passed),
        ("gps_board", "GPS-00042".to_owned(), passed),
        ("look", "clean".to_owned(), passed),
    ];
    assert_eq!(measured(&done.attempt), expected);
    assert_eq!(done.attempt.outcome, passed);
    let tp4 = &done.attempt.measurements[0];
    assert_eq!((tp4.low, tp4.high, &tp4.value), (Some(4.9), Some(5.1), &Reading::Number(5.01)));
    let by = "Chen Wei, at the screen";
    let line = |name: &str, question: &str, answer: &str| json!({ "name": name, "question": question, "answer": answer, "by": by, "answered before": "" });
    assert_eq!(
        details(&done.attempt),
        [
            line("tp4", "What does the meter at TP4 read?", "5,01 V"),
            line("gps_board", "Scan the GPS board.", "GPS-00042"),
            line("look", "How does the housing look?", "1"),
        ]
    );
    assert_eq!(
        journal(&done.events, "tp4"),
        [
            "What does the meter at TP4 read? A number in V. Limit: 4.9 .. 5.1 V. Press Enter when it is typed. (n: not possible)",
            "5,01 V"
        ]
    );
    let look = journal(&done.events, "look");
    assert_eq!(
        look,
        [
            "How does the housing look? 1 clean, 2 scratched. Limit: == clean. Press Enter when it is typed. (n: not possible; <: back)",
            "1",
            "Look over what is filed: tp4: 5.01 V. gps_board: GPS-00042. look: clean. Press y, Enter if it is right. (n: not possible; <: back)",
            ""
        ]
    );
}

/// A limit that is the number of the module is asked with that number, since a person cannot compare with a placeholder.
#[test]
fn the_number_of_the_module_stands_in_the_question() {
    let limits = "[item.limits]\n";
    let plan = PLAN
        .replace(limits, &format!("{limits}gps_board = \"== $serial_number\"\n"))
        .replace("pattern = \"GPS-[0-9]{5}\"\n", "");
    let done = with_person_by(&plan, Answers::default(), &[text("5"), text("SN"), text("1"), Reply::Done]);
    assert_eq!(done.attempt.outcome, Some(Outcome::Passed));
    let asked = journal(&done.events, "gps_board");
    assert!(asked[0].contains("Limit: == SN."), "{asked:?}");
}

/// A value outside its limit fails the module, as one that was measured does.
#[test]
fn an_answer_outside_its_limit_fails() {
    let done = with_person(Answers::default(), &[text("3.3"), text("GPS-00042"), text("clean"), Reply::Done]);
    assert_eq!(measured(&done.attempt)[0], ("tp4", "3.3 V".to_owned(), Some(Outcome::Failed)));
    assert_eq!(done.attempt.outcome, Some(Outcome::Failed));
    let scratched = with_person(Answers::default(), &[text("5"), text("GPS-00042"), text("2"), Reply::Done]);
    assert_eq!(scratched.attempt.outcome, Some(Outcome::Failed));
}

/// What is no answer is asked again with the reason, also if a face lets it through.
#[test]
fn what_is_no_answer_is_asked_again() {
    let replies = [
        text(""),
        text("abc"),
        text("inf"),
        text("1,234"),
        text("5"),
        text("GPS-1"),
        text("GPS-00042"),
        text("1"),
        Reply::Done,
    ];
    let done = with_person(Answers::default(), &replies);
    assert_eq!(done.attempt.outcome, Some(Outcome::Passed));
    assert_eq!(done.attempt.measurements.len(), 3);
    let said = journal(&done.events, "tp4");
    assert!(said[2].starts_with("No: the answer is empty; type or scan the answer. What does"), "{}", said[2]);
    assert!(said[8].starts_with("No: \"1,234\" could be 1.234 or 1234; write it with a decimal point"), "{}", said[8]);
    assert!(journal(&done.events, "gps_board")[2].starts_with("No: \"GPS-1\" does not match GPS-[0-9]{5};"));
}

/// Neither a correction that is typed without going back nor the second line end of a scan confirms the answers.
#[test]
fn only_a_yes_confirms_the_answers() {
    let lines = [text("5.02"), text(""), text("GPS-00043")];
    let replies = [vec![text("5.01"), text("GPS-00042"), text("1")], lines.to_vec(), vec![Reply::Back, text("2")]];
    let done = with_person(Answers::default(), &[replies.concat(), vec![text(""), Reply::Done]].concat());
    let values: Vec<String> = measured(&done.attempt).into_iter().map(|(_, value, _)| value).collect();
    assert_eq!(values, ["5.01 V", "GPS-00042", "scratched"]);
    let said = journal(&done.events, "look");
    for (at, typed) in [(4, "\"5.02\""), (6, "\"\""), (8, "\"GPS-00043\"")] {
        let no =
            format!("No: {typed} neither confirms nor corrects; y confirms, < goes back. Look over what is filed: ");
        assert!(said[at].starts_with(&no), "{}", said[at]);
    }
}

const LID: &str = r#"
name = "lid"
version = "1"
[[item]]
id = "prompt"
name = "by-hand"
[[item.ask]]
name = "lid"
en = "Close the lid."
kind = "done"
"#;

/// A line end at the terminal is no "done": a scanner sends two.
#[test]
fn an_empty_line_does_nothing() {
    let done = with_person_by(LID, Answers::default(), &[text(""), text("GPS-00042"), text(" \r"), Reply::Done]);
    assert_eq!(measured(&done.attempt), [("lid", "done".to_owned(), Some(Outcome::Passed))]);
    let said = journal(&done.events, "lid");
    assert_eq!(said[0], "Close the lid. Press y, Enter when it is done. (n: not possible)");
    for (at, typed) in [(2, "\"\""), (4, "\"GPS-00042\""), (6, "\"\"")] {
        assert!(said[at].starts_with(&format!("No: {typed} is not done; write done. Close")), "{}", said[at]);
    }
}

/// The last answer counts. The one that was taken back stays in the journal, is not judged, and the record tells of it.
#[test]
fn an_answer_can_be_given_again() {
    let replies =
        [text("50.1"), Reply::Back, text("5.01"), text("GPS-00042"), text("2"), Reply::Back, text("1"), Reply::Done];
    let done = with_person(Answers::default(), &replies);
    assert_eq!(measured(&done.attempt)[0], ("tp4", "5.01 V".to_owned(), Some(Outcome::Passed)));
    assert_eq!((done.attempt.measurements.len(), done.attempt.outcome), (3, Some(Outcome::Passed)));
    let answers = details(&done.attempt);
    let before: Vec<_> = answers.iter().map(|answer| (&answer["answer"], &answer["answered before"])).collect();
    let expected = [("5.01", "50.1"), ("GPS-00042", ""), ("1", "2")].map(|(is, was)| (json!(is), json!(was)));
    assert_eq!(before, expected.each_ref().map(|(is, was)| (is, was)));
    let said = journal(&done.events, "tp4");
    assert_eq!((said[1], said[3]), ("50.1", "5.01"));
    assert!(
        done.state
            .notes()
            .iter()
            .any(|note| note.text.contains("tp4 was answered again: \"50.1\" before, 5.01 V counts"))
    );
}

/// From the look over the answers one goes back as far as one likes, and no answer is lost on the way.
#[test]
fn one_goes_back_to_the_first_question() {
    let replies = [
        text("50.1"),
        text("GPS-00042"),
        text("1"),
        Reply::Back,
        Reply::Back,
        Reply::Back,
        text("5.01"),
        text("GPS-00043"),
        text("1"),
        Reply::Done,
    ];
    let done = with_person(Answers::default(), &replies);
    let values: Vec<String> = measured(&done.attempt).into_iter().map(|(_, value, _)| value).collect();
    assert_eq!(values, ["5.01 V", "GPS-00043", "clean"]);
    assert_eq!(done.attempt.outcome, Some(Outcome::Passed));
}

/// Before the first question there is none: it is asked again.
#[test]
fn nobody_goes_back_beyond_the_first_question() {
    let done = with_person(Answers::default(), &[Reply::Back, text("5"), text("GPS-00042"), text("1"), Reply::Done]);
    assert_eq!(done.attempt.outcome, Some(Outcome::Passed));
}

/// A person goes away for longer than the time limit of the item, by the clock of the board. The run waits, and nothing
/// fails.
#[test]
fn who_goes_away_fails_nothing() {
    let (screen, mut questions) = mpsc::channel::<OperatorQuestion>(4);
    let (tell_bench, bench) = std::sync::mpsc::channel::<BenchControl>();
    let person = std::thread::spawn(move || {
        let bench = bench.recv().expect("a bench");
        let replies = [text("5"), text("GPS-00042"), text("1"), Reply::Done];
        for (reply, away_s) in replies.into_iter().zip([AWAY_S, 0, 0, 0]) {
            let question = questions.blocking_recv().expect("a question");
            bench.sleep(Duration::from_secs(away_s)).expect("a bench");
            question.answer.send(reply).expect("somebody waits");
        }
    });
    let asked = RunRequest { answers: Answers::default().with(Person::Screen(screen)), ..request(PLAN) };
    // At full speed the board's clock leaps, and the station would not see that time passes.
    let options = BenchOptions { speed: Speed::Times(SPEED), ..options() };
    let done = run_at(&asked, &options, |bench| tell_bench.send(bench).expect("a person"));
    person.join().expect("a person");
    assert_eq!(done.attempt.outcome, Some(Outcome::Passed), "{:?}", done.attempt.error);
}

/// "Not possible" says nothing of the module.
#[test]
fn a_question_that_cannot_be_answered_is_errored() {
    for replies in [vec![Reply::NotPossible], vec![text("5"), text("GPS-00042"), text("1"), Reply::NotPossible]] {
        let done = with_person(Answers::default(), &replies);
        assert_eq!((done.attempt.outcome, done.attempt.measurements.len()), (Some(Outcome::Errored), 0));
        let error = done.attempt.error.expect("a reason");
        assert!(error.text.starts_with("the operator could not do this"), "{}", error.text);
    }
}

/// The simulated bench turns and switches by itself, and answers nothing.
#[test]
fn without_an_answer_nothing_is_made_up() {
    let state = run_plan(PLAN, &options(), |_, _| {});
    let attempt = &state.rows()[0].attempts[0];
    assert_eq!((attempt.outcome, attempt.measurements.len()), (Some(Outcome::Errored), 0));
    let error = attempt.error.as_ref().expect("a reason");
    assert_eq!(
        error.text,
        "the question tp4 (What does the meter at TP4 read?) cannot be answered: no person is at a terminal or at the screen"
    );
    assert_eq!(error.hint, "answer it with --answer NAME=VALUE, or run the plan on a terminal or on the screen");
}

/// Answers that come with the order are filed with that, and only the others are asked for.
#[test]
fn known_answers_are_not_asked_for() {
    let all = [("look", "clean"), ("tp4", "4,95"), ("gps_board", "GPS-00001")];
    let done = run(&RunRequest { answers: given(&all), ..request(PLAN) });
    assert_eq!(done.attempt.outcome, Some(Outcome::Passed));
    assert!(details(&done.attempt).iter().all(|answer| answer["by"] == "the command line"));
    let one = with_person(given(&all[..2]), &[text("GPS-00002"), Reply::Done]);
    assert_eq!(one.attempt.outcome, Some(Outcome::Passed));
    let by: Vec<_> = details(&one.attempt).iter().map(|answer| answer["by"].clone()).collect();
    assert_eq!(by, ["the command line", "Chen Wei, at the screen", "the command line"]);
    // Without a person the missing one is errored, whatever the others are.
    let missing = run(&RunRequest { answers: given(&all[..2]), ..request(PLAN) });
    assert_eq!(missing.attempt.outcome, Some(Outcome::Errored));
}

#[test]
fn answers_that_fit_no_question_are_refused() {
    let asked = request(PLAN);
    for (answers, said) in [
        (vec![("tp5", "1")], "the plan has no question \"tp5\""),
        (vec![("tp4", "abc")], "the answer to tp4: \"abc\" is not a number"),
        (vec![("tp4", "")], "the answer to tp4: the answer is empty"),
        (vec![("tp4", "5 A")], "the answer to tp4: \"5 A\" is not in V"),
        (vec![("tp4", "5"), ("tp4", "5.1")], "tp4 is answered twice"),
        (vec![("look", "3")], "the answer to look: \"3\" is none of clean, scratched"),
    ] {
        let owned: Vec<(String, String)> =
            answers.iter().map(|(name, typed)| ((*name).to_owned(), (*typed).to_owned())).collect();
        let Err(wrong) = Answers::given(&owned, asked.plan.plan()) else { panic!("{answers:?} are taken") };
        assert_eq!(wrong.what, said);
    }
}
