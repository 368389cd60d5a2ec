//! The questions of a plan: each is asked until it has an answer. A person may go back and answer again; the last
//! answer counts, and the record has all of them.
//!
//! The measurements are filed when all is answered, so that an answer that was taken back is not judged.

use std::sync::Arc;

use chrono::{DateTime, FixedOffset};
use gnc_analysis::figures::Findings;
use gnc_executive::details::Details;
use gnc_executive::measurement::Value;
use gnc_executive::plan::{DONE, Question, QuestionKind};
use gnc_text::{printable, quoted};
use serde_json::json;

use super::{ProcedureContext, ProcedureError, Recorder};
use crate::clock;
use crate::fixture::{Ask, FixtureError, QuestionAsked, Reply, YES};
use crate::questions::Asked;

/// Who gave an answer that came with the order for the run.
const COMMAND_LINE: &str = "the command line";

/// An answer.
struct Given {
    typed: String,
    value: Value,
    by: String,
    at: DateTime<FixedOffset>,
}

/// A question with its answers.
struct Line<'a> {
    question: &'a Arc<Question>,
    /// A person is asked, and may go back to it.
    by_person: bool,
    /// All answers; the last one counts.
    given: Vec<Given>,
    /// The last answer was taken back.
    open: bool,
}

pub(super) async fn run(bench: &ProcedureContext<'_>, recorder: &Recorder<'_>) -> Result<(), ProcedureError> {
    // A person may go away for an hour.
    bench.clock.stand();
    let asker = Asker { person: Asked::of(bench.fixture, bench.answers), recorder };
    let mut lines = Vec::new();
    for question in recorder.questions() {
        let known = bench.answers.to(question);
        let given = match known {
            Some(typed) => vec![asker.known(question, typed).await?],
            None => Vec::new(),
        };
        lines.push(Line { question, by_person: known.is_none(), open: given.is_empty(), given });
    }
    while let Some(at) = asker.next(&lines).await? {
        let before = lines[..at.min(lines.len())].iter().rposition(|line| line.by_person);
        let Some(line) = lines.get(at) else {
            // The answers were looked over, and the last one is to be given again.
            if let Some(line) = before.and_then(|before| lines.get_mut(before)) {
                line.open = true;
            }
            continue;
        };
        match asker.ask(line.question, before.is_some()).await? {
            Some(given) => {
                lines[at].given.push(given);
                lines[at].open = false;
            }
            None => {
                if let Some(before) = before {
                    lines[before].open = true;
                }
            }
        }
    }
    file(&lines, recorder).await
}

struct Asker<'a> {
    person: Asked<'a>,
    recorder: &'a Recorder<'a>,
}

