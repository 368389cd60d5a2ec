//! "Did you mean …?" for names that are nearly right.

/// Longer names are not compared. The work grows with the product of both lengths, and all names of ours are shorter.
const LONGEST: usize = 64;

/// The candidate that is nearest to the name, if it is near enough to be meant.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    if name.len() > LONGEST {
        return None;
    }
    let name = plain(name);
    candidates
        .into_iter()
        .filter(|candidate| candidate.len() <= LONGEST)
        .map(|candidate| (distance(&name, &plain(candidate)), candidate))
        // A third of the letters may differ: "sd-ram" means "sdram", while "foo" matches nothing of ours.
        .filter(|(distance, candidate)| *distance * 3 <= candidate.len().max(name.len()))
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// A hint for an unknown name: the candidate that was probably meant, or what `otherwise` says.
pub fn did_you_mean<'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a str>,
    otherwise: impl FnOnce() -> String,
) -> String {
    nearest(name, candidates).map_or_else(otherwise, |meant| format!("did you mean \"{meant}\"?"))
}

/// Letters and digits in lower case: case and joining marks are what people mix up most.
fn plain(name: &str) -> Vec<char> {
    name.chars().filter(|c| !matches!(c, '-' | '_' | ' ')).flat_map(char::to_lowercase).collect()
}

/// Levenshtein distance with transposed neighbours counted once (optimal string alignment).
fn distance(a: &[char], b: &[char]) -> usize {
    let mut before: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let substituted = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = substituted.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before[j - 2] + 1);
            }
        }
        before = last;
        last = row;
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_names_are_found() {
        let names = ["identity", "sdram", "spi-flash", "internal-flash", "imu", "io"];
        assert_eq!(nearest("sd_ram", names), Some("sdram"));
        assert_eq!(nearest("idnetity", names), Some("identity"));
        assert_eq!(nearest("SPI_FLASH", names), Some("spi-flash"));
        assert_eq!(nearest("imuu", names), Some("imu"));
        assert_eq!(nearest("gnss", names), None);
        assert_eq!(did_you_mean("imuu", names, || "no item".to_owned()), "did you mean \"imu\"?");
        assert_eq!(did_you_mean("gnss", names, || "no item".to_owned()), "no item");
        assert_eq!(nearest("", names), None);
        assert_eq!(nearest(&"x".repeat(1_000_000), names), None);
    }
}
