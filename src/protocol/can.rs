//! Classic CAN: frames, the ids of the interface document, ISO-TP, streams as raw frames, slcan, and both ends of the
//! link ([`endpoint`]). The module has no I/O and no clock: frames and link time go in, frames come out.

mod compensated;
pub mod endpoint;
pub mod id;
pub mod isotp;
pub mod slcan;
pub mod stream;

/// Bit rate of the bus.
pub const BIT_RATE: u32 = 500_000;
/// Data bytes of a frame, at most.
pub const MAX_DATA: usize = 8;

/// Data of a frame in its own buffer.
pub type Data = heapless::Vec<u8, MAX_DATA>;

/// An identifier. The lower one wins the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum CanId {
    /// 11 bits.
    Standard(u16),
    /// 29 bits.
    Extended(u32),
}

impl CanId {
    /// Largest standard id.
    pub const MAX_STANDARD: u16 = 0x7ff;
    /// Largest extended id.
    pub const MAX_EXTENDED: u32 = 0x1fff_ffff;

    /// Whether the id has only as many bits as its kind allows.
    #[must_use]
    pub const fn is_valid(self) -> bool {
        match self {
            Self::Standard(id) => id <= Self::MAX_STANDARD,
            Self::Extended(id) => id <= Self::MAX_EXTENDED,
        }
    }
}

/// A data frame: a valid id and 0 to 8 bytes. This protocol has no remote frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct CanFrame {
    id: CanId,
    length: u8,
    /// Zero beyond the length, so that equal frames compare equal.
    data: [u8; MAX_DATA],
}

impl CanFrame {
    /// Makes a frame; `None` if the id has too many bits or there are more than eight bytes.
    #[must_use]
    #[inline]
    pub fn new(id: CanId, bytes: &[u8]) -> Option<Self> {
        if !id.is_valid() || bytes.len() > MAX_DATA {
            return None;
        }
        let mut data = [0; MAX_DATA];
        data[..bytes.len()].copy_from_slice(bytes);
        Some(Self { id, length: bytes.len() as u8, data })
    }

    /// A frame of eight bytes under a standard id of this protocol.
    pub(crate) const fn full(id: u16, data: [u8; MAX_DATA]) -> Self {
        Self { id: CanId::Standard(id & CanId::MAX_STANDARD), length: MAX_DATA as u8, data }
    }

    /// The id.
    #[must_use]
    pub const fn id(&self) -> CanId {
        self.id
    }

    /// The data.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        &self.data[..usize::from(self.length)]
    }

    /// Bits on the bus, without stuffing, with the three bits of space after the frame.
    #[must_use]
    pub const fn bits(&self) -> u32 {
        bits(matches!(self.id, CanId::Extended(_)), self.length as u32)
    }

    /// Bits on the bus with the largest possible number of stuff bits. This is the safe value for a pace.
    #[must_use]
    pub const fn worst_bits(&self) -> u32 {
        worst_bits(matches!(self.id, CanId::Extended(_)), self.length as u32)
    }
}

/// Bits of a frame without stuffing: start, id and control, data, CRC, delimiters and acknowledgement, end, space.
#[must_use]
pub const fn bits(extended: bool, length: u32) -> u32 {
    (if extended { 67 } else { 47 }) + 8 * length
}

/// [`bits`] with the most stuff bits: one for each four bits after the first, from the start to the end of the CRC.
#[must_use]
pub const fn worst_bits(extended: bool, length: u32) -> u32 {
    let stuffed = (if extended { 54 } else { 34 }) + 8 * length;
    bits(extended, length) + (stuffed - 1) / 4
}

/// Time that this many bits need on the bus, rounded up to a microsecond.
#[must_use]
pub fn bus_time(bits: u64) -> core::time::Duration {
    core::time::Duration::from_micros((bits * 1_000_000).div_ceil(u64::from(BIT_RATE)))
}
