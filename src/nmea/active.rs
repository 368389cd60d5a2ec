//! Dimensions, dilutions and satellites of GSA, which has no time of its own and need not come with each epoch.

use super::sentence::Active;

/// Epochs for which a GSA is carried over at most.
pub(super) const CARRIED_EPOCHS: u32 = 10;

/// What the GSA of one epoch, or the last ones before it, say of it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Geometry {
    /// 1 none, 2 or 3; `None` where none came lately.
    pub(super) dimensions: Option<u32>,
    /// Satellites of all systems; only of an epoch with a GSA of its own.
    pub(super) satellites: Option<u32>,
    pub(super) hdop: Option<f64>,
    pub(super) vdop: Option<f64>,
}

/// Collects the GSA of an epoch and carries them over.
#[derive(Debug, Default)]
pub(super) struct ActiveSatellites {
    /// Since the last epoch ended.
    fresh: Vec<Active>,
    last: Geometry,
    /// Epochs since one had a GSA of its own.
    age: u32,
    /// Epochs from one GSA to the next, at most so far; `None` before the second one.
    usual: Option<u32>,
    /// A sentence was broken since, and it may have been one.
    missed: bool,
}

impl ActiveSatellites {
    pub(super) fn add(&mut self, active: Active) {
        let shares = |other: &Active| other.satellites.iter().any(|number| active.satellites.contains(number));
        let again = self.fresh.iter().any(|other| other.system == active.system && shares(other));
        if again {
            // Not another page of its system's satellites but the same one anew.
            self.fresh.retain(|other| other.system != active.system);
        }
        // A receiver has some systems with some pages each; more are said without an epoch between them.
        if self.fresh.len() < 32 {
            self.fresh.push(active);
        }
    }

    pub(super) fn missed(&mut self) {
        self.missed = true;
    }

    /// An epoch ends.
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
        // The one behind `usual` epochs should have come.
        if self.age >= carried || self.last.dimensions.is_none() {
            return Geometry::default();
        }
        // No fix then is no word of now.
        Geometry {
            satellites: None,
            dimensions: self.last.dimensions.filter(|dimensions| *dimensions > 1),
            ..self.last
        }
    }
}
