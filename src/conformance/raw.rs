//! Frames as bytes, also such as no sender should make.

use gnc_protocol::frame::checksum;

/// Most bytes in a run of the stuffing.
const FULL_RUN: usize = 254;

/// The header of a frame to be made by hand. The kind may be one that nobody knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct RawHeader {
    pub(crate) version: u8,
    pub(crate) kind: u8,
    pub(crate) flags: u8,
    pub(crate) request: u16,
    pub(crate) message: u16,
}

/// Header, payload and checksum, before stuffing.
pub(crate) fn frame_bytes(header: RawHeader, sequence: u16, payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![header.version << 4 | header.kind, header.flags];
    for field in [header.request, header.message, sequence] {
        bytes.extend_from_slice(&field.to_le_bytes());
    }
    bytes.extend_from_slice(payload);
    let crc = checksum(&bytes);
    bytes.extend_from_slice(&crc.to_le_bytes());
    bytes
}

/// How the stuffing ends behind a full run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ending {
    /// Nothing more.
    Bare,
    /// A last code 01.
    LastCode,
}

/// Stuffs `bytes`, without delimiters.
pub(crate) fn stuff(bytes: &[u8], ending: Ending) -> Vec<u8> {
    let mut stuffed = Vec::with_capacity(bytes.len() + bytes.len() / FULL_RUN + 1);
    let mut rest = bytes;
    loop {
        let run = rest.iter().take(FULL_RUN).take_while(|byte| **byte != 0).count();
        // A run is at most 254 bytes long.
        stuffed.push(u8::try_from(run + 1).unwrap_or(u8::MAX));
        stuffed.extend_from_slice(&rest[..run]);
        rest = &rest[run..];
        match (run == FULL_RUN, rest.is_empty()) {
            (true, true) => {
                if ending == Ending::LastCode {
                    stuffed.push(1);
                }
                return stuffed;
            }
            (true, false) => {}
            (false, true) => return stuffed,
            // The zero behind the run. If it is the last byte, an empty run follows.
            (false, false) => rest = &rest[1..],
        }
        if rest.is_empty() && run < FULL_RUN {
            stuffed.push(1);
            return stuffed;
        }
    }
}

/// Stuffed bytes between delimiters.
pub(crate) fn delimited(stuffed: &[u8]) -> Vec<u8> {
    let mut wire = vec![0];
    wire.extend_from_slice(stuffed);
    wire.push(0);
    wire
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The worked examples of the interface document.
    #[test]
    fn stuffs_as_the_document_shows() {
        assert_eq!(stuff(&[0x11, 0, 0, 0x2a], Ending::Bare), [2, 0x11, 1, 2, 0x2a]);
        let header = RawHeader { version: 1, kind: 6, flags: 0, request: 0, message: 2 };
        let wire = delimited(&stuff(&frame_bytes(header, 0x10, &[]), Ending::Bare));
        assert_eq!(wire, [0, 2, 0x16, 1, 1, 2, 2, 2, 0x10, 5, 0x1d, 0x11, 0x99, 0x3b, 0]);
    }

    #[test]
    fn a_full_run_ends_in_both_ways() {
        let bytes = [7; 254];
        let bare = stuff(&bytes, Ending::Bare);
        assert_eq!((bare.len(), bare[0]), (255, 0xff));
        let mut last = bare;
        last.push(1);
        assert_eq!(stuff(&bytes, Ending::LastCode), last);
        assert_eq!(stuff(&[5, 0], Ending::Bare), [2, 5, 1]);
        assert_eq!(stuff(&[0; 2], Ending::Bare), [1, 1, 1]);
    }
}
