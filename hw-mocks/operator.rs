//! The operator of the simulated bench: sets the DIP switches when asked, and sometimes answers without doing it.

/// Number of DIP switches.
pub(crate) const SWITCHES: u8 = 5;

/// What the operator does wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct OperatorFaults {
    /// The switches that are on at the start.
    pub switches_on: [bool; SWITCHES as usize],
    /// The first request to set switches that is forgotten, from 1.
    pub forgets_from: u32,
    /// How many requests are forgotten from there on.
    pub forgets: u32,
}

/// The operator.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SimulatedOperator {
    faults: OperatorFaults,
    asked: u32,
}

impl SimulatedOperator {
    pub(crate) fn new(faults: OperatorFaults) -> Self {
        Self { faults, asked: 0 }
    }

    /// Hears a request to set switches. Returns whether the operator does it; otherwise the answer comes without it.
    pub(crate) fn sets_switches(&mut self) -> bool {
        let since = self.asked.checked_sub(self.faults.forgets_from.saturating_sub(1));
        self.asked = self.asked.saturating_add(1);
        since.is_none_or(|since| since >= self.faults.forgets)
    }
}
