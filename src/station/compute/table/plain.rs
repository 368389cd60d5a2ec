//! The fast reader for plain pieces. In a plain piece each row has as many fields as the header, no quotes and no
//! comment, and numbers in the wanted columns. Nearly all pieces of a long record are plain. One pass marks where
//! fields and rows end; then only the fields of the wanted columns are read. [`ParsedRows`] reads all other pieces, and
//! reports every mistake.

use wide::u8x16;

use super::LONGEST_LINE;
use super::gathered::Gathered;
use super::number::Form;
use super::rows::{Delimiter, Parsed, ParsedRows, Role};

/// Bytes that are compared at once, four times in a row: fields are too short for one search each.
const WIDTH: usize = 16;
/// Bytes whose marks fit into the bits of one number.
const WORD: usize = 4 * WIDTH;

/// Reads a piece; `None` if it is not plain.
pub(super) fn parse(rows: &ParsedRows, piece: &[u8]) -> Option<Parsed> {
    let Delimiter::Byte(delimiter) = rows.delimiter else { return None };
    // Only numbers with a decimal point are plain.
    if !matches!(rows.form, Form::Open | Form::Known(super::Decimal::Point)) {
        return None;
    }
    let grid = Grid::of(piece, delimiter, rows.expected)?;
    let lines = grid.starts.len();
    let mut found = Gathered { numbers: vec![Vec::new(); rows.numbers], rows: lines, ..Gathered::default() };
    for (column, role) in rows.roles {
        let values = match role {
            Role::Number(k) => found.numbers.get_mut(*k)?,
            Role::Time { dates: false } => &mut found.times,
            _ => return None,
        };
        *values = grid.numbers(piece, delimiter, *column)?;
    }
    Some(Parsed { found, lines, fault: None })
}

/// The places of the rows and fields of a piece.
struct Grid {
    /// First byte of each row.
    starts: Vec<u32>,
    marks: Marks,
}

impl Grid {
    /// Finds rows and fields. `None` if the piece has a quote, or if a row does not end, has another number of fields,
    /// or does not begin like a number.
    fn of(piece: &[u8], delimiter: u8, expected: usize) -> Option<Self> {
        if piece.last() != Some(&b'\n') {
            return None;
        }
        let mut marks = Vec::with_capacity(piece.len() / WORD + 2);
        let mut starts = Vec::with_capacity(piece.len() / (2 * expected).max(1));
        let (words, rest) = piece.as_chunks::<WORD>();
        let mut last = [0; WORD];
        last[..rest.len()].copy_from_slice(rest);
        // `before`: fields that ended before this word. `due`: fields that the rows so far must have.
        let (mut before, mut due) = (0, 0);
        let mut start = 0;
        for (k, word) in words.iter().chain([&last]).enumerate() {
            let Found { delimiters, mut ends, quotes } = Found::of(word, delimiter);
            if quotes {
                return None;
            }
            let fields = delimiters | ends;
            while ends != 0 {
                let place = ends.trailing_zeros();
                ends &= ends - 1;
                let end = k * WORD + place as usize;
                let count = before + (fields & (u64::MAX >> (63 - place))).count_ones() as usize;
                due += expected;
                // Blanks, comment signs and other bytes below `-` in ASCII, except `+`, do not begin a number.
                let first = piece[start];
                let is_plain = (first >= b'-' || first == b'+') && first != delimiter;
                if count != due || !is_plain || end - start > LONGEST_LINE {
                    return None;
                }
                starts.push(start as u32);
                start = end + 1;
            }
            before += fields.count_ones() as usize;
            marks.push(fields);
        }
        marks.push(0);
        Some(Self { starts, marks: Marks(marks) })
    }

    /// The numbers of a column.
    fn numbers(&self, piece: &[u8], delimiter: u8, column: usize) -> Option<Vec<f64>> {
        let mut values = Vec::with_capacity(self.starts.len());
        for start in &self.starts {
            let start = *start as usize;
            let at = if column == 0 { start } else { self.marks.behind(start, column - 1)? + 1 };
            let (value, length) = fast_float2::parse_partial(piece.get(at..)?).ok()?;
            let mut end = *piece.get(at + length)?;
            if end == b'\r' {
                end = *piece.get(at + length + 1)?;
            }
            // Otherwise the field holds more than the number.
            if end != delimiter && end != b'\n' {
                return None;
            }
            values.push(value);
        }
        Some(values)
    }
}

/// A bit for each byte of a piece, the lowest one first: whether a field ends there. An empty word follows.
struct Marks(Vec<u64>);

impl Marks {
    /// Place of the first mark after skipping `others` marks, from byte `from` on.
    fn behind(&self, mut from: usize, mut others: usize) -> Option<usize> {
        loop {
            let word = self.word(from)?;
            let count = word.count_ones() as usize;
            if others < count {
                let bits = (0..others).fold(word, |bits, _| bits & (bits - 1));
                return Some(from + bits.trailing_zeros() as usize);
            }
            others -= count;
            from += WORD;
        }
    }

