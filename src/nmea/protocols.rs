//! Frames of other protocols that receivers send between their sentences. Each is recognised by its length and
//! checksum.
//!
//! The crate does not read these frames. It only tells them from spoilt bytes, so that the sentence after them is not
//! lost.

use crc::{Algorithm, CRC_16_XMODEM, CRC_24_LTE_A, Crc};

/// Longest frame to wait for: an epoch of raw measurements of all systems. A longer length is chance.
const MAX_FRAME: usize = 8192;
/// Longest packet between DLEs; such a packet does not state its length.
const MAX_DLE_PACKET: usize = 512;
const DLE: u8 = 0x10;
const ETX: u8 = 0x03;

/// CRC-24Q of RTCM 3 has the polynomial of LTE's CRC-24A.
static CRC_24Q: Crc<u32> = Crc::<u32>::new(&CRC_24_LTE_A);
/// CRC-CCITT of SBF.
static CRC_CCITT: Crc<u16> = Crc::<u16>::new(&CRC_16_XMODEM);
/// The CRC-32 of NovAtel and Unicore: the usual polynomial, with zeros at the start and no inversion at the end.
static CRC_OEM: Crc<u32> = Crc::<u32>::new(&Algorithm {
    width: 32,
    poly: 0x04c1_1db7,
    init: 0,
    refin: true,
    refout: true,
    xorout: 0,
    check: 0x2dfd_2d88,
    residue: 0,
});

/// A protocol that is not NMEA 0183.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Protocol {
    /// u-blox; Allystar has the same frame after another preamble.
    Ubx,
    /// SiRF binary.
    Sirf,
    /// RTCM 3 corrections.
    Rtcm,
    /// Septentrio binary format.
    Sbf,
    /// NovAtel OEM, binary or ASCII; Unicore has both as well.
    NovAtel,
    /// Skytraq binary.
    Skytraq,
    /// MediaTek binary.
    Mtk,
    /// Trimble TSIP or Garmin binary: packets between DLE and DLE ETX.
    Dle,
}

impl Protocol {
    /// All of them.
    pub(crate) const ALL: [Self; 8] =
        [Self::Ubx, Self::Sirf, Self::Rtcm, Self::Sbf, Self::NovAtel, Self::Skytraq, Self::Mtk, Self::Dle];

    /// Its usual name.
    #[must_use]
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Ubx => "UBX",
            Self::Sirf => "SiRF",
            Self::Rtcm => "RTCM 3",
            Self::Sbf => "SBF",
            Self::NovAtel => "NovAtel",
            Self::Skytraq => "Skytraq",
            Self::Mtk => "MTK",
            Self::Dle => "TSIP or Garmin",
        }
    }
}

/// The result of a look at the front of some bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Front {
    /// No frame.
    No,
    /// Too few bytes to tell.
    More,
    /// A frame of this many bytes.
    Frame(Protocol, usize),
}

/// How long a frame is, by its first bytes.
enum Length {
    Bytes(usize),
    More,
    No,
}

struct Layout {
    protocol: Protocol,
    preamble: &'static [u8],
    length: fn(&[u8]) -> Length,
    /// Whether the checksum of a whole frame is right.
    good: fn(&[u8]) -> bool,
}

