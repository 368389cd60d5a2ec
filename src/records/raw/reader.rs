//! Reads captures back, bit for bit. A file may be hostile: everything in it is checked before it is used.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Read};

use gnc_analysis::capture::{Capture, CaptureHead, HostView, MOST_SAMPLES, ReceiverCapture, Said, Timing};
use gnc_protocol::stream::Losses;
use mcap::McapError;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::Topic;
use super::budget::Budget;
use super::ending::CutOff;
use super::mark::RawMark;
use super::origin::RawOrigin;
use super::sample::{get_bytes, get_compensated, get_edge, get_sample};

/// Longest record, packed or unpacked: the writer ends its chunks at 1 MiB, other programs at 4 MiB or so.
const LONGEST_RECORD: usize = 64 << 20;
/// Longest record that names things: those of this station have a few hundred bytes. Each of their entries takes ten times as
/// much in memory as in the file.
const LONGEST_NAMES: usize = 1 << 20;
/// Bound on the captures of one file: no calibration uses 10,000 positions.
const MOST_CAPTURES: usize = 10_000;
/// Bound on the bytes of the receiver, and on those of texts: a day of 1 kB a second.
const MOST_BYTES: usize = 100_000_000;
/// Bound on the pieces in which the receiver's bytes come: a day of 46 a second. Each takes some 64 bytes beside its own.
const MOST_PIECES: usize = 4_000_000;

/// The content of a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RawRecord {
    /// The captures that have begun and ended, in order.
    pub captures: Vec<Capture>,
    /// The capture without an end: the station was killed, the capture given up, or the module moved.
    pub unfinished: Option<Unfinished>,
    /// The run that the file is of; files of earlier versions, and records on their own, do not say it.
    pub origin: Option<RawOrigin>,
    /// The file has no end, or the end was written later: the station was killed or lost its power. The content before
    /// the end is good.
    pub cut_off: bool,
}

/// A capture without an end.
#[derive(Debug, Clone, PartialEq)]
pub struct Unfinished {
    /// The head of the capture.
    pub about: CaptureHead,
    /// Number of samples that were filed.
    pub samples: usize,
}

/// Why a file is refused.
#[derive(Debug, thiserror::Error)]
pub enum RawError {
    /// The file cannot be read at all.
    #[error("it cannot be read")]
    Io(#[from] io::Error),
    /// The file is not an MCAP file, or is damaged.
    #[error("it is damaged {place}")]
    Damaged {
        /// The place, in words.
        place: String,
        /// What is wrong.
        source: McapError,
    },
    /// A message is complete but not what it should be.
    #[error("it is not a record of this station: {what} {place}")]
    Foreign {
        /// What is wrong.
        what: String,
        /// The place, in words.
        place: String,
    },
    /// The file names another run than the one in whose folder it is.
    #[error("it is of another run: {plan} of {serial_number}, begun at {started}")]
    OtherRun {
        /// The plan of that run.
        plan: String,
        /// Its module.
        serial_number: String,
        /// When it began.
        started: String,
    },
    /// The file names no run, and those of this run do.
    #[error("it does not say of which run it is, as the files of this run do")]
    NoRun,
    /// The digests of the run have another one for the file.
    #[error("it is another file than the one whose digest stands in SHA256SUMS")]
    Exchanged,
    /// The digests of the run do not have the file.
    #[error("it is not among the files with which the run was closed")]
    Added,
    /// The digests of the run are gone, or are not those that the chain has.
    #[error("nothing shows what was captured because SHA256SUMS is not the one that stands in the chain")]
    OtherDigests,
    /// The journal names other bytes.
    #[error("it is another file than the one whose digest stands in the journal")]
    NotCaptured,
    /// What the journal says of captures was edited.
    #[error("nothing shows what was captured because the journal was changed before a line about a capture")]
    EditedJournal,
    /// The journal names other files of captures, and not this one.
    #[error("the journal does not name it")]
    Unnamed,
    /// A small file asks for much time or memory.
    #[error("it asks for {unpacked} bytes when {packed} bytes are read, more than any record of this station")]
    Swollen {
        /// Bytes of the file so far.
        packed: u64,
        /// What they unpack to, or cost as much as.
        unpacked: u64,
    },
    /// The file exceeds a bound.
    #[error("it holds more than {most} {what}")]
    TooMuch {
        /// The bound.
        most: usize,
        /// What the bound counts.
        what: &'static str,
    },
}

impl RawError {
    /// What the operator can try.
    #[must_use]
    pub fn try_this(&self) -> &'static str {
        match self {
            Self::Io(_) => "check the path, and that this user may read it",
            Self::Damaged { .. } => {
                "restore the file from a backup; `gnc-station records verify` says what was changed"
            }
            Self::Foreign { .. } | Self::Swollen { .. } => {
                "give a file that this station wrote: RECORDS/.../attempt-1.mcap"
            }
            Self::OtherRun { .. }
            | Self::NoRun
            | Self::Exchanged
            | Self::Added
            | Self::OtherDigests
            | Self::NotCaptured
            | Self::EditedJournal
            | Self::Unnamed => {
                "restore the run's folder from a backup; `gnc-station records verify` says what was changed"
            }
            Self::TooMuch { .. } => "give a shorter record",
        }
    }
}

