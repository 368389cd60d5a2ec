//! Gives the bytes of a file as UTF-8 text, whatever their packing and encoding; or says what the file is if it is not
//! text.

use std::cell::Cell;
use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::Path;
use std::rc::Rc;

use flate2::read::MultiGzDecoder;

use super::TableError;

/// Bytes that decide the kind of a file.
const SNIFFED: usize = 4096;
/// Largest ratio of unpacked to packed bytes: records need 3 to 20, a column of zeros 200. Deflate can reach 1030.
pub(super) const MOST_UNPACKED: u64 = 400;
/// Number of unpacked bytes that are always accepted.
pub(super) const FREE_UNPACKED: u64 = 64 << 20;

/// A slip of a serial line may leave one control character in this many bytes, and a few in a short file. A text has no
/// more of them.
const SLIP_EVERY: usize = 50;
const FEW_SLIPS: usize = 3;

/// The kind of a file.
pub(super) enum Source {
    /// Text in UTF-8 (or in one byte a letter), without a byte-order mark, and what was understood of its packing.
    Text(Box<dyn Read>, Vec<String>),
    /// An array of numpy, from its first byte.
    Npy(Box<dyn Read>, Vec<String>),
    Parquet(File),
}

/// Opens a file; `-` is standard input.
pub(super) fn open(path: &Path) -> Result<Source, TableError> {
    if path == Path::new("-") {
        return of(path, Box::new(io::stdin()));
    }
    let fail = |source| TableError::Io { path: path.to_owned(), source };
    let mut file = gnc_files::open(path).map_err(fail)?;
    let mut magic = [0; 4];
    let got = file.read(&mut magic).map_err(fail)?;
    io::Seek::rewind(&mut file).map_err(fail)?;
    if magic[..got] == *b"PAR1" {
        return Ok(Source::Parquet(file));
    }
    of(path, Box::new(file))
}

