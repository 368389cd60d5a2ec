//! The calibration that a module keeps, the messages that write and read it, and the samples that it compensates.
//!
//! A write goes to the board's memory, a commit from there to the module's flash. Until the commit has ended, the
//! previous calibration stays in force, even if the power fails meanwhile. Coefficients are doubles. So the computed,
//! the written and the read coefficients are the same bits: nothing is rounded on the way.

use crate::frame::checksum;
use crate::wire::{List, Wire, wire_enum, wire_struct};

wire_struct! {
    /// Coefficients of a module. Matrices lie row by row: rows are outputs, columns are inputs. N is the raw output in
    /// counts.
    Calibration {
        /// The host's number for this calibration, not 0.
        id: u32,
        /// Ka of `f = Ka N + nabla`, m/s^2 per count.
        accel_matrix: [[f64; 3]; 3],
        /// nabla of the same formula, m/s^2.
        accel_offset: [f64; 3],
        /// Kg of `w = Kg N - epsilon - Gamma f`, rad/s per count.
        gyro_matrix: [[f64; 3]; 3],
        /// epsilon of the same formula, rad/s.
        gyro_offset: [f64; 3],
        /// Gamma of the same formula, rad/s per m/s^2, with the compensated f of the same sample; zeros if it is not
        /// known. For a g-sensitivity G in counts per m/s^2 it is `Kg G`.
        gyro_per_force: [[f64; 3]; 3],
        /// dX of `x' = ((x - dX) - y' sin(alpha)) / cos(alpha)`, gauss at the nominal scale.
        mag_dx: f64,
        /// dY of `y' = Ky (y - dY)`, gauss at the nominal scale.
        mag_dy: f64,
        /// Ky of the same formula, above 0.
        mag_ky: f64,
        /// sin(alpha) of the formula for x', within +-1.
        mag_sin_alpha: f64,
    }
}

impl Calibration {
    /// CRC-32C over the bytes of the calibration on the wire.
    #[must_use]
    pub fn checksum(&self) -> u32 {
        // The length is fixed and fits: a payload holds 512 bytes.
        self.to_payload().map_or(0, |bytes| checksum(&bytes))
    }

    /// The first coefficient outside its range. Every coefficient must be finite, the id not 0, Ky above 0 and
    /// sin(alpha) within +-1.
    #[must_use]
    pub fn bad_field(&self) -> Option<&'static str> {
        let finite = |rows: &[[f64; 3]]| rows.iter().flatten().all(|value| value.is_finite());
        let rules = [
            ("id", self.id != 0),
            ("accel_matrix", finite(&self.accel_matrix)),
            ("accel_offset", finite(&[self.accel_offset])),
            ("gyro_matrix", finite(&self.gyro_matrix)),
            ("gyro_offset", finite(&[self.gyro_offset])),
            ("gyro_per_force", finite(&self.gyro_per_force)),
            ("mag_dx", self.mag_dx.is_finite()),
            ("mag_dy", self.mag_dy.is_finite()),
            ("mag_ky", self.mag_ky.is_finite() && self.mag_ky > 0.0),
            ("mag_sin_alpha", self.mag_sin_alpha > -1.0 && self.mag_sin_alpha < 1.0),
        ];
        rules.iter().find_map(|(name, good)| (!good).then_some(*name))
    }
}

wire_struct! {
    /// See [`crate::Request::CalibrationWrite`].
    CalibrationWrite {
        /// The calibration that the next commit stores.
        calibration: Calibration,
    }
}
wire_struct! {
    /// See [`crate::Request::CalibrationCommit`].
    CalibrationCommit {
        /// [`Calibration::checksum`] of the written calibration. If the board holds another one, it refuses the commit.
        checksum: u32,
    }
}
wire_struct! {
    /// Answers [`CalibrationCommit`].
    CalibrationCommitReply {
        /// Commits that this module has seen, this one included.
        counter: u32,
        /// Time that the flash was busy, by the slave's clock, in microseconds.
        duration_us: u32,
    }
}
wire_enum! {
    /// The state of a module's calibration.
    CalibrationState: u8 {
        /// The module was never calibrated.
        None = 0,
        /// A calibration with a good checksum.
        Valid = 1,
        /// Something was stored, but it has no good checksum.
        Damaged = 2,
    }
}
wire_struct! {
    /// See [`crate::Request::CalibrationRead`].
    CalibrationRead {}
}
wire_struct! {
    /// Answers [`CalibrationRead`].
    CalibrationReadReply {
        /// A number of [`CalibrationState`].
        state: u8,
        /// The number of the commit that stored it; 0 if there is none.
        counter: u32,
        /// The checksum stored beside it.
        checksum: u32,
        /// The calibration as it reads now: one element unless the state is none. A damaged one is for people only.
        calibration: List<Calibration, 1>,
    }
}

/// Scale of a compensated rate: counts for one rad/s; a count is 0.002 deg/h.
pub const RATE_PER_RPS: f64 = 1e8;
/// Scale of a compensated specific force: counts for one m/s^2; a count is 0.1 micro-g.
pub const FORCE_PER_MPS2: f64 = 1e6;
/// Scale of a corrected field: counts for one gauss.
pub const FIELD_PER_GAUSS: f64 = 1e7;
/// Scale of the roll angle: counts for one radian.
pub const ROLL_PER_RAD: f64 = 1e8;

wire_struct! {
    /// One sample of the IMU, compensated by the stored calibration on the board. Values are rounded to the nearest count
    /// and kept within 32 bits.
    CompensatedSample {
        /// w about X, Y, Z, in counts of 1e-8 rad/s.
        rate: [i32; 3],
        /// f along X, Y, Z, in counts of 1e-6 m/s^2.
        force: [i32; 3],
        /// x', y' and z (nominal scale), in counts of 1e-7 gauss.
        field: [i32; 3],
        /// `atan2(-y', x')`, in counts of 1e-8 rad.
        roll: i32,
        /// Raw channels that saturated: bits 0 to 2 gyro x, y, z, bits 3 to 5 accel, bits 6 to 8 mag.
        saturated: u16,
        /// Temperature of the gyroscopes, 0.01 degC.
        gyro_temperature: i16,
        /// Temperature of the accelerometers, 0.01 degC.
        accel_temperature: i16,
    }
}
