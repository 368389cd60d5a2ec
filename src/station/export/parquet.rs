//! Tables as Apache Parquet, column by column.

use std::io::Write;
use std::ops::Range;
use std::sync::Arc;

use ::parquet::basic::Compression;
use ::parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use ::parquet::errors::{ParquetError, Result};
use ::parquet::file::metadata::KeyValue;
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use ::parquet::schema::parser::parse_message_type;
use serde_json::{Map, Value};

use super::table::{PLACE, SampleTable, TEMPERATURES, TableKind};

/// Rows of a group. A group is built in memory: some 50 MB.
const GROUP: usize = 500_000;

pub(super) fn write<'a>(
    file: impl Write + Send,
    kind: TableKind,
    tables: impl Iterator<Item = SampleTable<'a>>,
) -> Result<()> {
    let schema = Arc::new(parse_message_type(&schema(kind))?);
    let properties = WriterProperties::builder().set_compression(Compression::SNAPPY);
    let properties = Arc::new(properties.set_key_value_metadata(Some(metadata(kind))).build());
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

/// What the columns mean, for readers that show it: JSON objects by the name of the column.
fn metadata(kind: TableKind) -> Vec<KeyValue> {
    let units = kind.units();
    let unit: Map<String, Value> = units.iter().map(|(name, unit, _)| ((*name).to_owned(), (*unit).into())).collect();
    let counts = units.iter().filter_map(|(name, _, counts)| Some(((*name).to_owned(), Value::from((*counts)?))));
    let counts: Map<String, Value> = counts.collect();
    let scale = match kind {
        TableKind::Raw => "nominal, before any calibration",
        TableKind::Compensated => "compensated by the board with the calibration that the module holds",
    };
    [("units", Value::from(unit).to_string()), ("counts_per_unit", Value::from(counts).to_string())]
        .into_iter()
        .chain([("scale", scale.to_owned())])
        .map(|(name, value)| KeyValue::new(name.to_owned(), value))
        .collect()
}

/// The columns with their types, in the words of the format. Whole numbers have 64 bits: with 32 bits the sums of
/// programs that square and add in the type of the column would overflow silently.
fn schema(kind: TableKind) -> String {
    let columns = |kind: &str, names: &[&str]| -> String {
        names.iter().map(|name| format!("required {kind} {name}; ")).collect()
    };
    let [capture, series, position, run, number, t_s] = PLACE;
    let place = format!(
        "required binary {capture} (UTF8); required int64 {series}; required binary {position} (UTF8); \
         required binary {run} (UTF8); required int64 {number}; required double {t_s}; "
    );
    let samples = [
        columns("int64", kind.counts()),
        columns("double", kind.values()),
        columns("int64", kind.masks()),
        columns("double", &TEMPERATURES),
    ];
    format!("message samples {{ {place}{} }}", samples.concat())
}

fn rows<W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    kind: TableKind,
    table: &SampleTable<'_>,
    rows: Range<usize>,
) -> Result<()> {
    let count = rows.len();
    let text = |text: &str| vec![ByteArray::from(text); count];
    let whole = |of: &dyn Fn(usize) -> i64| rows.clone().map(of).collect::<Vec<i64>>();
    let real = |of: &dyn Fn(usize) -> f64| rows.clone().map(of).collect::<Vec<f64>>();
    put::<ByteArrayType, W>(group, &text(table.label()))?;
    put::<Int64Type, W>(group, &vec![i64::from(table.series()); count])?;
    put::<ByteArrayType, W>(group, &text(&table.position))?;
    put::<ByteArrayType, W>(group, &text(&table.run))?;
    put::<Int64Type, W>(group, &whole(&|row| row as i64))?;
    put::<DoubleType, W>(group, &real(&|row| table.at_us(row) as f64 / 1e6))?;
    for count in 0..kind.counts().len() {
        put::<Int64Type, W>(group, &whole(&|row| table.count(row, count).into()))?;
    }
    for value in 0..kind.values().len() {
        put::<DoubleType, W>(group, &real(&|row| table.value(row, value)))?;
    }
    for _ in kind.masks() {
        put::<Int64Type, W>(group, &whole(&|row| table.mask(row).into()))?;
    }
    for sensor in 0..TEMPERATURES.len() {
        put::<DoubleType, W>(group, &real(&|row| table.temperatures(row)[sensor]))?;
    }
    Ok(())
}

/// Writes the next column of the group.
fn put<T: DataType, W: Write + Send>(group: &mut SerializedRowGroupWriter<'_, W>, values: &[T::T]) -> Result<()> {
    let mut column =
        group.next_column()?.ok_or_else(|| ParquetError::General("more columns than the schema has".into()))?;
    column.typed::<T>().write_batch(values, None, None)?;
    column.close()
}