impl Asker<'_> {
    /// Files an answer that came with the order for the run.
    async fn known(&self, question: &Question, typed: &str) -> Result<Given, ProcedureError> {
        let value = question
            .read(typed)
            .map_err(|error| FixtureError::NoAnswer { question: question.name.clone(), why: error.to_string() })?;
        let (name, words) = (&question.name, &question.words.en);
        self.recorder.note(&format!("The command line answers {name} ({words}): {typed}")).await?;
        Ok(Given { typed: typed.to_owned(), value, by: COMMAND_LINE.to_owned(), at: clock::now() })
    }

    /// Position of the next question, or one after the last if the person takes an answer back; `None` if all is
    /// answered for good.
    async fn next(&self, lines: &[Line<'_>]) -> Result<Option<usize>, ProcedureError> {
        if let Some(open) = lines.iter().position(|line| line.open) {
            return Ok(Some(open));
        }
        // The look-over leaves "done" out: it has no other answer.
        let by_person = lines.iter().filter(|line| line.by_person);
        let typed = by_person.filter(|line| line.question.kind != QuestionKind::Done);
        let said: Vec<_> =
            typed.filter_map(|line| Some((line.question.name.clone(), shown(line.given.last()?)))).collect();
        if said.is_empty() {
            return Ok(None);
        }
        let Some(last) = lines.iter().rfind(|line| line.by_person) else { return Ok(None) };
        let ask = Ask::LookOver(said);
        let mut words = ask.to_string();
        loop {
            self.person.forget().await;
            self.recorder.looked_over(last.question, &words).await?;
            match self.person.reply(&ask, self.recorder).await? {
                Reply::Back => {
                    self.recorder.told(last.question, "the last answer is to be given again").await?;
                    return Ok(Some(lines.len()));
                }
                Reply::Done => {
                    self.recorder.told(last.question, "").await?;
                    return Ok(None);
                }
                // A scan, its second line end, or a correction that must not be lost.
                Reply::Text(typed) => {
                    let typed = typed.trim();
                    self.recorder.told(last.question, typed).await?;
                    let typed = quoted(typed);
                    words = format!("No: {typed} neither confirms nor corrects; {YES} confirms, < goes back. {ask}");
                }
                Reply::NotPossible => return Err(FixtureError::NotAnswered { what: ask.action() }.into()),
            }
        }
    }

    /// Asks a person until the answer is one; `None` if the question before is to be answered again.
    async fn ask(&self, question: &Arc<Question>, back: bool) -> Result<Option<Given>, ProcedureError> {
        let limit = self.recorder.limit(&question.name);
        let mut problem = None;
        loop {
            let asked = QuestionAsked { question: Arc::clone(question), limit: limit.clone(), back, problem };
            let ask = Ask::Question(Box::new(asked));
            if matches!(self.person, Asked::Nobody) {
                let question = format!("{} ({})", question.name, question.words.en);
                return Err(FixtureError::NobodyAnswers { question }.into());
            }
            self.person.forget().await;
            self.recorder.asked(question, &ask.to_string()).await?;
            let reply = self.person.reply(&ask, self.recorder).await?;
            // A key or a word. An empty line may be the second line end of a scan.
            let is_done = reply == Reply::Done;
            let typed = match reply {
                Reply::NotPossible => {
                    self.recorder.told(question, "not possible").await?;
                    return Err(FixtureError::NotAnswered { what: question.words.en.clone() }.into());
                }
                Reply::Back if back => {
                    self.recorder.told(question, "the answer before is to be given again").await?;
                    return Ok(None);
                }
                // There is nothing to go back to.
                Reply::Back => {
                    problem = None;
                    continue;
                }
                Reply::Done => String::new(),
                Reply::Text(typed) => typed,
            };
            self.recorder.told(question, typed.trim()).await?;
            let confirmed = is_done && question.kind == QuestionKind::Done;
            let read = if confirmed { Ok(Value::text(DONE)) } else { question.read(&typed) };
            match read {
                Ok(value) => {
                    let by = self.recorder.operator().unwrap_or_else(|| "the operator".to_owned());
                    let by = format!("{by}, {}", self.person);
                    return Ok(Some(Given { typed: typed.trim().to_owned(), value, by, at: clock::now() }));
                }
                Err(error) => problem = Some(error),
            }
        }
    }
}

/// Files all answers: how they were given, then the last ones as measurements.
async fn file(lines: &[Line<'_>], recorder: &Recorder<'_>) -> Result<(), ProcedureError> {
    let mut answers = Vec::new();
    for Line { question, given, .. } in lines {
        let Some((last, before)) = given.split_last() else { continue };
        let before: Vec<&str> = before.iter().map(|given| given.typed.as_str()).collect();
        if !before.is_empty() {
            let (was, is) = (before.join("\", then \""), shown(last));
            recorder.note(&format!("{} was answered again: \"{was}\" before, {is} counts.", question.name)).await?;
        }
        answers.push(json!({
            "name": question.name,
            "question": question.words.en,
            "answer": last.typed,
            "by": last.by,
            "at": last.at.format("%F %T %:z").to_string(),
            "answered before": before.join(", "),
        }));
    }
    recorder.found(Findings::from(Details::from(json!({ "answers": answers })))).await?;
    for Line { question, given, .. } in lines {
        if let Some(last) = given.last() {
            recorder.answer(&question.name, &last.value).await?;
        }
    }
    Ok(())
}

/// An answer for people: the number with its unit, or the text.
fn shown(given: &Given) -> String {
    match &given.value {
        Value::Number(quantity) => quantity.to_string(),
        Value::Text(text) => printable(text).into_owned(),
        _ => printable(&given.typed).into_owned(),
    }
}
