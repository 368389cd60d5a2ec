//! Writes the end of a file that lacks one because the station was killed. Other readers look for the end first, since
//! the summary before it tells where everything is.
//!
//! The file stays byte for byte, up to the last complete record. Behind it come the indexes of the last chunk if they
//! are missing, a metadata record that says what happened ([`CutOff`]), the summary and the footer (MCAP 0,
//! <https://mcap.dev/spec>). Only an incomplete record or parts of a summary are cut off.

use std::collections::BTreeMap;
use std::io::{Cursor, Read};

use binrw::BinWrite;
use crc::{CRC_32_ISO_HDLC, Crc, Table};
use mcap::records::{
    ChunkIndex, DataEnd, MessageIndex, MessageIndexEntry, Metadata, MetadataIndex, Record, Statistics, SummaryOffset,
    op,
};
use mcap::sans_io::LinearReaderOptions;
use mcap::{MAGIC, McapError, McapResult};

use super::RawError;
use super::budget::Budget;
use super::reader::{Unread, each_in_chunk, each_record, parsed};
use super::writer::RawWriter;

/// Bytes before the data of a record: its kind and its length.
const RECORD_HEAD: u64 = 9;
/// Bytes of a footer's data.
const FOOTER: u64 = 20;

/// The checksum of MCAP.
static CRC_32: Crc<u32, Table<16>> = Crc::<u32, Table<16>>::new(&CRC_32_ISO_HDLC);

type Sum = crc::Digest<'static, u32, Table<16>>;

/// The state of a file before its end was written later. A metadata record in the file holds it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct CutOff {
    /// The original length, with the bytes that were cut off.
    pub(crate) original_bytes: u64,
    /// The original SHA-256, with the bytes that were cut off.
    pub(crate) original_sha256: String,
}

impl CutOff {
    /// Name of the metadata record.
    pub(super) const NAME: &str = "gnc.cut_off";

    fn record(&self, kept_bytes: u64) -> Metadata {
        let what =
            "the station ended, or could not write, before the file did; this end was written when the run was sealed";
        let metadata = [
            ("what", what.to_owned()),
            ("original_bytes", self.original_bytes.to_string()),
            ("original_sha256", self.original_sha256.clone()),
            ("kept_bytes", kept_bytes.to_string()),
        ];
        let metadata = metadata.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
        Metadata { name: Self::NAME.to_owned(), metadata }
    }
}

/// The content of a file without an end, up to its last complete record.
pub(crate) struct Survey {
    /// The place behind the last record that was read.
    here: Place,
    /// The place behind the last record that stays.
    kept: Place,
    /// Schemas and channels as in their records, by their numbers.
    schemas: BTreeMap<u16, Vec<u8>>,
    channels: BTreeMap<u16, Vec<u8>>,
    /// Number of messages of each channel.
    counts: BTreeMap<u16, u64>,
    /// Log times of the earliest and the latest message.
    bounds: Option<(u64, u64)>,
    chunks: Vec<ChunkIndex>,
    /// The messages of the last chunk, by channel, until all of its indexes are read.
    unindexed: BTreeMap<u16, Vec<MessageIndexEntry>>,
    /// How many channels of the last chunk have an index that was not read yet.
    missing: usize,
    budget: Budget,
    /// Places of the indexes of the last chunk that were read.
    indexes: BTreeMap<u16, u64>,
    /// Metadata records that stay.
    metadata: Vec<MetadataIndex>,
    past_data: bool,
}

/// A place in the file, and the checksum of all bytes before it.
#[derive(Clone)]
struct Place {
    bytes: u64,
    sum: Sum,
}

impl Place {
    fn start() -> Self {
        Self { bytes: 0, sum: CRC_32.digest() }
    }

    fn pass(&mut self, bytes: &[u8]) {
        self.sum.update(bytes);
        self.bytes += bytes.len() as u64;
    }
}

