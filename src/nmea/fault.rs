//! What a receiver says under a good checksum that cannot be: an error of the receiver and not of the line.

/// What cannot be in a sentence.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SentenceFault {
    /// A sentence ends before the fields that make it.
    #[error("{sentence} ends after {fields} fields")]
    Short {
        /// Its kind.
        sentence: &'static str,
        /// How many it has.
        fields: usize,
    },
    /// A field that should be a number is none, or is one that cannot be.
    #[error("{sentence}: {what} is `{text}`")]
    Number {
        /// Its kind.
        sentence: &'static str,
        /// The field.
        what: &'static str,
        /// What it says.
        text: String,
    },
    /// Minutes of 60 and more.
    #[error("{sentence}: {what} `{text}` has minutes of 60 or more")]
    Minutes {
        /// Its kind.
        sentence: &'static str,
        /// Latitude or longitude.
        what: &'static str,
        /// What it says.
        text: String,
    },
    /// Degrees with too few digits or too many.
    #[error("{sentence}: {what} `{text}` has {digits} digits before the point, and should have {needed}")]
    Digits {
        /// Its kind.
        sentence: &'static str,
        /// Latitude or longitude.
        what: &'static str,
        /// What it says.
        text: String,
        /// How many it has.
        digits: usize,
        /// How many there should be.
        needed: usize,
    },
    /// More degrees than the earth has.
    #[error("{sentence}: {what} `{text}` is beyond {most_deg} deg")]
    Beyond {
        /// Its kind.
        sentence: &'static str,
        /// Latitude or longitude.
        what: &'static str,
        /// What it says.
        text: String,
        /// The most there can be.
        most_deg: u32,
    },
    /// A place without its hemisphere, or with one that is none.
    #[error("{sentence}: {what} has the hemisphere `{text}`")]
    Hemisphere {
        /// Its kind.
        sentence: &'static str,
        /// Latitude or longitude.
        what: &'static str,
        /// What it says.
        text: String,
    },
    /// One sentence calls the epoch void, and another one says a fix.
    #[error("RMC is void where {sentence} of the same time says a fix")]
    Void {
        /// The kind of the one with the fix.
        sentence: &'static str,
    },
}