/// Reads all captures of a file.
///
/// # Errors
/// [`RawError`]. A file without an end is not an error.
pub fn read(source: impl Read) -> Result<RawRecord, RawError> {
    let mut found = Found::default();
    let mut bytes = 0;
    // Chunks come as a whole and are checked before they are opened.
    let options = LinearReaderOptions::default().with_emit_chunks(true);
    let end = each_record(source, options, &mut bytes, |opcode, data| {
        found.budget.of_file(data)?;
        match opcode {
            op::CHUNK => found.chunk(data),
            _ => found.record(opcode, data),
        }
    });
    match end {
        Ok(()) => found.close(false),
        // A file that is shorter than its eight magic bytes is not a file of this station.
        Err(Unread::File(McapError::UnexpectedEof)) if bytes >= mcap::MAGIC.len() => found.close(true),
        Err(why) => Err(found.unread(why)),
    }
}

/// The run that a file says that it is of, and whether the file holds anything beside that. It reads no more than
/// the beginning: up to the first chunk with messages.
///
/// # Errors
/// [`RawError`]: the beginning is no MCAP file, or cannot be read.
pub(crate) fn origin(source: impl Read) -> Result<(Option<RawOrigin>, bool), RawError> {
    let mut reader = LinearReader::new_with_options(
        LinearReaderOptions::default().with_emit_chunks(true).with_record_length_limit(LONGEST_RECORD),
    );
    let damaged = |source| RawError::Damaged { place: place(&[], None), source };
    let mut source = source;
    let mut origin = None;
    while let Some(event) = reader.next_event() {
        match event {
            // What is cut off in its head holds nothing.
            Err(McapError::UnexpectedEof) => break,
            Err(error) => return Err(damaged(error)),
            Ok(LinearReadEvent::ReadRequest(need)) => {
                let got = fill(&mut source, reader.insert(need))?;
                reader.notify_read(got);
            }
            Ok(LinearReadEvent::Record { opcode: op::METADATA, data }) => {
                if let Record::Metadata(metadata) = parsed(op::METADATA, data).map_err(damaged)?
                    && metadata.name == RawOrigin::NAME
                {
                    origin.get_or_insert_with(|| RawOrigin::read(metadata.metadata));
                }
            }
            // The first chunk of a file that was cut off in its head holds no message.
            Ok(LinearReadEvent::Record { opcode: op::CHUNK, data }) => {
                if let Record::Chunk { header, .. } = parsed(op::CHUNK, data).map_err(damaged)?
                    && header.message_end_time > 0
                {
                    return Ok((origin, true));
                }
            }
            Ok(LinearReadEvent::Record { opcode: op::MESSAGE, .. }) => return Ok((origin, true)),
            Ok(LinearReadEvent::Record { .. }) => {}
        }
    }
    Ok((origin, false))
}

/// Why reading stopped before the end.
pub(super) enum Unread {
    /// A record was refused, or the file cannot be read.
    Refused(RawError),
    /// The records are not MCAP.
    File(McapError),
}

