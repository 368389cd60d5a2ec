//! What the board does against the interface document, as far as the conversation shows it.
//!
//! A breach is the board's, and never the module's: it fails no module. One that touches a value ends the request or the
//! stream with [`crate::BoardError::Breach`], so that no figure comes from it. All others are kept with their number,
//! the worst value and the first moment, so that a firmware engineer can mend them.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use gnc_protocol::stream::StreamId;
use tokio::sync::mpsc;

use crate::BoardError;

/// A rule of the interface document that the conversation checks.
#[derive(Debug, PartialEq, Eq)]
pub struct Rule {
    /// The section of the document.
    pub section: u8,
    /// What a board does that breaks the rule.
    pub what: &'static str,
    /// What a breach means for the run.
    pub weight: Weight,
    /// The number of breaches from which on the board is called so. A busy computer can be late by itself once or twice,
    /// and a bad line can change the order of two frames. A board that breaks the rule does it again.
    needed: u32,
}

/// What a breach means for the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Weight {
    /// No value depends on it.
    Note,
    /// A value may be wrong by it.
    Value,
    /// Somebody may be hurt, or a module destroyed.
    Safety,
}

/// Breaches of a rule of time or order from which on the board is called for it.
const AGAIN: u32 = 3;

impl Rule {
    const fn note(section: u8, what: &'static str) -> Self {
        Self { section, what, weight: Weight::Note, needed: 1 }
    }

    const fn time(section: u8, what: &'static str) -> Self {
        Self { section, what, weight: Weight::Note, needed: AGAIN }
    }

    const fn value(section: u8, what: &'static str) -> Self {
        Self { section, what, weight: Weight::Value, needed: 1 }
    }

    const fn safety(section: u8, what: &'static str) -> Self {
        Self { section, what, weight: Weight::Safety, needed: 1 }
    }
}

/// The rules.
pub mod rule {
    use super::Rule;

    /// Rules that explain a missing answer, the best explanation first.
    pub(crate) const INSTEAD_OF_AN_ANSWER: [&Rule; 8] =
        [&CHECKSUM, &VERSION, &HELLO_LAYOUT, &NONCE, &OTHER_MESSAGE, &UNASKED, &ANSWER_LAYOUT, &TEXT];