impl std::fmt::Debug for Survey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Survey")
            .field("kept", &self.kept.bytes)
            .field("chunks", &self.chunks.len())
            .finish_non_exhaustive()
    }
}

impl Survey {
    /// Surveys a file; `None` if the file has an end.
    ///
    /// # Errors
    /// [`RawError`]: the file cannot be read, or it is damaged and not only cut off.
    pub(crate) fn of(source: impl Read) -> Result<Option<Self>, RawError> {
        let mut survey = Self {
            here: Place::start(),
            kept: Place::start(),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            counts: BTreeMap::new(),
            bounds: None,
            chunks: Vec::new(),
            unindexed: BTreeMap::new(),
            missing: 0,
            budget: Budget::default(),
            indexes: BTreeMap::new(),
            metadata: Vec::new(),
            past_data: false,
        };
        survey.here.pass(MAGIC);
        let options = LinearReaderOptions::default().with_emit_chunks(true);
        let end = each_record(source, options, &mut 0, |opcode, data| {
            survey.budget.of_file(data)?;
            survey.record(opcode, data)
        });
        match end {
            Ok(()) => Ok(None),
            // A file without channels has no message either: such a file begins anew.
            Err(Unread::File(McapError::UnexpectedEof)) if survey.channels.is_empty() => {
                survey.kept = Place::start();
                Ok(Some(survey))
            }
            Err(Unread::File(McapError::UnexpectedEof)) => Ok(Some(survey)),
            Err(Unread::File(source)) => Err(survey.damaged(source)),
            Err(Unread::Refused(error)) => Err(error),
        }
    }

    /// Number of bytes from the beginning of the file that stay.
    pub(crate) fn kept_bytes(&self) -> u64 {
        self.kept.bytes
    }

    /// The bytes that belong behind them.
    ///
    /// # Errors
    /// A record cannot be written.
    pub(crate) fn end(mut self, was: &CutOff) -> McapResult<Vec<u8>> {
        if self.kept.bytes == 0 {
            return Self::whole_file(was);
        }
        let kept_bytes = self.kept.bytes;
        let mut out = Out { at: self.kept, bytes: Vec::new() };
        let indexes_at = out.at.bytes;
        for (channel_id, records) in self.unindexed {
            let at = out.put(op::MESSAGE_INDEX, &MessageIndex { channel_id, records })?;
            if let Some(chunk) = self.chunks.last_mut() {
                chunk.message_index_offsets.insert(channel_id, at);
                chunk.message_index_length = out.at.bytes - indexes_at;
            }
        }
        let note = was.record(kept_bytes);
        let offset = out.put(op::METADATA, &note)?;
        let note = MetadataIndex { offset, length: out.at.bytes - offset, name: note.name };
        let metadata: Vec<MetadataIndex> = self.metadata.into_iter().chain([note]).collect();
        let data_section_crc = out.at.sum.clone().finalize();
        out.put(op::DATA_END, &DataEnd { data_section_crc })?;

        // The checksum of the summary starts here.
        out.at.sum = CRC_32.digest();
        let summary_start = out.at.bytes;
        let (message_start_time, message_end_time) = self.bounds.unwrap_or_default();
        let statistics = Statistics {
            message_count: self.counts.values().sum(),
            schema_count: u16::try_from(self.schemas.len()).unwrap_or(u16::MAX),
            channel_count: u32::try_from(self.channels.len()).unwrap_or(u32::MAX),
            attachment_count: 0,
            metadata_count: u32::try_from(metadata.len()).unwrap_or(u32::MAX),
            chunk_count: u32::try_from(self.chunks.len()).unwrap_or(u32::MAX),
            message_start_time,
            message_end_time,
            channel_message_counts: self.counts,
        };
        let groups = [
            out.group(op::SCHEMA, self.schemas.values(), |out, schema| out.put_data(op::SCHEMA, schema))?,
            out.group(op::CHANNEL, self.channels.values(), |out, channel| out.put_data(op::CHANNEL, channel))?,
            out.group(op::STATISTICS, [&statistics], |out, one| out.put(op::STATISTICS, one))?,
            out.group(op::CHUNK_INDEX, &self.chunks, |out, chunk| out.put(op::CHUNK_INDEX, chunk))?,
            out.group(op::METADATA_INDEX, &metadata, |out, note| out.put(op::METADATA_INDEX, note))?,
        ];
        let summary_offset_start = out.at.bytes;
        for group in groups.iter().filter(|group| group.group_length > 0) {
            out.put(op::SUMMARY_OFFSET, group)?;
        }
        out.footer(summary_start, summary_offset_start);
        Ok(out.bytes)
    }

