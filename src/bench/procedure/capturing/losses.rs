//! Error messages for missing samples.

use gnc_analysis::capture::CaptureHead;
use gnc_protocol::stream::Losses;

use super::ProcedureError;

/// Samples are missing between two that came.
pub(super) fn gap(about: &CaptureHead, after: usize, losses: Losses) -> ProcedureError {
    let at_s = after as f64 / f64::from(about.rate_hz.max(1));
    ProcedureError::CaptureLost { label: about.label.clone(), after: after as u32, at_s, losses }
}

/// No sample came while the board's clock went on: the missing samples were lost on the line, or were never made.
pub(super) fn silent(about: &CaptureHead, after: usize, wanted: u32, losses: Losses) -> ProcedureError {
    let missing = wanted.saturating_sub(after as u32).saturating_sub(losses.on_board);
    gap(about, after, Losses { on_line: losses.on_line.max(missing).max(1), ..losses })
}
