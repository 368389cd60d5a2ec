//! Writes captures piece by piece.

use std::io::{Cursor, Seek, Write};

use gnc_analysis::capture::{Capture, CaptureHead, HostView, Said};
use gnc_protocol::calibration::CompensatedSample;
use gnc_protocol::stream::{ImuSample, Losses};
use mcap::records::MessageHeader;
use mcap::{McapResult, WriteOptions};

use super::Topic;
use super::mark::RawMark;
use super::origin::RawOrigin;
use super::sample::{put_bytes, put_compensated, put_edge, put_sample};
use super::schema::descriptor_set;

/// A piece of a capture, in this order: its begin, samples, bytes and edges as they come, its end.
#[derive(Debug, Clone, PartialEq)]
pub enum Piece {
    /// The capture begins.
    Begin {
        /// The head of the capture.
        about: CaptureHead,
        /// Board time of its first sample.
        board_time_us: u64,
    },
    /// Samples of the IMU without a gap between them.
    Imu {
        /// Number of the first sample in the capture.
        first: u32,
        /// Board time of the first sample.
        board_time_us: u64,
        /// Samples a second.
        rate_hz: u16,
        /// The samples.
        samples: Vec<ImuSample>,
    },
    /// Samples compensated by the board, without a gap between them.
    Compensated {
        /// Number of the first sample in the capture.
        first: u32,
        /// Board time of the first sample.
        board_time_us: u64,
        /// Samples a second.
        rate_hz: u16,
        /// The samples.
        samples: Vec<CompensatedSample>,
    },
    /// Bytes of the satellite receiver.
    Gnss {
        /// Board time of the first byte.
        board_time_us: u64,
        /// The bytes.
        bytes: Vec<u8>,
    },
    /// Edges of the 1PPS, board time in nanoseconds.
    Pps(Vec<u64>),
    /// The capture ends.
    End {
        /// The losses.
        losses: Losses,
        /// The board's clock against the host's.
        host: HostView,
        /// Board time of the end.
        board_time_us: u64,
    },
}

/// A file that is being written. Flushed content can be read, even if nothing more follows.
pub struct RawWriter<W: Write + Seek> {
    out: mcap::Writer<W>,
    message: Vec<u8>,
    sequence: [u32; Topic::ALL.len()],
}

impl<W: Write + Seek> std::fmt::Debug for RawWriter<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RawWriter").field("sequence", &self.sequence).finish_non_exhaustive()
    }
}

impl RawWriter<Cursor<Vec<u8>>> {
    /// The head of every file, before the first capture.
    ///
    /// # Errors
    /// The head cannot be written.
    pub(super) fn head() -> McapResult<Vec<u8>> {
        let mut file = Self::new(Cursor::new(Vec::new()), None)?;
        file.flush()?;
        Ok(file.out.into_inner().into_inner())
    }
}

