//! Files that claim what they do not hold, each built by hand: the library never writes them.

use std::io::Write as _;

use super::*;
use crate::compute::table::RecordTable;

/// Writes structures in the compact form of Thrift.
#[derive(Default)]
struct Built(Vec<u8>, i16);

impl Built {
    fn number(&mut self, mut number: u64) {
        while number >= 0x80 {
            self.0.push(number as u8 | 0x80);
            number >>= 7;
        }
        self.0.push(number as u8);
    }

    fn head(&mut self, field: i16, kind: u8) {
        self.0.push((field - self.1) as u8 * 16 + kind);
        self.1 = field;
    }

    /// A whole number: of kind 5 with 32 bits, of kind 6 with 64.
    fn int(mut self, field: i16, kind: u8, value: i64) -> Self {
        self.head(field, kind);
        self.number(((value << 1) ^ (value >> 63)) as u64);
        self
    }

    fn text(mut self, field: i16, text: &str) -> Self {
        self.head(field, 8);
        self.number(text.len() as u64);
        self.0.extend(text.as_bytes());
        self
    }

    fn within(mut self, field: i16, of: Self) -> Self {
        self.head(field, 12);
        self.0.extend(of.end());
        self
    }

    fn list(mut self, field: i16, kind: u8, of: &[Vec<u8>]) -> Self {
        self.head(field, 9);
        self.0.push(0xf0 | kind);
        self.number(of.len() as u64);
        of.iter().for_each(|of| self.0.extend(of));
        self
    }

    fn end(mut self) -> Vec<u8> {
        self.0.push(0);
        self.0
    }
}

fn group_of(name: &str, children: i64) -> Vec<u8> {
    Built::default().int(3, 5, 0).text(4, name).int(5, 5, children).end()
}

fn double(name: &str) -> Vec<u8> {
    Built::default().int(1, 5, 5).int(3, 5, 0).text(4, name).end()
}

/// A file of one column `x` of doubles, and what it claims.
#[derive(Clone)]
struct Claims {
    pages: Vec<u8>,
    schema: Vec<Vec<u8>>,
    kind: i64,
    codec: i64,
    rows: i64,
    unpacked: i64,
    start: i64,
    bytes: Option<i64>,
    groups: usize,
    footer_bytes: Option<u32>,
}

const SNAPPY: i64 = 1;
const GZIP: i64 = 2;
const TEXT: i64 = 6;

/// A page: its kind, its bytes, and what they are said to unpack to.
fn page(kind: i64, unpacked: i64, values: (i64, i64), bytes: &[u8]) -> Vec<u8> {
    let about = Built::default().int(1, 5, values.0).int(2, 5, values.1);
    let (field, about) = if kind == 2 { (7, about) } else { (5, about.int(3, 5, 3).int(4, 5, 3)) };
    let head = Built::default().int(1, 5, kind).int(2, 5, unpacked).int(3, 5, bytes.len() as i64).within(field, about);
    [head.end(), bytes.to_vec()].concat()
}

fn good() -> Claims {
    let values: Vec<u8> = (0..100).flat_map(|k| f64::from(k).to_le_bytes()).collect();
    Claims {
        pages: page(0, 800, (100, 0), &values),
        schema: vec![group_of("m", 1), double("x")],
        kind: 5,
        codec: 0,
        rows: 100,
        unpacked: 900,
        start: 4,
        bytes: None,
        groups: 1,
        footer_bytes: None,
    }
}

impl Claims {
    fn file(&self) -> Vec<u8> {
        let bytes = self.bytes.unwrap_or(self.pages.len() as i64);
        let about = Built::default()
            .int(1, 5, self.kind)
            .list(2, 5, &[vec![0]])
            .list(3, 8, &[vec![1, b'x']])
            .int(4, 5, self.codec)
            .int(5, 6, self.rows)
            .int(6, 6, self.unpacked)
            .int(7, 6, bytes)
            .int(9, 6, self.start);
        let chunk = Built::default().int(2, 6, 4).within(3, about).end();
        let group = Built::default().list(1, 12, &[chunk]).int(2, 6, self.unpacked).int(3, 6, self.rows).end();
        let rows = self.rows.saturating_mul(self.groups as i64);
        let footer = Built::default()
            .int(1, 5, 1)
            .list(2, 12, &self.schema)
            .int(3, 6, rows)
            .list(4, 12, &vec![group; self.groups])
            .end();
        let length = self.footer_bytes.unwrap_or(footer.len() as u32).to_le_bytes();
        [b"PAR1", self.pages.as_slice(), &footer, &length, b"PAR1"].concat()
    }
}

fn read(bytes: &[u8]) -> Result<Columns, TableError> {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(bytes).unwrap();
    let wanted = Wanted { numbers: &["x"], rate_hz: Some(100.0), ..Wanted::default() };
    RecordTable::open(file.path(), &ReadingOptions::default())?.read(&wanted, None)
}

fn gzipped(bytes: &[u8]) -> Vec<u8> {
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    packed.write_all(bytes).unwrap();
    packed.finish().unwrap()
}

