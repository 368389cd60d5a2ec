//! The part of protobuf's wire format that flat messages need (protobuf.dev, "Encoding"): varints, fixed numbers,
//! bytes.

/// Bytes of the longest varint: 64 bits in groups of seven.
const LONGEST_VARINT: usize = 10;

const VARINT: u64 = 0;
const FIXED_64: u64 = 1;
const BYTES: u64 = 2;
const FIXED_32: u64 = 5;

/// Puts fields at the end of a message.
#[derive(Debug)]
pub(super) struct Fields<'a>(pub(super) &'a mut Vec<u8>);

impl Fields<'_> {
    /// `uint32`, `uint64`, an enum.
    pub(super) fn unsigned(&mut self, field: u32, value: u64) -> &mut Self {
        self.key(field, VARINT);
        varint(self.0, value);
        self
    }

    /// `sint32`: small numbers of either sign are short.
    pub(super) fn signed(&mut self, field: u32, value: i32) -> &mut Self {
        let zigzag = (value << 1) ^ (value >> 31);
        self.unsigned(field, u64::from(zigzag.cast_unsigned()))
    }

    /// `sfixed32`.
    pub(super) fn fixed(&mut self, field: u32, value: i32) -> &mut Self {
        self.key(field, FIXED_32);
        self.0.extend_from_slice(&value.to_le_bytes());
        self
    }

    /// `double`.
    pub(super) fn double(&mut self, field: u32, value: f64) -> &mut Self {
        self.key(field, FIXED_64);
        self.0.extend_from_slice(&value.to_le_bytes());
        self
    }

    /// `string`, `bytes`, a message.
    pub(super) fn bytes(&mut self, field: u32, value: &[u8]) -> &mut Self {
        self.key(field, BYTES);
        varint(self.0, value.len() as u64);
        self.0.extend_from_slice(value);
        self
    }

    fn key(&mut self, field: u32, kind: u64) {
        varint(self.0, u64::from(field) << 3 | kind);
    }
}

fn varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// The value of a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Value<'a> {
    Varint(u64),
    Double(f64),
    Bytes(&'a [u8]),
    Fixed(i32),
}

impl<'a> Value<'a> {
    pub(super) fn unsigned(self) -> Option<u64> {
        if let Self::Varint(value) = self { Some(value) } else { None }
    }

    pub(super) fn narrow<T: TryFrom<u64>>(self) -> Option<T> {
        T::try_from(self.unsigned()?).ok()
    }

    pub(super) fn signed(self) -> Option<i32> {
        let zigzag = self.narrow::<u32>()?;
        Some((zigzag >> 1).cast_signed() ^ -((zigzag & 1).cast_signed()))
    }

    pub(super) fn fixed(self) -> Option<i32> {
        if let Self::Fixed(value) = self { Some(value) } else { None }
    }

    pub(super) fn double(self) -> Option<f64> {
        if let Self::Double(value) = self { Some(value) } else { None }
    }

    pub(super) fn bytes(self) -> Option<&'a [u8]> {
        if let Self::Bytes(bytes) = self { Some(bytes) } else { None }
    }

    pub(super) fn text(self) -> Option<String> {
        String::from_utf8(self.bytes()?.to_vec()).ok()
    }
}

/// Takes a field from the beginning of a message: number and value. `Some(None)` at the end, `None` if it is not a
/// message.
pub(super) fn next<'a>(rest: &mut &'a [u8]) -> Option<Option<(u32, Value<'a>)>> {
    if rest.is_empty() {
        return Some(None);
    }
    let key = take_varint(rest)?;
    let value = match key & 7 {
        VARINT => Value::Varint(take_varint(rest)?),
        FIXED_64 => Value::Double(f64::from_le_bytes(*rest.split_off(..8)?.first_chunk()?)),
        BYTES => {
            let length = usize::try_from(take_varint(rest)?).ok()?;
            Value::Bytes(rest.split_off(..length)?)
        }
        FIXED_32 => Value::Fixed(i32::from_le_bytes(*rest.split_off(..4)?.first_chunk()?)),
        _ => return None,
    };
    Some(Some((u32::try_from(key >> 3).ok()?, value)))
}

fn take_varint(rest: &mut &[u8]) -> Option<u64> {
    // Most varints are one byte long.
    let mut value = 0;
    for (index, byte) in rest.iter().take(LONGEST_VARINT).enumerate() {
        value |= u64::from(byte & 0x7f) << (7 * index);
        if byte & 0x80 == 0 {
            *rest = &rest[index + 1..];
            return Some(value);
        }
    }
    None
}
