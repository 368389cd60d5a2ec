//! What stands before the rows: a `sep=` line, title lines, the header, a row of units; and how the numbers below it are
//! written.
//!
//! The header is the line above the first stretch of rows: lines of one number of fields, of which some are numbers. What
//! stands above it is a title. All is told from the first [`HEAD`] bytes, whatever pieces the file comes in.

use std::path::Path;

use super::TableError;
use super::names::{self, Header};
use super::number::{self, Decimal, Evidence, Form};
use super::rows::Delimiter;

/// Bytes from which the form of a table is told.
pub(super) const HEAD: usize = 1 << 16;
/// Rows that make a stretch, whatever comes after it.
const STRETCH: usize = 8;

/// What was told from the beginning of a file.
pub(super) struct Preamble {
    pub(super) header: Header,
    pub(super) delimiter: Delimiter,
    pub(super) form: Form,
    /// Bytes before the first row.
    pub(super) bytes: usize,
    /// Lines before the first row.
    pub(super) lines: usize,
    /// Fields of the first row, to see how its stamps are written.
    pub(super) first_row: Vec<String>,
    pub(super) understood: Vec<String>,
}

/// A line of the beginning.
struct Line<'a> {
    /// From 1.
    number: usize,
    text: &'a [u8],
    /// Byte after its end.
    end: usize,
}

impl<'a> Line<'a> {
    fn is_comment(&self) -> bool {
        self.text.trim_ascii_start().starts_with(b"#") || self.text.trim_ascii_start().starts_with(b"%")
    }

    /// The text of a comment without its signs.
    fn uncommented(&self) -> &'a [u8] {
        let text = self.text.trim_ascii_start();
        text[text.iter().take_while(|b| matches!(b, b'#' | b'%')).count()..].trim_ascii()
    }
}

/// Where header and rows were found.
struct Found<'a> {
    delimiter: Delimiter,
    header: &'a [u8],
    header_line: usize,
    units: Option<&'a [u8]>,
    /// Place of the first row among the lines that are no comments.
    row: usize,
    titles: usize,
    in_comment: bool,
}

/// Reads the beginning of a text that holds its first [`HEAD`] bytes and maybe more.
pub(super) fn read(path: &Path, text: &[u8], decimal: Option<Decimal>) -> Result<Preamble, TableError> {
    let all = lines(text);
    let mut solid: Vec<&Line> = all.iter().filter(|l| !l.text.trim_ascii().is_empty() && !l.is_comment()).collect();
    let mut understood = Vec::new();
    let mut forced = None;
    if let Some(separator) = solid.first().and_then(|line| separator(line.text)) {
        understood.push("sep= line".to_owned());
        forced = Some(separator);
        solid.remove(0);
    }
    let no_header = |line: usize| TableError::NoHeader { path: path.to_owned(), line: line.max(1) };
    let Some(found) = locate(&all, &solid, forced) else {
        return Err(no_header(all.len()));
    };
    let Found { delimiter, header_line, titles, .. } = found;
    if titles > 0 {
        understood.push(if titles == 1 { "1 title line".to_owned() } else { format!("{titles} title lines") });
    }
    if found.in_comment {
        understood.push("header in a comment".to_owned());
    }
    let fields = |text: &[u8]| -> Vec<String> {
        let spans = delimiter.fields(text);
        spans.iter().map(|(at, end)| number::decoded(number::unquoted(&text[*at..*end])).into_owned()).collect()
    };
    let mut texts = delimiter.merged(fields(found.header));
    if texts.iter().all(|name| name.is_empty() || name.parse::<f64>().is_ok()) {
        return Err(no_header(header_line));
    }
    if std::str::from_utf8(found.header).is_err() {
        understood.push("Windows-1252".to_owned());
    }
    let rows = &solid[found.row.min(solid.len())..];
    let first_row = rows.first().map(|line| fields(line.text)).unwrap_or_default();
    if first_row.len() == texts.len() + 1 && first_row.last().is_some_and(String::is_empty) {
        texts.push(String::new());
        understood.push("a delimiter at the end of each row".to_owned());
    }
    let mut units = found.units.map(|text| delimiter.merged(fields(text)));
    if units.is_some() {
        understood.push("units row".to_owned());
    }
    let header = Header::new(path, header_line, texts, units.take())?;
    let form = match decimal {
        Some(decimal) => Form::Known(decimal),
        None => form(path, rows, delimiter, &mut understood)?,
    };
    // Rows begin after the header, the units, or the comment that holds them.
    let last =
        if found.row == 0 { all.iter().rfind(|l| solid.first().is_none_or(|s| l.number < s.number)) } else { None };
    let last = solid.get(found.row.wrapping_sub(1)).copied().or(last);
    let (bytes, lines) = last.map_or((0, 0), |line| (line.end, line.number));
    Ok(Preamble { header, delimiter, form, bytes, lines, first_row, understood })
}

