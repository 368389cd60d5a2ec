//! Reads everything before the rows: a `sep=` line, title lines, the header, a row of units. Finds out how the numbers
//! below are written.
//!
//! The header is the line above the first stretch of rows. A stretch is lines with equal numbers of fields, some of
//! which are numbers. Lines above the header are titles. The header may have another delimiter than the rows, if both
//! have equal numbers of fields. The first [`HEAD`] bytes decide all of this, in whatever pieces the file comes.

use std::path::Path;

use super::TableError;
use super::names::{self, Header};
use super::number::{self, Decimal, Evidence, Form};
use super::rows::Delimiter;

/// Bytes that decide the form of a table.
pub(super) const HEAD: usize = 1 << 16;
/// Rows that are enough for a stretch, whatever follows.
const STRETCH: usize = 8;

/// Facts from the beginning of a file.
pub(super) struct Preamble {
    pub(super) header: Header,
    pub(super) delimiter: Delimiter,
    pub(super) form: Form,
    /// Bytes before the first row.
    pub(super) bytes: usize,
    /// Lines before the first row.
    pub(super) lines: usize,
    /// Fields of the first row, which show how its time stamps are written.
    pub(super) first_row: Vec<String>,
    pub(super) understood: Vec<String>,
}

/// A line of the beginning.
struct Line<'a> {
    /// Counted from 1.
    number: usize,
    text: &'a [u8],
    /// Byte after its end.
    end: usize,
}

impl<'a> Line<'a> {
    fn is_comment(&self) -> bool {
        self.text.trim_ascii_start().starts_with(b"#") || self.text.trim_ascii_start().starts_with(b"%")
    }

    /// The text of a comment without its comment signs.
    fn uncommented(&self) -> &'a [u8] {
        let text = self.text.trim_ascii_start();
        text[text.iter().take_while(|b| matches!(b, b'#' | b'%')).count()..].trim_ascii()
    }
}

/// The place of header and rows.
struct Found<'a> {
    /// The delimiter of the rows.
    delimiter: Delimiter,
    /// The delimiter of the header and of the units below it.
    above: Delimiter,
    header: &'a [u8],
    header_line: usize,
    units: Option<&'a [u8]>,
    /// Index of the first row among the lines that are neither empty nor comments.
    row: usize,
    titles: usize,
    in_comment: bool,
}

/// Reads the beginning of a text. `text` holds the first [`HEAD`] bytes and maybe more.
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
    let Some(found) = locate(&Search { all: &all, solid: &solid, decimal }, forced) else {
        return Err(no_header(all.len()));
    };
    let Found { delimiter, above, header_line, titles, .. } = found;
    if titles > 0 {
        understood.push(if titles == 1 { "1 title line".to_owned() } else { format!("{titles} title lines") });
    }
    if found.in_comment {
        understood.push("header in a comment".to_owned());
    }
    if above != delimiter {
        understood.push(format!("{} between the names, {} between the values", above.named(), delimiter.named()));
    }
    let mut texts = split(above, found.header);
    if texts.iter().all(|name| name.is_empty() || name.parse::<f64>().is_ok()) {
        return Err(no_header(header_line));
    }
    if std::str::from_utf8(found.header).is_err() {
        understood.push("Windows-1252".to_owned());
    }
    let rows = &solid[found.row.min(solid.len())..];
    let first_row = rows.first().map(|line| fields(delimiter, line.text)).unwrap_or_default();
    if first_row.len() == texts.len() + 1 && first_row.last().is_some_and(String::is_empty) {
        texts.push(String::new());
        understood.push("a delimiter at the end of each row".to_owned());
    }
    let mut units = found.units.map(|text| split(above, text));
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

/// The lines in which header and rows are searched.
#[derive(Clone, Copy)]
struct Search<'a> {
    all: &'a [Line<'a>],
    /// Lines that are neither empty nor comments.
    solid: &'a [&'a Line<'a>],
    decimal: Option<Decimal>,
}

/// The delimiter between the names of a header, compared with that of the rows.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Names {
    /// The delimiter of the rows.
    Alike,
    /// A tab, a semicolon or a comma.
    Signs,
    /// Blanks, while the rows have another delimiter.
    Blanks,
}

const SIGNS: [Delimiter; 3] = [Delimiter::Byte(b'\t'), Delimiter::Byte(b';'), Delimiter::Byte(b',')];

fn locate<'a>(search: &Search<'a>, forced: Option<Delimiter>) -> Option<Found<'a>> {
    let every = [SIGNS[0], SIGNS[1], SIGNS[2], Delimiter::Blanks];
    let tried: Vec<Delimiter> = forced.map_or_else(|| every.to_vec(), |d| vec![d]);
    // `gyro z` above `0,5` is one column with a decimal comma, not two columns. So blanks between names come last.
    for (names, least) in [(Names::Alike, 2), (Names::Signs, 2), (Names::Alike, 1), (Names::Blanks, 2)] {
        if let Some(found) = tried.iter().find_map(|d| locate_by(*d, names, least, search)) {
            return Some(found);
        }
    }
    // If nothing fits, take the first line as the header, so that the first mistake below it is reported.
    let first = *search.solid.first()?;
    let delimiter = forced.unwrap_or_else(|| Delimiter::of(first.text));
    Some(Found {
        delimiter,
        above: delimiter,
        header: first.text.trim_ascii_end(),
        header_line: first.number,
        units: None,
        row: 1,
        titles: 0,
        in_comment: false,
    })
}

