//! The filter of what goes onto the wire: bytes on RS-422, frames on CAN.

use gnc_protocol::can::id::{URGENT_TO_HOST, WORK_TO_HOST};
use gnc_protocol::can::{CanFrame, CanId};
use gnc_protocol::frame::{CRC, checksum};

use super::{Breaches, TalkBreaches, is_nth};

/// How far the numbers of frames go back.
const BACK: u16 = 10;
/// Place of the number in a message.
const NUMBER_AT: usize = 6;

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
    number: [u8; 2],
    length: usize,
    content: Vec<u8>,
    at: usize,
}

impl Message {
    fn new(id: u16, talk: &TalkBreaches) -> Self {
        Self { id, numbers: Numbers::new(talk), number: [0; 2], length: 0, content: Vec::new(), at: 0 }
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
            } else if let Some(sum) = checksum(&self.content).to_le_bytes().get(self.at - end) {
                *byte = *sum;
            }
            self.at += 1;
        }
        CanFrame::new(frame.id(), &data).unwrap_or(frame)
    }
}

/// The filter of the board's frames on CAN.
#[derive(Debug)]
pub(crate) struct CanFilter {
    rewrites: bool,
    messages: [Message; 2],
}

impl CanFilter {
    pub(crate) fn new(breaches: &Breaches) -> Self {
        Self {
            rewrites: !breaches.talk.counts_well(),
            messages: [URGENT_TO_HOST, WORK_TO_HOST].map(|id| Message::new(id, &breaches.talk)),
        }
    }

    /// Takes a frame of the board and hands on what goes onto the bus.
    pub(crate) fn pass(&mut self, frame: CanFrame, mut send: impl FnMut(CanFrame)) {
        let message = self.messages.iter_mut().find(|message| frame.id() == CanId::Standard(message.id));
        match message {
            Some(message) if self.rewrites => send(message.rewrite(frame)),
            _ => send(frame),
        }
    }
}