    /// Bytes between frames that are text.
    pub const TEXT: Rule = Rule { needed: 2, ..Rule::note(3, "the board sends text between the frames") };
    /// Bytes between frames that are always the same.
    pub const BYTES_BETWEEN: Rule = Rule::note(3, "the board sends bytes between the frames that are no frame");
    /// A checksum that is right by another rule.
    pub const CHECKSUM: Rule = Rule::value(3, "the board works the checksum of its frames out in another way");
    /// A frame of another version than the one in force.
    pub const VERSION: Rule = Rule::value(4, "a frame carries another version than the one in force");
    /// A HELLO whose header has another version than 0.
    pub const HELLO_VERSION: Rule = Rule::note(4, "the header of the board's HELLO carries another version than 0");
    /// Sequence numbers that go back, or come again with another frame.
    pub const SEQUENCE: Rule = Rule::note(4, "the sequence number does not count the frames up");
    /// A frame of a stream or an event with the number of a request.
    pub const REQUEST_ID: Rule = Rule::note(4, "a frame that belongs to no request carries a request id");
    /// Text with NUL: a field of fixed length that was sent whole.
    pub const NUL: Rule = Rule::value(5, "a text holds NUL");
    /// HELLO with another layout.
    pub const HELLO_LAYOUT: Rule = Rule::note(6, "the board's HELLO has another layout");
    /// HELLO with another nonce.
    pub const NONCE: Rule = Rule::note(6, "the board's HELLO carries another nonce than the station's");
    /// HELLO that comes late.
    pub const HELLO_LATE: Rule = Rule::time(6, "the board answers HELLO later than 50 ms");
    /// HELLO that comes seconds late.
    pub const HELLO_VERY_LATE: Rule = Rule::note(6, "the board answers HELLO seconds late");
    /// A range of versions that does not hold the chosen one.
    pub const VERSION_RANGE: Rule = Rule::note(6, "the board chooses a version outside the ranges");
    /// Two boot ids of one start.
    pub const TWO_BOOT_IDS: Rule =
        Rule::note(6, "HELLO and heartbeat carry different boot ids, and the board did not restart");
    /// A clock that goes back without a restart.
    pub const CLOCK_BACK: Rule = Rule::value(9, "board time goes back, and the board did not restart");
    /// A boot id that stays at a restart.
    pub const BOOT_ID_KEPT: Rule = Rule::note(6, "the board restarted and kept its boot id");
    /// An answer that comes late.
    pub const ANSWER_LATE: Rule = Rule::time(7, "the board accepts or refuses a request later than 50 ms");
    /// An answer to a request that was never made.
    pub const UNASKED: Rule = Rule::note(7, "the board answers a request that was not made");
    /// An answer under another message.
    pub const OTHER_MESSAGE: Rule = Rule::value(7, "an answer carries the message id of another request");
    /// A result without ACCEPT.
    pub const NO_ACCEPT: Rule = Rule::note(7, "the board sends RESULT without ACCEPT");
    /// More time than allowed between two PROGRESS.
    pub const PROGRESS_LATE: Rule = Rule::time(7, "more than 500 ms pass without PROGRESS while a request runs");
    /// A PROGRESS that cannot be.
    pub const PROGRESS: Rule = Rule::note(7, "PROGRESS cannot be right");
    /// ACCEPT, PROGRESS or NAK that cannot be read.
    pub const ANSWER_LAYOUT: Rule = Rule::note(7, "an answer has another layout");
    /// A replay without its flag.
    pub const REPLAY_FLAG: Rule = Rule::note(7, "a RESULT comes twice, the second time without the flag REPLAYED");
    /// MAKE_SAFE that ends late.
    pub const SAFE_LATE: Rule = Rule::note(9, "MAKE_SAFE takes longer than 250 ms");
    /// Heartbeats that come seldom.
    pub const HEARTBEAT_LATE: Rule =
        Rule { needed: 2, ..Rule::time(9, "more than 1000 ms pass between two heartbeats") };
    /// Heartbeats that come often.
    pub const HEARTBEAT_EARLY: Rule = Rule::time(9, "less than 1000 ms pass between two heartbeats");
    /// A heartbeat that cannot be read.
    pub const HEARTBEAT_LAYOUT: Rule = Rule::note(9, "the heartbeat has another layout");
    /// Bit 0 of the state is wrong.
    pub const STATE_SESSION: Rule =
        Rule::note(9, "the heartbeat says that there is no session, and the board answers in it");
    /// Bit 1 of the state is 0 though the supply is on.
    pub const STATE_UNPOWERED: Rule =
        Rule::note(9, "the heartbeat says that the module is without power, and it was switched on");
    /// Bit 1 of the state is 1 though the supply is off.
    pub const STATE_POWERED: Rule =
        Rule::safety(9, "the heartbeat says that the module is under power, and it was switched off");
    /// A module under power after MAKE_SAFE.
    pub const STAYS_POWERED: Rule = Rule::safety(9, "the module is still under power after MAKE_SAFE");
    /// A watchdog that acts while the station is heard.
    pub const WATCHDOG_EARLY: Rule = Rule::note(9, "the watchdog acts before 1750 ms without the station have passed");
    /// Samples of a stream that is not running.
    pub const STREAM_UNASKED: Rule = Rule::note(10, "samples come of a stream that does not run");
    /// Samples before the RESULT of StreamStart.
    pub const STREAM_EARLY: Rule = Rule::note(10, "samples come before the RESULT of StreamStart");
    /// Frames with another number of samples.
    pub const STREAM_COUNT: Rule =
        Rule::note(10, "a frame holds another number of samples than the RESULT of StreamStart says");
    /// More samples than were asked for.
    pub const STREAM_LONG: Rule = Rule::note(10, "a stream goes on beyond the count that was asked for");
    /// Samples of a time that has not come.
    pub const STREAM_TIME: Rule = Rule::value(10, "samples carry a board time that does not fit the board's clock");
    /// A frame of a stream that cannot be read.
    pub const STREAM_LAYOUT: Rule = Rule::value(10, "a frame of a stream has another layout");
    /// An account that does not close.
    pub const ACCOUNT: Rule =
        Rule::value(10, "the account of a stream does not close: produced = received + dropped + lost");
    /// Samples that repeat without capability bit 3.
    pub const REPEATS: Rule = Rule::value(10, "samples repeat on all channels, and HELLO does not say so (bit 3)");
    /// A code beyond the converters.
    pub const CODE: Rule = Rule::value(10, "a sample holds a code beyond 24 bits");
    /// A capture of 1PPS at a time that cannot be.
    pub const CAPTURE: Rule = Rule::value(10, "a capture of 1PPS lies far from the board time of its frame");
    /// An answer that cannot be.
    pub const IMPOSSIBLE: Rule = Rule::value(11, "an answer cannot be");
    /// A code that the document does not have.
    pub const CODE_UNKNOWN: Rule = Rule::note(12, "the board uses a code that the document does not have");
}

/// A rule that the board broke.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Breach {
    /// The rule.
    pub rule: &'static Rule,
    /// How often.
    pub count: u32,
    /// The worst value, or the first case in words.
    pub worst: Option<String>,
}

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
pub struct Breaches(Arc<Mutex<Seen>>);

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
            breaches.push(Counted { breach: Breach { rule, count: 0, worst: None }, span: None, told: false });
            breaches.len() - 1
        });
        let Counted { breach, span, told } = &mut breaches[index];
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

    /// The breach that explains best why no answer came.
    pub(crate) fn instead_of_an_answer(&self) -> Option<Breach> {
        let all = self.all();
        rule::INSTEAD_OF_AN_ANSWER.iter().find_map(|rule| all.iter().find(|breach| breach.rule == *rule).cloned())
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
        assert_eq!(first, [3, 1, 3], "each is told once");
    }
}