    /// The bits of 64 bytes, from byte `from` on.
    fn word(&self, from: usize) -> Option<u64> {
        let [low, high] = self.0.get(from / WORD..)?.first_chunk()?;
        let shift = from % WORD;
        Some(low >> shift | (high << 1) << (WORD - 1 - shift))
    }
}

/// The signs that the bytes of a word hold.
struct Found {
    delimiters: u64,
    ends: u64,
    quotes: bool,
}

impl Found {
    fn of(word: &[u8; WORD], delimiter: u8) -> Self {
        let [delimiter, end, quote] = [delimiter, b'\n', b'"'].map(u8x16::splat);
        let mut found = Self { delimiters: 0, ends: 0, quotes: false };
        let mut quotes = u8x16::splat(0);
        for bytes in word.as_chunks::<WIDTH>().0.iter().rev() {
            let bytes = u8x16::new(*bytes);
            found.delimiters = found.delimiters << WIDTH | u64::from(bytes.simd_eq(delimiter).to_bitmask());
            found.ends = found.ends << WIDTH | u64::from(bytes.simd_eq(end).to_bitmask());
            quotes |= bytes.simd_eq(quote);
        }
        found.quotes = quotes.to_bitmask() != 0;
        found
    }
}

#[cfg(test)]
mod tests {
    use super::super::Decimal;
    use super::*;

    const ROLES: [(usize, Role); 3] = [(2, Role::Number(0)), (0, Role::Time { dates: false }), (3, Role::Number(1))];

    fn rows(roles: &[(usize, Role)]) -> ParsedRows<'_> {
        ParsedRows {
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

    /// Places of all delimiters and line ends, each search starting behind the last place.
    fn marks(text: &[u8], delimiter: u8) -> Vec<u32> {
        let words = text.chunks(WORD).map(|word| {
            let mut whole = [0; WORD];
            whole[..word.len()].copy_from_slice(word);
            let found = Found::of(&whole, delimiter);
            found.delimiters | found.ends
        });
        let marks = Marks(words.chain([0]).collect());
        let first = marks.behind(0, 0);
        std::iter::successors(first, |place| marks.behind(place + 1, 0)).map(|place| place as u32).collect()
    }

    /// The row-by-row reader is the reference: both give the same columns, whatever stands at the ends of words.
    #[test]
    fn plain_rows_are_read_as_one_by_one() {
        for end in ["\n", "\r\n"] {
            let mut text = String::new();
            for row in 0..500 {
                let digits = "123456789012345678".get(..row % 17).unwrap_or_default();
                text += &format!("{row},{digits}, -{row}.{row}e-3,0.{row}{end}").replace(", -", ",-");
            }
            // Empty fields are plain in a column that is not wanted. Every third row has marks close together.
            let found = parse(&rows(&ROLES), text.as_bytes()).unwrap();
            let expected = rows(&ROLES).one_by_one(text.as_bytes());
            assert_eq!(format!("{found:?}"), format!("{expected:?}"));
            let found = found.found;
            assert_eq!((found.rows, found.times[499], found.numbers[0][7]), (500, 499.0, -7.7e-3));
        }
        let dense = "1,,2,3\n".repeat(100);
        assert_eq!(marks(dense.as_bytes(), b',').len(), 400);
        assert_eq!(marks(&[b','; 200], b','), (0..200).collect::<Vec<u32>>());
    }

    /// Rows of 1 to 9 words: every column is found, however far from the beginning of its row.
    #[test]
    fn far_columns_are_found() {
        let roles = [0, 1, 2, 3].map(|column| (column, Role::Number(column)));
        let mut text = String::new();
        for row in 0..400_usize {
            let wide = |shift: usize| format!("{:.*}", (row * 37 + shift * 59) % 140, row as f64 / 7.0);
            text += &[0, 1, 2, 3].map(wide).join(",");
            text += "\n";
        }
        let rows = ParsedRows { numbers: 4, ..rows(&roles) };
        let found = parse(&rows, text.as_bytes()).unwrap();
        assert_eq!(format!("{found:?}"), format!("{:?}", rows.one_by_one(text.as_bytes())));
        assert_eq!([3, 2, 1, 0].map(|column| found.found.numbers[column].len()), [400; 4]);
    }

    /// Plain or not, the result for a field is that of the row-by-row reader.
    #[test]
    fn fields_are_read_whole_or_not_at_all() {
        let texts = |field| [format!("{field},2,7,4\n1,2,8,4\n"), format!("1,2,{field},4\n1,2,8,4\n")];
        let one_by_one = |text: &str| format!("{:?}", rows(&ROLES).one_by_one(text.as_bytes()));
        for text in ["1e5", "1E+2", "+1", "1.", ".5", "1\r", "inf", "-nan"].into_iter().flat_map(texts) {
            let found = parse(&rows(&ROLES), text.as_bytes()).unwrap();
            assert_eq!(format!("{found:?}"), one_by_one(&text), "{text:?}");
        }
        for text in ["1e", "-", ".", "1x", "1 ", "infinit", "0x1"].into_iter().flat_map(texts) {
            let found = parse(&rows(&ROLES), text.as_bytes());
            assert!(found.is_none_or(|found| format!("{found:?}") == one_by_one(&text)), "{text:?}");
        }
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
