//! What is said of a run whose record was lost.

use std::path::Path;

use gnc_records::store::StoreError;
use gnc_text::with_causes;

/// What to say of a run whose record could not be written and is not there: it was not begun, or its folder is gone since.
pub(crate) fn not_kept(folder: &Path, begun: bool, error: &StoreError) -> Option<String> {
    let why = with_causes(error);
    match (folder.exists(), begun) {
        (true, _) => None,
        // The chain could not take up that the run begins, so it did not.
        (false, false) => Some(format!(
            "ERRORED: this run is not a pass, because its record could not be begun: {why}; nothing was tested"
        )),
        (false, true) => Some(format!(
            "ERRORED: this run is not a pass, because its record could not be written: {why}; its folder {} is gone",
            gnc_text::shown_path(folder)
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// No sentence sends people to a folder that is not there.
    #[test]
    fn a_record_that_is_not_there_is_not_pointed_at() {
        let records = tempfile::tempdir().expect("a folder");
        let gone = records.path().join("gone");
        let error = StoreError::Closed { why: "x".into() };
        assert_eq!(not_kept(records.path(), true, &error), None);
        let lost = not_kept(&gone, true, &error).expect("a sentence");
        assert!(lost.ends_with("is gone") && lost.contains("could not be written"), "{lost}");
        let never = not_kept(&gone, false, &error).expect("a sentence");
        assert!(never.ends_with("nothing was tested") && never.contains("could not be begun"), "{never}");
    }
}
