//! What the board does against the interface document: the record names it with its section, apart from the verdict on
//! the module.

use gnc_board::rule::{Breach, Weight};
use gnc_executive::event::{BoardBreach, EventKind};
use gnc_records::store::StoreError;

use super::Run;

impl Run<'_> {
    /// Files a breach as it is now.
    pub(super) async fn breached(&self, breach: &Breach) -> Result<(), StoreError> {
        let breach = for_the_record(breach);
        let known = self.journal.look(|state| state.breaches().iter().any(|seen| seen.breach == breach));
        if known {
            return Ok(());
        }
        self.journal.emit(EventKind::BoardBreach(breach)).await
    }

    /// Files all breaches with their last counts.
    pub(super) async fn all_breaches(&self, breaches: &[Breach]) -> Result<(), StoreError> {
        for breach in breaches {
            self.breached(breach).await?;
        }
        Ok(())
    }
}

fn for_the_record(breach: &Breach) -> BoardBreach {
    let Breach { rule, count, worst } = breach;
    BoardBreach {
        section: rule.section,
        what: rule.what.to_owned(),
        count: *count,
        worst: worst.clone(),
        safety: rule.weight == Weight::Safety,
    }
}
