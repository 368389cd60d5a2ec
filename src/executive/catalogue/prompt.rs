//! Questions of the plan's own to the operator.

use super::{Device, ItemSpec, Resource, Traces};

/// A person looks, measures or scans, and tells.
pub(super) static PROMPT: ItemSpec = ItemSpec {
    title: "Questions to the operator",
    params: &[],
    // Each question of the plan is a measurement of its own name.
    measurements: &[],
    devices: &[Device::Slave],
    // A person has the module in hand.
    resources: &[Resource::Attitude],
    needs: &[],
    traces: Traces::NONE,
    // It never counts: a question waits as long as a person needs.
    timeout_s: 60.0,
};
