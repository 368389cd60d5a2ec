//! The order in which runs were closed. A clock that is set back, by its time service or at the end of summer time, changes the
//! names of folders, and not this order.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::read::{DayChain, chain_of, name_in};
use crate::store::reader::when;

/// The runs in the order in which they were closed, the first one first. A run that no chain names has the place of its folder:
/// behind the last closed run that is older by its folder.
pub(crate) fn by_close(records: &Path, mut runs: Vec<PathBuf>) -> Vec<PathBuf> {
    runs.sort_by_cached_key(|run| (when(run), run.clone()));
    let mut days: HashMap<String, HashMap<String, u64>> = HashMap::new();
    let mut number = |run: &Path| {
        let name = name_in(records, run);
        let day = name.split('/').next().unwrap_or_default();
        if !days.contains_key(day) {
            // `records verify` tells why a chain cannot be read. The list goes by the folders then.
            let links = chain_of(records, day).ok().flatten().map(DayChain::into_closes).into_iter().flatten();
            days.insert(day.to_owned(), links.map(|link| (link.run, link.number)).collect());
        }
        days.get(day).and_then(|links| links.get(&name)).copied()
    };
    let (mut closed, mut others) = (Vec::new(), Vec::new());
    for run in runs {
        match number(&run) {
            Some(number) => closed.push((number, run)),
            None => others.push(run),
        }
    }
    closed.sort_by_key(|(number, _)| *number);
    // The oldest folder from each place on, which never falls from place to place.
    let mut oldest: Vec<(String, String)> = closed.iter().map(|(_, run)| when(run)).collect();
    for at in (1..oldest.len()).rev() {
        if oldest[at] < oldest[at - 1] {
            oldest[at - 1] = oldest[at].clone();
        }
    }
    let mut ordered = Vec::with_capacity(closed.len() + others.len());
    let mut closed = closed.into_iter().map(|(_, run)| run).enumerate().peekable();
    for run in others {
        let own = when(&run);
        let place = oldest.partition_point(|oldest| *oldest <= own);
        while let Some((_, closed)) = closed.next_if(|(at, _)| *at < place) {
            ordered.push(closed);
        }
        ordered.push(run);
    }
    ordered.extend(closed.map(|(_, run)| run));
    ordered
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::chain::append;
    use crate::store::{DIGESTS, reader};

    /// A chain of runs whose clock was set back, and among them one that no chain names.
    #[test]
    fn a_clock_that_is_set_back_does_not_change_the_order() {
        let records = tempfile::tempdir().unwrap();
        let run = |name: &str| {
            let run = records.path().join(name);
            std::fs::create_dir_all(&run).unwrap();
            std::fs::write(run.join(DIGESTS), name).unwrap();
            run
        };
        let names = |names: &[&str]| names.iter().map(|name| records.path().join(name)).collect::<Vec<_>>();
        let in_order =
            ["2026-11-28/A/140000-x", "2026-11-28/A/150000-x", "2026-11-28/B/133000-x", "2026-11-27/A/100000-x"];
        for name in in_order {
            append(&run(name)).unwrap();
        }
        let by_name =
            ["2026-11-27/A/100000-x", "2026-11-28/B/133000-x", "2026-11-28/A/140000-x", "2026-11-28/A/150000-x"];
        assert_eq!(by_close(records.path(), names(&by_name)), names(&in_order));
        // Each list of runs has it.
        assert_eq!(reader::paths(records.path()).unwrap(), names(&in_order));
        let mut last_first = names(&in_order);
        last_first.remove(2);
        last_first.reverse();
        assert_eq!(reader::closed_last_of_module(records.path(), "A"), last_first);
        let of_day = ["2026-11-28/B/133000-x", "2026-11-28/A/150000-x", "2026-11-28/A/140000-x"];
        assert_eq!(reader::newest(records.path(), 3).collect::<Vec<_>>(), names(&of_day));
        let (found, cut) = reader::of_day(records.path(), "2026-11-28", 2).unwrap();
        let found: Vec<PathBuf> = found.into_iter().map(|run| run.path).collect();
        assert_eq!((found, cut), (names(&of_day[..2]), true));
        // One from before the first chain, one before and one behind the time to which the clock was set.
        for (name, place) in [
            ("2026-11-20/A/080000-x", 0),
            ("2026-11-28/A/134500-x", 4),
            ("2026-11-28/A/151500-x", 4),
            ("2026-11-27/C/090000-x", 0),
        ] {
            let mut expected = in_order.to_vec();
            expected.insert(place, name);
            assert_eq!(
                by_close(records.path(), [names(&by_name), names(&[name])].concat()),
                names(&expected),
                "{name}"
            );
        }
        // Without a chain the folders tell.
        std::fs::remove_file(records.path().join("2026-11-28/CHAIN")).unwrap();
        std::fs::remove_file(records.path().join("2026-11-27/CHAIN")).unwrap();
        assert_eq!(by_close(records.path(), names(&in_order)), names(&by_name));
    }
}