/// Whole lines that begin within the first [`HEAD`] bytes.
fn lines(text: &[u8]) -> Vec<Line<'_>> {
    let mut lines = Vec::new();
    let mut at = 0;
    while at < text.len().min(HEAD) {
        let end = memchr::memchr(b'\n', &text[at..]).map_or(text.len(), |l| at + l);
        let line = text[at..end].strip_suffix(b"\r").unwrap_or(&text[at..end]);
        lines.push(Line { number: lines.len() + 1, text: line, end: (end + 1).min(text.len()) });
        at = end + 1;
    }
    lines
}

/// The delimiter that a line `sep=;` names, as spreadsheets write it.
fn separator(line: &[u8]) -> Option<Delimiter> {
    let text = number::unquoted(line.strip_suffix(b"\r").unwrap_or(line));
    let rest = text.get(4..).filter(|_| text[..4].eq_ignore_ascii_case(b"sep="))?;
    match rest {
        [] if line.ends_with(b"\t") => Some(Delimiter::Byte(b'\t')),
        [b'\\', b't'] => Some(Delimiter::Byte(b'\t')),
        [byte @ (b';' | b',' | b'|' | b'\t')] => Some(Delimiter::Byte(*byte)),
        _ => None,
    }
}

fn locate<'a>(all: &'a [Line<'a>], solid: &[&'a Line<'a>], forced: Option<Delimiter>) -> Option<Found<'a>> {
    let every = [Delimiter::Byte(b'\t'), Delimiter::Byte(b';'), Delimiter::Byte(b','), Delimiter::Blanks];
    let tried: Vec<Delimiter> = forced.map_or_else(|| every.to_vec(), |d| vec![d]);
    for least in [2, 1] {
        if let Some(found) = tried.iter().find_map(|d| locate_by(*d, least, all, solid)) {
            return Some(found);
        }
    }
    // Nothing fits: the first line is the header, so that the first mistake below it is the one that is told.
    let first = *solid.first()?;
    let delimiter = forced.unwrap_or_else(|| Delimiter::of(first.text));
    Some(Found {
        delimiter,
        header: first.text.trim_ascii_end(),
        header_line: first.number,
        units: None,
        row: 1,
        titles: 0,
        in_comment: false,
    })
}

fn locate_by<'a>(delimiter: Delimiter, least: usize, all: &'a [Line<'a>], solid: &[&'a Line<'a>]) -> Option<Found<'a>> {
    let patterns: Vec<Vec<bool>> = solid.iter().map(|line| pattern(delimiter, line.text)).collect();
    let is_row = |i: usize| patterns[i].len() >= least && patterns[i].contains(&true);
    let mut best: Option<(usize, Found)> = None;
    for row in (0..solid.len())
        .filter(|&i| is_row(i) && (i == 0 || patterns[i - 1].len() != patterns[i].len() || !is_row(i - 1)))
    {
        let length = (row..solid.len()).take_while(|&i| is_row(i) && patterns[i].len() == patterns[row].len()).count();
        // Rows of the same kind above it are no title: the table begins there.
        if (0..row).any(|i| patterns[i] == patterns[row]) && best.is_some() {
            continue;
        }
        if best.as_ref().is_some_and(|(before, _)| length <= *before) {
            continue;
        }
        if let Some(found) = above(delimiter, row, &patterns, all, solid) {
            best = Some((length, found));
            if length >= STRETCH {
                break;
            }
        }
    }
    best.map(|(_, found)| found)
}

/// Which fields of a line are numbers.
fn pattern(delimiter: Delimiter, text: &[u8]) -> Vec<bool> {
    delimiter.fields(text).iter().map(|(at, end)| number::is_number(&text[*at..*end])).collect()
}

/// Header and units above a row.
fn above<'a>(
    delimiter: Delimiter,
    row: usize,
    patterns: &[Vec<bool>],
    all: &'a [Line<'a>],
    solid: &[&'a Line<'a>],
) -> Option<Found<'a>> {
    let fields = patterns[row].len();
    let ends_empty = delimiter
        .fields(solid[row].text)
        .last()
        .is_some_and(|(at, end)| solid[row].text[*at..*end].trim_ascii().is_empty());
    let fits = |text: &[u8]| {
        // A single column whose name holds a delimiter is a header of more columns than the rows have.
        if fields == 1 && text.iter().any(|b| matches!(b, b'\t' | b';' | b',')) {
            return false;
        }
        let texts: Vec<String> = split(delimiter, text);
        let named = texts.iter().any(|t| !t.is_empty()) && !texts.iter().any(|t| number::is_number(t.as_bytes()));
        named && (texts.len() == fields || (ends_empty && texts.len() + 1 == fields))
    };
    let units_of = |text: &[u8]| names::is_units_row(&split(delimiter, text));
    let header = |line: &'a Line<'a>, text: &'a [u8], units, titles, in_comment| {
        Some(Found { delimiter, header: text, header_line: line.number, units, row, titles, in_comment })
    };
    let trimmed = |line: &'a Line<'a>| line.text.trim_ascii_end();
    if row > 0 {
        let line = solid[row - 1];
        if !fits(trimmed(line)) {
            return None;
        }
        if row > 1 && fits(trimmed(solid[row - 2])) && units_of(trimmed(line)) {
            return header(solid[row - 2], trimmed(solid[row - 2]), Some(trimmed(line)), row - 2, false);
        }
        return header(line, trimmed(line), None, row - 1, false);
    }
    // The comments right above the first row.
    let comments: Vec<&Line> = all.iter().filter(|l| l.number < solid[row].number && l.is_comment()).collect();
    let last = *comments.last()?;
    if !fits(last.uncommented()) {
        return None;
    }
    match comments.len().checked_sub(2).map(|i| comments[i]) {
        Some(before) if fits(before.uncommented()) && units_of(last.uncommented()) => {
            header(before, before.uncommented(), Some(last.uncommented()), 0, true)
        }
        _ => header(last, last.uncommented(), None, 0, true),
    }
}

