//! How the module starts when its supply comes on.

/// Faults at some power-ons, counted from the bench's start; 0: never.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct StartFaults {
    /// The module is late at every n-th power-on.
    pub late_every: u32,
    /// Delay of a late start, s.
    pub late_s: f64,
    /// The module does not start at all at every n-th power-on.
    pub hangs_every: u32,
    /// Number of power-ons after which another module is in the socket.
    pub swapped_after: u32,
}

/// The start of a module.
#[derive(Debug, Clone)]
pub(crate) struct Start {
    faults: StartFaults,
    power_ons: u32,
    up_at_s: f64,
}

impl Start {
    pub(crate) fn new(faults: StartFaults) -> Self {
        Self { faults, power_ons: 0, up_at_s: f64::INFINITY }
    }

    /// Handles power-on at `now_s`.
    pub(crate) fn power_on(&mut self, now_s: f64) {
        self.power_ons += 1;
        let now_and_then = |every: u32| every > 0 && self.power_ons.is_multiple_of(every);
        self.up_at_s = if now_and_then(self.faults.hangs_every) {
            f64::INFINITY
        } else if now_and_then(self.faults.late_every) {
            now_s + self.faults.late_s
        } else {
            now_s
        };
    }

    /// Whether the module answers at `now_s`, if it is under power.
    pub(crate) fn is_up(&self, now_s: f64) -> bool {
        now_s >= self.up_at_s
    }

    /// Whether another module is in the socket by now.
    pub(crate) fn is_swapped(&self) -> bool {
        self.faults.swapped_after > 0 && self.power_ons > self.faults.swapped_after
    }
}
