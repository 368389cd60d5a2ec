//! Tables as Apache Parquet, column by column.

use std::fs::File;
use std::sync::Arc;

use ::parquet::basic::Compression;
use ::parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int32Type, Int64Type};
use ::parquet::errors::{ParquetError, Result};
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use ::parquet::schema::parser::parse_message_type;

use super::table::{Kind, Table};

/// Rows of a group, which is worked out in memory: some 50 MB.
const GROUP: usize = 500_000;

pub(super) fn write<'a>(file: File, kind: Kind, tables: impl Iterator<Item = Table<'a>>) -> Result<()> {
    let schema = Arc::new(parse_message_type(&schema(kind))?);
    let properties = Arc::new(WriterProperties::builder().set_compression(Compression::SNAPPY).build());
    let mut out = SerializedFileWriter::new(file, schema, properties)?;
    for table in tables {
        for first in (0..table.len()).step_by(GROUP) {
            let mut group = out.next_row_group()?;
            rows(&mut group, kind, &table, first..(first + GROUP).min(table.len()))?;
            group.close()?;
        }
    }
    out.close()?;
    Ok(())
}

/// The columns with their types, in the words of the format.
fn schema(kind: Kind) -> String {
    let value = if kind == Kind::Raw { "int32" } else { "double" };
    let values: String = kind.values().iter().map(|name| format!("required {value} {name}; ")).collect();
    let saturated = if kind == Kind::Compensated { "required int32 saturated; " } else { "" };
    format!(
        "message samples {{ required binary capture (UTF8); required int64 series; required binary position (UTF8); \
         required binary run (UTF8); required int64 number; required double t_s; {values}{saturated}\
         required double gyro_temperature_degc; required double accel_temperature_degc; }}"
    )
}

fn rows(
    group: &mut SerializedRowGroupWriter<'_, File>,
    kind: Kind,
    table: &Table<'_>,
    rows: std::ops::Range<usize>,
) -> Result<()> {
    let count = rows.len();
    let text = |text: &str| vec![ByteArray::from(text); count];
    put::<ByteArrayType>(group, &text(table.label()))?;
    put::<Int64Type>(group, &vec![i64::from(table.series()); count])?;
    put::<ByteArrayType>(group, &text(&table.position))?;
    put::<ByteArrayType>(group, &text(&table.run))?;
    put::<Int64Type>(group, &rows.clone().map(|row| row as i64).collect::<Vec<i64>>())?;
    put::<DoubleType>(group, &rows.clone().map(|row| table.at_us(row) as f64 * 1e-6).collect::<Vec<f64>>())?;
    for value in 0..kind.values().len() {
        match kind {
            Kind::Raw => {
                put::<Int32Type>(group, &rows.clone().map(|row| table.count(row, value)).collect::<Vec<i32>>())?;
            }
            Kind::Compensated => {
                put::<DoubleType>(group, &rows.clone().map(|row| table.value(row, value)).collect::<Vec<f64>>())?;
            }
        }
    }
    if kind == Kind::Compensated {
        let bits: Vec<i32> = rows.clone().map(|row| i32::from(table.saturated(row))).collect();
        put::<Int32Type>(group, &bits)?;
    }
    for sensor in 0..2 {
        let degc: Vec<f64> = rows.clone().map(|row| table.temperatures(row)[sensor]).collect();
        put::<DoubleType>(group, &degc)?;
    }
    Ok(())
}

/// The next column of the group.
fn put<T: DataType>(group: &mut SerializedRowGroupWriter<'_, File>, values: &[T::T]) -> Result<()> {
    let mut column =
        group.next_column()?.ok_or_else(|| ParquetError::General("more columns than the schema has".into()))?;
    column.typed::<T>().write_batch(values, None, None)?;
    column.close()
}
