//! What the board does against the interface document, as far as the conversation shows it.
//!
//! A breach is the board's, and never the module's: it fails no module. One that touches a value ends the request or the
//! stream with [`crate::BoardError::Breach`], so that no figure comes from it. All others are kept with their number,
//! the worst value and the first moment, so that a firmware engineer can mend them.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use gnc_protocol::stream::StreamId;
use tokio::sync::mpsc;
use tokio::time::Instant;

use crate::error::BoardError;
use crate::rule::{self, Breach, Rule};

/// What a breach looked like.
#[derive(Debug)]
pub(crate) enum Case {
    /// Nothing beside the rule.
    Plain,
    /// A time; the longest one is the worst.
    Took(Duration),
    /// A time; the shortest one is the worst.
    OnlyTook(Duration),
    /// Words; the first ones are kept.
    Words(String),
}

/// All breaches of a conversation. Copies of the handle share them.
#[derive(Debug, Clone)]
pub(crate) struct Breaches(Arc<Mutex<Seen>>);

#[derive(Debug)]
struct Seen {
    breaches: Vec<Counted>,
    /// Requests and streams whose values were refused, each with its newest error. There are as many as names.
    touched: Vec<Touched>,
    refusals: u64,
    /// Hands each breach on when the board is first called for it.
    news: mpsc::Sender<Breach>,
}

#[derive(Debug)]
struct Touched {
    of: &'static str,
    refusal: u64,
    error: BoardError,
}

#[derive(Debug)]
struct Counted {
    breach: Breach,
    /// The worst time.
    span: Option<Duration>,
    /// Whether the board is called for it.
    told: bool,
    /// When it was seen last.
    newest: Instant,
}

/// Breaches that may wait to be read: more than there are rules.
pub(crate) const NEWS: usize = 64;

impl Breaches {
    pub(crate) fn new(news: mpsc::Sender<Breach>) -> Self {
        Self(Arc::new(Mutex::new(Seen { breaches: Vec::new(), touched: Vec::new(), refusals: 0, news })))
    }

    fn lock(&self) -> MutexGuard<'_, Seen> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps a breach.
    pub(crate) fn see(&self, rule: &'static Rule, case: Case) {
        self.keep(rule, case, false);
    }

    /// Keeps a breach of a time that is so gross that once is enough.
    pub(crate) fn see_gross(&self, rule: &'static Rule, case: Case) {
        self.keep(rule, case, true);
    }

    fn keep(&self, rule: &'static Rule, case: Case, gross: bool) {
        let Seen { breaches, news, .. } = &mut *self.lock();
        let index = breaches.iter().position(|seen| seen.breach.rule == rule).unwrap_or_else(|| {
            breaches.push(Counted {
                breach: Breach { rule, count: 0, worst: None },
                span: None,
                told: false,
                newest: Instant::now(),
            });
            breaches.len() - 1
        });
        let Counted { breach, span, told, newest } = &mut breaches[index];
        *newest = Instant::now();
        breach.count = breach.count.saturating_add(1);
        match case {
            Case::Plain => {}
            Case::Words(words) => drop(breach.worst.get_or_insert(words)),
            Case::Took(took) => keep(breach, span, span.is_none_or(|worst| took > worst), took),
            Case::OnlyTook(took) => keep(breach, span, span.is_none_or(|worst| took < worst), took),
        }
        if !*told && (gross || breach.count >= rule.needed) {
            *told = true;
            // There is room for all rules.
            let _ = news.try_send(breach.clone());
        }
    }

    /// Keeps a breach that touches a value, and makes it the error of the request or the stream.
    #[must_use]
    pub(crate) fn refuse(&self, rule: &'static Rule, of: &'static str, why: String) -> BoardError {
        self.see(rule, Case::Words(format!("{of}: {why}")));
        let error = BoardError::Breach { rule, of, why };
        let Seen { touched, refusals, .. } = &mut *self.lock();
        *refusals += 1;
        touched.retain(|touched| touched.of != of);
        touched.push(Touched { of, refusal: *refusals, error: error.clone() });
        error
    }

    /// The number of refusals so far.
    pub(crate) fn refusals(&self) -> u64 {
        self.lock().refusals
    }

    /// The newest refusal of one of these streams after a number of refusals.
    pub(crate) fn touched_since(&self, refusals: u64, streams: &[StreamId]) -> Option<BoardError> {
        let is_one = |touched: &&Touched| streams.iter().any(|stream| stream.name() == touched.of);
        let seen = self.lock();
        seen.touched
            .iter()
            .filter(is_one)
            .find(|touched| touched.refusal > refusals)
            .map(|touched| touched.error.clone())
    }

    /// The breaches that the board is called for.
    pub(crate) fn all(&self) -> Vec<Breach> {
        self.lock().breaches.iter().filter(|seen| seen.told).map(|seen| seen.breach.clone()).collect()
    }

    /// The breach that explains best why no answer came since then.
    pub(crate) fn instead_of_an_answer(&self, since: Instant) -> Option<Breach> {
        let seen = self.lock();
        let new = |rule: &&'static Rule| {
            let is_it = |seen: &&Counted| seen.told && seen.newest >= since && seen.breach.rule == *rule;
            seen.breaches.iter().find(is_it).map(|seen| seen.breach.clone())
        };
        rule::INSTEAD_OF_AN_ANSWER.iter().find_map(new)
    }
}

fn keep(breach: &mut Breach, span: &mut Option<Duration>, is_worst: bool, took: Duration) {
    if is_worst {
        *span = Some(took);
        breach.worst = Some(format!("{} ms", took.as_millis()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_case_is_kept_and_the_first_words() {
        let (news, mut read) = mpsc::channel(NEWS);
        let breaches = Breaches::new(news);
        let ms = Duration::from_millis;
        for took in [60, 90] {
            breaches.see(&rule::ANSWER_LATE, Case::Took(ms(took)));
        }
        assert!(breaches.all().is_empty() && read.try_recv().is_err(), "late twice may be this computer");
        for took in [70, 80] {
            breaches.see(&rule::ANSWER_LATE, Case::Took(ms(took)));
        }
        for words in ["boot", "ready"] {
            breaches.see(&rule::TEXT, Case::Words(words.to_owned()));
        }
        for took in [900, 400, 500] {
            breaches.see(&rule::HEARTBEAT_EARLY, Case::OnlyTook(ms(took)));
        }
        let told: Vec<(u8, u32, Option<String>)> =
            breaches.all().into_iter().map(|breach| (breach.rule.section, breach.count, breach.worst)).collect();
        let worst = |text: &str| Some(text.to_owned());
        assert_eq!(told, [(7, 4, worst("90 ms")), (3, 2, worst("boot")), (9, 3, worst("400 ms"))]);
        let first: Vec<u32> = std::iter::from_fn(|| read.try_recv().ok()).map(|breach| breach.count).collect();
        assert_eq!(first, [3, 2, 3], "each is told once");
    }
}
