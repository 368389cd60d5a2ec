use std::io::{self, Read};

use super::*;

fn read(text: &'static str, numbers: &[&str], rate_hz: Option<f64>) -> Result<Columns, TableError> {
    let wanted = Wanted { numbers, rate_hz, ..Wanted::default() };
    RecordTable::from_reader(Path::new("r.csv"), Box::new(text.as_bytes()), PIECE)?.read(&wanted, None)
}

#[test]
fn every_delimiter_and_what_people_write() {
    for text in [
        "# by hand\n\nt,x,y\n0,1,2.5\n# pause\n0.1,-1e3,.5\n",
        "t;x;y\r\n0;1;2.5\r\n0.1;-1e3;0.5",
        "t\tx\ty\n0\t1\t2.5\n0.1\t-1e3\t0.5\n",
        "  t  x   y\n 0  1  2.5 \n0.1 -1e3 +0.5\n",
        "\u{feff}\"t\",\"x\",\"y\"\n0, 1 ,\"2.5\"\n0.1,-1e3,0.5\n",
    ] {
        let columns = read(text, &["y", "x"], None).unwrap_or_else(|e| panic!("{text:?}: {e}"));
        assert_eq!(columns.numbers, [vec![2.5, 0.5], vec![1.0, -1000.0]], "{text:?}");
    }
}

#[test]
fn mistakes_have_a_line_and_a_column() {
    let check = |text, expected: &str| match read(text, &["x", "y"], None) {
        Ok(_) => panic!("{text:?} was read"),
        Err(e) => assert_eq!(e.to_string(), expected),
    };
    check("x,y\n1,2\n1,abc\n", "r.csv:3:3: `abc` in column `y` is not a number");
    check("x,y\n1,\n", "column `y`: 1 of 1 cells are empty or say so, the first in line 2");
    check(
        "x;y\n1,234;2\n",
        "r.csv:2:1: `1,234` in column `x` may have a decimal comma or a thousands separator; the file does not show which",
    );
    check("x;y\n0,5;2\n1.5;2\n", "r.csv: `0,5` in line 2 has a decimal comma, `1.5` in line 3 a decimal point");
    check("x,y\n1,2,3\n", "r.csv:2:5: row has 3 fields, the header has 2");
    check("x,y\n1\n", "r.csv:2:2: row has 1 fields, the header has 2");
    check("#c\nx,z\n1,2\n", "r.csv:2:1: no column `y`; the header has x, z");
    check("1,2\n3,4\n", "r.csv:1:1: no header row with column names");
    check("x,y,x\n3,4,5\n", "r.csv:1:5: column `x` appears twice in the header");
    check("x\ty\n1\t\n", "column `y`: 1 of 1 cells are empty or say so, the first in line 2");
    check("x,y\n1,\"2\n", "r.csv:2:3: a quote is not closed in this line");
    check("x,y\r\n1\r\n", "r.csv:2:2: row has 1 fields, the header has 2");
    check("x y\n1 2\n 1  b \n", "r.csv:3:5: `b` in column `y` is not a number");
    check("x,y\n", "r.csv: no rows after the header");
    check("", "r.csv:1:1: no header row with column names");
}

#[test]
fn time_is_watched() {
    let check = |rows: &str, rate, expected: &str| {
        let head = (0..40).fold("t,x\n".to_owned(), |s, i| format!("{s}{},0\n", f64::from(i) * 0.1));
        let text: &'static str = Box::leak(format!("{head}{rows}").into_boxed_str());
        let said = read(text, &["x"], rate).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(said.starts_with(expected) && said.is_empty() == expected.is_empty(), "{said}");
    };
    check("4.0,0\n", Some(10.0), "");
    check("4.3,0\n", None, "gap at sample 40: step of 0.400000 s, expected 0.100000 s");
    check("3.9,0\n", None, "time does not increase at sample 40: 3.9000000000000004 s, then 3.9 s");
    check(
        "4.0,0\n",
        Some(20.0),
        "time column says 10.000000 Hz, stated are 20.000000 Hz: -50.0000 % apart, allowed are 3.",
    );
    check("nan,0\n", None, "time: sample 40 is NaN");
}

