//! Tables as text.

use std::io::{self, BufWriter, Write};

use gnc_text::printable;

use super::table::{PLACE, SampleTable, TEMPERATURES, TableKind};

pub(super) fn write<'a>(
    file: impl Write,
    kind: TableKind,
    tables: impl Iterator<Item = SampleTable<'a>>,
) -> io::Result<()> {
    let mut out = BufWriter::new(file);
    let columns: [&[&str]; 5] = [&PLACE, kind.counts(), kind.values(), kind.masks(), &TEMPERATURES];
    writeln!(out, "{}", columns.concat().join(","))?;
    for table in tables {
        let place = format!("{},{},{},{}", quoted(table.label()), table.series(), table.position, table.run);
        for row in 0..table.len() {
            let us = table.at_us(row);
            write!(out, "{place},{row},{}.{:06}", us / 1_000_000, us % 1_000_000)?;
            for count in 0..kind.counts().len() {
                write!(out, ",{}", table.count(row, count))?;
            }
            for value in 0..kind.values().len() {
                write!(out, ",{}", table.value(row, value))?;
            }
            for _ in kind.masks() {
                write!(out, ",{}", table.mask(row))?;
            }
            let [gyro, accel] = table.temperatures(row);
            writeln!(out, ",{gyro},{accel}")?;
        }
    }
    out.flush()
}

/// A text from outside as a field in quotes.
fn quoted(text: &str) -> String {
    format!("\"{}\"", printable(text).replace('"', "\"\""))
}
