//! Whose fault is what is missing? The module's where its own controller tells of it, where a frame comes back altered,
//! where two change places although only one was on its way, and where it keeps back what it received although the bus
//! is free. All else may be the line, the adapter, this computer or another node on the bus.

use gnc_protocol::message::CanState;

use super::exchange::Observed;
use crate::procedure::Trouble;

impl Observed {
    /// Whether what was seen is the module's doing.
    pub(super) fn is_module_at_fault(&self, lost_by_host: u64) -> bool {
        let after = &self.after;
        let counts_errors = after.tx_errors > 0 || after.rx_errors > 0 || after.state != CanState::ErrorActive as u8;
        // A module that answers other stations too, waits for the bus, or whose frames this computer does not hear, is
        // no worse for it.
        let undisturbed = self.seen.foreign == 0 && (self.through || (!self.is_busy() && lost_by_host == 0));
        counts_errors
            || self.seen.altered > 0
            || self.alone.out_of_order > 0
            || self.alone.altered > 0
            || (self.keeps_back && undisturbed)
    }

    /// Why nothing can be said of a module that is not at fault; `None`: there is no doubt.
    pub(super) fn doubt(&self, by_host: u64) -> Option<Trouble> {
        let seen = &self.seen;
        let (sent, lost, astray) = (seen.sent, seen.lost, seen.out_of_order + seen.twice);
        if seen.strange + seen.foreign > 0 {
            return Some(Trouble::TestIdsShared { sent, lost, strange: seen.strange, foreign: seen.foreign });
        }
        // A frame that was not sent tests nothing, even if the others came back when the bus moved again.
        if self.settled && lost + astray + seen.unsent == 0 {
            return None;
        }
        let (received, others) = (self.received(), self.others.frames);
        let busy_percent = self.busy_share() * 100.0;
        let (stale, span_s) = (self.stale, self.span.as_secs_f64());
        let unsent = seen.unsent;
        Some(Trouble::FramesLost { sent, unsent, lost, astray, received, by_host, others, busy_percent, span_s, stale })
    }
}
