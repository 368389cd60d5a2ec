//! The filter of what goes onto the wire: bytes on RS-422, frames on CAN.

use std::time::Duration;

use gnc_protocol::can::id::{BOARD_EVENTS, IMU_ACCEL, IMU_GYRO, URGENT_TO_HOST, WORK_TO_HOST};
use gnc_protocol::can::{CanFrame, CanId};
use gnc_protocol::frame::{CRC, Frame, checksum};
use gnc_protocol::serial::encode;

use super::{Breaches, TalkBreaches, is_nth};

/// How far the numbers of frames go back.
const BACK: u16 = 10;
/// Place of the number in a message.
const NUMBER_AT: usize = 6;
/// The reflected polynomial of the CRC-32 of Ethernet.
const CRC_32: u32 = 0xedb8_8320;
/// Longest run of bytes that are not 0 behind one code of the stuffing.
const RUN: usize = 254;
/// First byte of the CAN frame with the time of a heartbeat.
const BEAT_WHEN: u8 = 1;
/// First bytes of the first two consecutive frames of a message, and its bytes before and in each of them.
const CONSECUTIVE: [u8; 2] = [0x21, 0x22];
const IN_FIRST: usize = 6;
const IN_CONSECUTIVE: usize = 7;

/// How a board works out the checksum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Checksum {
    /// The right one, with its most significant byte first.
    BigEndian,
    /// The CRC-32 of Ethernet.
    Crc32,
    /// Without the final inversion.
    NotInverted,
}

impl Checksum {
    fn bytes(self, content: &[u8]) -> [u8; CRC] {
        match self {
            Self::BigEndian => checksum(content).to_be_bytes(),
            Self::Crc32 => crc_32(content).to_le_bytes(),
            Self::NotInverted => (!checksum(content)).to_le_bytes(),
        }
    }
}

fn crc_32(content: &[u8]) -> u32 {
    !content.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| crc >> 1 ^ if crc & 1 == 1 { CRC_32 } else { 0 })
    })
}

/// Which CAN frames leave in the wrong order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CanOrder {
    /// The accelerometers of each IMU sample before the gyroscopes.
    Samples,
    /// The second consecutive frame of each message before the first one.
    Messages,
}

/// What goes onto the wire.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct FrameBreaches {
    pub(crate) checksum: Option<Checksum>,
    /// RS-422: a text that is printed between frames, and how often.
    pub(crate) debug: Option<(String, Duration)>,
    /// RS-422: one of so many frames has a 00 in its middle.
    pub(crate) stray_zero_every: u32,
    /// RS-422: frames begin without a 00.
    pub(crate) no_leading_delimiter: bool,
    /// RS-422: bytes FF behind each frame.
    pub(crate) padding_bytes: u32,
    /// CAN: the time of heartbeats never comes.
    pub(crate) heartbeat_halved: bool,
    pub(crate) can_order: Option<CanOrder>,
}

/// The filter of the board's bytes on RS-422.
#[derive(Debug)]
pub(crate) struct ByteFilter {
    breaches: FrameBreaches,
    is_clean: bool,
    counted: u32,
    debug_due: Duration,
}

impl ByteFilter {
    pub(crate) fn new(breaches: &FrameBreaches) -> Self {
        let is_clean = *breaches == FrameBreaches::default();
        Self { breaches: breaches.clone(), is_clean, counted: 0, debug_due: Duration::ZERO }
    }

    /// Puts a frame onto the wire as this board does.
    pub(crate) fn write(&mut self, frame: &Frame, wire: impl FnOnce(&[u8])) {
        if self.is_clean { wire(&encode(frame)) } else { wire(&self.encode(frame)) }
    }

    fn encode(&mut self, frame: &Frame) -> Vec<u8> {
        self.counted = self.counted.wrapping_add(1);
        let mut bytes = frame.to_bytes();
        if let (Some(breach), Some((content, sum))) = (self.breaches.checksum, bytes.split_last_chunk_mut::<CRC>()) {
            *sum = breach.bytes(content);
        }
        let mut stuffed = stuff(&bytes);
        if is_nth(self.counted, self.breaches.stray_zero_every) {
            stuffed.insert(stuffed.len() / 2, 0);
        }
        let mut wire = if self.breaches.no_leading_delimiter { Vec::new() } else { vec![0] };
        wire.extend(stuffed);
        wire.push(0);
        wire.extend((0..self.breaches.padding_bytes).map(|_| 0xff));
        wire
    }

    /// What is printed now.
    pub(crate) fn print(&mut self, now: Duration) -> Option<Vec<u8>> {
        let (text, every) = self.breaches.debug.as_ref()?;
        if now < self.debug_due {
            return None;
        }
        self.debug_due = now + *every;
        Some(text.clone().into_bytes())
    }

    /// When something is printed.
    pub(crate) fn next_due(&self) -> Option<Duration> {
        self.breaches.debug.is_some().then_some(self.debug_due)
    }
}

/// Takes the zeros out of a frame: each run of other bytes goes behind a code, as the interface document says.
fn stuff(bytes: &[u8]) -> Vec<u8> {
    let mut stuffed = Vec::with_capacity(bytes.len() + 3);
    let mut parts = bytes.split(|byte| *byte == 0);
    let mut next = parts.next();
    while let Some(mut part) = next {
        next = parts.next();
        while part.len() >= RUN {
            stuffed.push(0xff);
            stuffed.extend_from_slice(&part[..RUN]);
            part = &part[RUN..];
        }
        stuffed.push(part.len() as u8 + 1);
        stuffed.extend_from_slice(part);
    }
    stuffed
}

