//! The module's SCI, which echoes all bytes.

use gnc_protocol::message::{SciEcho, SciEchoReply};

/// Faults of the SCI.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct SciFaults {
    /// One of this many bytes is lost with a framing error; 0: none.
    pub lose_every: u32,
    /// One of this many bytes arrives with its lowest bit inverted; 0: none.
    pub flip_every: u32,
}

/// The SCI.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sci {
    faults: SciFaults,
    bytes: u32,
}

impl Sci {
    /// An SCI with its faults.
    #[must_use]
    pub(crate) fn new(faults: SciFaults) -> Self {
        Self { faults, bytes: 0 }
    }

    /// Echoes a block.
    pub(crate) fn echo(&mut self, request: &SciEcho) -> SciEchoReply {
        let mut reply = SciEchoReply::default();
        let every = |count: u32, period: u32| period != 0 && count.is_multiple_of(period);
        for &byte in &request.data {
            self.bytes = self.bytes.wrapping_add(1);
            if every(self.bytes, self.faults.lose_every) {
                reply.framing_errors += 1;
                continue;
            }
            // At most as many bytes come back as a block holds.
            let _ = reply.data.push(byte ^ u8::from(every(self.bytes, self.faults.flip_every)));
        }
        reply
    }
}