fn split(delimiter: Delimiter, text: &[u8]) -> Vec<String> {
    let spans = delimiter.fields(text);
    let texts = spans.iter().map(|(at, end)| number::decoded(number::unquoted(&text[*at..*end])).into_owned());
    delimiter.merged(texts.collect())
}

/// How the numbers of the first rows are written.
fn form(path: &Path, rows: &[&Line], delimiter: Delimiter, understood: &mut Vec<String>) -> Result<Form, TableError> {
    let mut proofs: [Option<(usize, String)>; 2] = [None, None];
    let mut thousands = false;
    for line in rows {
        for (at, end) in delimiter.fields(line.text) {
            let field = &line.text[at..end];
            let (evidence, divided) = number::evidence(field);
            let place = match evidence {
                Evidence::Proves(Decimal::Comma) => 0,
                Evidence::Proves(Decimal::Point) => 1,
                Evidence::Either | Evidence::None => continue,
            };
            thousands |= divided;
            proofs[place].get_or_insert_with(|| (line.number, number::decoded(number::unquoted(field)).into_owned()));
        }
    }
    if thousands {
        understood.push("thousands separators".to_owned());
    }
    match proofs {
        [Some((comma_line, comma)), Some((point_line, point))] => {
            Err(TableError::MixedDecimals { path: path.to_owned(), comma_line, comma, point_line, point })
        }
        [Some(_), None] => {
            understood.insert(0, "decimal comma".to_owned());
            Ok(Form::Known(Decimal::Comma))
        }
        [None, Some(_)] => Ok(Form::Known(Decimal::Point)),
        [None, None] => Ok(Form::Open),
    }
}