const LAYOUTS: [Layout; 13] = [
    Layout { protocol: Protocol::Ubx, preamble: &[0xb5, 0x62], length: ubx_length, good: fletcher },
    Layout { protocol: Protocol::Ubx, preamble: &[0xf1, 0xd9], length: ubx_length, good: fletcher },
    Layout { protocol: Protocol::Sirf, preamble: &[0xa0, 0xa2], length: sirf_length, good: sirf_good },
    Layout { protocol: Protocol::Rtcm, preamble: &[0xd3], length: rtcm_length, good: rtcm_good },
    Layout { protocol: Protocol::Sbf, preamble: b"$@", length: sbf_length, good: sbf_good },
    Layout { protocol: Protocol::NovAtel, preamble: &[0xaa, 0x44, 0x12], length: novatel_length, good: oem_good },
    Layout { protocol: Protocol::NovAtel, preamble: &[0xaa, 0x44, 0x13], length: novatel_short_length, good: oem_good },
    Layout { protocol: Protocol::NovAtel, preamble: &[0xaa, 0x44, 0xb5], length: unicore_length, good: oem_good },
    Layout { protocol: Protocol::NovAtel, preamble: b"#", length: oem_text_length, good: oem_text_good },
    Layout { protocol: Protocol::NovAtel, preamble: b"%", length: oem_text_length, good: oem_text_good },
    Layout { protocol: Protocol::Skytraq, preamble: &[0xa0, 0xa1], length: skytraq_length, good: skytraq_good },
    Layout { protocol: Protocol::Mtk, preamble: &[0x04, 0x24], length: mtk_length, good: mtk_good },
    Layout { protocol: Protocol::Dle, preamble: &[DLE], length: dle_length, good: |_| true },
];

/// Whether a frame stands at the front.
pub(super) fn front(bytes: &[u8]) -> Front {
    let mut more = false;
    for layout in &LAYOUTS {
        let known = layout.preamble.len().min(bytes.len());
        if bytes[..known] != layout.preamble[..known] {
            continue;
        }
        match if known < layout.preamble.len() { Length::More } else { (layout.length)(bytes) } {
            Length::Bytes(length) if length > MAX_FRAME => {}
            Length::Bytes(length) => match bytes.get(..length) {
                Some(frame) if (layout.good)(frame) => return Front::Frame(layout.protocol, length),
                Some(_) => {}
                None => more = true,
            },
            Length::More => more = true,
            Length::No => {}
        }
    }
    if more { Front::More } else { Front::No }
}

fn little(bytes: &[u8], at: usize) -> Option<usize> {
    Some(usize::from(u16::from_le_bytes([*bytes.get(at)?, *bytes.get(at + 1)?])))
}

fn big(bytes: &[u8], at: usize) -> Option<usize> {
    Some(usize::from(u16::from_be_bytes([*bytes.get(at)?, *bytes.get(at + 1)?])))
}

/// The length of a frame: the payload length, as the frame states it, and the other bytes.
fn with(payload: Option<usize>, others: usize) -> Length {
    payload.map_or(Length::More, |payload| Length::Bytes(payload + others))
}

/// UBX: class, id, length and payload, then two sums of eight bits (u-blox 8 receiver description, 32.4).
fn ubx_length(bytes: &[u8]) -> Length {
    with(little(bytes, 4), 8)
}

fn fletcher(frame: &[u8]) -> bool {
    let (summed, checksum) = frame.split_at(frame.len() - 2);
    let sums = summed[2..].iter().fold((0_u8, 0_u8), |(a, b), byte| {
        let a = a.wrapping_add(*byte);
        (a, b.wrapping_add(a))
    });
    checksum == [sums.0, sums.1]
}

/// SiRF: length, payload, sum of 15 bits, `B0 B3` (SiRF binary protocol reference, 2).
fn sirf_length(bytes: &[u8]) -> Length {
    match big(bytes, 2) {
        Some(payload) if payload > 2047 => Length::No,
        payload => with(payload, 8),
    }
}

fn sirf_good(frame: &[u8]) -> bool {
    let payload = &frame[4..frame.len() - 4];
    let sum = payload.iter().fold(0_u32, |sum, byte| (sum + u32::from(*byte)) & 0x7fff) as usize;
    frame.ends_with(&[0xb0, 0xb3]) && big(frame, frame.len() - 4) == Some(sum)
}

/// RTCM 3: six bits of zero, ten of length, payload, CRC-24Q (RTCM 10403.3, 4).
fn rtcm_length(bytes: &[u8]) -> Length {
    match big(bytes, 1) {
        Some(head) if head > 0x3ff => Length::No,
        payload => with(payload, 6),
    }
}

fn rtcm_good(frame: &[u8]) -> bool {
    let (summed, checksum) = frame.split_at(frame.len() - 3);
    CRC_24Q.checksum(summed).to_be_bytes()[1..] == *checksum
}