/// A line cut by the end of a piece is still one line, and the first mistake has the right line whatever the threads
/// do.
#[test]
fn pieces_do_not_show() {
    let mut text = "# head\nt,a,b\n".to_owned();
    (0..400_000).for_each(|i| text += &format!("{i},{i},{}\n", i * 2));
    assert!(text.len() > 5 << 20, "several pieces");
    let good: &'static str = Box::leak(text.clone().into_boxed_str());
    let columns = read(good, &["b"], None).unwrap();
    assert_eq!(columns.numbers[0].len(), 400_000);
    assert!(columns.numbers[0].iter().enumerate().all(|(i, v)| *v == 2.0 * i as f64));
    let mut check = |row: usize, bad: &str, expected: &str| {
        let at = text.match_indices('\n').nth(row + 1).unwrap().0 + 1;
        let end = at + text[at..].find('\n').unwrap();
        text.replace_range(at..end, bad);
        let broken: &'static str = Box::leak(text.clone().into_boxed_str());
        assert_eq!(read(broken, &["b"], None).err().unwrap().to_string(), expected);
    };
    check(399_999, "399999,0,x", "r.csv:400002:10: `x` in column `b` is not a number");
    check(300_000, "300000,0", "r.csv:300003:9: row has 2 fields, the header has 3");
    check(200_000, "199999,0,0", "time does not increase at sample 200000: 199999 s, then 199999 s");
    check(3, "3,0,0,0", "r.csv:6:7: row has 4 fields, the header has 3");
}

#[test]
fn what_is_no_text_is_refused_soon() {
    struct Zeros;
    impl Read for Zeros {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            buffer.fill(b'0');
            Ok(buffer.len())
        }
    }
    let error = RecordTable::from_reader(Path::new("r.bin"), Box::new(Zeros), PIECE).err().unwrap();
    assert_eq!(error.to_string(), "r.bin: no line end within 1048576 bytes; is it a text?");
}

#[track_caller]
fn understood(text: &str, expected: &str) -> Columns {
    let text: &'static str = Box::leak(text.to_owned().into_boxed_str());
    let columns = read(text, &["w"], None).unwrap_or_else(|e| panic!("{text:?}: {e}"));
    assert_eq!(columns.about.understood.join(", "), expected, "{text:?}");
    assert_eq!(columns.numbers[0], [0.5, -1.25, 1234.5], "{text:?}");
    columns
}

/// One record, as many programs write it.
#[test]
fn records_as_people_have_them() {
    understood("t;w\n0,00;0,5\n0,01;-1,25\n0,02;1234,5\n", "decimal comma");
    understood("t;w\n0,00;0,5\n0,01;-1,25\n0,02;1.234,5\n", "decimal comma, thousands separators");
    understood("sep=;\nt;w\n0,00;0,5\n0,01;-1,25\n0,02;1234,5\n", "decimal comma, sep= line");
    understood("sep=,\r\nt,w\r\n0.00,0.5\r\n0.01,-1.25\r\n0.02,1234.5\r\n", "sep= line");
    understood("t,w\n0.00,0.5\n0.01,-1.25\n0.02,\"1,234.5\"\n", "thousands separators");
    understood("\"t\",\"w\",\"note, long\"\n0.00,0.5,\"a, b\"\n0.01,-1.25,\n0.02,1234.5,\"c\"\n", "");
    understood("Log of the IMU\nOperator: me\n\nt,w\n0.00,0.5\n0.01,-1.25\n0.02,1234.5\n", "2 title lines");
    understood("Device,IMU\nSerial,12\nt,w\n0.00,0.5\n0.01,-1.25\n0.02,1234.5\n", "2 title lines");
    let units = understood("t;w\ns;deg/s\n0;0.5\n0.01;-1.25\n0.02;1234.5\n", "units row");
    assert_eq!(units.units, [Some("deg/s".to_owned())]);
    let all = "Titel\n\nZeit;w\n[s];[°/s]\n0,00;0,5\n0,01;-1,25\n0,02;1234,5\n";
    understood(all, "decimal comma, 1 title line, units row");
    understood("# t,w\n0.00,0.5\n0.01,-1.25\n0.02,1234.5\n", "header in a comment");
    understood("# t w\n0.0e+00 5.0e-01\n1.0e-02 -1.25e+00\n2.0e-02 1.2345e+03\n", "header in a comment");
    understood("Time [s] w\n0.00 0.5\n0.01 -1.25\n0.02 1234.5\n", "");
    understood("t,w\n0.0D+00,0.5D+00\n1.0D-02,-1.25D0\n2.0D-02,1.2345D+03\n", "");
    understood("t,w,\n0.00,0.5,\n0.01,-1.25,\n0.02,1234.5,\n", "");
    understood("t,w\n0.00,0.5,\n0.01,-1.25,\n0.02,1234.5,\n", "a delimiter at the end of each row");
    understood("T;W\n0;0.5\n0.01;-1.25\n;\n0.02;1234.5\n;\n", "");
    understood(
        "TIMESTAMP,w\n2024-05-01T10:00:00.00Z,0.5\n2024-05-01T10:00:00.01Z,-1.25\n2024-05-01T10:00:00.02Z,1234.5\n",
        "",
    );
}

