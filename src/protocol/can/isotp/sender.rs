//! Splits a message into frames.

use core::time::Duration;

use heapless::Vec;

use super::{CONSECUTIVE, FIRST, Flow, IN_CONSECUTIVE, IN_FIRST, IN_SINGLE, MAX_PDU, MAX_WAITS, N_BS, separation};
use crate::can::Data;

/// Why a message cannot be sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum StartError {
    /// Another message is on its way.
    #[error("another message is on its way")]
    Busy,
    /// ISO-TP has no message without bytes.
    #[error("the message has no bytes")]
    Empty,
    /// The message is longer than the sender's buffer or than 4095 bytes.
    #[error("a message of {length} bytes is too long")]
    TooLong {
        /// Bytes of the message.
        length: usize,
    },
}

/// Why a message was given up half way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SendError {
    /// No flow control within [`N_BS`].
    #[error("no flow control in {} ms", N_BS.as_millis())]
    FlowTimeout,
    /// The receiver has no room for the message.
    #[error("the receiver has no room for the message")]
    Overflow,
    /// The receiver said "wait" once too often.
    #[error("the receiver asked to wait more than {MAX_WAITS} times")]
    TooManyWaits,
    /// Flow control with an unknown status.
    #[error("flow control with an unknown status")]
    BadFlow,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Idle,
    /// The first frame is not sent yet.
    Ready,
    WaitFlow {
        until: Duration,
        waits: u8,
    },
    /// The next frame may go at `at`; `left` frames up to the next flow control, `None` if there is no bound.
    Go {
        at: Duration,
        gap: Duration,
        left: Option<u8>,
    },
}

/// The sending state machine, for messages of up to `N` bytes.
#[derive(Debug)]
pub struct IsoTpSender<const N: usize> {
    pdu: Vec<u8, N>,
    sent: usize,
    /// The number of the next consecutive frame; the first one has 1.
    sequence: u8,
    state: State,
}

impl<const N: usize> Default for IsoTpSender<N> {
    fn default() -> Self {
        Self { pdu: Vec::new(), sent: 0, sequence: 1, state: State::Idle }
    }
}

impl<const N: usize> IsoTpSender<N> {
    /// Takes a message to send.
    ///
    /// # Errors
    /// [`StartError`]; nothing has changed then.
    pub fn start(&mut self, pdu: &[u8]) -> Result<(), StartError> {
        if self.state != State::Idle {
            return Err(StartError::Busy);
        }
        if pdu.is_empty() {
            return Err(StartError::Empty);
        }
        if pdu.len() > MAX_PDU.min(N) {
            return Err(StartError::TooLong { length: pdu.len() });
        }
        self.pdu.clear();
        // The length is checked above, so this cannot fail.
        let _ = self.pdu.extend_from_slice(pdu);
        (self.sent, self.sequence, self.state) = (0, 1, State::Ready);
        Ok(())
    }

    /// Whether no message is on its way.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.state == State::Idle
    }

    /// Gives up the message on its way.
    pub fn cancel(&mut self) {
        self.state = State::Idle;
    }

    /// The data of the next frame, if one may go now.
    pub fn poll(&mut self, now: Duration) -> Option<Data> {
        match self.state {
            State::Idle | State::WaitFlow { .. } => None,
            State::Ready if self.pdu.len() <= IN_SINGLE => {
                self.state = State::Idle;
                Some(frame(&[self.pdu.len() as u8], &self.pdu))
            }
            State::Ready => {
                self.sent = IN_FIRST;
                self.state = State::WaitFlow { until: now + N_BS, waits: 0 };
                let length = self.pdu.len();
                Some(frame(&[FIRST << 4 | (length >> 8) as u8, length as u8], &self.pdu[..IN_FIRST]))
            }
            State::Go { at, gap, left } => (now >= at).then(|| {
                let rest = &self.pdu[self.sent..];
                let data = frame(&[CONSECUTIVE << 4 | self.sequence], &rest[..rest.len().min(IN_CONSECUTIVE)]);
                self.sent += data.len() - 1;
                self.sequence = (self.sequence + 1) & 0x0f;
                let left = left.map(|left| left.saturating_sub(1));
                self.state = match left {
                    _ if self.sent >= self.pdu.len() => State::Idle,
                    Some(0) => State::WaitFlow { until: now + N_BS, waits: 0 },
                    _ => State::Go { at: now + gap, gap, left },
                };
                data
            }),
        }
    }

    /// Takes flow control; ignores it if the sender does not wait for it.
    ///
    /// # Errors
    /// [`SendError`] if the message is given up.
    pub fn flow(&mut self, data: &[u8], now: Duration) -> Result<(), SendError> {
        let State::WaitFlow { waits, .. } = self.state else { return Ok(()) };
        let error = match Flow::from_bytes(data) {
            Some(Flow::Continue { block_size, st_min }) => {
                let left = (block_size != 0).then_some(block_size);
                self.state = State::Go { at: now, gap: separation(st_min), left };
                return Ok(());
            }
            Some(Flow::Wait) if waits < MAX_WAITS => {
                self.state = State::WaitFlow { until: now + N_BS, waits: waits + 1 };
                return Ok(());
            }
            Some(Flow::Wait) => SendError::TooManyWaits,
            Some(Flow::Overflow) => SendError::Overflow,
            None => SendError::BadFlow,
        };
        self.state = State::Idle;
        Err(error)
    }

    /// Checks the time.
    ///
    /// # Errors
    /// [`SendError::FlowTimeout`] once, when the wait for flow control is over.
    pub fn expire(&mut self, now: Duration) -> Result<(), SendError> {
        match self.state {
            State::WaitFlow { until, .. } if now >= until => {
                self.state = State::Idle;
                Err(SendError::FlowTimeout)
            }
            _ => Ok(()),
        }
    }

    /// When [`IsoTpSender::poll`] or [`IsoTpSender::expire`] has something to do; `None` when idle.
    #[must_use]
    pub fn next_due(&self) -> Option<Duration> {
        match self.state {
            State::Idle => None,
            State::Ready => Some(Duration::ZERO),
            State::WaitFlow { until, .. } => Some(until),
            State::Go { at, .. } => Some(at),
        }
    }
}

/// Makes a frame of one or two head bytes and the content; the callers keep to eight bytes in all.
fn frame(head: &[u8], content: &[u8]) -> Data {
    head.iter().chain(content).copied().take(crate::can::MAX_DATA).collect()
}
