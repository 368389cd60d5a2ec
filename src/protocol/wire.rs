//! The layout of every payload: little-endian fields, one after the other, without padding.
//!
//! Integers and IEEE 754 doubles are little-endian; a text is a length byte and that many bytes of UTF-8; a byte
//! block is a `u16` length and the bytes; a list is a `u16` count and the elements.

use core::fmt::Write as _;

use heapless::{String, Vec};

/// Longest payload. A full frame takes 46 ms at 115200 baud, so an ABORT never waits long behind one.
pub const MAX_PAYLOAD: usize = 512;
/// A payload in its own buffer.
pub type Payload = heapless::Vec<u8, MAX_PAYLOAD>;

/// Why a payload could not be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum WireError {
    /// The payload ends before its last field.
    #[error("the payload ends after {have} bytes, in the middle of a field")]
    Short {
        /// Bytes in the payload.
        have: usize,
    },
    /// Bytes are left after the last field.
    #[error("{extra} byte{} left after the last field", if *extra == 1 { " is" } else { "s are" })]
    Long {
        /// Bytes too many.
        extra: usize,
    },
    /// A list, block or text is longer than the message allows.
    #[error("a field has {length} elements, and at most {most} are allowed")]
    TooMany {
        /// Elements announced.
        length: usize,
        /// The field's bound.
        most: usize,
    },
    /// A text is not UTF-8.
    #[error("a text is not UTF-8")]
    NotUtf8,
    /// An enumerated field holds a number without a meaning.
    #[error("{value} is no {} that the interface document has", Words(field))]
    Unknown {
        /// The field.
        field: &'static str,
        /// The number it held.
        value: u32,
    },
}

/// The name of a field as words: "fault code" for `FaultCode`.
struct Words<'a>(&'a str);

impl core::fmt::Display for Words<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        for (index, letter) in self.0.char_indices() {
            if letter.is_ascii_uppercase() && index > 0 {
                f.write_char(' ')?;
            }
            f.write_char(letter.to_ascii_lowercase())?;
        }
        Ok(())
    }
}

/// The message does not fit into [`MAX_PAYLOAD`] bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the message is longer than {MAX_PAYLOAD} bytes")]
pub struct Overflow;

/// Writes fields into a payload.
#[derive(Debug, Default)]
pub struct FieldWriter {
    payload: Payload,
}

impl FieldWriter {
    /// Appends raw bytes.
    ///
    /// # Errors
    /// [`Overflow`] when the payload is full.
    pub fn bytes(&mut self, bytes: &[u8]) -> Result<(), Overflow> {
        self.payload.extend_from_slice(bytes).map_err(|_| Overflow)
    }

    /// The payload written so far.
    #[must_use]
    pub fn finish(self) -> Payload {
        self.payload
    }
}

/// Reads fields from a payload.
#[derive(Debug)]
pub struct FieldReader<'a> {
    all: usize,
    rest: &'a [u8],
}

impl<'a> FieldReader<'a> {
    /// Makes a reader at the first byte.
    #[must_use]
    pub fn new(payload: &'a [u8]) -> Self {
        Self { all: payload.len(), rest: payload }
    }

    /// The next `count` bytes.
    ///
    /// # Errors
    /// [`WireError::Short`].
    pub fn take(&mut self, count: usize) -> Result<&'a [u8], WireError> {
        let (head, tail) = self.rest.split_at_checked(count).ok_or(WireError::Short { have: self.all })?;
        self.rest = tail;
        Ok(head)
    }

    /// All bytes that are left.
    pub fn take_rest(&mut self) -> &'a [u8] {
        core::mem::take(&mut self.rest)
    }

    /// Ends the reading.
    ///
    /// # Errors
    /// [`WireError::Long`] when bytes are left.
    pub fn finish(self) -> Result<(), WireError> {
        match self.rest.len() {
            0 => Ok(()),
            extra => Err(WireError::Long { extra }),
        }
    }
}

/// A value with a layout on the wire.
pub trait Wire: Sized {
    /// Appends the value.
    ///
    /// # Errors
    /// [`Overflow`] when the payload is full.
    fn put(&self, writer: &mut FieldWriter) -> Result<(), Overflow>;

