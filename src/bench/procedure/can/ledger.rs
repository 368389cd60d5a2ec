//! What became of the test frames of one exchange.

use gnc_protocol::can::id::{echo_of, is_echo};
use gnc_protocol::can::{CanFrame, CanId};

/// Counts of what happened to the frames on their way.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Seen {
    pub(super) sent: u64,
    /// Frames that were not sent, since no more echoes came.
    pub(super) unsent: u64,
    pub(super) lost: u64,
    /// Frames that came back under their id and length with another content, in place of the frame that was sent.
    pub(super) altered: u64,
    pub(super) out_of_order: u64,
    /// Frames that came back more often than they were sent.
    pub(super) twice: u64,
    /// Frames under an id of the module that are not echoes of this exchange: another module or station sent them, or
    /// this module altered their id or length. If there are such frames or other test frames, standard frames of
    /// another content count here too: another station may use the same sixteen ids.
    pub(super) strange: u64,
    /// Test frames of another station.
    pub(super) foreign: u64,
}

/// A frame that was sent, or is to be.
#[derive(Debug)]
struct Entry {
    sent: CanFrame,
    echo: Option<CanFrame>,
    fate: Fate,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fate {
    ToSend,
    UnderWay,
    /// Not back in time; it may come later.
    Late,
    /// Its id and length came back with another content.
    Altered,
    Back,
}

/// The frames of an exchange and what became of each.
#[derive(Debug)]
pub(super) struct Ledger {
    entries: Vec<Entry>,
    latest: usize,
    out_of_order: u64,
    twice: u64,
    strange: u64,
    foreign: u64,
}

impl Ledger {
    /// Two of the frames never have both id and length in common.
    pub(super) fn new(frames: &[CanFrame]) -> Self {
        let entry = |frame: &CanFrame| {
            let echo = echo_of(frame.id()).and_then(|id| CanFrame::new(id, frame.data()));
            Entry { sent: *frame, echo, fate: Fate::ToSend }
        };
        let entries = frames.iter().map(entry).collect();
        Self { entries, latest: 0, out_of_order: 0, twice: 0, strange: 0, foreign: 0 }
    }

    /// Returns the next frame to send; it is under way from now on.
    pub(super) fn send_next(&mut self) -> Option<CanFrame> {
        let entry = self.entries.iter_mut().find(|entry| entry.fate == Fate::ToSend)?;
        entry.fate = Fate::UnderWay;
        Some(entry.sent)
    }

    /// Number of frames that are awaited.
    pub(super) fn under_way(&self) -> usize {
        self.count(Fate::UnderWay) as usize
    }

    /// Whether each frame that was sent is back.
    pub(super) fn is_complete(&self) -> bool {
        self.entries.iter().all(|entry| !matches!(entry.fate, Fate::UnderWay | Fate::Late))
    }

    /// Stops waiting for the frames under way.
    pub(super) fn give_up(&mut self) {
        for entry in self.entries.iter_mut().filter(|entry| entry.fate == Fate::UnderWay) {
            entry.fate = Fate::Late;
        }
    }

    /// Notes a frame under a test id. Returns whether it was awaited.
    pub(super) fn note(&mut self, frame: &CanFrame) -> bool {
        if !is_echo(frame.id()) {
            // Some adapters repeat frames that their own computer sends.
            let own = self.entries.iter().any(|entry| entry.fate != Fate::ToSend && entry.sent == *frame);
            self.foreign += u64::from(!own);
            return false;
        }
        let is_it = |entry: &Entry| {
            let place = |echo: CanFrame| echo.id() == frame.id() && echo.data().len() == frame.data().len();
            entry.fate != Fate::ToSend && entry.echo.is_some_and(place)
        };
        let Some(at) = self.entries.iter().position(is_it) else {
            self.strange += 1;
            return false;
        };
        let entry = &mut self.entries[at];
        let was_missing = matches!(entry.fate, Fate::UnderWay | Fate::Late);
        match (entry.echo == Some(*frame), entry.fate) {
            (true, Fate::Back) => self.twice += 1,
            (true, before) => {
                entry.fate = Fate::Back;
                // The frame is back in full: another node sent the frame that came in its place.
                self.strange += u64::from(before == Fate::Altered);
                self.out_of_order += u64::from(at < self.latest);
                self.latest = self.latest.max(at);
            }
            (false, Fate::Back | Fate::Altered) => self.strange += 1,
            (false, _) => entry.fate = Fate::Altered,
        }
        was_missing
    }

    /// Whether a frame is an unaltered echo of a frame that was sent, for the first time or repeated.
    pub(super) fn holds(&self, frame: &CanFrame) -> bool {
        self.entries.iter().any(|entry| entry.fate != Fate::ToSend && entry.echo == Some(*frame))
    }

