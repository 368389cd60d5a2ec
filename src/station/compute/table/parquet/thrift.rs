//! The compact form of Thrift, in which a Parquet file describes itself (<https://github.com/apache/thrift>,
//! `doc/specs/thrift-compact-protocol.md`). It is walked over with bounds, and nothing of it is kept.

use std::io::{self, Read};

/// Deepest structure within another: those of Parquet have six levels.
const DEEPEST: u32 = 16;
/// Longest list. It stands beside those of columns and row groups, which have bounds of their own.
const LONGEST_LIST: u64 = 1 << 20;
/// Bytes of the longest whole number.
const LONGEST_NUMBER: u32 = 10;

/// Kinds of fields and of what a list holds.
pub(super) mod kind {
    pub(in super::super) const TRUE: u8 = 1;
    pub(in super::super) const FALSE: u8 = 2;
    pub(in super::super) const BYTE: u8 = 3;
    pub(in super::super) const SHORT: u8 = 4;
    pub(in super::super) const INT: u8 = 5;
    pub(in super::super) const LONG: u8 = 6;
    pub(in super::super) const DOUBLE: u8 = 7;
    pub(in super::super) const BINARY: u8 = 8;
    pub(in super::super) const LIST: u8 = 9;
    pub(in super::super) const SET: u8 = 10;
    pub(in super::super) const MAP: u8 = 11;
    pub(in super::super) const STRUCT: u8 = 12;
}

/// Walks over a source, of which no more than a number of bytes is read.
pub(super) struct Thrift<R> {
    source: R,
    left: u64,
    read: u64,
}

impl<R: Read> Thrift<R> {
    pub(super) fn new(source: R, most: u64) -> Self {
        Self { source, left: most, read: 0 }
    }

    /// Bytes that were read so far.
    pub(super) fn bytes_read(&self) -> u64 {
        self.read
    }

    fn count(&mut self, bytes: u64) -> io::Result<()> {
        self.left = self.left.checked_sub(bytes).ok_or(io::ErrorKind::UnexpectedEof)?;
        self.read += bytes;
        Ok(())
    }

    fn byte(&mut self) -> io::Result<u8> {
        self.count(1)?;
        let mut byte = [0];
        self.source.read_exact(&mut byte)?;
        Ok(byte[0])
    }

    fn pass(&mut self, bytes: u64) -> io::Result<()> {
        self.count(bytes)?;
        let passed = io::copy(&mut self.source.by_ref().take(bytes), &mut io::sink())?;
        if passed == bytes { Ok(()) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
    }

    fn number(&mut self) -> io::Result<u64> {
        let mut number = 0;
        for place in 0..LONGEST_NUMBER {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7f) << (7 * place);
            if byte & 0x80 == 0 {
                return Ok(number);
            }
        }
        Err(io::ErrorKind::InvalidData.into())
    }

    /// A whole number with a sign.
    pub(super) fn int(&mut self) -> io::Result<i64> {
        let number = self.number()?;
        Ok((number >> 1) as i64 ^ -((number & 1) as i64))
    }

    /// The length of a text, which is passed over.
    pub(super) fn text(&mut self) -> io::Result<u64> {
        let length = self.number()?;
        self.pass(length)?;
        Ok(length)
    }

    /// The head of a list: what it holds, and how many.
    pub(super) fn list(&mut self) -> io::Result<(u8, u64)> {
        let head = self.byte()?;
        let length = if head >> 4 == 15 { self.number()? } else { u64::from(head >> 4) };
        if length > LONGEST_LIST { Err(io::ErrorKind::InvalidData.into()) } else { Ok((head & 0xf, length)) }
    }

    /// The number and the kind of the next field behind a field; `None` at the end of the structure.
    pub(super) fn field(&mut self, before: i16) -> io::Result<Option<(i16, u8)>> {
        let head = self.byte()?;
        let kind = head & 0xf;
        if kind == 0 {
            return Ok(None);
        }
        let number = match head >> 4 {
            0 => i16::try_from(self.int()?).ok(),
            step => before.checked_add(i16::from(step)),
        };
        Ok(Some((number.ok_or(io::ErrorKind::InvalidData)?, kind)))
    }

    /// Passes over a value.
    pub(super) fn skip(&mut self, of: u8) -> io::Result<()> {
        self.skip_within(of, DEEPEST)
    }

    fn skip_within(&mut self, of: u8, depth: u32) -> io::Result<()> {
        let deeper = depth.checked_sub(1).ok_or(io::ErrorKind::InvalidData)?;
        match of {
            // A field has them in its head.
            kind::TRUE | kind::FALSE => Ok(()),
            kind::BYTE => self.pass(1),
            kind::SHORT | kind::INT | kind::LONG => self.number().map(drop),
            kind::DOUBLE => self.pass(8),
            kind::BINARY => self.text().map(drop),
            kind::LIST | kind::SET => {
                let (of, length) = self.list()?;
                (0..length).try_for_each(|_| self.skip_listed(of, deeper))
            }
            kind::MAP => {
                let length = self.number()?;
                let of = if length == 0 { 0 } else { self.byte()? };
                (0..length).try_for_each(|_| {
                    self.skip_listed(of >> 4, deeper)?;
                    self.skip_listed(of & 0xf, deeper)
                })
            }
            kind::STRUCT => {
                let mut before = 0;
                while let Some((number, of)) = self.field(before)? {
                    self.skip_within(of, deeper)?;
                    before = number;
                }
                Ok(())
            }
            _ => Err(io::ErrorKind::InvalidData.into()),
        }
    }

    fn skip_listed(&mut self, of: u8, depth: u32) -> io::Result<()> {
        match of {
            kind::TRUE | kind::FALSE => self.pass(1),
            of => self.skip_within(of, depth),
        }
    }
}
