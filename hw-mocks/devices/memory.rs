//! The RAMs: cells behind address and data lines, and the patterns that run over them.
//!
//! # Orders of the patterns
//! `N` words of `w` bits, index `i` from 0. "up" is rising index, "down" falling; `w x` writes, `r x` reads and
//! compares. A line ends before the next begins.
//!
//! | pattern | order | accesses |
//! | --- | --- | --- |
//! | solid | up w 0 / up r 0 / up w ~0 / up r ~0 | 4 N |
//! | checkerboard | up w 0x55.. / up r / up w 0xAA.. / up r | 4 N |
//! | walking ones | up w `1 << (i mod w)` / up r | 2 N |
//! | address | up w `i` / up r / up w `~i` / up r, each modulo `2^w` | 4 N |
//! | March C- | up w 0 / up (r 0, w ~0) / up (r ~0, w 0) / down (r 0, w ~0) / down (r ~0, w 0) / down r 0 | 10 N |
//!
//! In the March elements both operations are done on a word before the next word. `words` of the reply is `N`;
//! `mismatches` counts comparisons; the first failed comparison in this order gives place, expected and got.

use std::ops::Range;

use gnc_protocol::message::{MismatchReply, RamPattern};

/// Words of the internal RAM, 16 bits each.
pub(crate) const INTERNAL_WORDS: u32 = 65_536;
/// Words of the SDRAM, 32 bits each.
pub(crate) const SDRAM_WORDS: u32 = 1_048_576;

/// Faults of a memory.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct MemoryFaults {
    /// A data line held at a level (bit, level): it affects every word read.
    pub stuck_data_line: Option<(u8, bool)>,
    /// Two address lines in contact: both follow the lower of the two.
    pub shorted_address_lines: Option<(u8, u8)>,
    /// An address line held at a level (line, level).
    pub stuck_address_line: Option<(u8, bool)>,
    /// Cells that hold one value (index, bit, value).
    pub stuck_cells: Vec<(u32, u8, bool)>,
    /// Cells that flip when another one rises (aggressor's index, victim's index, bit).
    pub coupled_cells: Vec<(u32, u32, u8)>,
}

/// A memory.
#[derive(Debug, Clone)]
pub struct Memory {
    cells: Vec<u32>,
    width: u32,
    mask: u32,
    forced_high: u32,
    forced_low: u32,
    faults: MemoryFaults,
    plain: bool,
}

impl Memory {
    /// A memory of `words` words of `width` bits; `fill` gives its content at power-on.
    #[must_use]
    pub fn new(words: u32, width: u32, faults: MemoryFaults, mut fill: impl FnMut() -> u32) -> Self {
        let mask = if width >= 32 { u32::MAX } else { (1 << width) - 1 };
        let (mut forced_high, mut forced_low) = (0, 0);
        if let Some((bit, level)) = faults.stuck_data_line {
            *(if level { &mut forced_high } else { &mut forced_low }) |= (1_u32 << (bit & 31)) & mask;
        }
        let plain = faults.shorted_address_lines.is_none()
            && faults.stuck_address_line.is_none()
            && faults.stuck_cells.is_empty()
            && faults.coupled_cells.is_empty();
        // One drawn block is repeated, since the content of a RAM at power-on is undefined anyway.
        let block: Vec<u32> = (0..1024).map(|_| fill() & mask).collect();
        let cells = (0..words as usize).map(|index| block[index % block.len()]).collect();
        Self { cells, width, mask, forced_high, forced_low, faults, plain }
    }

    /// Number of words.
    #[must_use]
    pub(crate) fn words(&self) -> u32 {
        self.cells.len() as u32
    }

    /// The word that arrives on the data lines.
    #[inline]
    fn on_lines(&self, value: u32) -> u32 {
        (value | self.forced_high) & !self.forced_low
    }

    /// Writes a word through the lines.
    #[inline]
    pub(crate) fn write(&mut self, index: u32, value: u32) {
        let value = self.on_lines(value & self.mask);
        if self.plain {
            self.cells[index as usize] = value;
        } else {
            self.write_faulty(index, value);
        }
    }

    /// Reads a word through the lines.
    #[must_use]
    #[inline]
    pub(crate) fn read(&self, index: u32) -> u32 {
        let index = if self.plain { index } else { self.decode(index) };
        self.on_lines(self.cells[index as usize])
    }

    /// Writes a range of words of a plain memory.
    fn fill(&mut self, words: Range<u32>, value: Value) {
        let (mask, width, high, low) = (self.mask, self.width, self.forced_high, self.forced_low);
        let cells = &mut self.cells[words.start as usize..words.end as usize];
        for (cell, index) in cells.iter_mut().zip(words) {
            *cell = (word(value, index, width) & mask | high) & !low;
        }
    }

