//! An slcan adapter on a serial port.
//!
//! It is told to open and never asked whether it did: adapters differ in what they acknowledge. It tells neither of
//! error frames nor of bus-off.

use std::io;
use std::path::Path;

use gnc_protocol::can::CanFrame;
use gnc_protocol::can::slcan::{self, Decoder, Item, encode};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, ReadHalf, WriteHalf};
use tokio_serial::SerialStream;
use tokio_util::bytes::{Buf as _, BytesMut};

use super::bus::Turn;
use crate::link::serial::{self, OpenError};

/// Rate of the port. USB adapters ignore it; on a real line it must carry more than the bus: 27 characters for each
/// frame of 111 bits.
pub(crate) const RATE_BAUD: u32 = 2_000_000;
/// Bytes of lines that may wait for the port: 150 frames.
const OUTGOING: usize = 4096;

/// The adapter.
#[derive(Debug)]
pub(super) struct SlcanBus {
    reader: ReadHalf<SerialStream>,
    writer: WriteHalf<SerialStream>,
    incoming: BytesMut,
    outgoing: BytesMut,
    decoder: Decoder,
}

impl SlcanBus {
    pub(super) fn open(port: &Path) -> Result<Self, OpenError> {
        let stream = serial::open_port(port, RATE_BAUD)?;
        let (reader, writer) = tokio::io::split(stream);
        let outgoing = BytesMut::from(slcan::OPEN_500K);
        Ok(Self { reader, writer, incoming: BytesMut::new(), outgoing, decoder: Decoder::default() })
    }

    pub(super) async fn turn(&mut self, outgoing: Option<&CanFrame>, read: bool) -> io::Result<Turn> {
        loop {
            if let Some(frame) = outgoing.filter(|_| self.outgoing.len() < OUTGOING) {
                self.outgoing.extend_from_slice(&encode(frame));
                return Ok(Turn::Sent);
            }
            if read && let Some(frame) = self.decoded() {
                return Ok(Turn::Received(frame));
            }
            tokio::select! {
                biased;
                written = self.writer.write_buf(&mut self.outgoing), if !self.outgoing.is_empty() => {
                    written?;
                }
                count = self.reader.read_buf(&mut self.incoming), if read => {
                    if count? == 0 {
                        return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the other end was closed"));
                    }
                }
                else => std::future::pending().await,
            }
        }
    }

    /// The next frame in what has come. Answers of the adapter are passed over.
    fn decoded(&mut self) -> Option<CanFrame> {
        loop {
            let mut rest: &[u8] = &self.incoming;
            let item = self.decoder.next(&mut rest);
            let consumed = self.incoming.len() - rest.len();
            self.incoming.advance(consumed);
            if let Item::Frame(frame) = item? {
                return Some(frame);
            }
        }
    }

    pub(super) async fn close(mut self) {
        // What still waits belongs to nobody; half a line is ended by the first byte.
        self.outgoing.clear();
        self.outgoing.extend_from_slice(b"\r");
        self.outgoing.extend_from_slice(slcan::CLOSE);
        // A port that takes nothing is closed all the same.
        let _ =
            tokio::time::timeout(std::time::Duration::from_millis(50), self.writer.write_all_buf(&mut self.outgoing))
                .await;
    }
}