/// Counts frames.
#[derive(Debug, Clone)]
pub(crate) struct Numbers {
    stands_every: u32,
    back_every: u32,
    counted: u32,
    next: u16,
}

impl Numbers {
    pub(super) fn new(talk: &TalkBreaches) -> Self {
        Self { stands_every: talk.sequence_stands_every, back_every: talk.sequence_back_every, counted: 0, next: 0 }
    }

    /// The number of the next frame.
    pub(super) fn next(&mut self) -> u16 {
        self.counted = self.counted.wrapping_add(1);
        if is_nth(self.counted, self.stands_every) {
            self.next = self.next.wrapping_sub(1);
        }
        if is_nth(self.counted, self.back_every) {
            self.next = self.next.wrapping_sub(BACK);
        }
        let number = self.next;
        self.next = number.wrapping_add(1);
        number
    }
}

/// A message on its way through frames of ISO-TP. What it holds so far tells its checksum, since that comes last.
#[derive(Debug)]
struct Message {
    id: u16,
    numbers: Numbers,
    checksum: Option<Checksum>,
    swaps: bool,
    number: [u8; 2],
    length: usize,
    content: Vec<u8>,
    at: usize,
    /// The first consecutive frame, until the second one has gone.
    held: Option<CanFrame>,
}

impl Message {
    fn new(id: u16, breaches: &Breaches) -> Self {
        Self {
            id,
            numbers: Numbers::new(&breaches.talk),
            checksum: breaches.frames.checksum,
            swaps: breaches.frames.can_order == Some(CanOrder::Messages),
            number: [0; 2],
            length: 0,
            content: Vec::new(),
            at: 0,
            held: None,
        }
    }

    fn pass(&mut self, frame: CanFrame, mut send: impl FnMut(CanFrame)) {
        let frame = self.rewrite(frame);
        let first = frame.data().first().copied();
        if self.swaps && first == Some(CONSECUTIVE[0]) && self.length > IN_FIRST + IN_CONSECUTIVE && self.held.is_none()
        {
            self.held = Some(frame);
            return;
        }
        send(frame);
        if first == Some(CONSECUTIVE[1])
            && let Some(held) = self.held.take()
        {
            send(held);
        }
    }

    /// The frame with the numbers and the checksum of this board.
    fn rewrite(&mut self, frame: CanFrame) -> CanFrame {
        let mut data = frame.data().to_vec();
        let begin = match data.first().map(|first| first >> 4) {
            Some(1) if data.len() > 2 => {
                self.length = usize::from(data[0] & 0x0f) << 8 | usize::from(data[1]);
                self.number = self.numbers.next().to_le_bytes();
                self.content.clear();
                self.at = 0;
                self.held = None;
                2
            }
            Some(2) => 1,
            _ => return frame,
        };
        let end = self.length.saturating_sub(CRC);
        for byte in data.iter_mut().skip(begin) {
            if self.at < end {
                if let Some(number) = self.at.checked_sub(NUMBER_AT).and_then(|at| self.number.get(at)) {
                    *byte = *number;
                }
                self.content.push(*byte);
            } else {
                let right = checksum(&self.content).to_le_bytes();
                let sum = self.checksum.map_or(right, |breach| breach.bytes(&self.content));
                *byte = sum.get(self.at - end).copied().unwrap_or(*byte);
            }
            self.at += 1;
        }
        CanFrame::new(frame.id(), &data).unwrap_or(frame)
    }
}

/// The filter of the board's frames on CAN.
#[derive(Debug)]
pub(crate) struct CanFilter {
    is_clean: bool,
    breaches: FrameBreaches,
    messages: [Message; 2],
    /// The gyroscopes of a sample, until its accelerometers have gone.
    held: Option<CanFrame>,
}

impl CanFilter {
    pub(crate) fn new(breaches: &Breaches) -> Self {
        Self {
            is_clean: breaches.talk.counts_well() && breaches.frames == FrameBreaches::default(),
            breaches: breaches.frames.clone(),
            messages: [URGENT_TO_HOST, WORK_TO_HOST].map(|id| Message::new(id, breaches)),
            held: None,
        }
    }

    /// Takes a frame of the board and hands on what goes onto the bus.
    pub(crate) fn pass(&mut self, frame: CanFrame, mut send: impl FnMut(CanFrame)) {
        let CanId::Standard(id) = frame.id() else { return send(frame) };
        if self.is_clean {
            return send(frame);
        }
        if let Some(message) = self.messages.iter_mut().find(|message| message.id == id) {
            return message.pass(frame, send);
        }
        match id {
            BOARD_EVENTS if self.breaches.heartbeat_halved && frame.data().first() == Some(&BEAT_WHEN) => {}
            IMU_GYRO if self.breaches.can_order == Some(CanOrder::Samples) => self.held = Some(frame),
            IMU_ACCEL => {
                send(frame);
                self.held.take().into_iter().for_each(send);
            }
            _ => send(frame),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check values of the catalogues, and the first worked example of the interface document.
    #[test]
    fn checksums_and_stuffing() {
        let digits = b"123456789";
        assert_eq!(crc_32(digits), 0xcbf4_3926);
        assert_eq!(Checksum::BigEndian.bytes(digits), [0xe3, 0x06, 0x92, 0x83]);
        assert_eq!(Checksum::NotInverted.bytes(digits), (!0xe306_9283_u32).to_le_bytes());
        assert_eq!(stuff(&[0x11, 0, 0, 0x2a]), [2, 0x11, 1, 2, 0x2a]);
        let run = [7; RUN];
        assert_eq!(stuff(&run)[..2], [0xff, 7]);
        assert_eq!(stuff(&run).len(), RUN + 2, "a last code 01, which receivers take");
    }
}