/// Finds the kind of any bytes.
pub(super) fn of(path: &Path, source: Box<dyn Read>) -> Result<Source, TableError> {
    let fail = |source| TableError::Io { path: path.to_owned(), source };
    let mut understood = Vec::new();
    let (mut head, mut source) = sniffed(source).map_err(fail)?;
    if head.starts_with(&[0x1f, 0x8b]) {
        understood.push("gzip".to_owned());
        (head, source) = sniffed(Box::new(unpacked(source))).map_err(fail)?;
    }
    let foreign = |what, hint| Err(TableError::Foreign { path: path.to_owned(), what, hint });
    match head.as_slice() {
        [b'P', b'K', 3 | 5, ..] => {
            return foreign("a zip archive (.xlsx, .ods, .npz)", "save the sheet as CSV, or the array as .npy");
        }
        [0x28, 0xb5, 0x2f, 0xfd, ..] => return foreign("packed with zstd", "unpack it first: zstd -d FILE"),
        [0x1f, 0x8b, ..] => return foreign("packed twice with gzip", "unpack it first: gunzip FILE"),
        [b'P', b'A', b'R', b'1', ..] => {
            return foreign("Parquet behind a pipe or gzip", "unpack it and name the file itself");
        }
        [0x89, b'H', b'D', b'F', ..] => return foreign("HDF5", "save the data set as CSV or .npy"),
        [0x89, b'M', b'C', b'A', b'P', ..] => return foreign("MCAP", "rename the file so that it ends in .mcap"),
        [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => return Ok(Source::Npy(source, understood)),
        _ => {}
    }
    let text: Box<dyn Read> = match head.as_slice() {
        [0xef, 0xbb, 0xbf, ..] => {
            skip(&mut source, 3).map_err(fail)?;
            source
        }
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => {
            understood.push("UTF-16".to_owned());
            skip(&mut source, 2).map_err(fail)?;
            Box::new(Utf16::new(source, head[0] == 0xff))
        }
        // UTF-16 without its mark: letters of the header are ASCII, so every second byte is 0.
        [a, 0, b, 0, ..] if *a != 0 && *b != 0 => {
            understood.push("UTF-16 without a mark".to_owned());
            Box::new(Utf16::new(source, true))
        }
        [0, a, 0, b, ..] if *a != 0 && *b != 0 => {
            understood.push("UTF-16 without a mark".to_owned());
            Box::new(Utf16::new(source, false))
        }
        _ if is_binary(&head) => {
            return foreign("binary", "give a table as text, .npy or Parquet, or raw samples as .mcap");
        }
        _ => source,
    };
    if head.contains(&b'\r') && !head.contains(&b'\n') {
        understood.push("line ends are carriage returns".to_owned());
        return Ok(Source::Text(Box::new(Returns(text)), understood));
    }
    Ok(Source::Text(text, understood))
}

/// Whether the first bytes of a file hold too many control characters for text in UTF-8 or in one byte a letter.
fn is_binary(head: &[u8]) -> bool {
    let controls = head.iter().filter(|byte| byte.is_ascii_control() && !byte.is_ascii_whitespace()).count();
    controls > (head.len() / SLIP_EVERY).max(FEW_SLIPS)
}

/// The first bytes of a source, and the source with these bytes still in front.
fn sniffed(mut source: Box<dyn Read>) -> io::Result<(Vec<u8>, Box<dyn Read>)> {
    let mut head = Vec::new();
    source.by_ref().take(SNIFFED as u64).read_to_end(&mut head)?;
    Ok((head.clone(), Box::new(Cursor::new(head).chain(source))))
}

fn skip(source: &mut impl Read, bytes: u64) -> io::Result<()> {
    io::copy(&mut source.take(bytes), &mut io::sink()).map(|_| ())
}

/// Unpacks gzip, and stops if a small file unpacks to too many bytes.
fn unpacked(source: Box<dyn Read>) -> impl Read {
    let packed = Rc::new(Cell::new(0));
    let counted = Counted { source, packed: packed.clone() };
    Bounded { source: MultiGzDecoder::new(counted), packed, unpacked: 0 }
}

struct Counted {
    source: Box<dyn Read>,
    packed: Rc<Cell<u64>>,
}

impl Read for Counted {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let got = self.source.read(buffer)?;
        self.packed.set(self.packed.get() + got as u64);
        Ok(got)
    }
}

struct Bounded<R> {
    source: R,
    packed: Rc<Cell<u64>>,
    unpacked: u64,
}

impl<R: Read> Read for Bounded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let got = self.source.read(buffer)?;
        self.unpacked += got as u64;
        if self.unpacked > FREE_UNPACKED.max(MOST_UNPACKED * self.packed.get()) {
            let what = format!("it unpacks to more than {MOST_UNPACKED} times its size, so it is not a record");
            return Err(io::Error::new(io::ErrorKind::InvalidData, what));
        }
        Ok(got)
    }
}

/// Turns line ends of a carriage return alone into line feeds.
struct Returns<R>(R);

impl<R: Read> Read for Returns<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let got = self.0.read(buffer)?;
        buffer[..got].iter_mut().filter(|b| **b == b'\r').for_each(|b| *b = b'\n');
        Ok(got)
    }
}

/// Converts UTF-16 to UTF-8. Invalid text becomes the replacement character.
struct Utf16<R> {
    source: R,
    little: bool,
    /// Half of a unit, and a high surrogate, whose other half is not read yet.
    half: Option<u8>,
    high: Option<u16>,
    out: Vec<u8>,
    at: usize,
}

impl<R: Read> Utf16<R> {
    fn new(source: R, little: bool) -> Self {
        Self { source, little, half: None, high: None, out: Vec::new(), at: 0 }
    }

    /// Reads and converts some more; false at the end.
    fn more(&mut self) -> io::Result<bool> {
        let mut bytes = vec![0; 1 << 16];
        let got = self.source.read(&mut bytes)?;
        let mut units: Vec<u16> = self.high.take().into_iter().collect();
        for byte in &bytes[..got] {
            match self.half.take() {
                None => self.half = Some(*byte),
                Some(first) if self.little => units.push(u16::from_le_bytes([first, *byte])),
                Some(first) => units.push(u16::from_be_bytes([first, *byte])),
            }
        }
        if got > 0 && units.last().is_some_and(|unit| (0xd800..0xdc00).contains(unit)) {
            self.high = units.pop();
        }
        let text: String = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
        self.out = text.into_bytes();
        self.at = 0;
        Ok(got > 0)
    }
}

