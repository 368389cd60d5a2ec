//! Stored biases, in two copies. At any moment at least one copy is whole.

use crc::{CRC_32_ISCSI, Crc};

/// Most biases that a copy holds.
pub(super) const MOST_SLOTS: usize = 64;
const MAGIC: [u8; 4] = *b"GZB1";
const CRC32C: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

/// Biases of earlier power cycles (A) and the slot of the last one (Flag).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Stored {
    biases: Vec<f64>,
    flag: usize,
}

impl Stored {
    /// Returns the mean of the stored biases, or `None` where there is none.
    #[must_use]
    pub fn mean(&self) -> Option<f64> {
        (!self.biases.is_empty()).then(|| crate::stats::mean(&self.biases))
    }

    /// Returns the biases, in the order of their slots.
    #[must_use]
    pub fn biases(&self) -> &[f64] {
        &self.biases
    }

    /// Writes a bias into the slot after the last one. There are `slots` slots.
    pub fn push(&mut self, bias: f64, slots: usize) {
        if self.biases.len() < slots {
            self.biases.push(bias);
            self.flag = self.biases.len() - 1;
        } else if slots > 0 {
            self.flag = (self.flag + 1) % slots;
            self.biases[self.flag] = bias;
        }
    }

    /// Encodes a copy: `magic | sequence u64 | count u16 | flag u16 | biases f64 | CRC-32C`, little-endian.
    fn encode(&self, sequence: u64) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(sequence.to_le_bytes());
        bytes.extend((self.biases.len() as u16).to_le_bytes());
        bytes.extend((self.flag as u16).to_le_bytes());
        bytes.extend(self.biases.iter().flat_map(|b| b.to_le_bytes()));
        bytes.extend(CRC32C.checksum(&bytes).to_le_bytes());
        bytes
    }

    /// Reads a copy; `None` where it is not whole. Bytes after the copy are ignored.
    fn decode(bytes: &[u8]) -> Option<(u64, Self)> {
        let bytes = bytes.strip_prefix(&MAGIC)?;
        let (sequence, bytes_after) = bytes.split_first_chunk::<8>()?;
        let (count, rest) = bytes_after.split_first_chunk::<2>()?;
        let (flag, rest) = rest.split_first_chunk::<2>()?;
        let (count, flag) = (usize::from(u16::from_le_bytes(*count)), usize::from(u16::from_le_bytes(*flag)));
        if count > MOST_SLOTS || flag >= count.max(1) {
            return None;
        }
        let (biases, rest) = rest.split_at_checked(8 * count)?;
        let (checksum, _) = rest.split_first_chunk::<4>()?;
        let mut digest = CRC32C.digest();
        digest.update(&MAGIC);
        digest.update(bytes.get(..12 + 8 * count)?);
        if digest.finalize() != u32::from_le_bytes(*checksum) {
            return None;
        }
        let biases: Vec<f64> = biases.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
        biases.iter().all(|b| b.is_finite()).then_some((u64::from_le_bytes(*sequence), Self { biases, flag }))
    }
}

/// The two copies as they lie in non-volatile memory.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Copies(pub [Vec<u8>; 2]);

impl Copies {
    /// Returns the newest whole copy; an empty store where neither is whole.
    #[must_use]
    pub fn load(&self) -> Stored {
        self.newest().map_or_else(Stored::default, |(_, _, stored)| stored)
    }

    /// Returns what to write, and over which copy: never over the newest whole copy. The caller may write the bytes in
    /// any order and may be cut off at any byte. Until the last byte is there, the other copy counts.
    #[must_use]
    pub fn plan(&self, stored: &Stored) -> (usize, Vec<u8>) {
        let (copy, sequence) = self.newest().map_or((0, 1), |(copy, sequence, _)| (1 - copy, sequence.wrapping_add(1)));
        (copy, stored.encode(sequence))
    }

    fn newest(&self) -> Option<(usize, u64, Stored)> {
        let read = |copy: usize| Stored::decode(&self.0[copy]).map(|(sequence, stored)| (copy, sequence, stored));
        match (read(0), read(1)) {
            // Newer means up to half the range ahead, so that the sequence may wrap.
            (Some(a), Some(b)) => Some(if b.1.wrapping_sub(a.1) < u64::MAX / 2 { b } else { a }),
            (a, b) => a.or(b),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A write may be cut off after any number of bytes, or one byte of it may be wrong. A reader always gets the old
    /// state or the new one.
    #[test]
    fn a_write_may_be_cut_off_anywhere() {
        let mut copies = Copies::default();
        let mut stored = Stored::default();
        for k in 0..25 {
            let before = stored.clone();
            stored.push(f64::from(k) * 0.5, 10);
            let (copy, bytes) = copies.plan(&stored);
            for cut in 0..bytes.len() {
                let mut torn = copies.clone();
                // The old copy's bytes remain behind the cut.
                let old = torn.0[copy].get(cut..).unwrap_or_default().to_vec();
                torn.0[copy] = [&bytes[..cut], &old].concat();
                assert_eq!(torn.load(), before, "write {k} cut at {cut}");
                let mut wrong = copies.clone();
                wrong.0[copy] = bytes.clone();
                wrong.0[copy][cut] ^= 0x10;
                assert_eq!(wrong.load(), before, "write {k}, byte {cut} wrong");
            }
            copies.0[copy] = bytes;
            assert_eq!(copies.load(), stored);
        }
        assert_eq!(stored.biases().len(), 10);
    }

    #[test]
    fn the_sequence_may_run_over() {
        let (mut old, mut new) = (Stored::default(), Stored::default());
        old.push(1.0, 10);
        new.push(2.0, 10);
        let copies = Copies([new.encode(0), old.encode(u64::MAX)]);
        assert_eq!(copies.load(), new);
    }
}