    /// The counts up to now.
    pub(super) fn seen(&self) -> Seen {
        let Self { out_of_order, twice, strange, foreign, .. } = *self;
        let altered = |entry: &&Entry| entry.fate == Fate::Altered;
        let is_standard = |entry: &&Entry| matches!(entry.sent.id(), CanId::Standard(_));
        let all = self.count(Fate::Altered);
        let standard = self.entries.iter().filter(altered).filter(is_standard).count() as u64;
        let doubtful = if strange + foreign > 0 { standard } else { 0 };
        Seen {
            sent: self.entries.len() as u64 - self.count(Fate::ToSend),
            unsent: self.count(Fate::ToSend),
            lost: self.count(Fate::UnderWay) + self.count(Fate::Late) + doubtful,
            altered: all - doubtful,
            out_of_order,
            twice,
            strange: strange + doubtful,
            foreign,
        }
    }

    fn count(&self, fate: Fate) -> u64 {
        self.entries.iter().filter(|entry| entry.fate == fate).count() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::super::frames::Mark;
    use super::*;

    fn echo(frame: &CanFrame) -> CanFrame {
        CanFrame::new(echo_of(frame.id()).unwrap(), frame.data()).unwrap()
    }

    fn echoes() -> Vec<CanFrame> {
        Mark(7).test_frames().iter().map(echo).collect()
    }

    fn flipped(frame: &CanFrame) -> CanFrame {
        let mut data = frame.data().to_vec();
        data[0] ^= 0x10;
        CanFrame::new(frame.id(), &data).unwrap()
    }

    fn seen(returned: &[CanFrame]) -> Seen {
        let mut ledger = Ledger::new(&Mark(7).test_frames());
        while ledger.send_next().is_some() {}
        returned.iter().for_each(|frame| {
            ledger.note(frame);
        });
        ledger.seen()
    }

    #[test]
    fn what_happened_on_the_way_is_told_apart() {
        let all = Seen { sent: 216, ..Seen::default() };
        let good = echoes();
        assert_eq!(seen(&good), all);
        assert_eq!(seen(&good[..200]), Seen { lost: 16, ..all });
        let mut swapped = good.clone();
        swapped.swap(50, 51);
        assert_eq!(seen(&swapped), Seen { out_of_order: 1, ..all });
        for at in 0..216 {
            let mut twice = good.clone();
            twice.insert(at + 1, good[at]);
            assert_eq!(seen(&twice), Seen { twice: 1, ..all });
            let mut altered = good.clone();
            if altered[at].data().is_empty() {
                continue;
            }
            altered[at] = flipped(&altered[at]);
            assert_eq!(seen(&altered), Seen { altered: 1, ..all });
        }
    }

    /// A frame that is back in full was not altered, even if other frames came under its id.
    #[test]
    fn what_others_send_is_no_alteration() {
        let all = Seen { sent: 216, ..Seen::default() };
        let good = echoes();
        let other = CanFrame::new(CanId::Standard(0x71f), &[]).unwrap();
        for stranger in [other, flipped(&good[35])] {
            for at in [0, 216] {
                let mut returned = good.clone();
                returned.insert(at, stranger);
                assert_eq!(seen(&returned), Seen { strange: 1, ..all });
            }
        }
        // The set of another exchange, which comes late: its extended frames do not belong to this exchange.
        let late = Mark(0x55aa).test_frames();
        let extended: Vec<CanFrame> =
            late.iter().filter(|frame| matches!(frame.id(), CanId::Extended(_))).map(echo).collect();
        assert_eq!(seen(&extended), Seen { lost: 216, strange: 108, ..all });
        // A test frame of another station. The station's own frame, repeated by an adapter, does not count as one.
        let mut shared = good.clone();
        shared.extend([Mark(7).test_frames()[0], late[60]]);
        assert_eq!(seen(&shared), Seen { foreign: 1, ..all });
    }

    /// Beside strangers an altered standard frame may be one of theirs. An altered extended frame of this exchange may
    /// not.
    #[test]
    fn beside_strangers_only_extended_frames_are_altered_for_certain() {
        let stranger = CanFrame::new(CanId::Standard(0x71f), &[]).unwrap();
        let mut returned = echoes();
        (returned[35], returned[71]) = (flipped(&returned[35]), flipped(&returned[71]));
        returned.push(stranger);
        assert_eq!(seen(&returned), Seen { sent: 216, altered: 1, lost: 1, strange: 2, ..Seen::default() });
    }

    #[test]
    fn frames_that_come_late_are_back() {
        let mut ledger = Ledger::new(&Mark(7).test_frames());
        for _ in 0..4 {
            ledger.send_next();
        }
        assert_eq!(ledger.under_way(), 4);
        ledger.give_up();
        assert_eq!((ledger.under_way(), ledger.is_complete(), ledger.seen().lost), (0, false, 4));
        echoes()[..4].iter().for_each(|frame| assert!(ledger.note(frame)));
        assert_eq!((ledger.is_complete(), ledger.seen()), (true, Seen { sent: 4, unsent: 212, ..Seen::default() }));
        // A frame that was not sent yet cannot be back.
        assert!(!ledger.note(&echoes()[4]));
        assert_eq!(ledger.seen().strange, 1);
    }
}
