//! Impossible content under a good checksum: an error of the receiver and not of the line.

/// Impossible content of a sentence.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SentenceFault {
    /// A sentence ends before its necessary fields.
    #[error("{sentence} ends after {fields} fields")]
    Short {
        /// Its kind.
        sentence: &'static str,
        /// The number of fields it has.
        fields: usize,
    },
    /// A field that should be a number is not a number, or not a possible one.
    #[error("{sentence}: {what} is `{text}`")]
    Number {
        /// Its kind.
        sentence: &'static str,
        /// The field.
        what: &'static str,
        /// The text of the field.
        text: String,
    },
    /// Minutes of 60 and more.
    #[error("{sentence}: {what} `{text}` has minutes of 60 or more")]
    Minutes {
        /// Its kind.
        sentence: &'static str,
        /// Latitude or longitude.
        what: &'static str,
        /// The text of the field.
        text: String,
    },
    /// Degrees with too few digits or too many.
    #[error("{sentence}: {what} `{text}` has {digits} digits before the point, and should have {needed}")]
    Digits {
        /// Its kind.
        sentence: &'static str,
        /// Latitude or longitude.
        what: &'static str,
        /// The text of the field.
        text: String,
        /// The number of digits it has.
        digits: usize,
        /// The number of digits it should have.
        needed: usize,
    },
    /// More degrees than the earth has.
    #[error("{sentence}: {what} `{text}` is beyond {most_deg} deg")]
    Beyond {
        /// Its kind.
        sentence: &'static str,
        /// Latitude or longitude.
        what: &'static str,
        /// The text of the field.
        text: String,
        /// The largest possible value.
        most_deg: u32,
    },
    /// A place without a hemisphere, or with an unknown one.
    #[error("{sentence}: {what} has the hemisphere `{text}`")]
    Hemisphere {
        /// Its kind.
        sentence: &'static str,
        /// Latitude or longitude.
        what: &'static str,
        /// The text of the field.
        text: String,
    },
    /// One sentence declares the epoch void, and another one reports a fix.
    #[error("RMC is void where {sentence} of the same time says a fix")]
    Void {
        /// The kind of the sentence with the fix.
        sentence: &'static str,
    },
}
