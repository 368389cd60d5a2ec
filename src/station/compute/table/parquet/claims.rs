//! What a Parquet file claims of itself. The library believes it: it makes room for as many columns and values as a file
//! names, and goes as deep as its columns do. So the claims are looked at here first.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek as _, SeekFrom};

use flate2::read::MultiGzDecoder;

use super::thrift::{Thrift, kind};

/// The mark at both ends.
const MAGIC: &[u8; 4] = b"PAR1";
/// Bytes behind the footer: its length and the mark.
const TAIL: u64 = 8;
/// Longest footer. It becomes up to fifty times as long in memory; a day of twenty columns at 1 kHz has 3 MB.
const LONGEST_FOOTER: u64 = 8 << 20;
/// Most columns, and structures around them: a table has them side by side.
const MOST_COLUMNS: usize = 10_000;
/// Most stretches of rows that a file is cut into. Each takes its columns times some hundred bytes.
const MOST_GROUPS: u64 = 100_000;
/// Deepest structure of columns: a list within a list has six levels.
const DEEPEST: usize = 16;
/// Longest name of a column. Each column keeps the names of all structures around it.
const LONGEST_NAME: u64 = 1024;
/// Longest head of a page. Some writers put the least and the greatest text into it.
const LONGEST_HEAD: u64 = 1 << 20;
/// Most bytes that a page unpacks to. Pages are unpacked as a whole, and some writers make one of 50 million numbers.
const LARGEST_PAGE: u64 = 512 << 20;
/// Most different values that a page of them may have. A text of it takes 40 bytes beside its own.
const MOST_DIFFERENT: u64 = 1 << 23;
/// Fewest bytes of such a value: one of a fixed length may have a single byte.
const OF_DIFFERENT: u64 = 1;

/// Why the claims are refused.
#[derive(Debug, thiserror::Error)]
pub(super) enum Claim {
    #[error("it does not end as a Parquet file does")]
    NoEnd,
    #[error("its footer claims {claimed} bytes of a file of {bytes} bytes")]
    FooterBeyond { claimed: u64, bytes: u64 },
    #[error("its footer has {bytes} bytes and at most {LONGEST_FOOTER} are read")]
    LongFooter { bytes: u64 },
    #[error("its footer is damaged")]
    Footer,
    #[error("it has more than {MOST_COLUMNS} columns")]
    Columns,
    #[error("its columns claim to be nested more than {DEEPEST} deep")]
    Deep,
    #[error("a column has a name of more than {LONGEST_NAME} bytes")]
    Name,
    #[error("it has more than {MOST_GROUPS} groups of rows")]
    Groups,
    #[error("a column claims bytes outside of the file")]
    Outside,
    #[error("its columns claim more bytes than the file has")]
    Overlapping,
    #[error("a page claims more than its column holds")]
    Page,
    #[error("a page unpacks to more than {} MiB", LARGEST_PAGE >> 20)]
    LargePage,
    #[error("a page unpacks to more than it claims")]
    Swollen,
}

impl From<io::Error> for Claim {
    fn from(_: io::Error) -> Self {
        Self::Footer
    }
}

/// Looks at the footer: its place and its length, and the columns and groups that it names.
pub(super) fn check_footer(mut file: &File, bytes: u64) -> Result<(), Claim> {
    let behind = bytes.checked_sub(TAIL + MAGIC.len() as u64).ok_or(Claim::NoEnd)?;
    let mut tail = [0; TAIL as usize];
    file.seek(SeekFrom::Start(bytes - TAIL))?;
    file.read_exact(&mut tail)?;
    let [l0, l1, l2, l3, mark @ ..] = tail;
    if mark != *MAGIC {
        return Err(Claim::NoEnd);
    }
    let claimed = u64::from(u32::from_le_bytes([l0, l1, l2, l3]));
    if claimed > behind {
        return Err(Claim::FooterBeyond { claimed, bytes });
    }
    if claimed > LONGEST_FOOTER {
        return Err(Claim::LongFooter { bytes: claimed });
    }
    let mut footer = vec![0; claimed as usize];
    file.seek(SeekFrom::Start(bytes - TAIL - claimed))?;
    file.read_exact(&mut footer)?;
    footer_of(&footer)
}

fn footer_of(footer: &[u8]) -> Result<(), Claim> {
    let mut thrift = Thrift::new(footer, footer.len() as u64);
    let mut before = 0;
    while let Some((number, of)) = thrift.field(before)? {
        match (number, of) {
            (2, kind::LIST) => columns(&mut thrift)?,
            (4, kind::LIST) => {
                let (of, groups) = thrift.list()?;
                if groups > MOST_GROUPS {
                    return Err(Claim::Groups);
                }
                (0..groups).try_for_each(|_| thrift.skip(of))?;
            }
            // The library reads these two as lists whatever they say.
            (2 | 4, _) => return Err(Claim::Footer),
            _ => thrift.skip(of)?,
        }
        before = number;
    }
    Ok(())
}

/// The columns stand as a tree: each structure says how many follow that are of it.
fn columns(thrift: &mut Thrift<&[u8]>) -> Result<(), Claim> {
    let (of, elements) = thrift.list()?;
    let elements = usize::try_from(elements).unwrap_or(usize::MAX);
    if elements > MOST_COLUMNS {
        return Err(Claim::Columns);
    }
    if of != kind::STRUCT && elements > 0 {
        return Err(Claim::Footer);
    }
    let mut open: Vec<usize> = Vec::new();
    for _ in 0..elements {
        let mut children = 0;
        let mut before = 0;
        while let Some((number, of)) = thrift.field(before)? {
            match (number, of) {
                (4, kind::BINARY) if thrift.text()? > LONGEST_NAME => return Err(Claim::Name),
                (4, kind::BINARY) => {}
                (5, kind::INT) => children = thrift.int()?,
                (1..=3 | 6..=9, kind::INT) => thrift.skip(of)?,
                (1..=9, _) => return Err(Claim::Footer),
                _ => thrift.skip(of)?,
            }
            before = number;
        }
        let children = usize::try_from(children).ok().filter(|children| *children <= elements);
        if let Some(of) = open.last_mut() {
            *of -= 1;
        }
        open.push(children.ok_or(Claim::Footer)?);
        if open.len() > DEEPEST {
            return Err(Claim::Deep);
        }
        while open.last() == Some(&0) {
            open.pop();
        }
    }
    Ok(())
}

