//! A receiver's log, played back: the bytes of a receiver in their order.
//!
//! A log holds no times. The kind of its first message (an NMEA sentence, a UBX message) marks epochs: each message of
//! this kind begins a new epoch, and epochs are sent at a steady pace. GSV, GSA and TXT begin no epoch, since an epoch
//! has several. Bytes that are not messages stay in place, so that garbage is played too. Lines that begin with `#`
//! before the first message are remarks of the recorder.

/// Longest log: an hour of a receiver that sends 1 kB a second.
pub(crate) const LONGEST: usize = 4 << 20;
/// Longest epoch: the bytes of a second at 115,200 baud. Garbage without messages is sent in such pieces.
const LONGEST_EPOCH: usize = 11_520;
/// Size of the pieces in which undivided garbage is sent.
const PIECE: usize = 512;

/// A log, divided into epochs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Recording {
    epochs: Vec<Vec<u8>>,
}

impl Recording {
    /// Divides a log; `None` if it is empty.
    #[must_use]
    pub(crate) fn new(log: &[u8]) -> Option<Self> {
        let mut rest = without_remarks(log);
        let mut epochs: Vec<Vec<u8>> = Vec::new();
        let mut first = None;
        while !rest.is_empty() {
            let (kind, length) = message(rest);
            let (bytes, after) = rest.split_at(length.clamp(1, rest.len()));
            rest = after;
            if first.is_none() {
                first = kind.filter(|kind| !matches!(&kind[3..], b"GSV" | b"GSA" | b"TXT"));
            }
            let begins = kind.is_some() && kind == first;
            match epochs.last_mut() {
                Some(epoch) if !begins && epoch.len() + bytes.len() <= LONGEST_EPOCH => epoch.extend_from_slice(bytes),
                _ => epochs.push(bytes.to_vec()),
            }
        }
        (!epochs.is_empty()).then_some(Self { epochs })
    }

    /// The bytes of an epoch, counted from 0; empty after the last.
    #[must_use]
    pub(crate) fn epoch(&self, index: usize) -> &[u8] {
        self.epochs.get(index).map_or(&[], Vec::as_slice)
    }
}

fn without_remarks(mut log: &[u8]) -> &[u8] {
    while log.first() == Some(&b'#') {
        let end = log.iter().position(|byte| *byte == b'\n').map_or(log.len(), |end| end + 1);
        log = &log[end..];
    }
    log
}

/// The kind of the message at the front and its length; garbage has no kind and extends to the next message.
fn message(bytes: &[u8]) -> (Option<[u8; 6]>, usize) {
    if let Some(kind) = nmea(bytes) {
        return (Some(kind), line(bytes));
    }
    if let Some((kind, length)) = ubx(bytes) {
        return (Some(kind), length);
    }
    let next = (1..bytes.len()).find(|at| nmea(&bytes[*at..]).is_some() || ubx(&bytes[*at..]).is_some());
    (None, next.unwrap_or(bytes.len()).min(PIECE))
}

/// Length up to the end of the line, which is CR, LF or both, or up to the next sentence.
fn line(bytes: &[u8]) -> usize {
    let end = (1..bytes.len()).find(|at| matches!(bytes[*at], b'\r' | b'\n' | b'$'));
    end.map_or(bytes.len(), |end| end + bytes[end..].iter().take_while(|byte| matches!(byte, b'\r' | b'\n')).count())
}

/// `$GPGGA`: five capitals or digits.
fn nmea(bytes: &[u8]) -> Option<[u8; 6]> {
    let kind: [u8; 6] = bytes.get(..6)?.try_into().ok()?;
    let is_kind = kind[0] == b'$' && kind[1..].iter().all(|byte| byte.is_ascii_uppercase() || byte.is_ascii_digit());
    is_kind.then_some(kind)
}

/// `B5 62`, class, id, length, payload, checksum.
fn ubx(bytes: &[u8]) -> Option<([u8; 6], usize)> {
    let [0xb5, 0x62, class, id, low, high, ..] = *bytes else { return None };
    let length = usize::from(u16::from_le_bytes([low, high])) + 8;
    (length <= bytes.len()).then_some(([0xb5, 0x62, class, id, 0, 0], length))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(log: &[u8], expected: &[&[u8]]) {
        let epochs = Recording::new(log).map_or_else(Vec::new, |recording| recording.epochs);
        assert_eq!(epochs, expected, "{log:02x?}");
    }

    #[test]
    fn an_epoch_begins_with_what_stands_first() {
        check(
            b"# a remark\n# another\n$GPRMC,1\r\n$GPGGA,1\r\n$GPRMC,2\r\n$GPGGA,2\r\n",
            &[b"$GPRMC,1\r\n$GPGGA,1\r\n", b"$GPRMC,2\r\n$GPGGA,2\r\n"],
        );
        check(
            &[0xb5, 0x62, 1, 7, 1, 0, 9, 0, 0, 0xb5, 0x62, 1, 3, 0, 0, 0, 0, 0xb5, 0x62, 1, 7, 0, 0, 0, 0],
            &[&[0xb5, 0x62, 1, 7, 1, 0, 9, 0, 0, 0xb5, 0x62, 1, 3, 0, 0, 0, 0], &[0xb5, 0x62, 1, 7, 0, 0, 0, 0]],
        );
    }

    #[test]
    fn lines_end_in_many_ways() {
        check(b"$GPRMC,1\r$GPGGA,1\r$GPRMC,2\r", &[b"$GPRMC,1\r$GPGGA,1\r", b"$GPRMC,2\r"]);
        check(b"$GPRMC,1$GPGGA,1\n\n$GPRMC,2", &[b"$GPRMC,1$GPGGA,1\n\n", b"$GPRMC,2"]);
        check(
            b"$GPGSV,1\n$GPGSV,2\n$GPGGA,1\n$GPGSV,1\n$GPGGA,2\n",
            &[b"$GPGSV,1\n$GPGSV,2\n", b"$GPGGA,1\n$GPGSV,1\n", b"$GPGGA,2\n"],
        );
    }

    /// No byte is lost or added, for any log.
    #[test]
    fn garbage_is_played_as_it_is() {
        check(b"", &[]);
        check(b"# only a remark", &[]);
        check(b"\x80\xff", &[b"\x80\xff"]);
        check(b"tail\n$GPGGA,1\n\x00\xb5$GPGGA,2", &[b"tail\n", b"$GPGGA,1\n\x00\xb5", b"$GPGGA,2"]);
        let noise: Vec<u8> = (0..40_000_u32).map(|at| (at.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
        let recording = Recording::new(&noise).unwrap();
        assert_eq!(recording.epochs.concat(), noise);
        assert!(recording.epochs.iter().all(|epoch| epoch.len() <= LONGEST_EPOCH));
    }
}
