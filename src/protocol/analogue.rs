//! Electrical facts of the socket that both ends must agree on.

/// Output of the analogue magnetometer (AD channels 1 to 3) in no field, in volts.
pub const MAG_ZERO_V: f64 = 2.5;
/// Volts per gauss.
pub const MAG_V_PER_GAUSS: f64 = 0.35;