/// Passes each record to `take`: its kind and its content. `bytes` counts the bytes that were read.
pub(super) fn each_record(
    mut source: impl Read,
    options: LinearReaderOptions,
    bytes: &mut usize,
    mut take: impl FnMut(u8, &[u8]) -> Result<(), RawError>,
) -> Result<(), Unread> {
    let mut reader = LinearReader::new_with_options(options.with_record_length_limit(LONGEST_RECORD));
    while let Some(event) = reader.next_event() {
        match event.map_err(Unread::File)? {
            LinearReadEvent::ReadRequest(need) => {
                let got = fill(&mut source, reader.insert(need)).map_err(|error| Unread::Refused(error.into()))?;
                *bytes += got;
                reader.notify_read(got);
            }
            LinearReadEvent::Record { opcode, data } => take(opcode, data).map_err(Unread::Refused)?,
        }
    }
    Ok(())
}

/// Parses a record. Attachments stay as they are: no file of this station has one, and the MCAP reader panics at an
/// attachment that is cut short.
pub(super) fn parsed(opcode: u8, data: &[u8]) -> Result<Record<'_>, McapError> {
    match opcode {
        op::ATTACHMENT => Ok(Record::Unknown { opcode, data: Cow::Borrowed(data) }),
        op::CHANNEL | op::METADATA if data.len() > LONGEST_NAMES => {
            Err(McapError::RecordTooLarge { opcode, len: data.len() as u64 })
        }
        _ => mcap::parse_record(opcode, data),
    }
}

/// Passes each record of a chunk to `take` after a check of the chunk's checksum.
pub(super) fn each_in_chunk(chunk: &[u8], take: impl FnMut(u8, &[u8]) -> Result<(), RawError>) -> Result<(), Unread> {
    let opened = mcap::parse_record(op::CHUNK, chunk).map_err(Unread::File)?;
    // The MCAP reader would read beyond the end of an uncompressed chunk and take the bytes there for part of the
    // chunk.
    if let Record::Chunk { header, data } = opened
        && header.compression.is_empty()
        && !are_records(&data)
    {
        return Err(Unread::File(McapError::UnexpectedEoc));
    }
    let mut head = vec![op::CHUNK];
    head.extend_from_slice(&(chunk.len() as u64).to_le_bytes());
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true);
    each_record(head.chain(chunk), options, &mut 0, take)
}

/// Whether these bytes consist of complete records only.
fn are_records(mut rest: &[u8]) -> bool {
    while !rest.is_empty() {
        let length = rest.get(1..9).and_then(|length| Some(u64::from_le_bytes(*length.first_chunk()?)));
        let end = length.and_then(|length| usize::try_from(length).ok()?.checked_add(9));
        match end.and_then(|end| rest.get(end..)) {
            Some(behind) => rest = behind,
            None => return false,
        }
    }
    true
}

fn fill(source: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    loop {
        match source.read(buffer) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            done => return done,
        }
    }
}

/// The content that was found so far.
#[derive(Debug, Default)]
struct Found {
    budget: Budget,
    captures: Vec<Capture>,
    /// Labels of all captures, also of the one that has not ended.
    labels: BTreeSet<String>,
    /// The capture that has begun and not ended.
    open: Option<Capture>,
    /// Topics by the numbers that this file gives them. A file may define any number of them, and repeat them.
    channels: BTreeMap<u16, Topic>,
    origin: Option<RawOrigin>,
    samples: usize,
    bytes: usize,
    pieces: usize,
    /// Everything that follows repeats earlier content.
    past_data: bool,
    /// The end of the file was written later.
    cut_off: bool,
}

impl Found {
    fn record(&mut self, opcode: u8, data: &[u8]) -> Result<(), RawError> {
        let record = parsed(opcode, data).map_err(|source| self.damaged(source))?;
        self.take(record)
    }

    fn chunk(&mut self, chunk: &[u8]) -> Result<(), RawError> {
        self.budget.chunk(chunk)?;
        let end = each_in_chunk(chunk, |opcode, data| {
            self.budget.in_chunk(data)?;
            self.record(opcode, data)
        });
        end.map_err(|why| self.unread(why))
    }

    fn unread(&self, why: Unread) -> RawError {
        match why {
            Unread::Refused(error) => error,
            Unread::File(source) => self.damaged(source),
        }
    }

