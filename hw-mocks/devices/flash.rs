//! NOR flash: an erase sets a sector to ones, programming only clears bits.

use gnc_protocol::message::MismatchReply;
use gnc_protocol::pattern::Xorshift32;

use crate::noise::Dice;

/// A bit of a sector that always reads one level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BadBit {
    /// Scratch sector.
    pub sector: u16,
    /// Word in the sector.
    pub word: u32,
    /// Bit of the word, 0 the lowest.
    pub bit: u8,
    /// The level that it reads.
    pub level: bool,
}

/// Faults of a flash.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FlashFaults {
    /// Worn bits.
    pub bad_bits: Vec<BadBit>,
    /// Factor on the time of an erase; 0 means 1.
    pub erase_factor: f64,
}

/// The flash part on the board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlashPart {
    /// JEDEC id; zeros if it has none.
    pub jedec: [u8; 3],
    /// Bytes of a sector.
    pub sector_bytes: u32,
    /// Scratch sectors.
    pub scratch_sectors: u16,
    /// Typical time of a sector's erase.
    pub erase_ms: f64,
    /// Longest time of an erase by the data sheet.
    pub erase_limit_ms: f64,
    /// Typical time to program a whole sector.
    pub write_ms: f64,
    /// Longest time of programming by the data sheet.
    pub write_limit_ms: f64,
    /// Time to read a whole sector.
    pub read_ms: f64,
}

/// The flash on the SPI bus: a 128 Mbit serial NOR; 16 pages of 256 bytes a sector, read at 20 MHz.
pub const SPI_FLASH: FlashPart = FlashPart {
    jedec: [0xef, 0x40, 0x18],
    sector_bytes: 4096,
    scratch_sectors: 8,
    erase_ms: 60.0,
    erase_limit_ms: 400.0,
    write_ms: 15.0,
    write_limit_ms: 48.0,
    read_ms: 1.7,
};

/// The flash in the processor, read at 50 MHz by words.
pub(crate) const INTERNAL_FLASH: FlashPart = FlashPart {
    jedec: [0, 0, 0],
    sector_bytes: 16_384,
    scratch_sectors: 4,
    erase_ms: 120.0,
    erase_limit_ms: 1000.0,
    write_ms: 50.0,
    write_limit_ms: 200.0,
    read_ms: 0.4,
};

/// A flash with its scratch sectors.
#[derive(Debug, Clone)]
pub struct FlashMemory {
    /// The part.
    pub part: FlashPart,
    faults: FlashFaults,
    sectors: Vec<Vec<u32>>,
    erases: u32,
    dice: Dice,
}

impl FlashMemory {
    /// A flash with scratch sectors that were used before.
    #[must_use]
    pub fn new(part: FlashPart, faults: FlashFaults, dice: Dice) -> Self {
        let words = (part.sector_bytes / 4) as usize;
        let used = |sector: u16| Xorshift32::new(0x0bad_5eed ^ u32::from(sector)).take(words).collect();
        let sectors = (0..part.scratch_sectors).map(used).collect();
        Self { part, faults, sectors, erases: 0, dice }
    }

    /// Words of a sector.
    #[must_use]
    pub(crate) fn words(&self) -> u32 {
        self.part.sector_bytes / 4
    }

    /// Erases begun since the bench was started.
    #[must_use]
    pub(crate) fn erases(&self) -> u32 {
        self.erases
    }

    /// Sets a sector to ones.
    pub fn erase(&mut self, sector: u16) {
        self.erases += 1;
        if let Some(words) = self.sectors.get_mut(usize::from(sector)) {
            words.fill(u32::MAX);
        }
    }

    /// Handles a power loss in the middle of an erase: half of the sector is erased.
    pub fn interrupt_erase(&mut self, sector: u16) {
        if let Some(words) = self.sectors.get_mut(usize::from(sector)) {
            let half = words.len() / 2;
            words[..half].fill(u32::MAX);
        }
    }

    /// Programs a sector with the pattern of a seed: it clears bits and never sets them.
    pub fn write(&mut self, sector: u16, seed: u32) {
        if let Some(words) = self.sectors.get_mut(usize::from(sector)) {
            for (word, value) in words.iter_mut().zip(Xorshift32::new(seed)) {
                *word &= value;
            }
        }
    }

    /// Reads a word.
    #[must_use]
    pub fn read(&self, sector: u16, word: u32) -> u32 {
        let stored = self.sectors.get(usize::from(sector)).and_then(|words| words.get(word as usize));
        let bad = self.faults.bad_bits.iter().filter(|bad| bad.sector == sector && bad.word == word);
        bad.fold(stored.copied().unwrap_or(u32::MAX), |value, bad| {
            let bit = 1 << (bad.bit & 31);
            if bad.level { value | bit } else { value & !bit }
        })
    }

    /// Counts the words that are not erased.
    #[must_use]
    pub fn blank_check(&self, sector: u16) -> MismatchReply {
        self.compare(sector, core::iter::repeat(u32::MAX))
    }

    /// Compares a sector with the pattern of a seed.
    #[must_use]
    pub fn verify(&self, sector: u16, seed: u32) -> MismatchReply {
        self.compare(sector, Xorshift32::new(seed))
    }

    fn compare(&self, sector: u16, expected: impl Iterator<Item = u32>) -> MismatchReply {
        let mut reply = MismatchReply { words: self.words(), ..MismatchReply::default() };
        for (place, expected) in (0..self.words()).zip(expected) {
            let got = self.read(sector, place);
            if got != expected {
                if reply.mismatches == 0 {
                    (reply.first_place, reply.expected, reply.got) = (place, expected, got);
                }
                reply.mismatches += 1;
            }
        }
        reply
    }

    /// How long the next erase keeps the flash busy: the typical time, with 3 % of scatter.
    pub(crate) fn erase_us(&mut self) -> u32 {
        let factor = if self.faults.erase_factor > 0.0 { self.faults.erase_factor } else { 1.0 };
        (self.part.erase_ms * 1000.0 * factor * (1.0 + 0.03 * self.dice.normal().clamp(-3.0, 3.0))) as u32
    }

    /// How long the next programming of a sector keeps the flash busy: the typical time, with 2 % of scatter.
    pub(crate) fn write_us(&mut self) -> u32 {
        (self.part.write_ms * 1000.0 * (1.0 + 0.02 * self.dice.normal().clamp(-3.0, 3.0))) as u32
    }
}
