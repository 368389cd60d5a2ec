//! The supply at the socket.

/// The supply at the socket.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SupplyModel {
    /// Voltage at the socket with the module on.
    pub voltage_v: f64,
    /// Current into the module.
    pub current_a: f64,
}

impl Default for SupplyModel {
    /// The published 5 V and 0.49 A, off by what supplies and modules are off.
    fn default() -> Self {
        Self { voltage_v: 5.012, current_a: 0.487 }
    }
}