impl<R: Read> Read for Utf16<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.at == self.out.len() {
            if !self.more()? && self.out.is_empty() {
                return Ok(0);
            }
        }
        let count = buffer.len().min(self.out.len() - self.at);
        buffer[..count].copy_from_slice(&self.out[self.at..self.at + count]);
        self.at += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn text(bytes: Vec<u8>) -> Result<(String, Vec<String>), String> {
        match of(Path::new("r"), Box::new(Cursor::new(bytes))) {
            Ok(Source::Text(mut source, understood)) => {
                let mut text = String::new();
                source.read_to_string(&mut text).map_err(|e| e.to_string())?;
                Ok((text, understood))
            }
            Ok(_) => Err("no text".to_owned()),
            Err(e) => Err(e.to_string()),
        }
    }

    fn gzip(bytes: &[u8]) -> Vec<u8> {
        let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
        out.write_all(bytes).unwrap();
        out.finish().unwrap()
    }

    #[test]
    fn every_packing_gives_the_same_text() {
        let record = "t;w [°/s]\n0;1\n\u{1f600}".repeat(20_000);
        let wide = |bytes: fn(u16) -> [u8; 2], mark: bool| -> Vec<u8> {
            let units = mark.then_some(0xfeff).into_iter().chain(record.encode_utf16());
            units.flat_map(bytes).collect()
        };
        let (le, be) = (wide(u16::to_le_bytes, true), wide(u16::to_be_bytes, true));
        let two = [gzip(&record.as_bytes()[..1000]), gzip(&record.as_bytes()[1000..])].concat();
        for (bytes, said) in [
            (record.clone().into_bytes(), vec![]),
            (format!("\u{feff}{record}").into_bytes(), vec![]),
            (le.clone(), vec!["UTF-16"]),
            (be, vec!["UTF-16"]),
            (wide(u16::to_le_bytes, false), vec!["UTF-16 without a mark"]),
            (gzip(record.as_bytes()), vec!["gzip"]),
            (gzip(&le), vec!["gzip", "UTF-16"]),
            (two, vec!["gzip"]),
        ] {
            let (read, understood) = text(bytes).unwrap();
            assert!(read == record, "{said:?}");
            assert_eq!(understood, said);
        }
        assert_eq!(text(b"x\r1\r2\r".to_vec()).unwrap().0, "x\n1\n2\n");
    }

    #[test]
    fn bombs_and_strangers_are_refused() {
        let bomb = gzip(&vec![b'0'; 70 << 20]);
        assert!(bomb.len() < 1 << 20);
        let said = text(bomb).map(|(text, _)| text.len()).unwrap_err();
        assert!(said.contains("more than 400 times its size"), "{said}");
        let cut = gzip("t,w\n0,1\n".repeat(1000).as_bytes());
        assert!(text(cut[..cut.len() / 2].to_vec()).is_err());
        assert!(text(b"PK\x03\x04rest".to_vec()).unwrap_err().contains("zip archive"));
        assert!(text(b"\x28\xb5\x2f\xfdrest".to_vec()).unwrap_err().contains("zstd"));
        let program = std::fs::read(std::env::current_exe().unwrap()).unwrap();
        assert!(text(program).unwrap_err().contains("is binary, not a table"));
        let every_byte: Vec<u8> = (0..4096_usize).map(|at| (at * 151 % 256) as u8).collect();
        assert!(text(every_byte).unwrap_err().contains("is binary, not a table"));
        // A text from a serial line that slipped is text with a bad row.
        let slipped = format!("t,w\n0,1\n0.1\0,\u{1b}2\n{}", "0.2,3\n".repeat(100));
        assert_eq!(text(slipped.clone().into_bytes()).unwrap().0, slipped);
    }
}
