//! The rules of the interface document that the conversation checks, and what a board does against them.

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
    pub(crate) needed: u32,
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
pub const NONCE: Rule =
    Rule { needed: 2, ..Rule::note(6, "the board's HELLO carries another nonce than the station's") };
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
pub const PROGRESS_LATE: Rule =
    Rule { needed: 5, ..Rule::time(7, "more than 500 ms pass without PROGRESS while a request runs") };
/// A PROGRESS that cannot be.
pub const PROGRESS: Rule = Rule::note(7, "PROGRESS holds a value that cannot be");
/// ACCEPT, PROGRESS or NAK that cannot be read.
pub const ANSWER_LAYOUT: Rule = Rule::note(7, "an answer has another layout");
/// A replay without its flag.
pub const REPLAY_FLAG: Rule = Rule::note(7, "a RESULT comes twice, the second time without the flag REPLAYED");
/// MAKE_SAFE that ends late.
pub const SAFE_LATE: Rule = Rule::note(9, "MAKE_SAFE takes longer than 250 ms");
/// Heartbeats that come seldom.
pub const HEARTBEAT_LATE: Rule = Rule { needed: 2, ..Rule::time(9, "more than 1000 ms pass between two heartbeats") };
/// Heartbeats that come often.
pub const HEARTBEAT_EARLY: Rule = Rule::time(9, "less than 1000 ms pass between two heartbeats");
/// A heartbeat that cannot be read.
pub const HEARTBEAT_LAYOUT: Rule = Rule::note(9, "the heartbeat has another layout");
/// Bit 0 of the state is wrong.
pub const STATE_SESSION: Rule =
    Rule { needed: 2, ..Rule::note(9, "the heartbeat says that there is no session, and the board answers in it") };
/// Bit 1 of the state is 0 though the supply is on.
pub const STATE_UNPOWERED: Rule =
    Rule::note(9, "the heartbeat says that the module is without power, and it was switched on");
/// Bit 1 of the state is 1 though the supply is off.
pub const STATE_POWERED: Rule =
    Rule::safety(9, "the heartbeat says that the module is under power, and it was switched off");
/// A module under power after MAKE_SAFE.
pub const STAYS_POWERED: Rule = Rule::safety(9, "the module is still under power after MAKE_SAFE");
/// A watchdog that acts while the station is heard.
pub const WATCHDOG_EARLY: Rule =
    Rule { needed: 2, ..Rule::note(9, "the watchdog acts before 1750 ms without the station have passed") };
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
pub const IMPOSSIBLE: Rule = Rule::value(11, "an answer holds a value that cannot be");
/// A code that the document does not have.
pub const CODE_UNKNOWN: Rule = Rule::note(12, "the board uses a code that the document does not have");