/// SBF: CRC, id, length of the whole frame, a multiple of four (Septentrio reference guide, SBF block header).
fn sbf_length(bytes: &[u8]) -> Length {
    match little(bytes, 6) {
        Some(length) if length < 8 || length % 4 != 0 => Length::No,
        length => with(length, 0),
    }
}

fn sbf_good(frame: &[u8]) -> bool {
    little(frame, 2) == Some(usize::from(CRC_CCITT.checksum(&frame[4..])))
}

/// NovAtel: a header that states its own length, payload, CRC-32 (OEM7 commands and logs, binary).
fn novatel_length(bytes: &[u8]) -> Length {
    match bytes.get(3) {
        Some(header) if *header < 28 => Length::No,
        header => with(header.copied().map(usize::from).zip(little(bytes, 8)).map(|(a, b)| a + b), 4),
    }
}

fn novatel_short_length(bytes: &[u8]) -> Length {
    with(bytes.get(3).copied().map(usize::from), 16)
}

fn unicore_length(bytes: &[u8]) -> Length {
    with(little(bytes, 6), 28)
}

fn oem_good(frame: &[u8]) -> bool {
    let (summed, checksum) = frame.split_at(frame.len() - 4);
    CRC_OEM.checksum(summed).to_le_bytes() == *checksum
}

/// `#NAME,...;...*` or `%NAME,...;...*`, and CRC-32 in eight digits.
fn oem_text_length(bytes: &[u8]) -> Length {
    let printable = |byte: &u8| matches!(byte, b' '..=b'~');
    let end = bytes.iter().position(|byte| *byte == b'*' || !printable(byte));
    match end {
        Some(star) if bytes[star] == b'*' => Length::Bytes(star + 9),
        Some(_) => Length::No,
        None if bytes.len() > MAX_FRAME => Length::No,
        None => Length::More,
    }
}

fn oem_text_good(frame: &[u8]) -> bool {
    let (summed, checksum) = frame.split_at(frame.len() - 8);
    let told = std::str::from_utf8(checksum).ok().and_then(|digits| u32::from_str_radix(digits, 16).ok());
    told == Some(CRC_OEM.checksum(&summed[1..summed.len() - 1]))
}

/// Skytraq: length, payload, exclusive or, CR, LF (Skytraq binary messages, 1).
fn skytraq_length(bytes: &[u8]) -> Length {
    with(big(bytes, 2), 7)
}

fn skytraq_good(frame: &[u8]) -> bool {
    ended_by_xor(frame, 4)
}

/// MTK: length of the whole frame, command, payload, exclusive or, CR, LF.
fn mtk_length(bytes: &[u8]) -> Length {
    match little(bytes, 2) {
        Some(length) if length < 9 => Length::No,
        length => with(length, 0),
    }
}

fn mtk_good(frame: &[u8]) -> bool {
    ended_by_xor(frame, 2)
}

fn ended_by_xor(frame: &[u8], from: usize) -> bool {
    let (summed, end) = frame.split_at(frame.len() - 3);
    end == [summed[from..].iter().fold(0, |sum, byte| sum ^ byte), b'\r', b'\n']
}

/// DLE, id, data, DLE ETX; a DLE inside the data is sent twice (Trimble TSIP, 1). TSIP has no checksum.
fn dle_length(bytes: &[u8]) -> Length {
    if bytes.get(1).is_some_and(|id| matches!(*id, DLE | ETX)) {
        return Length::No;
    }
    let mut at = 2;
    while at < MAX_DLE_PACKET {
        match (bytes.get(at), bytes.get(at + 1)) {
            (Some(&DLE), Some(&ETX)) => return Length::Bytes(at + 2),
            (Some(&DLE), Some(&DLE)) => at += 2,
            (Some(&DLE), Some(_)) => return Length::No,
            (Some(&DLE), None) | (None, _) => return Length::More,
            (Some(_), _) => at += 1,
        }
    }
    Length::No
}
