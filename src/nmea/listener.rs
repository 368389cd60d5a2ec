//! Bytes in, epochs and counts out.

use crate::epoch::Epoch;
use crate::epochs::Epochs;
use crate::fault::SentenceFault;
use crate::framing::{Framer, Piece};
use crate::protocols::Protocol;
use crate::sentence;

/// Finds sentences in bytes and epochs in sentences.
#[derive(Debug, Default)]
pub struct Sentences {
    framer: Framer,
    heard: Heard,
}

/// The results of the pieces so far.
#[derive(Debug, Default)]
struct Heard {
    epochs: Epochs,
    counts: Counts,
    fault: Option<SentenceFault>,
    foreign: [u32; Protocol::ALL.len()],
}

/// Counts of everything that was heard beside the epochs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Sentences with a wrong checksum, spoilt sentences, sentences with an impossible field, and bytes without a
    /// meaning.
    pub errors: u32,
    /// Errors with a right checksum: errors of the receiver. `errors` includes them.
    pub faults: u32,
    /// Epochs with the same time as the one before: sent again, or from a clock that stands still. They do not count as
    /// epochs.
    pub repeated: u32,
    /// Frames of other protocols.
    pub foreign: u32,
    /// Sentences of a receiver that sends no checksums.
    pub unchecked: u32,
}

impl Sentences {
    /// Takes bytes as they come. Returns the epochs that ended in them.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<Epoch> {
        self.hear(|framer, found| framer.push(bytes, found))
    }

    /// Ends the input. Returns the epochs that ended in bytes that seemed to be under way. The last epoch has not
    /// ended.
    pub fn finish(&mut self) -> Vec<Epoch> {
        self.hear(|framer, found| framer.finish(found))
    }

    fn hear(&mut self, listen: impl FnOnce(&mut Framer, &mut dyn FnMut(Piece<'_>))) -> Vec<Epoch> {
        let Self { framer, heard } = self;
        let mut ended = Vec::new();
        listen(framer, &mut |piece| ended.extend(heard.piece(&piece)));
        ended
    }

    /// Counts of everything that was heard beside the epochs.
    #[must_use]
    pub fn counts(&self) -> Counts {
        let (repeated, unchecked) = (self.heard.epochs.repeated(), self.framer.unchecked());
        Counts { repeated, unchecked, ..self.heard.counts }
    }

    /// The first error of the receiver itself.
    #[must_use]
    pub fn fault(&self) -> Option<&SentenceFault> {
        self.heard.fault.as_ref()
    }

    /// The other protocols with the number of their frames, as `12 UBX, 3 RTCM 3`; empty if there are none.
    #[must_use]
    pub fn foreign(&self) -> String {
        let heard = Protocol::ALL.iter().zip(self.heard.foreign).filter(|(_, frames)| *frames > 0);
        heard.map(|(protocol, frames)| format!("{frames} {}", protocol.name())).collect::<Vec<_>>().join(", ")
    }
}

impl Heard {
    /// Takes a piece. Returns the epoch that ended with it.
    fn piece(&mut self, piece: &Piece<'_>) -> Option<Epoch> {
        match piece {
            Piece::Sentence(body) => match sentence::read(body) {
                Ok(sentence) => match self.epochs.add(sentence?)? {
                    Ok(epoch) => return Some(epoch),
                    Err(fault) => {
                        self.faulty(fault);
                        return Some(Epoch::default());
                    }
                },
                Err(fault) => {
                    self.epochs.faulty(body);
                    self.faulty(fault);
                }
            },
            Piece::Foreign(protocol) => {
                self.counts.foreign = self.counts.foreign.saturating_add(1);
                let frames = &mut self.foreign[*protocol as usize];
                *frames = frames.saturating_add(1);
            }
            Piece::Broken => {
                self.counts.errors = self.counts.errors.saturating_add(1);
                self.epochs.broken();
            }
        }
        None
    }

    fn faulty(&mut self, fault: SentenceFault) {
        self.counts.errors = self.counts.errors.saturating_add(1);
        self.counts.faults = self.counts.faults.saturating_add(1);
        self.fault.get_or_insert(fault);
    }
}
