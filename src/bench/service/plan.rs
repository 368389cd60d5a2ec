//! A checked plan.

use std::sync::Arc;

use gnc_analysis::motion;
use gnc_config::Mistakes;
use gnc_executive::event::PlanInfo;
use gnc_executive::plan::Plan;
use gnc_records::store::digest;

/// A plan without mistakes, with the texts that were checked and their digest. It cannot change, so the plan that was
/// shown is the plan that runs and the plan in the record.
#[derive(Debug, Clone)]
pub struct CheckedPlan {
    plan: Arc<Plan>,
    sha256: String,
}

impl CheckedPlan {
    /// Checks what the items do with the module; the plan's own reader does not check that.
    ///
    /// # Errors
    /// All mistakes.
    pub fn new(plan: Plan) -> Result<Self, Mistakes> {
        let plan = plan.check(motion::mistakes)?;
        let sha256 = digest::of_plan(plan.files());
        Ok(Self { plan: Arc::new(plan), sha256 })
    }

    /// The plan.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// SHA-256 over the texts of the plan and all that it includes, as hexadecimal digits.
    #[must_use]
    pub fn sha256(&self) -> &str {
        &self.sha256
    }

    /// The plan as records name it.
    #[must_use]
    pub fn info(&self) -> PlanInfo {
        let Plan { name, version, .. } = self.plan();
        PlanInfo { name: name.clone(), version: version.clone(), sha256: self.sha256.clone() }
    }
}
