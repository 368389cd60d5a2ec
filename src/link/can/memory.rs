//! A bus in memory, for tests and for a board in the same program.

use std::io;

use gnc_protocol::can::CanFrame;
use tokio::sync::mpsc;

use super::bus::BusEvent;

/// Frames under way in each direction: as many as an adapter buffers.
const FRAMES: usize = 1024;

/// The station's end.
#[derive(Debug)]
pub(super) struct MemoryBus {
    outgoing: mpsc::Sender<CanFrame>,
    incoming: mpsc::Receiver<CanFrame>,
}

/// The other end.
#[derive(Debug)]
pub struct MemoryEnd {
    /// What the host sends.
    pub from_host: mpsc::Receiver<CanFrame>,
    /// What the host hears.
    pub to_host: mpsc::Sender<CanFrame>,
}

pub(super) fn pair() -> (MemoryBus, MemoryEnd) {
    let (outgoing, from_host) = mpsc::channel(FRAMES);
    let (to_host, incoming) = mpsc::channel(FRAMES);
    (MemoryBus { outgoing, incoming }, MemoryEnd { from_host, to_host })
}

impl MemoryBus {
    pub(super) async fn turn(&mut self, outgoing: Option<&CanFrame>, read: bool) -> io::Result<BusEvent> {
        tokio::select! {
            biased;
            room = self.outgoing.reserve(), if outgoing.is_some() => {
                let room = room.map_err(|_| super::gone())?;
                if let Some(frame) = outgoing {
                    room.send(*frame);
                }
                Ok(BusEvent::Sent)
            }
            frame = self.incoming.recv(), if read => frame.map(BusEvent::Received).ok_or_else(super::gone),
            else => std::future::pending().await,
        }
    }
}
