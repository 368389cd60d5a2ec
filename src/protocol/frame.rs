//! The frame that both links carry: an eight-byte header, up to 512 bytes of payload, a CRC-32C.

use crc::{CRC_32_ISCSI, CRC_32_ISO_HDLC, Crc, NoTable, Table};

use crate::wire::wire_enum;
pub use crate::wire::{MAX_PAYLOAD, Payload};

/// Version of the messages in this crate. HELLO frames carry version 0, since their layout never changes.
pub const PROTOCOL_VERSION: u8 = 1;
/// Bytes of the header.
pub const HEADER: usize = 8;
/// Bytes of the checksum.
pub const CRC: usize = 4;
/// Longest frame before it is stuffed for a link.
pub const MAX_FRAME: usize = HEADER + MAX_PAYLOAD + CRC;

/// CRC-32C (Castagnoli; CRC-32/ISCSI): finds every error of up to five bits in a frame of this length.
static CRC_32C: Crc<u32, Table<16>> = Crc::<u32, Table<16>>::new(&CRC_32_ISCSI);

/// The checksum of Ethernet and zip, which many libraries call "the" CRC-32. Only damaged frames are compared with it, so it
/// needs no table.
static CRC_32_OF_ETHERNET: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// The checksum of `bytes`.
#[must_use]
pub fn checksum(bytes: &[u8]) -> u32 {
    CRC_32C.checksum(bytes)
}

wire_enum! {
    /// What a frame is in the life of a request.
    Kind: u8 {
        /// Opens a session, both ways.
        Hello = 0,
        /// Host: do this.
        Request = 1,
        /// Board: understood and started.
        Accept = 2,
        /// Board: still running.
        Progress = 3,
        /// Board: ended; status and body.
        Result = 4,
        /// Board: numbered samples, never acknowledged.
        Stream = 5,
        /// Either side: heartbeat, keep-alive, watchdog; never acknowledged.
        Event = 6,
        /// Board: refused, never started.
        Nak = 7,
    }
}

/// Marks on a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Flags(pub u8);

impl Flags {
    /// Host: this request was sent before under the same id.
    pub const RESENT: Self = Self(0x01);
    /// Board: this answer was given before and is repeated from memory.
    pub const REPLAYED: Self = Self(0x02);

    /// Whether the mark is set.
    #[must_use]
    pub fn has(self, mark: Self) -> bool {
        self.0 & mark.0 != 0
    }
}

/// The header, eight bytes: version and kind, flags, request id, message id, sequence number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Version of the layout, 0 in HELLO frames.
    pub version: u8,
    /// What the frame is.
    pub kind: Kind,
    /// Marks.
    pub flags: Flags,
    /// The host's number for the request, echoed; 0 in frames without a request.
    pub request: u16,
    /// Which message.
    pub message: u16,
    /// Counts the frames of one direction, for the statistics of losses.
    pub sequence: u16,
}

/// A checksum that is not damaged but worked out in another way than section 3 of the interface document asks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChecksumMistake {
    /// The right CRC-32C, most significant byte first.
    ByteOrder,
    /// The CRC-32C without the final exclusive or.
    NotInverted,
    /// The CRC-32 of Ethernet and zip.
    OtherPolynomial,
}

impl ChecksumMistake {
    /// Compares a wrong checksum with those of the usual mistakes. A damaged frame fits one of them once in 10^9 times.
    fn of(content: &[u8], received: u32, computed: u32) -> Option<Self> {
        let mistakes = [
            (Self::ByteOrder, computed.swap_bytes()),
            (Self::NotInverted, !computed),
            (Self::OtherPolynomial, CRC_32_OF_ETHERNET.checksum(content)),
        ];
        mistakes.into_iter().find(|(_, checksum)| *checksum == received).map(|(mistake, _)| mistake)
    }

    /// The mistake in words.
    #[must_use]
    pub fn meaning(self) -> &'static str {
        match self {
            Self::ByteOrder => "its most significant byte comes first",
            Self::NotInverted => "the final exclusive or is missing",
            Self::OtherPolynomial => "it is the CRC-32 of Ethernet instead of CRC-32C",
        }
    }
}

/// Why bytes are not a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum FrameError {
    /// Fewer bytes than a header and a checksum.
    #[error("a frame of {length} bytes is shorter than header and checksum")]
    Short {
        /// Bytes received.
        length: usize,
    },
    /// More bytes than the longest frame.
    #[error("a frame of more than {MAX_FRAME} bytes")]
    Long,
    /// The stuffing is broken.
    #[error("broken byte stuffing")]
    Stuffing,
    /// The checksum does not match.
    #[error("checksum {received:08x} received, {computed:08x} computed")]
    Checksum {
        /// The checksum as received.
        received: u32,
        /// The checksum of the bytes that came.
        computed: u32,
        /// The mistake by which the sender comes to its checksum, if it is no damage.
        mistake: Option<ChecksumMistake>,
    },
    /// The kind is unknown. The checksum is good, so the other end speaks another protocol.
    #[error("frame kind {kind} is unknown")]
    UnknownKind {
        /// The number.
        kind: u8,
    },
}

/// A whole frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// The header.
    pub header: Header,
    /// The payload.
    pub payload: Payload,
}

impl Frame {
    /// Header, payload and checksum as bytes, before stuffing.
    #[must_use]
    pub fn to_bytes(&self) -> heapless::Vec<u8, MAX_FRAME> {
        let h = &self.header;
        let mut bytes = heapless::Vec::new();
        let [r0, r1] = h.request.to_le_bytes();
        let [m0, m1] = h.message.to_le_bytes();
        let [s0, s1] = h.sequence.to_le_bytes();
        // The buffer holds the longest frame, so none of these calls can fail.
        let _ = bytes.extend_from_slice(&[h.version << 4 | h.kind as u8, h.flags.0, r0, r1, m0, m1, s0, s1]);
        let _ = bytes.extend_from_slice(&self.payload);
        let crc = checksum(&bytes);
        let _ = bytes.extend_from_slice(&crc.to_le_bytes());
        bytes
    }

    /// Reads a frame from unstuffed bytes.
    ///
    /// # Errors
    /// [`FrameError`] for a wrong length, checksum or kind.
    #[inline]
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FrameError> {
        if bytes.len() > MAX_FRAME {
            return Err(FrameError::Long);
        }
        let short = FrameError::Short { length: bytes.len() };
        let (content, tail) = bytes.split_last_chunk::<CRC>().ok_or(short)?;
        let (head, payload) = content.split_first_chunk::<HEADER>().ok_or(short)?;
        let received = u32::from_le_bytes(*tail);
        let computed = checksum(content);
        if received != computed {
            let mistake = ChecksumMistake::of(content, received, computed);
            return Err(FrameError::Checksum { received, computed, mistake });
        }
        let &[first, flags, r0, r1, m0, m1, s0, s1] = head;
        let kind = Kind::from_number(first & 0x0f).ok_or(FrameError::UnknownKind { kind: first & 0x0f })?;
        Ok(Self {
            header: Header {
                version: first >> 4,
                kind,
                flags: Flags(flags),
                request: u16::from_le_bytes([r0, r1]),
                message: u16::from_le_bytes([m0, m1]),
                sequence: u16::from_le_bytes([s0, s1]),
            },
            payload: Payload::from_slice(payload).map_err(|_| FrameError::Long)?,
        })
    }
}
