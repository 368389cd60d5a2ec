//! Ctrl-C is the byte ETX, with which some scanners begin a code. A slow one types the code only later, and a wireless one
//! sends the ETX first and then the rest. So a lone ETX waits: a character behind it shows that it was the head of a code.

use std::time::Duration;

use crate::tui::decode::Key;

/// How long the first character behind the head of a code may take: slow scanners type a character every 20 to 250 ms. A hand that
/// wants a stop types nothing so soon; F8 does not wait.
const HEAD_OF_CODE: Duration = Duration::from_millis(500);

/// What becomes of an ETX.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Etx {
    /// The next bytes tell.
    Waits,
    /// It is told now.
    IsKey,
    /// It is told now, and before it the one that waited: no code is between them, so a hand presses.
    IsSecondKey,
}

/// An ETX that waits.
#[derive(Debug, Default)]
pub(super) struct HeldEtx {
    since: Option<Duration>,
    /// When the last character came, if no ETX came behind it.
    character_at: Option<Duration>,
}

impl HeldEtx {
    /// Takes note of the first byte of what comes. `true`: what waited is a key, and comes before this byte.
    pub(super) fn byte_comes(&mut self, at: Duration, byte: u8) -> bool {
        match byte {
            // The head of a code goes with the code.
            b' '..=b'~' | 0x80.. => {
                self.since = None;
                self.character_at = Some(at);
                false
            }
            // Another ETX is weighed when it is whole; STX, EOT and the separators of fields belong to frames, too.
            0x02..=0x04 | 0x1c..=0x1f => false,
            _ => self.since.take().is_some(),
        }
    }

    /// An ETX came among these keys. Behind a character it is the end of a code, which the screen passes over.
    pub(super) fn pressed(&mut self, at: Duration, keys: &[Key]) -> Etx {
        let heads = keys.iter().filter(|key| **key == Key::Ctrl('c')).count();
        // STX and separators stand beside it in frames.
        let alone = heads == 1 && keys.iter().all(|key| matches!(key, Key::Ctrl('c' | 'b' | 'd') | Key::Control));
        let behind = self.character_at.take().is_some_and(|character| at.saturating_sub(character) < HEAD_OF_CODE);
        match self.since.take() {
            Some(_) => Etx::IsSecondKey,
            None if behind || !alone => Etx::IsKey,
            None => {
                self.since = Some(at);
                Etx::Waits
            }
        }
    }

    /// When the wait ends.
    pub(super) fn due_at(&self) -> Option<Duration> {
        self.since.map(|since| since + HEAD_OF_CODE)
    }

    /// Whether nothing came in time. The ETX waits no more then.
    pub(super) fn is_due(&mut self, at: Duration) -> bool {
        self.due_at().is_some_and(|due_at| at >= due_at) && self.since.take().is_some()
    }
}
