//! Opens the table reader to `fuzz/` only.

use std::io::Cursor;
use std::path::Path;

use super::table::{RecordTable, Wanted};

/// Columns of numbers, and for each row the index of its label among the allowed labels.
pub type Read = (Vec<Vec<f64>>, Vec<u8>);

/// Reads the wanted columns of a text, in pieces of about this many bytes; or returns what is wrong with the text, in
/// words.
///
/// # Errors
/// The text is not a table, or it lacks these columns.
pub fn read_table(text: &[u8], piece: usize, numbers: &[&str], label: Option<(&str, &[&str])>) -> Result<Read, String> {
    RecordTable::from_reader(Path::new("table"), Box::new(Cursor::new(text.to_vec())), piece)
        .and_then(|table| table.read(&Wanted { numbers, label, ..Wanted::default() }, None))
        .map(|columns| (columns.numbers, columns.labels))
        .map_err(|error| error.to_string())
}
