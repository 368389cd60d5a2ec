//! The test frames of the item `can`. Each exchange has its own mark, which tells its frames from all others.

use gnc_protocol::can::id::{ECHO_EXTENDED, ECHO_STANDARD};
use gnc_protocol::can::{CanFrame, CanId};
use gnc_protocol::pattern::Xorshift32;

/// How often the whole set is sent.
const ROUNDS: u32 = 3;
/// Frames of the set.
const SET: u32 = 72;
/// Frames sent one by one: a third of the set.
const SINGLE: u32 = 72;
/// A step that is prime to the number of extended ids, so that all their bits change.
const STEP: u32 = 1021;
/// The id of fences: the last of the test ids on the bus, so that no test frame waits behind one.
const FENCE: CanId = CanId::Standard(ECHO_STANDARD + 0xf);

/// Drawn anew for each exchange. Another exchange, of this station or another one, has the same mark only by chance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Mark(pub(super) u32);

/// The parts of an exchange. A fence begins or ends each of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    /// Before the test frames.
    Before = 1,
    /// Behind them.
    Behind = 2,
}

impl Phase {
    pub(super) const ALL: [Self; 2] = [Self::Before, Self::Behind];
}

impl Mark {
    /// Extended ids of an exchange begin at any place in their range.
    fn extended(self, index: u32) -> CanId {
        CanId::Extended(ECHO_EXTENDED + (self.0 % 0x1_0000 + index * STEP) % 0x1_0000)
    }

    /// Both kinds of ids with every length and four fillings. Two frames never have the same id and the same length, so
    /// each echo can be assigned to its frame.
    pub(super) fn test_frames(self) -> Vec<CanFrame> {
        let mut mixed = Xorshift32::new(self.0 | 1);
        let mut frames = Vec::new();
        for index in 0..ROUNDS * SET {
            let (round, number) = (index / SET, index % SET);
            let (extended, length, filling) = (number >= 36, number % 36 / 4, number % 4);
            let id = if extended {
                self.extended(index)
            } else {
                CanId::Standard(ECHO_STANDARD + (number + 4 * round) as u16 % 16)
            };
            let byte = |at: u32| match filling {
                0 => 0x00,
                1 => 0xff,
                2 if at.is_multiple_of(2) => 0x55,
                2 => 0xaa,
                _ => mixed.next().unwrap_or_default() as u8,
            };
            let data: Vec<u8> = (0..length).map(byte).collect();
            frames.extend(CanFrame::new(id, &data));
        }
        frames
    }

    /// Frames that are sent one by one. Their ids ascend: a controller that sends the lowest id first keeps their
    /// order.
    pub(super) fn single_frames(self) -> Vec<CanFrame> {
        let mut ids: Vec<CanId> = (0..SINGLE).map(|number| self.extended(ROUNDS * SET + number)).collect();
        ids.sort_by_key(|id| match id {
            CanId::Standard(id) => u32::from(*id),
            CanId::Extended(id) => *id,
        });
        let [m0, m1, m2, m3] = self.0.to_le_bytes();
        let data = [m0, m1, m2, m3, 0x55, 0xaa, 0x55, 0xaa];
        ids.into_iter().filter_map(|id| CanFrame::new(id, &data)).collect()
    }

    /// The fence: when it is back, all frames that were sent before it have left the line. It has the mark twice, so
    /// that a module that alters bytes does not hide it. Each phase of an exchange has its own fence.
    pub(super) fn fence(self, phase: Phase) -> Option<CanFrame> {
        let mark = u64::from(self.of(phase));
        CanFrame::new(FENCE, &(!mark << 32 | mark).to_le_bytes())
    }

    /// Whether a frame is a fence of a phase, even if one of its halves is altered.
    pub(super) fn is_fence(self, phase: Phase, frame: &CanFrame) -> bool {
        let Ok(data) = <[u8; 8]>::try_from(frame.data()) else { return false };
        let (whole, mark) = (u64::from_le_bytes(data), self.of(phase));
        whole as u32 == mark || !(whole >> 32) as u32 == mark
    }

    fn of(self, phase: Phase) -> u32 {
        self.0.wrapping_add((phase as u32).wrapping_mul(0x9e37_79b9))
    }

    /// Whether a frame that came back is one of the single frames, even if it is altered.
    pub(super) fn is_single(self, frame: &CanFrame) -> bool {
        frame.data().starts_with(&self.0.to_le_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gnc_protocol::can::id::echo_of;
    use std::collections::HashSet;

    const MARKS: [u32; 5] = [0, 1, 0xffff, 0x1234_5678, u32::MAX];

    #[test]
    fn every_length_and_both_kinds_of_ids_are_sent() {
        for mark in MARKS {
            let frames = Mark(mark).test_frames();
            for extended in [false, true] {
                for length in 0..=8 {
                    let fits = |frame: &&CanFrame| {
                        matches!(frame.id(), CanId::Extended(_)) == extended && frame.data().len() == length
                    };
                    assert_eq!(frames.iter().filter(fits).count(), 12, "extended {extended}, {length} bytes");
                }
            }
            let known: HashSet<_> = frames.iter().map(|frame| (frame.id(), frame.data().len())).collect();
            assert_eq!(known.len(), 216, "each is known by its id and length");
            let mut bits = 0;
            for frame in &frames {
                let CanId::Extended(id) = frame.id() else { continue };
                bits |= id ^ (ECHO_EXTENDED + mark % 0x1_0000);
            }
            assert_eq!(bits, 0xffff, "all bits of the extended ids change");
        }
    }

    /// A single frame or a fence is never taken for another frame of its exchange or for a frame with another mark.
    #[test]
    fn all_frames_of_an_exchange_are_told_apart() {
        for mark in MARKS.map(Mark) {
            let fences: Vec<CanFrame> = Phase::ALL.iter().filter_map(|phase| mark.fence(*phase)).collect();
            let all = [mark.test_frames(), mark.single_frames(), fences.clone()].concat();
            assert!(all.iter().all(|frame| echo_of(frame.id()).is_some()));
            let ids: HashSet<_> = all.iter().map(|frame| (frame.id(), frame.data())).collect();
            assert_eq!(ids.len(), 216 + 72 + 2);
            let long = |frame: &&CanFrame| frame.data().len() == 8;
            let places: HashSet<_> = all[..288].iter().filter(long).map(CanFrame::id).collect();
            assert_eq!(places.len(), 24 + 72);
            assert!(!places.contains(&fences[0].id()));
            let other = Mark(mark.0.wrapping_add(0x0101_0101));
            for (fence, phase) in fences.iter().zip(Phase::ALL) {
                let back = CanFrame::new(echo_of(fence.id()).unwrap(), fence.data()).unwrap();
                assert!(mark.is_fence(phase, &back) && !other.is_fence(phase, &back));
                for byte in 0..8 {
                    let mut data: [u8; 8] = fence.data().try_into().unwrap();
                    data[byte] ^= 1;
                    let altered = CanFrame::new(back.id(), &data).unwrap();
                    let of: Vec<Phase> = Phase::ALL.into_iter().filter(|of| mark.is_fence(*of, &altered)).collect();
                    assert_eq!(of, [phase], "byte {byte}");
                }
            }
            assert!(!all[..288].iter().any(|frame| Phase::ALL.iter().any(|phase| mark.is_fence(*phase, frame))));
        }
    }
}
