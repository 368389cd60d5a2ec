//! The supply at the socket.

/// The supply at the socket.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SupplyModel {
    /// Voltage at the socket with the module on.
    pub voltage_v: f64,
    /// Current into the module.
    pub current_a: f64,
    /// Voltage at the socket with the switch off: a few millivolts, unless another source feeds the module.
    pub off_voltage_v: f64,
    /// Current into the module with the switch off: none, unless the switch is welded.
    pub off_current_a: f64,
    /// The meter no longer measures after its first reading of a module that is on.
    pub meter_holds: bool,
}

impl Default for SupplyModel {
    /// The published 5 V and 0.49 A, with the usual deviations of supplies and modules.
    fn default() -> Self {
        Self { voltage_v: 5.012, current_a: 0.487, off_voltage_v: 0.003, off_current_a: 0.0, meter_holds: false }
    }
}
