//! Pages that were unpacked, looked at before their values are: some forms begin with a number of values of their own, and
//! the library makes room for it. What else contradicts itself in them the library finds while it reads, and gives up.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

use ::parquet::basic::Encoding;
use ::parquet::column::page::{Page, PageMetadata, PageReader};
use ::parquet::errors::{ParquetError, Result};

/// Longest block of differences, values. Writers use 128.
const LONGEST_BLOCK: u64 = 1 << 16;
/// Bytes before the levels of a page of the first version: their length.
const LEVELS_HEAD: usize = 4;

/// Passes pages on whose claims fit them.
pub(super) struct CheckedPages {
    pages: Box<dyn PageReader>,
    /// Whether values may be missing, so that levels stand before them.
    levels: bool,
}

impl CheckedPages {
    pub(super) fn new(pages: Box<dyn PageReader>, levels: bool) -> Self {
        Self { pages, levels }
    }

    fn is_sound(&self, page: &Page) -> bool {
        let (values, count) = match page {
            Page::DictionaryPage { .. } => return true,
            Page::DataPage { buf, num_values, def_level_encoding, .. } => {
                let behind = match def_level_encoding {
                    _ if !self.levels => Some(0),
                    Encoding::RLE => buf
                        .first_chunk::<LEVELS_HEAD>()
                        .and_then(|length| usize::try_from(u32::from_le_bytes(*length)).ok()?.checked_add(LEVELS_HEAD)),
                    // The other form has a bit for each value.
                    _ => usize::try_from(num_values.div_ceil(8)).ok(),
                };
                (behind.and_then(|behind| buf.get(behind..)), *num_values)
            }
            Page::DataPageV2 { buf, num_values, def_levels_byte_len, rep_levels_byte_len, .. } => {
                let behind = usize::try_from(u64::from(*def_levels_byte_len) + u64::from(*rep_levels_byte_len)).ok();
                (behind.and_then(|behind| buf.get(behind..)), *num_values)
            }
        };
        let Some(values) = values else { return false };
        match page.encoding() {
            Encoding::DELTA_BINARY_PACKED | Encoding::DELTA_LENGTH_BYTE_ARRAY => {
                Differences::of(values).is_some_and(|differences| differences.are_at_most(count))
            }
            Encoding::DELTA_BYTE_ARRAY => {
                let beginnings = Differences::of(values);
                let ends = beginnings.as_ref().and_then(|beginnings| Differences::of(beginnings.behind()?));
                [beginnings, ends].iter().all(|part| part.as_ref().is_some_and(|part| part.are_at_most(count)))
            }
            _ => true,
        }
    }
}

impl Iterator for CheckedPages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

impl PageReader for CheckedPages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        match self.pages.get_next_page()? {
            Some(page) if !self.is_sound(&page) => {
                Err(ParquetError::General("a page claims more values than it has".to_owned()))
            }
            page => Ok(page),
        }
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        self.pages.peek_next_page()
    }

    fn skip_next_page(&mut self) -> Result<()> {
        self.pages.skip_next_page()
    }
}

/// Whole numbers as differences in blocks
/// (<https://github.com/apache/parquet-format/blob/master/Encodings.md>, `DELTA_BINARY_PACKED`).
struct Differences<'a> {
    block: u64,
    parts: u64,
    count: u64,
    /// The blocks and what follows.
    rest: &'a [u8],
}

impl<'a> Differences<'a> {
    fn of(mut rest: &'a [u8]) -> Option<Self> {
        let mut number = || {
            let mut number = 0_u64;
            for place in 0..10 {
                let (byte, behind) = rest.split_first()?;
                rest = behind;
                number |= u64::from(byte & 0x7f) << (7 * place);
                if byte & 0x80 == 0 {
                    return Some(number);
                }
            }
            None
        };
        let (block, parts, count, _first) = (number()?, number()?, number()?, number()?);
        let sound = (1..=LONGEST_BLOCK).contains(&block) && (1..=block).contains(&parts);
        sound.then_some(Self { block, parts, count, rest })
    }

    fn are_at_most(&self, count: u32) -> bool {
        self.count <= u64::from(count)
    }

    /// What stands behind the blocks.
    fn behind(&self) -> Option<&'a [u8]> {
        let mut rest = self.rest;
        let mut left = self.count.saturating_sub(1);
        let parts = usize::try_from(self.parts).ok()?;
        let of_part = self.block / self.parts;
        while left > 0 {
            let least = rest.iter().position(|byte| byte & 0x80 == 0)?;
            let (widths, mut values) = rest.get(least + 1..)?.split_at_checked(parts)?;
            for width in widths {
                if left == 0 {
                    break;
                }
                values = values.get(usize::try_from(of_part.checked_mul(u64::from(*width))?.div_ceil(8)).ok()?..)?;
                left = left.saturating_sub(of_part.max(1));
            }
            rest = values;
        }
        Some(rest)
    }
}

thread_local! {
    /// Whether this thread reads what may make the library give up.
    static READS: Cell<bool> = const { Cell::new(false) };
}

/// Reads with the library. Where values contradict each other it panics; here that is an error like another, and nothing is told of
/// it beside that.
pub(super) fn guarded<T>(read: impl FnOnce() -> Result<T>) -> Result<T> {
    static QUIET: Once = Once::new();
    QUIET.call_once(|| {
        let tell = take_hook();
        set_hook(Box::new(move |info| {
            if !READS.get() {
                tell(info);
            }
        }));
    });
    READS.set(true);
    // What was being read is dropped with the error.
    let done = catch_unwind(AssertUnwindSafe(read));
    READS.set(false);
    done.unwrap_or_else(|_| Err(ParquetError::General("its values contradict each other".to_owned())))
}