    /// Whether a range of words of a plain memory reads as it should.
    fn holds(&self, words: Range<u32>, value: Value) -> bool {
        let cells = &self.cells[words.start as usize..words.end as usize];
        // Without an early end the processor compares several words at once.
        let differing = cells.iter().zip(words).fold(0, |differing, (cell, index)| {
            differing | (self.on_lines(*cell) ^ (word(value, index, self.width) & self.mask))
        });
        differing == 0
    }

    /// The address that the faulty address lines select.
    #[cold]
    fn decode(&self, mut index: u32) -> u32 {
        if let Some((a, b)) = self.faults.shorted_address_lines {
            let both = (index >> a) & (index >> b) & 1;
            index = index & !(1 << a | 1 << b) | both << a | both << b;
        }
        if let Some((line, level)) = self.faults.stuck_address_line {
            index = index & !(1 << line) | u32::from(level) << line;
        }
        index
    }

    #[cold]
    fn write_faulty(&mut self, index: u32, mut value: u32) {
        let index = self.decode(index);
        for &(cell, bit, level) in &self.faults.stuck_cells {
            if cell == index {
                value = value & !(1 << bit) | u32::from(level) << bit;
            }
        }
        let rising = value & !self.cells[index as usize];
        self.cells[index as usize] = value;
        for &(aggressor, victim, bit) in &self.faults.coupled_cells {
            if aggressor == index && rising >> bit & 1 == 1 {
                self.cells[victim as usize] ^= 1 << bit;
            }
        }
    }
}

/// The value that an operation writes to a word or expects there.
#[derive(Debug, Clone, Copy)]
enum Value {
    Same(u32),
    Walking,
    Index,
    NotIndex,
}

#[derive(Debug, Clone, Copy)]
enum Operation {
    Write(Value),
    Read(Value),
}

#[derive(Debug, Clone, Copy)]
struct Element {
    down: bool,
    operations: &'static [Operation],
}

const fn up(operations: &'static [Operation]) -> Element {
    Element { down: false, operations }
}

const fn down(operations: &'static [Operation]) -> Element {
    Element { down: true, operations }
}

fn elements(pattern: RamPattern) -> &'static [Element] {
    use Operation::{Read, Write};
    use Value::{Index, NotIndex, Same, Walking};
    const ZEROS: Value = Same(0);
    const ONES: Value = Same(u32::MAX);
    const FIVES: Value = Same(0x5555_5555);
    const TENS: Value = Same(0xaaaa_aaaa);
    match pattern {
        RamPattern::Solid => {
            const { &[up(&[Write(ZEROS)]), up(&[Read(ZEROS)]), up(&[Write(ONES)]), up(&[Read(ONES)])] }
        }
        RamPattern::Checkerboard => {
            const { &[up(&[Write(FIVES)]), up(&[Read(FIVES)]), up(&[Write(TENS)]), up(&[Read(TENS)])] }
        }
        RamPattern::WalkingOnes => const { &[up(&[Write(Walking)]), up(&[Read(Walking)])] },
        RamPattern::Address => {
            const { &[up(&[Write(Index)]), up(&[Read(Index)]), up(&[Write(NotIndex)]), up(&[Read(NotIndex)])] }
        }
        RamPattern::MarchC => {
            const {
                &[
                    up(&[Write(ZEROS)]),
                    up(&[Read(ZEROS), Write(ONES)]),
                    up(&[Read(ONES), Write(ZEROS)]),
                    down(&[Read(ZEROS), Write(ONES)]),
                    down(&[Read(ONES), Write(ZEROS)]),
                    down(&[Read(ZEROS)]),
                ]
            }
        }
    }
}

/// A pattern under way over a memory. It runs in pieces, so that the board stays able to answer.
#[derive(Debug, Clone)]
pub struct PatternRun {
    elements: &'static [Element],
    element: usize,
    step: u32,
    reply: MismatchReply,
}

impl PatternRun {
    /// A run that has not begun.
    #[must_use]
    pub fn new(pattern: RamPattern) -> Self {
        Self { elements: elements(pattern), element: 0, step: 0, reply: MismatchReply::default() }
    }

    /// Accesses that the pattern makes to a memory of `words` words.
    #[must_use]
    pub fn accesses(pattern: RamPattern, words: u32) -> u64 {
        elements(pattern).iter().map(|element| element.operations.len() as u64 * u64::from(words)).sum()
    }

