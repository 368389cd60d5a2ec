//! Tables of numbers: refused with line and column, or each number as the standard library reads it; the same for pieces
//! of any size.

#![no_main]

use gnc_station::compute::fuzzing::read_table;
use libfuzzer_sys::fuzz_target;

const LABELS: (&str, &[&str]) = ("position", &["z+", "z-"]);
/// A piece that holds the largest input, and one of a line or two, so that several threads parse.
const PIECES: [usize; 2] = [1 << 20, 48];

fuzz_target!(|text: &[u8]| {
    for (numbers, label) in [(&["x", "y"][..], Some(LABELS)), (&["x"][..], None)] {
        let [whole, cut] = PIECES.map(|piece| read_table(text, piece, numbers, label));
        // As text: a number that is none is not equal to itself.
        assert_eq!(format!("{whole:?}"), format!("{cut:?}"));
        match whole {
            Ok((columns, labels)) => {
                assert!(label.is_none() || columns.iter().all(|column| column.len() == labels.len()));
                assert!(columns.iter().all(|column| !column.is_empty() && column.len() <= text.len()));
                if let Some(naive) = naive_column(text, "x") {
                    assert_eq!(format!("{:?}", columns[0]), format!("{naive:?}"));
                }
            }
            Err(why) => assert!(!why.is_empty()),
        }
    }
});

/// A column of a text with commas and nothing else in it that needs thought.
fn naive_column(text: &[u8], name: &str) -> Option<Vec<f64>> {
    let text = std::str::from_utf8(text).ok()?;
    if text.contains(['\t', ';', '"', '\u{feff}', '\r', '\u{b}', '\u{c}']) || !text.is_ascii() {
        return None;
    }
    let mut lines = text.split('\n').filter(|line| !line.trim().is_empty());
    let header = lines.find(|line| !line.trim_start().starts_with('#')).filter(|header| header.contains(','))?;
    let column = header.split(',').position(|field| field.trim() == name)?;
    let rows = lines.filter(|line| !line.starts_with('#'));
    rows.map(|line| line.split(',').nth(column)?.trim().parse().ok()).collect()
}