/// Where a column of a group of rows lies, and how it is packed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stretch {
    /// First byte.
    pub(super) start: i64,
    /// Number of bytes.
    pub(super) bytes: i64,
    /// Whether its pages are packed with gzip.
    pub(super) gzip: bool,
}

/// Looks at the pages of a column. All of its stretches together may be no longer than the file.
pub(super) fn check_pages(
    file: &File,
    file_bytes: u64,
    stretches: impl Iterator<Item = Stretch>,
    most_unpacked: impl Fn(u64) -> u64,
) -> Result<(), Claim> {
    let mut in_all = 0_u64;
    for stretch in stretches {
        let place = u64::try_from(stretch.start).ok().zip(u64::try_from(stretch.bytes).ok());
        let inside = place.filter(|(start, bytes)| start.checked_add(*bytes).is_some_and(|end| end <= file_bytes));
        let (start, bytes) = inside.ok_or(Claim::Outside)?;
        in_all = in_all.saturating_add(bytes);
        if in_all > file_bytes {
            return Err(Claim::Overlapping);
        }
        pages(file, (start, bytes), stretch.gzip, most_unpacked(bytes)).map_err(|claim| match claim {
            Claim::Footer => Claim::Page,
            claim => claim,
        })?;
    }
    Ok(())
}

fn pages(mut file: &File, (start, mut left): (u64, u64), gzip: bool, most: u64) -> Result<(), Claim> {
    file.seek(SeekFrom::Start(start))?;
    let mut source = BufReader::new(file);
    let mut unpacked = 0_u64;
    while left > 0 {
        let mut thrift = Thrift::new(&mut source, left.min(LONGEST_HEAD));
        let page = page_head(&mut thrift)?;
        left -= thrift.bytes_read();
        if page.packed > left
            || page.different.is_some_and(|different| different > MOST_DIFFERENT.min(page.unpacked / OF_DIFFERENT))
        {
            return Err(Claim::Page);
        }
        unpacked = unpacked.saturating_add(page.unpacked);
        if page.unpacked > LARGEST_PAGE {
            return Err(Claim::LargePage);
        }
        if unpacked > most || page.levels > page.unpacked.min(page.packed) {
            return Err(Claim::Page);
        }
        left -= page.packed;
        if gzip && page.is_packed {
            // The library unpacks as much as comes.
            io::copy(&mut source.by_ref().take(page.levels), &mut io::sink())?;
            let mut packed = source.by_ref().take(page.packed - page.levels);
            let got = io::copy(&mut MultiGzDecoder::new(&mut packed).take(page.unpacked + 1), &mut io::sink());
            io::copy(&mut packed, &mut io::sink())?;
            if got.is_ok_and(|got| got > page.unpacked) {
                return Err(Claim::Swollen);
            }
        } else {
            source.seek_relative(i64::try_from(page.packed).map_err(|_| Claim::Page)?)?;
        }
    }
    Ok(())
}

/// What the head of a page claims.
struct PageHead {
    packed: u64,
    unpacked: u64,
    /// Different values, if it is a page of them.
    different: Option<u64>,
    /// Bytes before the values that are never packed.
    levels: u64,
    is_packed: bool,
}

fn page_head(thrift: &mut Thrift<impl Read>) -> Result<PageHead, Claim> {
    let (mut packed, mut unpacked, mut different, mut levels, mut is_packed) = (0, 0, None, [0, 0], true);
    let mut before = 0;
    while let Some((number, of)) = thrift.field(before)? {
        match (number, of) {
            (2, kind::INT) => unpacked = thrift.int()?,
            (3, kind::INT) => packed = thrift.int()?,
            (1, kind::INT) => thrift.skip(of)?,
            (7 | 8, kind::STRUCT) => {
                let mut within = 0;
                while let Some((inner, of)) = thrift.field(within)? {
                    match (number, inner, of) {
                        (7, 1, kind::INT) => different = Some(u64::try_from(thrift.int()?).map_err(|_| Claim::Page)?),
                        (8, 5, kind::INT) => levels[0] = thrift.int()?,
                        (8, 6, kind::INT) => levels[1] = thrift.int()?,
                        (8, 7, kind::TRUE | kind::FALSE) => is_packed = of == kind::TRUE,
                        (7, 1, _) | (8, 5..=7, _) => return Err(Claim::Page),
                        _ => thrift.skip(of)?,
                    }
                    within = inner;
                }
            }
            (1..=3 | 7 | 8, _) => return Err(Claim::Page),
            _ => thrift.skip(of)?,
        }
        before = number;
    }
    let positive = |claimed: i64| u64::try_from(claimed).ok().filter(|claimed| *claimed <= i32::MAX as u64);
    let both = positive(levels[0]).zip(positive(levels[1])).map(|(repetition, definition)| repetition + definition);
    let sizes = positive(packed).zip(positive(unpacked)).zip(both);
    let ((packed, unpacked), levels) = sizes.ok_or(Claim::Page)?;
    Ok(PageHead { packed, unpacked, different, levels, is_packed })
}
