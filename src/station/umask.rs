//! The rights that new files get: with a umask that takes nothing from other users, each of them may change records.

use gnc_files::text;

/// The bit of a umask that keeps other users from writing.
const OTHERS_WRITE: u32 = 0o002;
/// Longest status of a process: it has a line for each of some sixty facts.
const MAX_STATUS_BYTES: u64 = 64 << 10;

/// What is said, and what can be done, if other users may write the files of this program.
pub(crate) fn doubt() -> Option<(String, &'static str)> {
    of_status(&text(std::path::Path::new("/proc/self/status"), MAX_STATUS_BYTES).ok()?)
}

fn of_status(status: &str) -> Option<(String, &'static str)> {
    let umask = status.lines().find_map(|line| line.strip_prefix("Umask:"))?.trim();
    let bits = u32::from_str_radix(umask, 8).ok()?;
    let what = || format!("the umask is {umask}, so every user of this computer may change the records of new runs");
    (bits & OTHERS_WRITE == 0).then(|| (what(), "start the station with `umask 022`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_all_may_write_are_said() {
        let said = |umask: &str| of_status(&format!("Name:\tx\nUmask:\t{umask}\nState:\tR\n")).is_some();
        for open in ["0000", "0020", "0055", "0775"] {
            assert!(said(open), "{open}");
        }
        for kept in ["0022", "0002", "0077", "0027", "none"] {
            assert!(!said(kept), "{kept}");
        }
        assert!(of_status("").is_none());
    }
}
