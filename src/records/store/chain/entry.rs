//! A line of the chain.

use std::fmt::{self, Write as _};

use chrono::{DateTime, FixedOffset, SecondsFormat};
use sha2::{Digest as _, Sha256};

use crate::store::{PublicKey, StationKey, digest};

/// The word of a line that was written when its run began.
const BEGIN: &str = "begin";
/// The word of a line that was written when its run was closed.
const CLOSE: &str = "close";
/// The word before the name under which a run began, if it was moved since.
const FROM: &str = "from";
/// The mark of a line whose run was closed late.
const LATE: &str = "late";
/// The word before the signature.
const SIG: &str = "sig";
/// What is signed, before the link: no signature of a list of digests can be taken for that of a line.
const SIGNED: &str = "gnc-station chain 2 ";

/// When and by what a run was put into the chain whose station had ended before it did so.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LateClose {
    /// The time, as RFC 3339 writes it.
    pub at: String,
    /// The program with its version.
    pub by: String,
}

impl LateClose {
    /// A mark of now by a program. A line of the chain has spaces between its words, so these have none.
    pub(crate) fn new(at: DateTime<FixedOffset>, program: &str) -> Self {
        let is_word = |mark: char| !mark.is_whitespace() && !mark.is_control();
        let by = program.chars().map(|mark| if is_word(mark) { mark } else { '_' }).collect();
        Self { at: at.to_rfc3339_opts(SecondsFormat::Secs, false), by }
    }

    /// What happened, for people.
    #[must_use]
    pub fn in_words(&self) -> String {
        format!(
            "{self}, after its station had ended, or could not write, before the run was in the chain; until then its journal could be edited; it never counts as a pass"
        )
    }
}

impl fmt::Display for LateClose {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at = DateTime::parse_from_rfc3339(&self.at);
        let at = at.map_or_else(|_| self.at.clone(), |at| at.format("%F %T").to_string());
        write!(f, "closed late at {at} by {}", self.by)
    }
}

/// Number and link of a line: they witness all lines before it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The number.
    pub number: u64,
    /// The link, as hexadecimal digits.
    pub link: String,
}

impl Place {
    /// Reads what [`Place`] shows: `12 3fa9…`, with all 64 digits. The file `COUNTER` has the same form.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let (number, link) = text.trim_end().split_once(' ')?;
        let is_number = !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit());
        let is_link = link.len() == 64 && link.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
        let number = number.parse().ok().filter(|number| is_number && is_link && *number > 0)?;
        Some(Self { number, link: link.to_owned() })
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.number, self.link)
    }
}

/// Who writes a line, when, and how.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scribe<'a> {
    /// The station.
    pub(crate) station: &'a str,
    /// The time that the line says: of the run's start or end, or of the start that closes what was left.
    pub(crate) at: DateTime<FixedOffset>,
    /// Signs the line.
    pub(crate) key: Option<&'a StationKey>,
    /// The mark of a run that is closed late.
    pub(crate) late: Option<&'a LateClose>,
}

/// What a line is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// The run began: the digest is that of the first line of its journal.
    Begin,
    /// The run was closed: the digest is that of its `SHA256SUMS`.
    Close,
}

impl Kind {
    fn word(self) -> &'static str {
        match self {
            Self::Begin => BEGIN,
            Self::Close => CLOSE,
        }
    }
}

/// Who wrote a line, and when. Lines of earlier versions do not say it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Stamp {
    /// The station, as one word.
    pub(super) station: String,
    /// The time, as RFC 3339 writes it.
    pub(super) at: String,
}

/// A line of the chain.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ChainEntry {
    pub(super) number: u64,
    pub(super) before: String,
    pub(super) digest: String,
    pub(super) link: String,
    pub(super) kind: Kind,
    /// `None`: a version of the station wrote the line that wrote none when a run began.
    pub(super) stamp: Option<Stamp>,
    /// `DATE/SERIAL/TIME-PLAN`.
    pub(super) run: String,
    /// The name under which the run began, if its folder was moved since.
    pub(super) from: Option<String>,
    pub(super) late: Option<LateClose>,
    /// The signature as hexadecimal digits.
    pub(super) signature: Option<String>,
}

impl ChainEntry {
    /// The next line behind one, signed if there is a key.
    pub(super) fn new(
        before: &Place,
        kind: Kind,
        digest: &str,
        run: &str,
        from: Option<&str>,
        by: &Scribe<'_>,
    ) -> Self {
        let stamp = Stamp { station: as_word(by.station), at: by.at.to_rfc3339_opts(SecondsFormat::Secs, false) };
        let mut entry = Self {
            number: before.number.saturating_add(1),
            before: before.link.clone(),
            digest: digest.to_owned(),
            link: String::new(),
            kind,
            stamp: Some(stamp),
            run: run.to_owned(),
            from: from.map(str::to_owned),
            late: by.late.cloned().filter(|_| kind == Kind::Close),
            signature: None,
        };
        entry.link = entry.true_link();
        entry.signature = by.key.map(|key| digest::hexadecimal(&key.sign(entry.signed_text().as_bytes())));
        entry
    }

    pub(super) fn place(&self) -> Place {
        Place { number: self.number, link: self.link.clone() }
    }