/// Header and rows with different delimiters: both have equal numbers of fields, so the meaning is clear.
#[test]
fn other_signs_between_the_names_than_between_the_values() {
    let check = |head: &str, rows: [&str; 3], expected: &str| {
        understood(&format!("{head}\n{}\n", rows.join("\n")), expected);
        // A comment may hold the header, and titles may stand above it.
        let comment = expected.replace("decimal comma, ", "");
        let decimal = &expected[..expected.len() - comment.len()];
        let comment = format!("{decimal}header in a comment, {comment}");
        understood(&format!("# {head}\n{}\n", rows.join("\n")), &comment);
    };
    let blanks = ["0.00 0.5", "0.01 -1.25", "0.02 1234.5"];
    check("t,w", blanks, "`,` between the names, blanks between the values");
    check("t, w", blanks, "`,` between the names, blanks between the values");
    check("t;w", blanks, "`;` between the names, blanks between the values");
    check("Log time\tw", blanks, "tabs between the names, blanks between the values");
    let commas = ["0.00,0.5", "0.01,-1.25", "0.02,1234.5"];
    check("t\tw", commas, "tabs between the names, `,` between the values");
    check("t;w", commas, "`;` between the names, `,` between the values");
    check("t w", commas, "blanks between the names, `,` between the values");
    let semicolons = ["0,00;0,5", "0,01;-1,25", "0,02;1234,5"];
    check("t,w", semicolons, "decimal comma, `,` between the names, `;` between the values");
    check("t w", semicolons, "decimal comma, blanks between the names, `;` between the values");
    check("t,w", ["0.00\t0.5", "0.01\t-1.25", "0.02\t1234.5"], "`,` between the names, tabs between the values");
    check(
        "t;w",
        ["0,00 0,5", "0,01 -1,25", "0,02 1234,5"],
        "decimal comma, `;` between the names, blanks between the values",
    );
    understood(
        "t,w\ns,deg/s\n0.00 0.5\n0.01 -1.25\n0.02 1234.5\n",
        "`,` between the names, blanks between the values, units row",
    );
    understood(
        "Log\nt,w\n0 0.5\n0.01 -1.25\n0.02 1234.5\n",
        "1 title line, `,` between the names, blanks between the values",
    );
    // Rows of zeros are not names, and digits in two columns are not thousands.
    let counts = read("x,y\n0 0\n1 234\n5 678\n", &["x", "y"], None).unwrap();
    assert_eq!(counts.numbers, [[0.0, 1.0, 5.0], [0.0, 234.0, 678.0]]);
    assert_eq!(read("w\n1 234\n0\n", &["w"], None).unwrap().numbers, [[1234.0, 0.0]]);
}

#[test]
fn signs_that_leave_it_open_are_refused() {
    let check = |text: &'static str, expected: &str| {
        assert_eq!(read(text, &["x", "y"], None).err().map(|e| e.to_string()).unwrap_or_default(), expected, "{text}");
    };
    check("x,y,z\n0 0\n1 234\n", "r.csv:2:4: row has 1 fields, the header has 3");
    check("x,y\n0 0 0\n1 2 3\n", "r.csv:2:6: row has 1 fields, the header has 2");
    // Two columns of whole numbers, or one with a decimal comma?
    check("x;y\n0,5\n1,7\n", "r.csv:2:4: row has 1 fields, the header has 2");
    check("x y\n0,5\n1,7\n", "r.csv:1:1: no column `x`; the header has x y");
    let text = "x y\n0,5\n1,7\n";
    let reading = ReadingOptions { decimal: Some(Decimal::Point), ..ReadingOptions::default() };
    let source = source::of(Path::new("r.csv"), Box::new(text.as_bytes())).unwrap();
    let table = RecordTable::of(Path::new("r.csv"), source, PIECE, &reading).unwrap();
    let wanted = Wanted { numbers: &["x", "y"], ..Wanted::default() };
    assert_eq!(table.read(&wanted, None).unwrap().numbers, [[0.0, 1.0], [5.0, 7.0]]);
}