    /// A complete file in place of one that was cut off within its head.
    fn whole_file(was: &CutOff) -> McapResult<Vec<u8>> {
        let mut file = RawWriter::head()?;
        match Self::of(file.as_slice()) {
            Ok(Some(survey)) if survey.kept.bytes > 0 => {
                file.extend(survey.end(was)?);
                Ok(file)
            }
            _ => Err(McapError::UnexpectedEof),
        }
    }

    fn record(&mut self, opcode: u8, data: &[u8]) -> Result<(), RawError> {
        let at = self.here.bytes;
        self.here.pass(&head(opcode, data));
        self.here.pass(data);
        if opcode == op::DATA_END {
            // All that follows can be derived from what stands before.
            self.past_data = true;
        }
        if self.past_data {
            return Ok(());
        }
        match opcode {
            op::CHUNK => self.chunk(at, data)?,
            op::MESSAGE_INDEX => {
                let Record::MessageIndex(index) = self.parsed(opcode, data)? else { return Ok(()) };
                return self.indexed(at, &index);
            }
            op::METADATA => {
                if let Record::Metadata(metadata) = self.parsed(opcode, data)? {
                    let length = self.here.bytes - at;
                    self.metadata.push(MetadataIndex { offset: at, length, name: metadata.name });
                }
            }
            // A zero is not a record: the system reserved the place and did not write it.
            0 => return Err(self.damaged(McapError::UnexpectedEof)),
            _ => self.look_at(opcode, data, None)?,
        }
        self.kept = self.here.clone();
        Ok(())
    }

    fn chunk(&mut self, at: u64, data: &[u8]) -> Result<(), RawError> {
        let Record::Chunk { header, .. } = self.parsed(op::CHUNK, data)? else { return Ok(()) };
        self.unindexed.clear();
        self.indexes.clear();
        let mut offset = 0;
        self.budget.chunk(data)?;
        each_in_chunk(data, |opcode, data| {
            self.budget.in_chunk(data)?;
            self.look_at(opcode, data, Some(offset))?;
            offset += RECORD_HEAD + data.len() as u64;
            Ok(())
        })
        .map_err(|why| match why {
            Unread::Refused(error) => error,
            Unread::File(source) => self.damaged(source),
        })?;
        self.missing = self.unindexed.len();
        self.chunks.push(ChunkIndex {
            message_start_time: header.message_start_time,
            message_end_time: header.message_end_time,
            chunk_start_offset: at,
            chunk_length: self.here.bytes - at,
            message_index_offsets: BTreeMap::new(),
            message_index_length: 0,
            compression: header.compression,
            compressed_size: header.compressed_size,
            uncompressed_size: header.uncompressed_size,
        });
        Ok(())
    }

