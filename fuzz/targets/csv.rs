//! Tables of numbers: refused with line and column, or each number as the standard library reads it; the same for pieces
//! of any size.

#![no_main]

use gnc_station::fuzzing::{Read, read_table};
use libfuzzer_sys::fuzz_target;

const LABELS: (&str, &[&str]) = ("position", &["z+", "z-"]);
/// Bytes of a piece that holds the largest input, and of one that holds a few lines, so that several threads parse.
const WHOLE: usize = 1 << 20;
const CUT: usize = 200;

fuzz_target!(|text: &[u8]| {
    let whole = read(text, WHOLE, &["x"], None);
    if let (Ok((columns, _)), Some(naive)) = (&whole, naive_column(text, "x")) {
        // As text: a number that is none is not equal to itself.
        assert_eq!(format!("{:?}", columns[0]), format!("{naive:?}"));
    }
    let whole = read(text, WHOLE, &["x", "y"], Some(LABELS));
    let cut = read(text, CUT, &["x", "y"], Some(LABELS));
    assert_eq!(format!("{whole:?}"), format!("{cut:?}"));
});

fn read(text: &[u8], piece: usize, numbers: &[&str], label: Option<(&str, &[&str])>) -> Result<Read, String> {
    let read = read_table(text, piece, numbers, label);
    match &read {
        Ok((columns, labels)) => {
            assert_eq!(columns.len(), numbers.len());
            let rows = columns[0].len();
            // Unless they were packed, rows are not more than bytes.
            let packed = text.starts_with(&[0x1f, 0x8b]);
            assert!(rows > 0 && (packed || rows <= text.len()) && columns.iter().all(|column| column.len() == rows));
            assert_eq!(labels.len(), label.map_or(0, |_| rows));
        }
        Err(why) => assert!(!why.is_empty()),
    }
    read
}

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
