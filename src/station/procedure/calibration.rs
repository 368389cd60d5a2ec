//! Items of calibration and performance.

use gnc_executive::catalogue::ItemId;

use super::Trouble;

pub(super) fn run(item: ItemId) -> Result<(), Trouble> {
    Err(Trouble::CannotRun { item, why: "it is not on this bench yet" })
}