    /// Whether the pattern is done.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.element >= self.elements.len()
    }

    /// The result so far.
    #[must_use]
    pub fn reply(&self) -> &MismatchReply {
        &self.reply
    }

    /// Processes at most `words` words more; returns the number of accesses.
    pub fn run(&mut self, memory: &mut Memory, words: u32) -> u64 {
        self.reply.words = memory.words();
        let mut left = words;
        let mut accesses = 0;
        while left > 0 && !self.is_done() {
            let element = self.elements[self.element];
            let end = memory.words().min(self.step.saturating_add(left));
            if memory.plain {
                self.pass_plain(memory, element, self.step..end);
            } else {
                self.pass(memory, element.down, self.step..end, element.operations);
            }
            accesses += u64::from(end - self.step) * element.operations.len() as u64;
            left -= end - self.step;
            self.step = end;
            if end == memory.words() {
                self.element += 1;
                self.step = 0;
            }
        }
        accesses
    }

    /// Processes a range of words, word by word.
    fn pass(&mut self, memory: &mut Memory, down: bool, steps: Range<u32>, operations: &[Operation]) {
        let last = memory.words() - 1;
        for step in steps {
            let index = if down { last - step } else { step };
            for operation in operations {
                self.carry_out(*operation, memory, index);
            }
        }
    }

    /// Processes a range of words of a memory in which no word touches another: one operation on all words, then the
    /// next operation. Only a range with a mismatch is read word by word.
    fn pass_plain(&mut self, memory: &mut Memory, element: Element, steps: Range<u32>) {
        let words = if element.down { memory.words() - steps.end..memory.words() - steps.start } else { steps.clone() };
        for operation in element.operations {
            match *operation {
                Operation::Write(value) => memory.fill(words.clone(), value),
                Operation::Read(value) if memory.holds(words.clone(), value) => {}
                Operation::Read(_) => self.pass(memory, element.down, steps.clone(), &[*operation]),
            }
        }
    }

    #[inline]
    fn carry_out(&mut self, operation: Operation, memory: &mut Memory, index: u32) {
        match operation {
            Operation::Write(value) => memory.write(index, word(value, index, memory.width)),
            Operation::Read(value) => {
                let expected = word(value, index, memory.width) & memory.mask;
                let got = memory.read(index);
                if got != expected {
                    self.note(index, expected, got);
                }
            }
        }
    }

    #[cold]
    fn note(&mut self, index: u32, expected: u32, got: u32) {
        if self.reply.mismatches == 0 {
            self.reply.first_place = index;
            self.reply.expected = expected;
            self.reply.got = got;
        }
        self.reply.mismatches = self.reply.mismatches.saturating_add(1);
    }
}

#[inline]
fn word(value: Value, index: u32, width: u32) -> u32 {
    match value {
        Value::Same(word) => word,
        // Widths are powers of two; a division for each of a million words would take noticeable time.
        Value::Walking => 1 << (index & (width - 1)),
        Value::Index => index,
        Value::NotIndex => !index,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{Dice, RandomStream};

    const PATTERNS: [RamPattern; 5] =
        [RamPattern::Solid, RamPattern::Checkerboard, RamPattern::WalkingOnes, RamPattern::Address, RamPattern::MarchC];

    /// Runs a pattern in pieces of random size. After each piece a cell changes its content.
    fn result(faults: MemoryFaults, pattern: RamPattern, width: u32, seed: u64) -> (MismatchReply, Vec<u32>) {
        let mut dice = Dice::new(seed, RandomStream::Line);
        let mut memory = Memory::new(3000, width, faults, || 0x1234_5678);
        let mut run = PatternRun::new(pattern);
        while !run.is_done() {
            run.run(&mut memory, 1 + dice.word() % 700);
            if dice.word().is_multiple_of(4) {
                let (cell, bit) = (dice.word() % 3000, dice.word() % width);
                memory.cells[cell as usize] ^= 1 << bit;
            }
        }
        (run.reply().clone(), memory.cells)
    }

    /// A coupling whose aggressor does not exist changes nothing but the way: word by word.
    #[test]
    fn a_plain_memory_gives_the_same_in_ranges_as_word_by_word() {
        let word_by_word = vec![(u32::MAX, 0, 0)];
        let mut mismatches = 0;
        for (seed, pattern) in (1..=40).flat_map(|seed| PATTERNS.map(|pattern| (seed, pattern))) {
            for (width, stuck_data_line) in [(16, None), (32, None), (16, Some((5, true))), (32, Some((31, false)))] {
                let faults = MemoryFaults { stuck_data_line, ..MemoryFaults::default() };
                let slow = MemoryFaults { coupled_cells: word_by_word.clone(), ..faults.clone() };
                let (reply, cells) = result(faults, pattern, width, seed);
                mismatches += reply.mismatches;
                assert!((reply, cells) == result(slow, pattern, width, seed), "seed {seed}, {pattern:?}, {width} bits");
            }
        }
        assert!(mismatches > 1000, "{mismatches}");
    }
}
