//! Tables as text.

use std::fs::File;
use std::io::{self, BufWriter, Write};

use super::table::{Kind, Table};

pub(super) fn write<'a>(file: File, kind: Kind, tables: impl Iterator<Item = Table<'a>>) -> io::Result<()> {
    let mut out = BufWriter::new(file);
    let saturated = if kind == Kind::Compensated { ",saturated" } else { "" };
    let values = kind.values().join(",");
    writeln!(
        out,
        "capture,series,position,run,number,t_s,{values}{saturated},gyro_temperature_degc,accel_temperature_degc"
    )?;
    for table in tables {
        let place = format!("{},{},{},{}", quoted(table.label()), table.series(), table.position, table.run);
        for row in 0..table.len() {
            let us = table.at_us(row);
            write!(out, "{place},{row},{}.{:06}", us / 1_000_000, us % 1_000_000)?;
            for value in 0..kind.values().len() {
                match kind {
                    Kind::Raw => write!(out, ",{}", table.count(row, value))?,
                    Kind::Compensated => write!(out, ",{}", table.value(row, value))?,
                }
            }
            if kind == Kind::Compensated {
                write!(out, ",{}", table.saturated(row))?;
            }
            let [gyro, accel] = table.temperatures(row);
            writeln!(out, ",{gyro},{accel}")?;
        }
    }
    out.flush()
}

/// A text from outside as a field.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\"").replace(char::is_control, " "))
}
