//! Pieces in which every row is plain: as many fields as the header, no quotes, no comment, and numbers in the columns that
//! are wanted. Nearly all pieces of a long record are, and the columns of such a piece are read one by one, at twice the
//! speed. Whatever else a piece holds, and every mistake in it, is left to [`Rows`].

use wide::u8x16;

use super::LONGEST_LINE;
use super::number::Form;
use super::rows::{Delimiter, Parsed, Role, Rows};

/// Bytes that are compared at once, four times in a row: fields are too short for a search of its own each.
const WIDTH: usize = 16;
const WORD: usize = 4 * WIDTH;
/// Marks of a word that are written without a question: more of them are rare.
const USUAL: usize = 8;

/// Reads a piece; `None` where it is not plain.
pub(super) fn parse(rows: &Rows, piece: &[u8]) -> Option<Parsed> {
    let Delimiter::Byte(delimiter) = rows.delimiter else { return None };
    // Those of a decimal point alone.
    if !matches!(rows.form, Form::Open | Form::Known(super::Decimal::Point)) || memchr::memchr(b'"', piece).is_some() {
        return None;
    }
    let marks = marks(piece, delimiter);
    let lines = memchr::memchr_iter(b'\n', piece).count();
    if lines == 0 || piece.last() != Some(&b'\n') || marks.len() != lines * rows.expected {
        return None;
    }
    // As many line ends as rows, and one behind each row: there is none within a row.
    let mut start = 0;
    for row in marks.chunks_exact(rows.expected) {
        let end = *row.last()? as usize;
        let first = piece[start];
        let is_plain = first != b'#' && first != b'%' && first != delimiter && !first.is_ascii_whitespace();
        if piece[end] != b'\n' || !is_plain || end - start > LONGEST_LINE {
            return None;
        }
        start = end + 1;
    }
    let mut parsed = Parsed { numbers: vec![Vec::new(); rows.numbers], rows: lines, lines, ..Parsed::default() };
    for (column, role) in rows.roles {
        let values = match role {
            Role::Number(k) => parsed.numbers.get_mut(*k)?,
            Role::Time { dates: false } => &mut parsed.times,
            _ => return None,
        };
        *values = numbers(piece, &marks, rows.expected, *column)?;
    }
    Some(parsed)
}

/// The numbers of a column.
fn numbers(piece: &[u8], marks: &[u32], expected: usize, column: usize) -> Option<Vec<f64>> {
    let ends = marks.iter().skip(column).step_by(expected);
    // The mark before a field is that of the field before, in the same row or in the row before.
    let starts = marks.iter().skip((column + expected - 1) % expected).step_by(expected);
    let first = if column == 0 { Some(&u32::MAX) } else { None };
    let mut values = Vec::with_capacity(marks.len() / expected);
    for (before, end) in first.into_iter().chain(starts).zip(ends) {
        let field = piece.get(before.wrapping_add(1) as usize..*end as usize)?;
        let field = field.strip_suffix(b"\r").unwrap_or(field);
        values.push(fast_float2::parse(field).ok()?);
    }
    Some(values)
}

/// Places of all delimiters and line ends.
fn marks(text: &[u8], delimiter: u8) -> Vec<u32> {
    let (delimiters, ends) = (u8x16::splat(delimiter), u8x16::splat(b'\n'));
    let of = |bytes: &[u8; WIDTH]| {
        let bytes = u8x16::new(*bytes);
        u64::from((bytes.simd_eq(delimiters) | bytes.simd_eq(ends)).to_bitmask())
    };
    let (words, rest) = text.as_chunks::<WORD>();
    let mut marks = Vec::with_capacity(text.len() / 4);
    for (k, word) in words.iter().enumerate() {
        let chunks = word.as_chunks::<WIDTH>().0;
        let mut found = chunks.iter().rev().fold(0, |found, chunk| found << WIDTH | of(chunk));
        let count = found.count_ones() as usize;
        let mut places = [0; WORD];
        let mut next = || {
            let place = (k * WORD) as u32 + found.trailing_zeros();
            found &= found.wrapping_sub(1);
            place
        };
        // A fixed number of steps, since the processor cannot foresee how many there are.
        places[..USUAL].fill_with(&mut next);
        if count > USUAL {
            places[USUAL..count].fill_with(next);
        }
        marks.extend_from_slice(&places[..count]);
    }
    let start = text.len() - rest.len();
    let is_mark = |byte: u8| byte == delimiter || byte == b'\n';
    marks.extend(rest.iter().enumerate().filter(|(_, byte)| is_mark(**byte)).map(|(at, _)| (start + at) as u32));
    marks
}

#[cfg(test)]
mod tests {
    use super::super::Decimal;
    use super::*;

    const ROLES: [(usize, Role); 3] = [(2, Role::Number(0)), (0, Role::Time { dates: false }), (3, Role::Number(1))];

    fn rows(roles: &[(usize, Role)]) -> Rows<'_> {
        Rows {
            delimiter: Delimiter::Byte(b','),
            expected: 4,
            roles,
            numbers: 2,
            allowed: &[],
            form: Form::Known(Decimal::Point),
            capture: None,
            unlabelled: false,
        }
    }

    /// The row-by-row reading is the reference: the same columns, whatever lies at the ends of words.
    #[test]
    fn plain_rows_are_read_as_one_by_one() {
        for end in ["\n", "\r\n"] {
            let mut text = String::new();
            for row in 0..500 {
                let digits = "123456789012345678".get(..row % 17).unwrap_or_default();
                text += &format!("{row},{digits}, -{row}.{row}e-3,0.{row}{end}").replace(", -", ",-");
            }
            // Fields without anything in a column that is not wanted are plain; every third row has marks close together.
            let found = parse(&rows(&ROLES), text.as_bytes()).unwrap();
            let expected = rows(&ROLES).one_by_one(text.as_bytes());
            assert_eq!(format!("{found:?}"), format!("{expected:?}"));
            assert_eq!((found.rows, found.times[499], found.numbers[0][7]), (500, 499.0, -7.7e-3));
        }
        let dense = "1,,2,3\n".repeat(100);
        assert_eq!(marks(dense.as_bytes(), b',').len(), 400);
        assert_eq!(marks(&[b','; 200], b','), (0..200).collect::<Vec<u32>>());
    }

    #[test]
    fn what_is_not_plain_is_left_to_the_other() {
        let good = "1,2,3,4\n".repeat(40);
        assert!(parse(&rows(&ROLES), good.as_bytes()).is_some());
        for odd in [
            "#,2,3,4\n",
            "%,2,3,4\n",
            " 1,2,3,4\n",
            ",2,3,4\n",
            "\n",
            "1,2,3\n",
            "1,2,3,4,5\n",
            "1,2,3\n1,2,3,4,5\n",
            "1,2,x,4\n",
            "1,2,,4\n",
            "1,2,3,4",
            "1,\"2\",3,4\n",
        ] {
            let text = format!("{good}{odd}");
            assert!(parse(&rows(&ROLES), text.as_bytes()).is_none(), "{odd:?}");
            let text = format!("{odd}{good}");
            assert!(parse(&rows(&ROLES), text.as_bytes()).is_none(), "{odd:?}");
        }
        let labels = [(0, Role::Label)];
        assert!(parse(&rows(&labels), good.as_bytes()).is_none());
    }
}
