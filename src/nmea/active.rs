//! Dimensions, dilutions and satellites of GSA. GSA has no time of its own and may be missing in an epoch.

use super::sentence::Active;

/// Epochs for which a GSA is carried over at most.
pub(super) const CARRIED_EPOCHS: u32 = 10;

/// The geometry of an epoch, from its own GSA or from the last ones before it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Geometry {
    /// 1 none, 2 or 3; `None` if no GSA came lately.
    pub(super) dimensions: Option<u32>,
    /// Satellites of all systems; only for an epoch with a GSA of its own.
    pub(super) satellites: Option<u32>,
    pub(super) hdop: Option<f64>,
    pub(super) vdop: Option<f64>,
}

/// Collects the GSA of an epoch and carries them over to the next epochs.
#[derive(Debug, Default)]
pub(super) struct ActiveSatellites {
    /// GSA since the end of the last epoch.
    fresh: Vec<Active>,
    last: Geometry,
    /// Epochs since the last one with a GSA of its own.
    age: u32,
    /// The largest number of epochs from one GSA to the next so far; `None` before the second GSA.
    usual: Option<u32>,
    /// A sentence was broken since the last GSA, and it may have been a GSA.
    missed: bool,
}

impl ActiveSatellites {
    pub(super) fn add(&mut self, active: Active) {
        let shares = |other: &Active| other.satellites.iter().any(|number| active.satellites.contains(number));
        let again = self.fresh.iter().any(|other| other.system == active.system && shares(other));
        if again {
            // This is not another page of the satellites of its system, but the same page again.
            self.fresh.retain(|other| other.system != active.system);
        }
        // A receiver has several systems with several pages each. Without an epoch between them a receiver may send any
        // number, so the list is bounded.
        if self.fresh.len() < 32 {
            self.fresh.push(active);
        }
    }

    pub(super) fn missed(&mut self) {
        self.missed = true;
    }

    /// Ends an epoch.
    pub(super) fn close(&mut self) -> Geometry {
        self.age = self.age.saturating_add(1);
        let fresh = std::mem::take(&mut self.fresh);
        let Some(best) = fresh.iter().map(|active| active.dimensions).max() else { return self.carried() };
        if self.last.dimensions.is_some() && !self.missed {
            self.usual = Some(self.usual.unwrap_or(0).max(self.age.min(CARRIED_EPOCHS)));
        }
        (self.age, self.missed) = (0, false);
        let of_best = || fresh.iter().filter(|active| active.dimensions == best);
        let satellites: usize = fresh.iter().map(|active| active.satellites.len()).sum();
        self.last = Geometry {
            dimensions: Some(best),
            satellites: u32::try_from(satellites).ok(),
            hdop: of_best().find_map(|active| active.hdop),
            vdop: of_best().find_map(|active| active.vdop),
        };
        self.last
    }

    fn carried(&self) -> Geometry {
        let usual = self.usual.unwrap_or(CARRIED_EPOCHS);
        let carried = if self.missed { 2 * usual } else { usual };
        // The next GSA should have come after `usual` epochs.
        if self.age >= carried || self.last.dimensions.is_none() {
            return Geometry::default();
        }
        // An earlier GSA without a fix says nothing about now.
        Geometry {
            satellites: None,
            dimensions: self.last.dimensions.filter(|dimensions| *dimensions > 1),
            ..self.last
        }
    }
}
