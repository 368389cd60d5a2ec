//! How many records a test of coverage counts.

/// Number of records: `whole` where `GNC_LONG` is set, as in the step `coverage` of `.ci/run`; else `short`. The bound
/// of the coverage must follow from the number.
pub(crate) fn records(short: usize, whole: usize) -> usize {
    if std::env::var_os("GNC_LONG").is_some() { whole } else { short }
}