fn locate_by<'a>(delimiter: Delimiter, names: Names, least: usize, search: &Search<'a>) -> Option<Found<'a>> {
    let solid = search.solid;
    let patterns: Vec<Vec<bool>> = solid.iter().map(|line| search.pattern(delimiter, line.text)).collect();
    let is_row = |i: usize| patterns[i].len() >= least && patterns[i].contains(&true);
    let mut best: Option<(usize, Found)> = None;
    for row in (0..solid.len())
        .filter(|&i| is_row(i) && (i == 0 || patterns[i - 1].len() != patterns[i].len() || !is_row(i - 1)))
    {
        let length = (row..solid.len()).take_while(|&i| is_row(i) && patterns[i].len() == patterns[row].len()).count();
        // Rows of the same kind above this row are not a title: the table begins there.
        if (0..row).any(|i| patterns[i] == patterns[row]) && best.is_some() {
            continue;
        }
        if best.as_ref().is_some_and(|(before, _)| length <= *before) {
            continue;
        }
        let above: &[Delimiter] = match names {
            Names::Alike => &[delimiter],
            // Each row may be one number with a decimal comma, in a table that has lost its other columns.
            _ if delimiter == Delimiter::Byte(b',') && (row..row + length).all(|i| search.is_number(solid[i].text)) => {
                &[]
            }
            Names::Signs => &SIGNS,
            Names::Blanks => &[Delimiter::Blanks],
        };
        let found = above.iter().find_map(|above| search.above(row, patterns[row].len(), (delimiter, *above)));
        if let Some(found) = found {
            best = Some((length, found));
            if length >= STRETCH {
                break;
            }
        }
    }
    best.map(|(_, found)| found)
}

impl<'a> Search<'a> {
    fn is_number(&self, field: &[u8]) -> bool {
        match self.decimal {
            Some(decimal) => number::read(field, Form::Known(decimal)).is_ok(),
            None => number::is_number(field),
        }
    }

    /// Whether each field of a line is a number.
    fn pattern(&self, delimiter: Delimiter, text: &[u8]) -> Vec<bool> {
        delimiter.fields(text).iter().map(|(at, end)| self.is_number(&text[*at..*end])).collect()
    }

    /// Finds header and units above a row of `fields` fields. The delimiters are those of the rows and of the header.
    fn above(&self, row: usize, fields: usize, (delimiter, above): (Delimiter, Delimiter)) -> Option<Found<'a>> {
        let (all, solid) = (self.all, self.solid);
        let first = solid[row];
        let last = delimiter.fields(first.text).last().copied();
        let ends_empty = last.is_some_and(|(at, end)| first.text[at..end].trim_ascii().is_empty());
        let fits = |text: &[u8]| is_header(text, above, fields, ends_empty);
        let units_of = |text: &[u8]| names::is_units_row(&split(above, text));
        let header = |line: &Line, text: &'a [u8], units, titles, in_comment| {
            let header_line = line.number;
            Some(Found { delimiter, above, header: text, header_line, units, row, titles, in_comment })
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
        let comments: Vec<&Line> = all.iter().filter(|l| l.number < first.number && l.is_comment()).collect();
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
}

/// Whether a line holds the names of `fields` columns.
fn is_header(text: &[u8], delimiter: Delimiter, fields: usize, ends_empty: bool) -> bool {
    // If the name of a single column holds a delimiter, the header has more columns than the rows.
    if fields == 1 && text.iter().any(|b| matches!(b, b'\t' | b';' | b',')) {
        return false;
    }
    // `t, x` has commas between its names, not blanks.
    if delimiter == Delimiter::Blanks && fields > 1 && SIGNS.iter().any(|sign| split(*sign, text).len() == fields) {
        return false;
    }
    let is_number = |text: &String| number::is_number(text.as_bytes());
    let texts = split(delimiter, text);
    let named = texts.iter().any(|t| !t.is_empty()) && !texts.iter().any(is_number);
    // `0 0` is not a name but a row with other delimiters.
    let row = split(Delimiter::Blanks, text).iter().all(is_number);
    named && !row && (texts.len() == fields || (ends_empty && texts.len() + 1 == fields))
}

/// Names or units of a line, without quotes.
fn split(delimiter: Delimiter, text: &[u8]) -> Vec<String> {
    delimiter.merged(fields(delimiter, text))
}

/// Fields of a line, without quotes.
fn fields(delimiter: Delimiter, text: &[u8]) -> Vec<String> {
    let spans = delimiter.fields(text);
    spans.iter().map(|(at, end)| number::decoded(number::unquoted(&text[*at..*end])).into_owned()).collect()
}

/// Finds out how the numbers of the first rows are written.
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
