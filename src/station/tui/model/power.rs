//! Whether the module is under power, as far as the station knows.

use super::{RunView, ScreenModel};

/// What is known of the module's power, beside what the run on the screen says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PowerSeen {
    /// Nothing was on since the run on the screen.
    ByRun,
    /// The board has confirmed, after values were watched, that the module is off.
    Off,
    /// The module was under power when the station last heard of it, and no board has confirmed since that it is off.
    Unknown,
}

/// Whether the station knows if the module is under power.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PowerKnown {
    Known,
    /// Nothing is on, and no board has confirmed that the module is off.
    Unknown,
    /// The line was lost in the run that is on, and the station asks for the board again.
    LineLost,
}

impl ScreenModel {
    /// Whether it is known if the module is under power.
    pub(crate) fn power(&self) -> PowerKnown {
        let of_run = self.run.as_ref().is_some_and(RunView::power_unknown);
        match self.power_seen {
            _ if self.watching => PowerKnown::Known,
            _ if self.is_running() && self.line_lost => PowerKnown::LineLost,
            PowerSeen::Unknown => PowerKnown::Unknown,
            PowerSeen::ByRun if of_run => PowerKnown::Unknown,
            PowerSeen::ByRun | PowerSeen::Off => PowerKnown::Known,
        }
    }

    /// Keeps what is known of the power when the run on the screen goes.
    pub(crate) fn keep_power(&mut self) {
        if self.power() == PowerKnown::Unknown {
            self.power_seen = PowerSeen::Unknown;
        }
    }
}