/// Every kind of time column is checked: three seconds are missing from each of them.
#[test]
fn gaps_are_found_under_every_name_of_time() {
    for (name, per_s) in [
        ("t", 1.0),
        ("Time [s]", 1.0),
        ("time_ms", 1e3),
        ("time_us", 1e6),
        ("timestamp", 1.0),
        ("timestamp", 1e3),
        ("timestamp_ns", 1e9),
        ("epoch", 1e6),
        ("t (ms)", 1e3),
    ] {
        let row = |i: u32| {
            format!("{},1\n", (f64::from(if i < 50 { i } else { i + 300 }) * 0.01 * per_s * 1e3).round() / 1e3)
        };
        let text: &'static str =
            Box::leak(format!("{name},w\n{}", (0..100).map(row).collect::<String>()).into_boxed_str());
        let refusal = read(text, &["w"], Some(100.0)).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(refusal.starts_with("gap at sample 50"), "{name}: {refusal}");
        assert!(read(text, &["w"], None).is_err(), "{name}");
    }
    let counter: String = (0..100).map(|i| format!("{},1\n", if i < 50 { i } else { i + 300 })).collect();
    let text: &'static str = Box::leak(format!("n,w\n{counter}").into_boxed_str());
    assert!(read(text, &["w"], Some(100.0)).is_ok(), "a counter is no clock");
    let odd = "timestamp,w\n0,1\n7,1\n14,1\n21,1\n";
    let refusal = read(odd, &["w"], Some(100.0)).err().map(|e| e.to_string()).unwrap_or_default();
    assert_eq!(refusal, "steps of 7 in column `timestamp` fit 100 Hz in none of s, ms, us and ns");
}

/// An array as numpy writes it, from the description of the format.
fn npy(descr: &str, fortran: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let mut header = format!("{{'descr': {descr}, 'fortran_order': {fortran}, 'shape': {shape}, }}");
    header += &" ".repeat(63 - (header.len() + 10) % 64);
    header.push('\n');
    let length = u16::try_from(header.len()).unwrap().to_le_bytes();
    [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), data].concat()
}

fn array(bytes: Vec<u8>, numbers: &[&str]) -> Result<Columns, TableError> {
    let wanted = Wanted { numbers, ..Wanted::default() };
    RecordTable::from_reader(Path::new("r.npy"), Box::new(io::Cursor::new(bytes)), PIECE)?.read(&wanted, None)
}

