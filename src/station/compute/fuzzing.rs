//! Opens the table reader to `fuzz/`, and to nobody else.

use std::io::Cursor;
use std::path::Path;

use super::table::{RecordTable, Wanted};

/// Columns of numbers, and for each row the place of its label among those allowed.
pub type Read = (Vec<Vec<f64>>, Vec<u8>);

/// The wanted columns of a text that is read in pieces of about this many bytes; or what is wrong with it, in words.
///
/// # Errors
/// The text is no table, or has no such columns.
pub fn read_table(text: &[u8], piece: usize, numbers: &[&str], label: Option<(&str, &[&str])>) -> Result<Read, String> {
    RecordTable::from_reader(Path::new("table"), Box::new(Cursor::new(text.to_vec())), piece)
        .and_then(|table| table.read(&Wanted { numbers, label, ..Wanted::default() }, None))
        .map(|columns| (columns.numbers, columns.labels))
        .map_err(|error| error.to_string())
}