#[test]
fn what_a_file_claims_is_looked_at_before_it_is_believed() {
    let expected: Vec<f64> = (0..100).map(f64::from).collect();
    assert_eq!(read(&good().file()).unwrap().numbers, [expected], "the file itself is good");

    let of = |change: &dyn Fn(&mut Claims)| {
        let mut claims = good();
        change(&mut claims);
        claims.file()
    };
    let columns = |count: usize| {
        let all: Vec<_> = [group_of("m", count as i64)].into_iter().chain(vec![double("x"); count]).collect();
        of(&|claims| claims.schema = all.clone())
    };
    let deep: Vec<_> = std::iter::repeat_n(group_of("m", 1), 5000).chain([double("x")]).collect();
    let many = 400_i64 << 20;
    let texts = |values: &[u8], encoding| {
        let values = page(0, values.len() as i64, (100, encoding), values);
        of(&|claims| {
            (claims.kind, claims.pages) = (TEXT, values.clone());
            claims.schema[1] = Built::default().int(1, 5, TEXT).int(3, 5, 0).text(4, "x").end();
        })
    };
    // A block of 128 differences in 4 parts, of so many values.
    let differences = [&[0x80, 0x01, 4][..], &[0xff; 8][..], &[0x0f, 0, 0, 0, 0, 0, 0]].concat();
    let told: [(&str, Vec<u8>, &str); 22] = [
        ("rows", of(&|c| c.rows = 1 << 60), "more than 536870912 values"),
        ("columns", columns(1_000_000), "it has more than 10000 columns"),
        ("a child for each number", of(&|c| c.schema[0] = group_of("m", i32::MAX.into())), "its footer is damaged"),
        ("fewer children than none", of(&|c| c.schema[0] = group_of("m", -1)), "its footer is damaged"),
        ("depth", of(&|c| c.schema = deep.clone()), "nested more than 16 deep"),
        ("a name", of(&|c| c.schema[1] = double(&"x".repeat(2000))), "a name of more than 1024 bytes"),
        ("groups", of(&|c| c.groups = 200_000), "it has more than 100000 groups of rows"),
        ("a footer behind the file", of(&|c| c.footer_bytes = Some(u32::MAX)), "its footer claims 4294967295 bytes"),
        ("a footer that has itself in it", of(&|c| c.footer_bytes = Some(1000)), "cannot be read as Parquet"),
        ("no end", good().file()[..500].to_vec(), "it does not end as a Parquet file does"),
        ("one column in each group", of(&|c| c.groups = 3), "its columns claim more bytes than the file has"),
        ("a place before the file", of(&|c| c.start = -4), "a column claims bytes outside of the file"),
        ("a place behind the file", of(&|c| c.start = 1 << 40), "a column claims bytes outside of the file"),
        ("a column of less than nothing", of(&|c| c.bytes = Some(-1)), "a column claims bytes outside of the file"),
        ("a column of more than all", of(&|c| c.bytes = Some(i64::MAX)), "a column claims bytes outside of the file"),
        (
            "a page that unpacks to all numbers",
            of(&|c| (c.codec, c.pages) = (SNAPPY, page(0, i32::MAX.into(), (100, 0), &[0; 100]))),
            "a page unpacks to more than 512 MiB",
        ),
        (
            "a page that unpacks to much",
            of(&|c| (c.codec, c.pages) = (SNAPPY, page(0, many, (100, 0), &[0; 100]))),
            "a page claims more than its column holds",
        ),
        (
            "a page that unpacks to more than it says",
            of(&|c| (c.codec, c.pages) = (GZIP, page(0, 800, (100, 0), &gzipped(&[0; 1 << 20])))),
            "a page unpacks to more than it claims",
        ),
        (
            "a page of different values",
            of(&|c| c.pages = page(2, 800, (i32::MAX.into(), 0), &[0; 800])),
            "a page claims more than its column holds",
        ),
        (
            "a dictionary that is not there",
            of(&|c| c.pages = page(0, 800, (100, 8), &[0; 800])),
            "its values contradict each other",
        ),
        ("lengths of texts", texts(&differences, 6), "a page claims more values than it has"),
        ("beginnings of texts", texts(&differences, 7), "a page claims more values than it has"),
    ];
    let mut others = Vec::new();
    for (case, bytes, expected) in told {
        match read(&bytes) {
            Ok(_) => others.push(format!("{case}: it was read")),
            Err(refusal) if refusal.to_string().contains(expected) => {}
            Err(refusal) => others.push(format!("{case}: {refusal}")),
        }
    }
    assert!(others.is_empty(), "{others:#?}");
}

/// Bytes of a good file are exchanged at random: it is read or refused, and the program goes on.
#[test]
fn a_changed_file_is_read_or_refused() {
    let good = good().file();
    let seed = std::env::var("SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(0x9e37_79b9_7f4a_7c15_u64);
    println!("SEED={seed}");
    let mut state = seed;
    let mut chance = |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % below as u64) as usize
    };
    let (mut taken, mut refused) = (0, 0);
    for _ in 0..3000 {
        let mut bytes = good.clone();
        for _ in 0..=chance(3) {
            // The values say nothing wrong: most changes are of heads and footer.
            let place = if chance(4) == 0 { chance(40) } else { bytes.len() - 1 - chance(130) };
            bytes[place] = chance(256) as u8;
        }
        if chance(10) == 0 {
            bytes.truncate(chance(bytes.len()));
        }
        match read(&bytes) {
            Ok(_) => taken += 1,
            Err(_) => refused += 1,
        }
    }
    assert!(taken > 0 && refused > 1000, "{taken} were read, {refused} refused");
}
