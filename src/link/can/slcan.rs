//! An slcan adapter on a serial port.
//!
//! The station tells the adapter to open and does not check the answer, since adapters differ in what they acknowledge.
//! The adapter reports neither error frames nor bus-off.

use std::io;
use std::time::Duration;

use gnc_protocol::can::CanFrame;
use gnc_protocol::can::slcan::{self, SlcanDecoder, SlcanEvent, encode};
use tokio_util::bytes::Buf as _;

use super::bus::BusEvent;
use crate::doubt::Doubt;
use crate::serial::{OpenError, Port, PortEvent, PortLocation};

/// Rate of the port. USB adapters ignore it; on a real line the rate must be higher than that of the bus: 27 characters
/// for each frame of 111 bits.
pub const RATE_BAUD: u32 = 2_000_000;
/// Bytes of lines that may wait for the port: 150 frames.
const OUTGOING: usize = 4096;
/// Longest wait for a port to take the line that closes the adapter.
const CLOSE_WITHIN: Duration = Duration::from_millis(50);

/// The adapter.
#[derive(Debug)]
pub(super) struct SlcanBus {
    port: Port,
    decoder: SlcanDecoder,
}

impl SlcanBus {
    pub(super) fn open(place: PortLocation) -> Result<Self, OpenError> {
        let mut port = Port::open(place)?;
        port.outgoing.extend_from_slice(slcan::OPEN_500K);
        Ok(Self { port, decoder: SlcanDecoder::default() })
    }

    pub(super) fn name(&self) -> String {
        self.port.name()
    }

    pub(super) fn doubt(&self) -> Option<&Doubt> {
        self.port.doubt()
    }

    pub(super) async fn turn(&mut self, outgoing: Option<&CanFrame>, read: bool) -> io::Result<BusEvent> {
        loop {
            if let Some(frame) = outgoing.filter(|_| self.port.is_there() && self.port.outgoing.len() < OUTGOING) {
                self.port.outgoing.extend_from_slice(&encode(frame));
                return Ok(BusEvent::Sent);
            }
            if read && let Some(frame) = self.decoded() {
                return Ok(BusEvent::Received(frame));
            }
            match self.port.turn(read).await? {
                PortEvent::Read | PortEvent::Written => {}
                PortEvent::Away => {
                    // Half a line from before the absence must not begin a line from after it.
                    (self.decoder, self.port.incoming) = Default::default();
                    return Ok(BusEvent::Away);
                }
                PortEvent::Back(lasted) => {
                    // An adapter that was without power has left the bus.
                    self.port.outgoing.extend_from_slice(slcan::OPEN_500K);
                    return Ok(BusEvent::Back(lasted));
                }
            }
        }
    }

    /// The next frame in the received bytes. Answers of the adapter are skipped.
    fn decoded(&mut self) -> Option<CanFrame> {
        loop {
            let incoming = &mut self.port.incoming;
            let mut rest: &[u8] = incoming;
            let item = self.decoder.next(&mut rest);
            let consumed = incoming.len() - rest.len();
            incoming.advance(consumed);
            if let SlcanEvent::Frame(frame) = item? {
                return Some(frame);
            }
        }
    }

    pub(super) async fn close(mut self) {
        // Waiting bytes are no longer needed. The first byte ends a line that is half sent.
        self.port.outgoing.clear();
        self.port.outgoing.extend_from_slice(b"\r");
        self.port.outgoing.extend_from_slice(slcan::CLOSE);
        // If the port takes nothing, close anyway.
        while self.port.is_there() && !self.port.outgoing.is_empty() {
            match tokio::time::timeout(CLOSE_WITHIN, self.port.turn(false)).await {
                Ok(Ok(_)) => {}
                Ok(Err(_)) | Err(_) => return,
            }
        }
    }
}