impl<W: Write + Seek> RawWriter<W> {
    /// Begins a file, with the run that it is of; without one it is a record on its own.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn new(out: W, origin: Option<&RawOrigin>) -> McapResult<Self> {
        let program = concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION"));
        // Append only, so that written content stays good in all cases; no threads beside the writing one.
        let options = WriteOptions::new().library(program).disable_seeking(true).compression_threads(0);
        let mut out = options.create(out)?;
        // Before all else: it is there however early the file is cut off.
        if let Some(origin) = origin {
            out.write_metadata(&origin.record())?;
        }
        for topic in Topic::ALL {
            let schema = schema_id(topic);
            out.add_schema_with_id(schema, topic.message(), "protobuf", &descriptor_set(topic))?;
            out.add_channel_with_id(topic as u16, schema, topic.name(), "protobuf", &Default::default())?;
        }
        Ok(Self { out, message: Vec::new(), sequence: [0; Topic::ALL.len()] })
    }

    /// Writes a piece.
    ///
    /// # Errors
    /// The piece cannot be written.
    pub fn write(&mut self, piece: Piece) -> McapResult<()> {
        match piece {
            Piece::Begin { about, board_time_us } => {
                RawMark::Begin(about).put(&mut self.message);
                self.message(Topic::Capture, nanoseconds(board_time_us))
            }
            Piece::End { losses, host, board_time_us } => {
                RawMark::End(losses, host).put(&mut self.message);
                self.message(Topic::Capture, nanoseconds(board_time_us))
            }
            Piece::Imu { first, board_time_us, rate_hz, samples } => {
                self.samples(Topic::Imu, first, Instants { board_time_us, rate_hz }, &samples, put_sample)
            }
            Piece::Compensated { first, board_time_us, rate_hz, samples } => {
                self.samples(Topic::Compensated, first, Instants { board_time_us, rate_hz }, &samples, put_compensated)
            }
            Piece::Gnss { board_time_us, bytes } => {
                put_bytes(&mut self.message, board_time_us, &bytes);
                self.message(Topic::Gnss, nanoseconds(board_time_us))
            }
            Piece::Pps(edges_ns) => edges_ns.into_iter().try_for_each(|board_time_ns| {
                put_edge(&mut self.message, board_time_ns);
                self.message(Topic::Pps, board_time_ns)
            }),
        }
    }

    /// Flushes everything to the underlying writer.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn flush(&mut self) -> McapResult<()> {
        self.out.flush()
    }

    /// Writes the summary and the end, and returns the underlying writer.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(mut self) -> McapResult<W> {
        self.out.finish()?;
        Ok(self.out.into_inner())
    }

    fn samples<S>(
        &mut self,
        topic: Topic,
        first: u32,
        instants: Instants,
        samples: &[S],
        put: fn(&mut Vec<u8>, &S),
    ) -> McapResult<()> {
        for (index, sample) in (0u32..).zip(samples) {
            put(&mut self.message, sample);
            self.sequence[topic as usize - 1] = first.saturating_add(index);
            self.message(topic, nanoseconds(instants.at_us(index)))?;
        }
        Ok(())
    }

    fn message(&mut self, topic: Topic, time_ns: u64) -> McapResult<()> {
        let sequence = &mut self.sequence[topic as usize - 1];
        let header =
            MessageHeader { channel_id: topic as u16, sequence: *sequence, log_time: time_ns, publish_time: time_ns };
        *sequence = sequence.wrapping_add(1);
        let written = self.out.write_to_known_channel(&header, &self.message);
        self.message.clear();
        written
    }
}

/// The number of a schema. Old files, whose fields had no presence, use the numbers of the topics. The new numbers
/// differ: decoders that keep classes by number from file to file must not confuse the two.
fn schema_id(topic: Topic) -> u16 {
    topic as u16 + 10
}

/// The times of evenly spaced samples.
#[derive(Debug, Clone, Copy)]
struct Instants {
    /// Time of the first sample.
    board_time_us: u64,
    rate_hz: u16,
}

impl Instants {
    fn at_us(self, index: u32) -> u64 {
        self.board_time_us.saturating_add(u64::from(index) * 1_000_000 / u64::from(self.rate_hz.max(1)))
    }
}

/// Samples in a piece when a whole capture is split.
const PIECE: usize = 1000;

/// Splits a whole capture into pieces.
pub fn pieces(capture: &Capture) -> impl Iterator<Item = Piece> {
    let Capture { about, first_us, samples, compensated, losses, receiver, timing } = capture;
    let (rate_hz, first_us) = (about.rate_hz, *first_us);
    let first = |index: usize| u32::try_from(index * PIECE).unwrap_or(u32::MAX);
    let instants = Instants { board_time_us: first_us, rate_hz };
    let begin = Piece::Begin { about: about.clone(), board_time_us: first_us };
    let parts = samples.chunks(PIECE).enumerate().map(move |(index, part)| {
        let first = first(index);
        Piece::Imu { first, board_time_us: instants.at_us(first), rate_hz, samples: part.to_vec() }
    });
    let compensated = compensated.chunks(PIECE).enumerate().map(move |(index, part)| {
        let first = first(index);
        Piece::Compensated { first, board_time_us: instants.at_us(first), rate_hz, samples: part.to_vec() }
    });
    let said = receiver.said.iter().map(|said| {
        let Said { board_time_us, bytes } = said.clone();
        Piece::Gnss { board_time_us, bytes }
    });
    let pulses = Piece::Pps(receiver.pulses_ns.clone());
    let end = Piece::End { losses: *losses, host: timing.host.clone(), board_time_us: first_us };
    std::iter::once(begin).chain(parts).chain(compensated).chain(said).chain([pulses, end])
}

/// Microseconds as nanoseconds; enough for 584 years of board time.
fn nanoseconds(us: u64) -> u64 {
    us.saturating_mul(1000)
}
