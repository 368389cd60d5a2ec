//! Decides whether the module is at fault for missing frames. It is at fault if its own controller counts errors, if a
//! frame comes back altered, if two frames change places although only one was under way, or if it keeps back received
//! frames although the bus is free. All else may be the line, the adapter, this computer or another node on the bus.

use gnc_protocol::message::CanState;

use super::exchange::Observed;
use crate::procedure::ProcedureError;

impl Observed {
    /// Whether the module caused what was seen.
    pub(super) fn is_module_at_fault(&self, lost_by_host: u64) -> bool {
        let after = &self.after;
        let counts_errors = after.tx_errors > 0 || after.rx_errors > 0 || after.state != CanState::ErrorActive as u8;
        // A module is not at fault if it also answers other stations, waits for the bus, or if this computer misses its
        // frames.
        let undisturbed = self.seen.foreign == 0 && (self.through || (!self.is_busy() && lost_by_host == 0));
        counts_errors
            || self.seen.altered > 0
            || self.alone.out_of_order > 0
            || self.alone.altered > 0
            || (self.keeps_back && undisturbed)
    }

    /// Why the station cannot judge a module that is not at fault; `None`: there is no doubt.
    pub(super) fn doubt(&self, by_host: u64) -> Option<ProcedureError> {
        let seen = &self.seen;
        let (sent, lost, astray) = (seen.sent, seen.lost, seen.out_of_order + seen.twice);
        if seen.strange + seen.foreign > 0 {
            return Some(ProcedureError::TestIdsShared { sent, lost, strange: seen.strange, foreign: seen.foreign });
        }
        // A frame that was not sent tests nothing, even if the others came back when the bus moved again.
        if self.settled && lost + astray + seen.unsent == 0 {
            return None;
        }
        let (received, others) = (self.received(), self.others.frames);
        let busy_percent = self.busy_share() * 100.0;
        let (stale, span_s) = (self.stale, self.span.as_secs_f64());
        let unsent = seen.unsent;
        Some(ProcedureError::FramesLost {
            sent,
            unsent,
            lost,
            astray,
            received,
            by_host,
            others,
            busy_percent,
            span_s,
            stale,
        })
    }
}