    pub(super) fn is_close(&self) -> bool {
        self.kind == Kind::Close
    }

    /// The name under which the run began.
    pub(super) fn began_as(&self) -> &str {
        self.from.as_ref().unwrap_or(&self.run)
    }

    /// The station that wrote it; lines of earlier versions do not say it.
    pub(super) fn station(&self) -> Option<&str> {
        self.stamp.as_ref().map(|stamp| stamp.station.as_str())
    }

    /// The day in whose folder the run stands.
    pub(super) fn day(&self) -> &str {
        self.run.split('/').next().unwrap_or_default()
    }

    /// The words behind the link that the link covers.
    fn tail(&self) -> String {
        let mut tail = match &self.stamp {
            Some(Stamp { station, at }) => format!("{} {station} {at} {}", self.kind.word(), self.run),
            None => self.run.clone(),
        };
        if let Some(from) = &self.from {
            let _ = write!(tail, " {FROM} {from}");
        }
        if let Some(LateClose { at, by }) = &self.late {
            let _ = write!(tail, " {LATE} {at} {by}");
        }
        tail
    }

    fn true_link(&self) -> String {
        let Self { number, before, digest, .. } = self;
        digest::hexadecimal(&Sha256::digest(format!("{number} {before} {digest} {}", self.tail())))
    }

    pub(super) fn line(&self) -> String {
        let signature = self.signature.as_ref().map(|signature| format!(" {SIG} {signature}")).unwrap_or_default();
        format!("{} {} {} {} {}{signature}\n", self.number, self.before, self.digest, self.link, self.tail())
    }

    /// `None` if the text is not a line of a chain, letter for letter as a station writes it.
    pub(super) fn parse(line: &str) -> Option<Self> {
        // A station writes none: not the carriage return that an editor of Windows leaves at the end, and none into a name.
        if line.contains(char::is_control) {
            return None;
        }
        let mut words = line.split(' ').peekable();
        let mut word = || words.next().map(str::to_owned);
        let (number, before, digest, link, fifth) = (word()?, word()?, word()?, word()?, word()?);
        let kind = [Kind::Begin, Kind::Close].into_iter().find(|kind| kind.word() == fifth);
        let (kind, stamp, run) = match kind {
            Some(kind) => {
                let (station, at, run) = (word()?, word()?, word()?);
                (kind, Some(Stamp { station, at }), run)
            }
            None => (Kind::Close, None, fifth),
        };
        let mut entry = Self {
            number: number.parse().ok()?,
            before,
            digest,
            link,
            kind,
            stamp,
            run,
            from: None,
            late: None,
            signature: None,
        };
        while let Some(word) = words.next() {
            let mut next = || words.next().map(str::to_owned);
            match word {
                FROM => entry.from = Some(next()?),
                LATE => entry.late = Some(LateClose { at: next()?, by: next()? }),
                SIG => entry.signature = Some(next()?),
                _ => return None,
            }
        }
        let is_whole = entry.line().strip_suffix('\n') == Some(line);
        // The station writes small letters; another form of the same signature is a change.
        let is_digits = |text: &String| text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
        let is_as_signed = entry.signature.as_ref().is_none_or(is_digits);
        Some(entry).filter(|_| is_whole && is_as_signed)
    }

    pub(super) fn is_true(&self) -> bool {
        self.true_link() == self.link
    }

    fn signed_text(&self) -> String {
        signed_text(&self.link)
    }

    /// Whether one of the keys signed the line. `None`: it has no signature.
    pub(super) fn is_signed_by(&self, keys: &[PublicKey]) -> Option<bool> {
        Some(is_signed_by(&self.link, self.signature.as_ref()?, keys))
    }
}

fn signed_text(link: &str) -> String {
    format!("{SIGNED}{link}")
}

/// Whether a signature, as hexadecimal digits, is that of the line with this link by one of the keys.
pub(super) fn is_signed_by(link: &str, signature: &str, keys: &[PublicKey]) -> bool {
    let is_by = |bytes: Vec<u8>| keys.iter().any(|key| key.signed(signed_text(link).as_bytes(), &bytes));
    bytes(signature).is_some_and(is_by)
}

/// The bytes of hexadecimal digits.
fn bytes(digits: &str) -> Option<Vec<u8>> {
    let digit = |byte: u8| char::from(byte).to_digit(16).and_then(|digit| u8::try_from(digit).ok());
    let pairs = digits.as_bytes().chunks(2);
    pairs.map(|pair| Some(digit(*pair.first()?)? << 4 | digit(*pair.get(1)?)?)).collect()
}

/// The name of a station as one word: spaces, signs that are not shown and `%` are written as `%` and two digits a byte.
fn as_word(name: &str) -> String {
    if name.is_empty() {
        return "%".to_owned();
    }
    let mut word = String::with_capacity(name.len());
    for mark in name.chars() {
        if mark.is_whitespace() || mark.is_control() || mark == '%' {
            let mut utf8 = [0; 4];
            for byte in mark.encode_utf8(&mut utf8).bytes() {
                let _ = write!(word, "%{byte:02x}");
            }
        } else {
            word.push(mark);
        }
    }
    word
}
