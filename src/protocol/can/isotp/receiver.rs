//! Assembles a message from its frames.

use core::time::Duration;

use heapless::Vec;

use super::{CONSECUTIVE, FIRST, Flow, IN_CONSECUTIVE, IN_FIRST, IN_SINGLE, N_CR, SINGLE};

/// What a receiver asks of a sender by flow control.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FlowSettings {
    /// Consecutive frames up to the next flow control; 0: all.
    pub block_size: u8,
    /// STmin as its byte on the wire.
    pub st_min: u8,
}

/// Why a message or a frame is lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Failure {
    /// No consecutive frame within [`N_CR`].
    #[error("no consecutive frame in {} ms", N_CR.as_millis())]
    Timeout,
    /// A consecutive frame has another number than expected: a frame was lost, doubled or overtaken.
    #[error("consecutive frame {got} instead of {expected}")]
    Sequence {
        /// The expected number.
        expected: u8,
        /// The number that came.
        got: u8,
    },
    /// The message is longer than the receiver's buffer.
    #[error("a message of {length} bytes is too long")]
    TooLong {
        /// Its announced length.
        length: usize,
    },
    /// The frame has too few bytes for its kind, or a forbidden length. The receiver skips it; a message under way goes
    /// on.
    #[error("the frame is not an ISO-TP frame")]
    Malformed,
}

/// The result of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IsoTpReceived {
    /// Nothing yet.
    Nothing,
    /// Flow control to send, at once.
    Flow(Flow),
    /// A message is complete: [`IsoTpReceiver::pdu`].
    Complete,
    /// A message or a frame is lost; if the message was too long, the sender must be told ([`Flow::Overflow`]).
    Failed(Failure),
}

#[derive(Debug, Clone, Copy)]
struct Running {
    length: usize,
    sequence: u8,
    /// Consecutive frames up to the next flow control; `None` if there is no bound.
    left: Option<u8>,
    until: Duration,
}

/// The receiving state machine, for messages of up to `N` bytes.
#[derive(Debug)]
pub struct IsoTpReceiver<const N: usize> {
    settings: FlowSettings,
    pdu: Vec<u8, N>,
    running: Option<Running>,
    interrupted: u32,
}

impl<const N: usize> Default for IsoTpReceiver<N> {
    fn default() -> Self {
        Self::new(FlowSettings::default())
    }
}

impl<const N: usize> IsoTpReceiver<N> {
    /// Makes a receiver with its settings.
    #[must_use]
    pub const fn new(settings: FlowSettings) -> Self {
        Self { settings, pdu: Vec::new(), running: None, interrupted: 0 }
    }

    /// The message after [`IsoTpReceived::Complete`]; it is valid up to the next frame.
    #[must_use]
    pub fn pdu(&self) -> &[u8] {
        &self.pdu
    }

    /// Whether no message is under way.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.running.is_none()
    }

    /// Messages that were cut off by the beginning of another one.
    #[must_use]
    pub fn interrupted(&self) -> u32 {
        self.interrupted
    }

    /// Drops the message under way.
    pub fn cancel(&mut self) {
        self.running = None;
    }

    /// Takes the data of a frame that is not flow control.
    pub fn receive(&mut self, data: &[u8], now: Duration) -> IsoTpReceived {
        let Some((&first, content)) = data.split_first() else { return IsoTpReceived::Failed(Failure::Malformed) };
        match first >> 4 {
            SINGLE => self.single(usize::from(first & 0x0f), content),
            FIRST => self.first(first & 0x0f, content, now),
            CONSECUTIVE => self.consecutive(first & 0x0f, content, now),
            _ => IsoTpReceived::Failed(Failure::Malformed),
        }
    }

    /// Checks the time.
    ///
    /// # Errors
    /// [`Failure::Timeout`] once, when the wait for a consecutive frame is over.
    pub fn expire(&mut self, now: Duration) -> Result<(), Failure> {
        match self.running {
            Some(running) if now >= running.until => {
                self.running = None;
                Err(Failure::Timeout)
            }
            _ => Ok(()),
        }
    }

    /// When [`IsoTpReceiver::expire`] has something to do.
    #[must_use]
    pub fn next_due(&self) -> Option<Duration> {
        self.running.map(|running| running.until)
    }

    fn single(&mut self, length: usize, content: &[u8]) -> IsoTpReceived {
        if !(1..=IN_SINGLE).contains(&length) || content.len() < length {
            return IsoTpReceived::Failed(Failure::Malformed);
        }
        self.begin();
        self.keep(&content[..length]);
        IsoTpReceived::Complete
    }

    fn first(&mut self, high: u8, content: &[u8], now: Duration) -> IsoTpReceived {
        let Some((&low, content)) = content.split_first().filter(|(_, content)| content.len() == IN_FIRST) else {
            return IsoTpReceived::Failed(Failure::Malformed);
        };
        let length = match usize::from(high) << 8 | usize::from(low) {
            // This is the escape to lengths of 32 bits, which are more than any buffer here.
            0 => match content {
                &[a, b, c, d, ..] => u32::from_be_bytes([a, b, c, d]) as usize,
                _ => return IsoTpReceived::Failed(Failure::Malformed),
            },
            length => length,
        };
        if length <= IN_SINGLE {
            return IsoTpReceived::Failed(Failure::Malformed);
        }
        self.begin();
        if length > N {
            return IsoTpReceived::Failed(Failure::TooLong { length });
        }
        self.keep(content);
        self.running = Some(Running { length, sequence: 1, left: self.block(), until: now + N_CR });
        self.flow()
    }

    fn consecutive(&mut self, sequence: u8, content: &[u8], now: Duration) -> IsoTpReceived {
        // The receiver expects no such frame: it belongs to a message that was given up, or to another sender.
        let Some(running) = self.running.as_mut() else { return IsoTpReceived::Nothing };
        let wanted = (running.length - self.pdu.len()).min(IN_CONSECUTIVE);
        if content.len() < wanted {
            return IsoTpReceived::Failed(Failure::Malformed);
        }
        if sequence != running.sequence {
            let expected = running.sequence;
            self.running = None;
            return IsoTpReceived::Failed(Failure::Sequence { expected, got: sequence });
        }
        running.sequence = (sequence + 1) & 0x0f;
        running.until = now + N_CR;
        running.left = running.left.map(|left| left.saturating_sub(1));
        let (length, block_over) = (running.length, running.left == Some(0));
        self.keep(&content[..wanted]);
        if self.pdu.len() >= length {
            self.running = None;
            return IsoTpReceived::Complete;
        }
        if !block_over {
            return IsoTpReceived::Nothing;
        }
        let block = self.block();
        if let Some(running) = self.running.as_mut() {
            running.left = block;
        }
        self.flow()
    }

    fn begin(&mut self) {
        self.interrupted = self.interrupted.wrapping_add(u32::from(self.running.take().is_some()));
        self.pdu.clear();
    }

    /// Keeps bytes. Their length is checked against the buffer before.
    fn keep(&mut self, content: &[u8]) {
        let _ = self.pdu.extend_from_slice(content);
    }

    fn block(&self) -> Option<u8> {
        (self.settings.block_size != 0).then_some(self.settings.block_size)
    }

    fn flow(&self) -> IsoTpReceived {
        let FlowSettings { block_size, st_min } = self.settings;
        IsoTpReceived::Flow(Flow::Continue { block_size, st_min })
    }
}
