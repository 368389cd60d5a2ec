//! Rows that may each be right or wrong, and that are more than chance gives. Only the surplus is marked. The record
//! keeps the rows that its noise gives, and so its variance and the correlation of its rows.

/// Factor on the natural number, and standard deviations of it, up to which a number is chance.
const CHANCE: (f64, f64) = (1.2, 6.0);
/// The same limits for a number that follows from a normal distribution alone.
const ROUGH: (f64, f64) = (2.0, 6.0);
/// Factor on the number that a normal distribution gives, and standard deviations of it, above which a number is
/// suspect.
const SUSPECT: (f64, f64) = (1.1, 3.0);

/// A run is a fault where chance gives it in fewer records than this.
const RARE: f64 = 1e-5;

/// The shortest run that is a fault in a record of `rows` rows, where each row has this chance.
pub(super) fn shortest_run(chance: f64, rows: usize) -> usize {
    if chance < 1.0 { ((RARE / rows as f64).ln() / chance.ln()) as usize + 1 } else { usize::MAX }
}

/// The surplus of rows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Excess {
    /// Part of the rows that has to be marked.
    share: f64,
    /// Rows that still have to be marked, as the sum of the shares.
    owed: f64,
}

impl Excess {
    /// The surplus of `counted` rows, where a normal distribution gives `expected`. `beside` returns the counts of the
    /// record one and two steps beside, where it has them; it is called only where the number is suspect.
    pub(super) fn of(counted: usize, expected: f64, beside: impl FnOnce() -> Option<[f64; 2]>) -> Self {
        let counted = counted as f64;
        let above = |natural: f64, (times, sigmas): (f64, f64)| counted > times * natural + sigmas * natural.sqrt();
        let none = Self { share: 0.0, owed: 0.0 };
        if !above(expected, SUSPECT) {
            return none;
        }
        // The density at a place follows from the densities beside it, with their curvature.
        let natural = beside().map(|[one, two]| ((4.0 * one - two) / 3.0).max(expected.min(1.0)));
        let (natural, limit) = natural.map_or((expected, ROUGH), |natural| (natural, CHANCE));
        if above(natural, limit) { Self { share: 1.0 - natural / counted, owed: 0.0 } } else { none }
    }

    /// The surplus of `counted` rows, where at most `natural` are natural.
    pub(super) fn over(counted: usize, natural: f64) -> Self {
        let counted = counted as f64;
        let (times, sigmas) = CHANCE;
        let above = counted > times * natural + sigmas * natural.sqrt();
        Self { share: if above { 1.0 - natural / counted } else { 0.0 }, owed: 0.0 }
    }

    /// Whether there is a surplus.
    pub(super) fn any(&self) -> bool {
        self.share > 0.0
    }

    /// A surplus of all rows, for a record without any row that is certainly right.
    pub(super) fn all(self) -> Self {
        Self { share: self.share.ceil(), ..self }
    }

    /// Whether a run of `rows` rows is marked. The marks are spread evenly over the rows that the caller asks for.
    pub(super) fn takes(&mut self, rows: usize) -> bool {
        let rows = rows as f64;
        self.owed += self.share * rows;
        let taken = self.any() && self.owed >= 0.5 * rows;
        if taken {
            self.owed -= rows;
        }
        taken
    }
}

/// Numbers of places one and two steps from 0, each the mean of both sides.
pub(super) fn beside(places: impl Iterator<Item = f64>) -> [f64; 2] {
    let mut counts = [0_u64; 2];
    for place in places {
        let steps = place.abs();
        for (count, step) in counts.iter_mut().zip([1.0, 2.0]) {
            *count += u64::from((steps - step).abs() < 0.25);
        }
    }
    counts.map(|count| count as f64 / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 1,000 rows where 600 are natural, 400 are marked, evenly; 700 are chance for a whole record, but not for a
    /// number of 100.
    #[test]
    fn what_is_too_many_is_marked_evenly() {
        let marked = |counted: usize, beside: Option<[f64; 2]>| {
            let mut excess = Excess::of(counted, 500.0, || beside);
            (0..counted).map(|_| usize::from(excess.takes(1))).collect::<Vec<_>>()
        };
        let taken = marked(1000, Some([600.0, 600.0]));
        assert!((398..=400).contains(&taken.iter().sum::<usize>()), "{}", taken.iter().sum::<usize>());
        let first: usize = taken[..500].iter().sum();
        assert!((198..=202).contains(&first), "{first}");
        assert_eq!(marked(700, Some([600.0, 600.0])).iter().sum::<usize>(), 0);
        // Without the counts beside, twice the number is chance.
        assert_eq!(marked(1000, None).iter().sum::<usize>(), 0);
        assert_eq!(marked(1200, None).iter().sum::<usize>(), 700);
    }

    /// 20,000 rows times 0.0133^k are 6.3e-4 for four rows and 8.3e-6 for five.
    #[test]
    fn the_shortest_run_is_the_first_that_is_rare() {
        assert_eq!(shortest_run(0.0133, 20_000), 5);
        assert_eq!(shortest_run(1e-10, 1000), 1);
        assert_eq!(shortest_run(1.0, 1000), usize::MAX);
    }

    /// At 0 the density of a normal distribution of 1.6 steps is 1.216 times the density one step beside. The curvature
    /// gives most of that.
    #[test]
    fn the_curvature_counts() {
        let density = |place: f64| 1000.0 * (-place * place / (2.0 * 1.6 * 1.6)).exp();
        let natural = (4.0 * density(1.0) - density(2.0)) / 3.0;
        assert!((natural - 1000.0).abs() < 70.0, "{natural}");
        assert_eq!(beside([0.0, 1.0, -1.0, 2.0, 3.0, 0.9].into_iter()), [1.5, 0.5]);
    }
}