    /// Examines a record; `offset` is its place among the records of a chunk.
    fn look_at(&mut self, opcode: u8, data: &[u8], offset: Option<u64>) -> Result<(), RawError> {
        match self.parsed(opcode, data)? {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, data.to_vec());
            }
            Record::Channel(channel) => {
                self.channels.insert(channel.id, data.to_vec());
            }
            Record::Message { header, .. } => {
                let time = header.log_time;
                *self.counts.entry(header.channel_id).or_default() += 1;
                let (first, last) = self.bounds.unwrap_or((time, time));
                self.bounds = Some((first.min(time), last.max(time)));
                if let Some(offset) = offset {
                    let entry = MessageIndexEntry { log_time: time, offset };
                    self.unindexed.entry(header.channel_id).or_default().push(entry);
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Keeps the indexes of a chunk as soon as all of them are read.
    fn indexed(&mut self, at: u64, index: &MessageIndex) -> Result<(), RawError> {
        let expected = self.unindexed.get(&index.channel_id).map_or(&[][..], Vec::as_slice);
        if index.records != expected {
            return Err(self.damaged(McapError::BadIndex));
        }
        let is_new = self.indexes.insert(index.channel_id, at).is_none();
        if is_new && self.unindexed.contains_key(&index.channel_id) {
            self.missing -= 1;
        }
        if let Some(chunk) = self.chunks.last_mut()
            && self.missing == 0
        {
            chunk.message_index_length = self.here.bytes - (chunk.chunk_start_offset + chunk.chunk_length);
            // Not `append`, which would go through all of them for each index that a file repeats.
            chunk.message_index_offsets.extend(std::mem::take(&mut self.indexes));
            self.unindexed.clear();
            self.kept = self.here.clone();
        }
        Ok(())
    }

    fn parsed<'d>(&self, opcode: u8, data: &'d [u8]) -> Result<Record<'d>, RawError> {
        parsed(opcode, data).map_err(|source| self.damaged(source))
    }

    fn damaged(&self, source: McapError) -> RawError {
        RawError::Damaged { place: format!("behind byte {}", self.kept.bytes), source }
    }
}

/// The bytes that are put behind the bytes that stay.
struct Out {
    at: Place,
    bytes: Vec<u8>,
}

impl Out {
    /// Puts a record, and returns its place.
    fn put<R>(&mut self, opcode: u8, record: &R) -> McapResult<u64>
    where
        R: for<'a> BinWrite<Args<'a> = ()>,
    {
        let mut data = Cursor::new(Vec::new());
        record.write_le(&mut data)?;
        self.put_data(opcode, data.get_ref())
    }

    fn put_data(&mut self, opcode: u8, data: &[u8]) -> McapResult<u64> {
        let at = self.at.bytes;
        self.append(&head(opcode, data));
        self.append(data);
        Ok(at)
    }

    /// Puts records of one kind, and returns their place.
    fn group<T>(
        &mut self,
        group_opcode: u8,
        records: impl IntoIterator<Item = T>,
        put: impl Fn(&mut Self, T) -> McapResult<u64>,
    ) -> McapResult<SummaryOffset> {
        let group_start = self.at.bytes;
        for record in records {
            put(self, record)?;
        }
        Ok(SummaryOffset { group_opcode, group_start, group_length: self.at.bytes - group_start })
    }

    /// Puts the footer. Its last part is the checksum of the summary, which covers the other parts.
    fn footer(&mut self, summary_start: u64, summary_offset_start: u64) {
        self.append(&[op::FOOTER]);
        self.append(&FOOTER.to_le_bytes());
        self.append(&summary_start.to_le_bytes());
        self.append(&summary_offset_start.to_le_bytes());
        let sum = self.at.sum.clone().finalize();
        self.append(&sum.to_le_bytes());
        self.append(MAGIC);
    }

    fn append(&mut self, bytes: &[u8]) {
        self.at.pass(bytes);
        self.bytes.extend_from_slice(bytes);
    }
}

/// The bytes before the data of a record.
fn head(opcode: u8, data: &[u8]) -> [u8; RECORD_HEAD as usize] {
    let mut head = [opcode; RECORD_HEAD as usize];
    head[1..].copy_from_slice(&(data.len() as u64).to_le_bytes());
    head
}

#[cfg(test)]
mod tests;
