//! What items leave in the module. A run that takes over the captures of an earlier one finds the module without these
//! traces, and must have them again before it captures anything new.

use super::ItemId;

/// Something that stays in the module when an item is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trace {
    /// The module's own heat, after a long time under power. A resumed run waits until the module is as warm as it was.
    Heat,
    /// A new power-on: biases differ from power-on to power-on. A resumed run captures all of one power-on, or none.
    PowerOn,
    /// Coefficients that the module stores. A resumed run does not take over what the module compensated with them.
    Coefficients,
    /// Positions of the DIP switches. Items that need them set them, and such items always run again.
    Switches,
}

impl Trace {
    /// All of them.
    pub const ALL: [Trace; 4] = [Trace::Heat, Trace::PowerOn, Trace::Coefficients, Trace::Switches];
}

/// The traces of an item.
#[derive(Debug)]
pub struct Traces {
    /// What it leaves in the module.
    pub leaves: &'static [Trace],
    /// The traces of earlier items, or of its own earlier captures, on which its values depend.
    pub feels: &'static [Trace],
}

impl Traces {
    /// It runs again in seconds and leaves the module as it was.
    pub(super) const NONE: Traces = Traces { leaves: &[], feels: &[] };
    /// It captures the sensors of a module that warms up meanwhile.
    pub(super) const CAPTURES: Traces = Traces { leaves: &[Trace::Heat], feels: &[Trace::Heat] };
    /// The same, with power-ons between its series.
    pub(super) const CYCLES_AND_CAPTURES: Traces =
        Traces { leaves: &[Trace::Heat, Trace::PowerOn], feels: &[Trace::Heat, Trace::PowerOn] };
    /// It captures what the module compensates.
    pub(super) const COMPENSATED: Traces =
        Traces { leaves: &[Trace::Heat], feels: &[Trace::Heat, Trace::Coefficients] };
}

impl ItemId {
    /// Whether the item leaves a trace in the module.
    pub fn leaves(self, trace: Trace) -> bool {
        self.spec().traces.leaves.contains(&trace)
    }

    /// Whether the values of the item depend on a trace.
    pub fn feels(self, trace: Trace) -> bool {
        self.spec().traces.feels.contains(&trace)
    }
}