    fn take(&mut self, record: Record<'_>) -> Result<(), RawError> {
        match record {
            Record::DataEnd(_) => self.past_data = true,
            _ if self.past_data => {}
            Record::Metadata(metadata) if metadata.name == CutOff::NAME => self.cut_off = true,
            // The first one counts: it stands before all samples.
            Record::Metadata(metadata) if metadata.name == RawOrigin::NAME => {
                self.origin.get_or_insert_with(|| RawOrigin::read(metadata.metadata));
            }
            Record::Channel(channel) => {
                let topic = Topic::ALL.into_iter().find(|topic| topic.name() == channel.topic);
                match topic {
                    Some(topic) if channel.message_encoding == "protobuf" => {
                        self.channels.entry(channel.id).or_insert(topic);
                    }
                    Some(_) => return Err(self.foreign(format!("{} is not protobuf", channel.topic))),
                    // Later versions may have more topics.
                    None => {}
                }
            }
            Record::Message { header, data } => {
                let Some(topic) = self.channels.get(&header.channel_id) else { return Ok(()) };
                self.message(*topic, (header.sequence, header.log_time), &data)?;
            }
            _ => {}
        }
        Ok(())
    }

    fn message(&mut self, topic: Topic, (number, time_ns): (u32, u64), data: &[u8]) -> Result<(), RawError> {
        let name = topic.message();
        match topic {
            Topic::Capture => match RawMark::get(data) {
                Some(RawMark::Begin(about)) => self.begin(about, time_ns),
                Some(RawMark::End(losses, host)) => self.end(losses, host),
                None => Err(self.foreign(format!("{name} cannot be read"))),
            },
            Topic::Imu => {
                let Some(sample) = get_sample(data) else {
                    return Err(self.foreign(format!("{name} cannot be read")));
                };
                self.sample(name, (number, time_ns), |capture| capture.samples.push(sample))
            }
            Topic::Compensated => {
                let Some(sample) = get_compensated(data) else {
                    return Err(self.foreign(format!("{name} cannot be read")));
                };
                self.sample(name, (number, time_ns), |capture| capture.compensated.push(sample))
            }
            Topic::Gnss => {
                let Some((board_time_us, bytes)) = get_bytes(data) else {
                    return Err(self.foreign(format!("{name} cannot be read")));
                };
                self.spend(bytes.len())?;
                self.pieces += 1;
                if self.pieces > MOST_PIECES {
                    return Err(RawError::TooMuch { most: MOST_PIECES, what: "pieces of the receiver's bytes" });
                }
                let bytes = bytes.to_vec();
                self.open(name)?.receiver.said.push(Said { board_time_us, bytes });
                Ok(())
            }
            Topic::Pps => {
                let Some(board_time_ns) = get_edge(data) else {
                    return Err(self.foreign(format!("{name} cannot be read")));
                };
                self.spend(size_of::<u64>())?;
                self.open(name)?.receiver.pulses_ns.push(board_time_ns);
                Ok(())
            }
        }
    }

    /// Counts bytes that are kept beside the samples.
    fn spend(&mut self, bytes: usize) -> Result<(), RawError> {
        self.bytes = self.bytes.saturating_add(bytes);
        if self.bytes > MOST_BYTES {
            return Err(RawError::TooMuch { most: MOST_BYTES, what: "bytes of the receiver and of texts" });
        }
        Ok(())
    }

    fn begin(&mut self, about: CaptureHead, time_ns: u64) -> Result<(), RawError> {
        self.spend(about.label.len())?;
        if let Some(open) = &self.open {
            let what = format!("a capture begins in the middle of `{}`", open.about.label);
            return Err(self.foreign(what));
        }
        if !self.labels.insert(about.label.clone()) {
            return Err(self.foreign(format!("`{}` comes twice", about.label)));
        }
        if self.captures.len() >= MOST_CAPTURES {
            return Err(RawError::TooMuch { most: MOST_CAPTURES, what: "captures" });
        }
        let timing = Timing::new(about.rate_hz);
        self.open = Some(Capture {
            about,
            first_us: time_ns / 1000,
            samples: Vec::new(),
            compensated: Vec::new(),
            losses: Losses::default(),
            receiver: ReceiverCapture::default(),
            timing,
        });
        Ok(())
    }

    fn end(&mut self, losses: Losses, host: HostView) -> Result<(), RawError> {
        let Some(mut capture) = self.open.take() else {
            return Err(self.foreign("a capture ends before it begins".into()));
        };
        if let HostView::Nothing(why) = &host {
            self.spend(why.len())?;
        }
        capture.losses = losses;
        capture.timing.host = host;
        capture.samples.shrink_to_fit();
        capture.compensated.shrink_to_fit();
        self.captures.push(capture);
        Ok(())
    }

