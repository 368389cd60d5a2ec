//! Who answers the questions of a plan: the command line, or a person at the terminal or at the screen. Nothing else
//! does, and no answer is made up.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use gnc_config::did_you_mean;
use gnc_executive::plan::{Plan, Question};
use gnc_text::quoted;
use tokio::sync::mpsc;

use crate::fixture::{Ask, Fixture, FixtureError, Operator, OperatorQuestion, Reply, at_the_screen};
use crate::recorder::Recorder;

/// The answers that are known before a run, and the person who gives the others.
#[derive(Debug, Clone, Default)]
pub struct Answers {
    /// By the names of their questions.
    given: BTreeMap<String, String>,
    /// Who is asked at a bench whose fixture is no person.
    person: Person,
}

/// Somebody who can be asked.
#[derive(Debug, Clone, Default)]
pub enum Person {
    /// Nobody.
    #[default]
    Nobody,
    /// At the terminal.
    Terminal(Arc<Operator>),
    /// At the screen.
    Screen(mpsc::Sender<OperatorQuestion>),
}

/// An answer on the command line that is none.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WrongAnswer {
    /// What is wrong.
    pub what: String,
    /// What to try.
    pub hint: String,
}

impl Answers {
    /// Takes answers that were given before the run, each with the name of its question.
    ///
    /// # Errors
    /// The plan has no such question, it is answered twice, or the text is no answer to it.
    pub fn given(answers: &[(String, String)], plan: &Plan) -> Result<Self, WrongAnswer> {
        let asked = || plan.items().iter().flat_map(|item| &item.questions);
        let mut given = BTreeMap::new();
        for (name, typed) in answers {
            let Some(question) = asked().find(|question| question.name == *name) else {
                let hint = did_you_mean(name, asked().map(|question| question.name.as_str()), || {
                    "`plan check` shows the plan; its questions stand below [[item.ask]]".to_owned()
                });
                return Err(WrongAnswer { what: format!("the plan has no question {}", quoted(name)), hint });
            };
            if let Err(error) = question.read(typed) {
                let hint = error.try_this().to_owned();
                return Err(WrongAnswer { what: format!("the answer to {name}: {error}"), hint });
            }
            if given.insert(name.clone(), typed.clone()).is_some() {
                let hint = "give one answer to each question".to_owned();
                return Err(WrongAnswer { what: format!("{name} is answered twice"), hint });
            }
        }
        Ok(Self { given, person: Person::Nobody })
    }

    /// With a person for a bench whose fixture is none.
    #[must_use]
    pub fn with(self, person: Person) -> Self {
        Self { person, ..self }
    }

    /// Names of the questions that a run of the chosen items asks and that are not answered yet. Without a selection it
    /// is a run of the whole plan.
    #[must_use]
    pub fn lack<'a>(&self, plan: &'a Plan, selection: Option<&[String]>) -> Vec<&'a str> {
        let chosen = plan.items().iter().filter(|item| item.is_chosen(selection));
        let asked = chosen.flat_map(|item| &item.questions).filter(|question| self.to(question).is_none());
        asked.map(|question| question.name.as_str()).collect()
    }

    /// The answer that is known before the run.
    pub(crate) fn to(&self, question: &Question) -> Option<&str> {
        self.given.get(&question.name).map(String::as_str)
    }
}

/// The person at a bench.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Asked<'a> {
    Nobody,
    Terminal(&'a Operator),
    Screen(&'a mpsc::Sender<OperatorQuestion>),
}

impl<'a> Asked<'a> {
    /// The fixture, if it is a person; else the person who came with the request.
    pub(crate) fn of(fixture: &'a Fixture, answers: &'a Answers) -> Self {
        match (fixture, &answers.person) {
            (Fixture::Operator(operator), _) => Self::Terminal(operator),
            (_, Person::Terminal(operator)) => Self::Terminal(operator),
            (Fixture::Screen(screen), _) | (_, Person::Screen(screen)) => Self::Screen(screen),
            (Fixture::Absent | Fixture::Driven(_), Person::Nobody) => Self::Nobody,
        }
    }

    /// Forgets what was typed before a question. The caller files the question after this.
    pub(crate) async fn forget(self) {
        if let Self::Terminal(operator) = self {
            operator.forget().await;
        }
    }

    /// Asks, and waits as long as it takes. The caller has filed the question.
    pub(crate) async fn reply(self, ask: &Ask, recorder: &Recorder<'_>) -> Result<Reply, FixtureError> {
        match self {
            Self::Nobody => Err(FixtureError::Nobody { what: ask.action() }),
            Self::Terminal(operator) => operator.reply(ask).await,
            Self::Screen(screen) => at_the_screen(screen, recorder.item(), ask).await,
        }
    }
}

/// Where the person is, for the record.
impl fmt::Display for Asked<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Nobody => "nobody",
            Self::Terminal(_) => "at the terminal",
            Self::Screen(_) => "at the screen",
        })
    }
}
