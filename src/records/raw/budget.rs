//! What reading a file may cost, against the size of the file. A file of a few kilobytes can unpack to gigabytes, and hold
//! millions of records that say nothing.

use super::RawError;

/// Bytes that any file may unpack to. An hour of a sensor that never changes at 200 Hz, which packs best of all, unpacks to
/// 70 MB: that of a day is a file of more than 100 MB, since each message has another time.
const ANY_FILE: u64 = 256 << 20;
/// Bytes beyond that for each byte of the file. Samples of live sensors pack to a fifth, those of a sensor that never changes
/// to a fifteenth.
const FOR_EACH_BYTE: u64 = 64;
/// What a record costs at least: a message of one sample with its head has 80 bytes.
const RECORD: u64 = 64;
/// What a chunk costs at least: a decoder is made for each.
const CHUNK: u64 = 4096;
/// Place of the unpacked size in a chunk, behind two times (MCAP 0, <https://mcap.dev/spec#chunk-op0x06>).
const UNPACKED_SIZE: std::ops::Range<usize> = 16..24;

/// The cost of reading so far.
#[derive(Debug, Default)]
pub(super) struct Budget {
    packed: u64,
    spent: u64,
}

impl Budget {
    /// Counts a record of the file itself.
    pub(super) fn of_file(&mut self, data: &[u8]) -> Result<(), RawError> {
        self.packed += data.len() as u64;
        self.spend((data.len() as u64).max(RECORD))
    }

    /// Counts a chunk by the size that it claims, before it is unpacked; its records are counted on top, since many small ones
    /// cost more than their bytes.
    pub(super) fn chunk(&mut self, chunk: &[u8]) -> Result<(), RawError> {
        let claimed = chunk.get(UNPACKED_SIZE).and_then(|size| Some(u64::from_le_bytes(*size.first_chunk()?)));
        self.spend(claimed.unwrap_or_default().max(CHUNK))
    }

    /// Counts a record of a chunk.
    pub(super) fn in_chunk(&mut self, data: &[u8]) -> Result<(), RawError> {
        self.spend(RECORD.saturating_sub(data.len() as u64))
    }

    fn spend(&mut self, cost: u64) -> Result<(), RawError> {
        self.spent = self.spent.saturating_add(cost);
        if self.spent > ANY_FILE.saturating_add(self.packed.saturating_mul(FOR_EACH_BYTE)) {
            return Err(RawError::Swollen { packed: self.packed, unpacked: self.spent });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