#[test]
fn arrays_of_numpy() {
    let floats = |values: &[f64]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let one = npy("'<f8'", "False", "(3,)", &floats(&[1.0, 2.5, -3.0]));
    assert_eq!(array(one.clone(), &["0"]).unwrap().numbers, [[1.0, 2.5, -3.0]]);
    let columns = array(one, &["w"]).unwrap();
    assert_eq!(columns.about.understood, ["numpy array", "columns by order: w"]);
    let rows = npy("'<f8'", "False", "(2, 3)", &floats(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    assert_eq!(array(rows.clone(), &["x", "y", "z"]).unwrap().numbers, [[1.0, 4.0], [2.0, 5.0], [3.0, 6.0]]);
    assert_eq!(array(rows.clone(), &["2"]).unwrap().numbers, [[3.0, 6.0]]);
    assert!(array(rows, &["w"]).is_err());
    let by_columns = npy("'<f8'", "True", "(2, 3)", &floats(&[1.0, 4.0, 2.0, 5.0, 3.0, 6.0]));
    assert_eq!(array(by_columns, &["x", "y", "z"]).unwrap().numbers, [[1.0, 4.0], [2.0, 5.0], [3.0, 6.0]]);
    let big = npy("'>i2'", "False", "(2,)", &[0xff, 0xfe, 0x01, 0x00]);
    assert_eq!(array(big, &["0"]).unwrap().numbers, [[-2.0, 256.0]]);
    let mut data = Vec::new();
    for (t, w) in [(0.0_f64, 7_i32), (0.01, -8), (0.02, 9)] {
        data.extend(t.to_le_bytes());
        data.extend(w.to_le_bytes());
    }
    let named = array(npy("[('t_s', '<f8'), ('w', '<i4')]", "False", "(3,)", &data), &["w"]).unwrap();
    assert_eq!(named.numbers, [[7.0, -8.0, 9.0]]);
    assert!(matches!(named.about.clock, RecordClock::Checked { .. }));
    let cut = npy("'<f8'", "False", "(3,)", &floats(&[1.0, 2.0]));
    assert!(array(cut, &["0"]).is_err());
    let huge = npy("'<f8'", "False", "(99999999999,)", &[]);
    assert!(matches!(array(huge, &["0"]), Err(TableError::TooLarge { .. })));
}

/// A column of one value: 9 million rows in a few kilobytes, which would be 72 MB, and so on without an end.
#[test]
fn parquet_that_unpacks_to_much_is_refused() {
    use ::parquet::data_type::DoubleType;
    use ::parquet::file::{properties::WriterProperties, writer::SerializedFileWriter};
    let schema = ::parquet::schema::parser::parse_message_type("message m { required double x; }").unwrap();
    let file = tempfile::NamedTempFile::new().unwrap();
    let written = WriterProperties::builder().set_data_page_row_count_limit(1 << 24).build();
    let mut out = SerializedFileWriter::new(file.reopen().unwrap(), schema.into(), written.into()).unwrap();
    let rows = vec![1.0; 1_000_000];
    for _ in 0..9 {
        let mut group = out.next_row_group().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<DoubleType>().write_batch(&rows, None, None).unwrap();
        column.close().unwrap();
        group.close().unwrap();
    }
    out.close().unwrap();
    assert!(file.path().metadata().unwrap().len() < 10_000);
    let wanted = Wanted { numbers: &["x"], rate_hz: Some(100.0), ..Wanted::default() };
    let opened = RecordTable::open(file.path(), &ReadingOptions::default()).unwrap();
    let refusal = opened.read(&wanted, None).unwrap_err().to_string();
    assert!(refusal.ends_with("it unpacks to more than 400 times its size, so it is not a record"), "{refusal}");
}

/// Columns of whole numbers in both lengths and of floats, with empty cells, are read alike.
#[test]
fn parquet_of_every_type() {
    use ::parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int32Type, Int64Type};
    use ::parquet::file::{properties::WriterProperties, writer::SerializedFileWriter};
    let schema = "message m { required double t_s; required int32 a; required int64 b; optional double c; \
                  required binary position (UTF8); }";
    let schema = std::sync::Arc::new(::parquet::schema::parser::parse_message_type(schema).unwrap());
    let file = tempfile::NamedTempFile::new().unwrap();
    let mut out =
        SerializedFileWriter::new(file.reopen().unwrap(), schema, WriterProperties::builder().build().into()).unwrap();
    for half in 0..2 {
        let mut group = out.next_row_group().unwrap();
        let rows = || (half * 50..half * 50 + 50).map(|k: i32| k);
        let mut column = group.next_column().unwrap().unwrap();
        let times: Vec<f64> = rows().map(|k| f64::from(k) * 0.01).collect();
        column.typed::<DoubleType>().write_batch(&times, None, None).unwrap();
        column.close().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<Int32Type>().write_batch(&rows().collect::<Vec<_>>(), None, None).unwrap();
        column.close().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<Int64Type>().write_batch(&rows().map(i64::from).collect::<Vec<_>>(), None, None).unwrap();
        column.close().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        let levels: Vec<i16> = rows().map(|k| i16::from(k != 70)).collect();
        let values: Vec<f64> = rows().filter(|k| *k != 70).map(f64::from).collect();
        column.typed::<DoubleType>().write_batch(&values, Some(&levels), None).unwrap();
        column.close().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        let labels = vec![ByteArray::from(if half == 0 { "z+" } else { "z-" }); 50];
        column.typed::<ByteArrayType>().write_batch(&labels, None, None).unwrap();
        column.close().unwrap();
        group.close().unwrap();
    }
    out.close().unwrap();
    let read = |numbers: &[&str]| {
        let label = Some(("position", &["z+", "z-"][..]));
        let wanted = Wanted { numbers, label, rate_hz: Some(100.0), ..Wanted::default() };
        RecordTable::open(file.path(), &ReadingOptions::default())?.read(&wanted, None)
    };
    let columns = read(&["a", "b"]).unwrap();
    let expected: Vec<f64> = (0..100).map(f64::from).collect();
    assert_eq!(columns.numbers, [expected.clone(), expected]);
    assert_eq!(columns.labels.iter().filter(|code| **code == 1).count(), 50);
    assert!(matches!(columns.about.clock, RecordClock::Checked { .. }));
    let refusal = read(&["c"]).unwrap_err().to_string();
    assert_eq!(refusal, "column `c`: 1 of 100 cells are empty or say so, the first in line 71");
}
