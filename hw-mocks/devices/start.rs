//! How the module starts when its supply comes on.

/// What goes wrong at some power-ons, counted from the bench's start; 0: it never does.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct StartFaults {
    /// At every so many-th power-on the module is late.
    pub late_every: u32,
    /// How late, s.
    pub late_s: f64,
    /// At every so many-th power-on the module does not start at all.
    pub hangs_every: u32,
    /// After so many power-ons another module is in the socket.
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

    /// Power came on at `now_s`.
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
