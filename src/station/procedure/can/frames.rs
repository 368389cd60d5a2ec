//! The test frames of the item `can`, and what happened to them on their way.

use gnc_protocol::can::id::{ECHO_EXTENDED, ECHO_STANDARD, echo_of};
use gnc_protocol::can::{CanFrame, CanId};
use gnc_protocol::pattern::Xorshift32;

/// Times that the whole set is sent.
const ROUNDS: u32 = 3;
/// Frames of the set.
const SET: u32 = 72;
/// Frames sent one by one: a third of the set.
const SINGLE: u8 = 72;

/// Both kinds of ids with every length and four fillings. No two are alike, nor have both id and length in common, so
/// that each that comes back is known for what it is.
pub(super) fn test_frames() -> Vec<CanFrame> {
    let mut mixed = Xorshift32::new(1);
    let mut frames = Vec::new();
    for index in 0..ROUNDS * SET {
        let (round, number) = (index / SET, index % SET);
        let (extended, length, filling) = (number >= 36, number % 36 / 4, number % 4);
        let id = if extended {
            // A step that is prime to the number of ids, so that all their bits change.
            CanId::Extended(ECHO_EXTENDED + index * 1021 % 0x1_0000)
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

/// Frames to be sent one by one. The mark, which no earlier ones had, tells them from all before, which may still be on
/// their way.
pub(super) fn single_frames(mark: u32) -> Vec<CanFrame> {
    let [m0, m1, m2, m3] = mark.to_le_bytes();
    let frame = |number: u8| {
        let id = CanId::Extended(ECHO_EXTENDED + u32::from(number));
        CanFrame::new(id, &[m0, m1, m2, m3, 0x55, 0xaa, 0x55, 0xaa])
    };
    (0..SINGLE).filter_map(frame).collect()
}

/// What happened to the frames on their way.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Seen {
    pub(super) lost: u64,
    pub(super) altered: u64,
    pub(super) out_of_order: u64,
    /// More often than they were sent.
    pub(super) twice: u64,
}

/// Compares what was sent with what came back. No two of the frames sent have both id and length in common.
pub(super) fn compare(sent: &[CanFrame], returned: &[CanFrame]) -> Seen {
    let expected = |frame: &CanFrame| echo_of(frame.id()).and_then(|id| CanFrame::new(id, frame.data()));
    let expected: Vec<Option<CanFrame>> = sent.iter().map(expected).collect();
    let mut back = vec![false; expected.len()];
    let mut seen = Seen::default();
    let mut latest = 0;
    for frame in returned {
        let is_it = |wanted: &CanFrame| wanted.id() == frame.id() && wanted.data().len() == frame.data().len();
        let Some(at) = expected.iter().position(|wanted| wanted.as_ref().is_some_and(is_it)) else {
            // Nobody sent it: its id or its length was another one.
            seen.altered += 1;
            continue;
        };
        if std::mem::replace(&mut back[at], true) {
            seen.twice += 1;
        } else {
            seen.out_of_order += u64::from(at < latest);
            latest = latest.max(at);
        }
        seen.altered += u64::from(expected[at] != Some(*frame));
    }
    seen.lost = back.iter().filter(|back| !**back).count() as u64;
    seen
}

#[cfg(test)]
mod tests {
    use super::*;

    fn echoes() -> Vec<CanFrame> {
        test_frames().iter().map(|frame| CanFrame::new(echo_of(frame.id()).unwrap(), frame.data()).unwrap()).collect()
    }

    fn check(returned: &[CanFrame], lost: u64, altered: u64, out_of_order: u64, twice: u64) {
        assert_eq!(compare(&test_frames(), returned), Seen { lost, altered, out_of_order, twice });
    }

    #[test]
    fn every_length_and_both_kinds_of_ids_are_sent() {
        let frames = test_frames();
        for extended in [false, true] {
            for length in 0..=8 {
                let fits = |frame: &&CanFrame| {
                    matches!(frame.id(), CanId::Extended(_)) == extended && frame.data().len() == length
                };
                assert_eq!(frames.iter().filter(fits).count(), 12, "extended {extended}, {length} bytes");
            }
        }
        let known: std::collections::HashSet<_> = frames.iter().map(|frame| (frame.id(), frame.data().len())).collect();
        assert_eq!(known.len(), 216, "each is known by its id and length");
    }

    #[test]
    fn what_happened_on_the_way_is_told_apart() {
        let good = echoes();
        check(&good, 0, 0, 0, 0);
        check(&good[..200], 16, 0, 0, 0);
        let mut swapped = good.clone();
        swapped.swap(50, 51);
        check(&swapped, 0, 0, 1, 0);
        let mut altered = good.clone();
        let mut data = [0; 8];
        data.copy_from_slice(altered[35].data());
        data[3] ^= 0x10;
        altered[35] = CanFrame::new(altered[35].id(), &data).unwrap();
        check(&altered, 0, 1, 0, 0);
        for at in 0..216 {
            let mut twice = good.clone();
            twice.insert(at + 1, good[at]);
            check(&twice, 0, 0, 0, 1);
        }
        let mut foreign = good;
        foreign.push(CanFrame::new(CanId::Standard(0x71f), &[]).unwrap());
        check(&foreign, 0, 1, 0, 0);
    }

    /// What is on its way from an earlier set of either kind is none of these.
    #[test]
    fn single_frames_are_nobody_elses() {
        let mut all = test_frames();
        (0..3).for_each(|mark| all.extend(single_frames(mark)));
        let distinct: std::collections::HashSet<_> = all.iter().collect();
        assert_eq!(distinct.len(), 216 + 3 * 72);
        assert!(all.iter().all(|frame| echo_of(frame.id()).is_some()));
    }
}