    fn sample(
        &mut self,
        name: &str,
        (number, time_ns): (u32, u64),
        push: impl FnOnce(&mut Capture),
    ) -> Result<(), RawError> {
        self.samples += 1;
        if self.samples > MOST_SAMPLES {
            return Err(RawError::TooMuch { most: MOST_SAMPLES, what: "samples" });
        }
        let capture = self.open(name)?;
        push(capture);
        capture.timing.board.stamp(number, time_ns);
        Ok(())
    }

    fn open(&mut self, name: &str) -> Result<&mut Capture, RawError> {
        match &mut self.open {
            Some(open) => Ok(open),
            None => {
                let place = place(&self.captures, None);
                Err(RawError::Foreign { what: format!("{name} outside of any capture"), place })
            }
        }
    }

    fn close(self, cut_off: bool) -> Result<RawRecord, RawError> {
        if self.channels.is_empty() {
            return Err(self.foreign("it has none of the station's topics".into()));
        }
        let unfinished = self
            .open
            .map(|open| Unfinished { samples: open.samples.len().max(open.compensated.len()), about: open.about });
        Ok(RawRecord { captures: self.captures, unfinished, origin: self.origin, cut_off: cut_off || self.cut_off })
    }

    fn foreign(&self, what: String) -> RawError {
        RawError::Foreign { what, place: self.place() }
    }

    fn damaged(&self, source: McapError) -> RawError {
        RawError::Damaged { place: self.place(), source }
    }

    fn place(&self) -> String {
        place(&self.captures, self.open.as_ref())
    }
}

/// The place in the file, in words by which people find it again.
fn place(captures: &[Capture], open: Option<&Capture>) -> String {
    match (open, captures.last()) {
        (Some(open), _) => format!(
            "after {} samples of capture `{}`",
            open.samples.len().max(open.compensated.len()),
            open.about.label
        ),
        (None, Some(last)) => format!("after capture `{}`", last.about.label),
        (None, None) => "before the first capture".into(),
    }
}

#[cfg(test)]
mod tests {
    use mcap::records::Channel;

    use super::*;

    /// Each message looks its channel up. With a list of all channels, a small file could take minutes.
    #[test]
    fn a_channel_that_is_told_again_is_kept_once() {
        let mut found = Found::default();
        for topic in ["/imu", "/gnss", "/imu"] {
            let message_encoding = "protobuf".to_owned();
            let channel =
                Channel { id: 7, schema_id: 1, topic: topic.to_owned(), message_encoding, metadata: BTreeMap::new() };
            found.take(Record::Channel(channel)).unwrap();
        }
        assert_eq!(found.channels.into_iter().collect::<Vec<_>>(), [(7, Topic::Imu)]);
    }

    /// An attachment of any length, complete or cut short, is skipped.
    #[test]
    fn attachments_are_passed_over() {
        for length in 0..64 {
            Found::default().record(op::ATTACHMENT, &vec![0; length]).unwrap();
        }
    }

    /// Pieces of one byte take more memory than their bytes, and labels are kept as well.
    #[test]
    fn what_is_kept_beside_the_samples_has_a_bound() {
        let begun = |label: String| {
            let mut found = Found::default();
            let pose = gnc_analysis::capture::Pose::Still { up: [0.0, 0.0, 1.0], heading_deg: 0.0 };
            found.begin(CaptureHead { label, series: 0, pose, rate_hz: 100 }, 0).map(|()| found)
        };
        let mut found = begun("x".into()).unwrap();
        found.pieces = MOST_PIECES;
        let mut piece = Vec::new();
        super::super::sample::put_bytes(&mut piece, 0, b"$");
        let error = found.message(Topic::Gnss, (0, 0), &piece).unwrap_err();
        assert!(matches!(error, RawError::TooMuch { most: MOST_PIECES, .. }), "{error}");

        let error = begun("x".repeat(MOST_BYTES + 1)).err().unwrap();
        assert!(matches!(error, RawError::TooMuch { most: MOST_BYTES, .. }), "{error}");
        let mut found = begun("x".into()).unwrap();
        let error = found.end(Losses::default(), HostView::Nothing("x".repeat(MOST_BYTES))).unwrap_err();
        assert!(matches!(error, RawError::TooMuch { most: MOST_BYTES, .. }), "{error}");
    }
}