    /// Reads the value.
    ///
    /// # Errors
    /// [`WireError`] when the bytes are not such a value.
    fn get(reader: &mut FieldReader<'_>) -> Result<Self, WireError>;

    /// The value as a payload of its own.
    ///
    /// # Errors
    /// [`Overflow`] when it is longer than [`MAX_PAYLOAD`].
    fn to_payload(&self) -> Result<Payload, Overflow> {
        let mut writer = FieldWriter::default();
        self.put(&mut writer)?;
        Ok(writer.finish())
    }

    /// Reads the value that fills the whole payload.
    ///
    /// # Errors
    /// [`WireError`] when the bytes are not exactly such a value.
    fn from_payload(payload: &[u8]) -> Result<Self, WireError> {
        let mut reader = FieldReader::new(payload);
        let value = Self::get(&mut reader)?;
        reader.finish()?;
        Ok(value)
    }
}

macro_rules! wire_numbers {
    ($($number:ty),*) => {$(
        impl Wire for $number {
            fn put(&self, writer: &mut FieldWriter) -> Result<(), Overflow> {
                writer.bytes(&self.to_le_bytes())
            }
            fn get(reader: &mut FieldReader<'_>) -> Result<Self, WireError> {
                let mut bytes = [0; size_of::<$number>()];
                bytes.copy_from_slice(reader.take(size_of::<$number>())?);
                Ok(<$number>::from_le_bytes(bytes))
            }
        }
    )*};
}
wire_numbers!(u8, u16, u32, u64, i16, i32, f64);

impl Wire for () {
    fn put(&self, _: &mut FieldWriter) -> Result<(), Overflow> {
        Ok(())
    }
    fn get(_: &mut FieldReader<'_>) -> Result<Self, WireError> {
        Ok(())
    }
}

impl<T: Wire + Copy + Default, const N: usize> Wire for [T; N] {
    fn put(&self, writer: &mut FieldWriter) -> Result<(), Overflow> {
        self.iter().try_for_each(|element| element.put(writer))
    }
    fn get(reader: &mut FieldReader<'_>) -> Result<Self, WireError> {
        let mut array = [T::default(); N];
        for element in &mut array {
            *element = T::get(reader)?;
        }
        Ok(array)
    }
}

/// A text of at most `N` bytes, `N` <= 255.
pub type Text<const N: usize> = String<N>;

/// The longest beginning of `text` that fits. A short diagnostic is better than a lost one.
#[must_use]
pub fn text<const N: usize>(text: &str) -> Text<N> {
    let mut fitting = Text::new();
    for character in text.chars() {
        if fitting.push(character).is_err() {
            break;
        }
    }
    fitting
}

impl<const N: usize> Wire for String<N> {
    fn put(&self, writer: &mut FieldWriter) -> Result<(), Overflow> {
        let length = u8::try_from(self.len()).map_err(|_| Overflow)?;
        length.put(writer)?;
        writer.bytes(self.as_bytes())
    }
    fn get(reader: &mut FieldReader<'_>) -> Result<Self, WireError> {
        let length = usize::from(u8::get(reader)?);
        let text = core::str::from_utf8(reader.take(length)?).map_err(|_| WireError::NotUtf8)?;
        Self::try_from(text).map_err(|_| WireError::TooMany { length, most: N })
    }
}

/// A list of at most `N` elements (for bytes, a block).
pub type List<T, const N: usize> = Vec<T, N>;

impl<T: Wire, const N: usize> Wire for Vec<T, N> {
    fn put(&self, writer: &mut FieldWriter) -> Result<(), Overflow> {
        u16::try_from(self.len()).map_err(|_| Overflow)?.put(writer)?;
        self.iter().try_for_each(|element| element.put(writer))
    }
    fn get(reader: &mut FieldReader<'_>) -> Result<Self, WireError> {
        let length = usize::from(u16::get(reader)?);
        if length > N {
            return Err(WireError::TooMany { length, most: N });
        }
        let mut list = Self::new();
        for _ in 0..length {
            // The length is checked above, so there is room.
            let _ = list.push(T::get(reader)?);
        }
        Ok(list)
    }
}

/// Declares a struct. Its fields are on the wire in the written order.
macro_rules! wire_struct {
    ($(#[$meta:meta])* $name:ident { $($(#[$field_meta:meta])* $field:ident: $kind:ty),* $(,)? }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, PartialEq, Default)]
        pub struct $name { $($(#[$field_meta])* pub $field: $kind),* }

        impl $crate::wire::Wire for $name {
            fn put(&self, writer: &mut $crate::wire::FieldWriter) -> Result<(), $crate::wire::Overflow> {
                $($crate::wire::Wire::put(&self.$field, writer)?;)*
                let _ = writer;
                Ok(())
            }
            fn get(reader: &mut $crate::wire::FieldReader<'_>) -> Result<Self, $crate::wire::WireError> {
                let _ = &reader;
                Ok(Self { $($field: $crate::wire::Wire::get(reader)?),* })
            }
        }
    };
}
pub(crate) use wire_struct;

/// Declares a byte that stands for one of a few names.
macro_rules! wire_enum {
    ($(#[$meta:meta])* $name:ident: $number:ty { $($(#[$variant_meta:meta])* $variant:ident = $value:literal),* $(,)? }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        #[repr($number)]
        pub enum $name { $($(#[$variant_meta])* $variant = $value),* }

        impl $name {
            /// Every value.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// The name for a number on the wire.
            #[must_use]
            pub fn from_number(number: $number) -> Option<Self> {
                match number { $($value => Some(Self::$variant),)* _ => None }
            }
        }

        impl $crate::wire::Wire for $name {
            fn put(&self, writer: &mut $crate::wire::FieldWriter) -> Result<(), $crate::wire::Overflow> {
                $crate::wire::Wire::put(&(*self as $number), writer)
            }
            fn get(reader: &mut $crate::wire::FieldReader<'_>) -> Result<Self, $crate::wire::WireError> {
                let value = <$number as $crate::wire::Wire>::get(reader)?;
                Self::from_number(value)
                    .ok_or($crate::wire::WireError::Unknown { field: stringify!($name), value: u32::from(value) })
            }
        }
    };
}
pub(crate) use wire_enum;
