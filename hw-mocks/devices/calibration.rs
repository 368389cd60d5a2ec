//! The calibration in the module's flash, and the compensation that the module's firmware does with it.
//!
//! There are two slots in the internal flash, outside the scratch sectors. Each has a counter, the checksum and the
//! coefficients. A commit goes to the slot that is not in force, so that an interrupted commit leaves the other slot
//! unchanged. The slot in force is the one with the highest counter among those with a right checksum.

use gnc_protocol::calibration::{
    Calibration, CalibrationReadReply, CalibrationState, CompensatedSample, FIELD_PER_GAUSS, FORCE_PER_MPS2,
    RATE_PER_RPS, ROLL_PER_RAD,
};
use gnc_protocol::frame::checksum;
use gnc_protocol::stream::{ImuSample, MAG_LSB_PER_GAUSS, SATURATION};
use gnc_protocol::wire::Wire;
use nalgebra::{Matrix3, Vector3};

/// A bit of the stored coefficients that flips.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LostBit {
    /// Byte of the coefficients in wire order.
    pub byte: u16,
    /// Bit of the byte, 0 the lowest.
    pub bit: u8,
    /// Whether the bit flips at the next power-on and not at the commit.
    pub after_power_cycle: bool,
}

/// Faults of the calibration memory.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CalibrationFaults {
    /// Both slots lose this bit of every calibration.
    pub lost_bit: Option<LostBit>,
    /// The firmware multiplies by the columns of the matrices instead of their rows.
    pub transposed: bool,
}

#[derive(Debug, Clone)]
struct Slot {
    counter: u32,
    checksum: u32,
    bytes: Vec<u8>,
    /// Whether the bit was already flipped.
    bit_lost: bool,
}

impl Slot {
    fn is_valid(&self) -> bool {
        checksum(&self.bytes) == self.checksum
    }
}

/// A slot whose checksum is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct DamagedSlot {
    /// 0 or 1.
    pub slot: u32,
    /// The checksum stored with it.
    pub expected: u32,
    /// The checksum of the bytes read.
    pub got: u32,
}

/// The module's memory for its calibration.
#[derive(Debug, Clone, Default)]
pub struct CalibrationMemory {
    faults: CalibrationFaults,
    slots: [Option<Slot>; 2],
    /// A calibration that is written but not committed; lost without power.
    written: Option<Calibration>,
    commits: u32,
}

impl CalibrationMemory {
    /// The memory of a module that was never calibrated.
    #[must_use]
    pub fn new(faults: CalibrationFaults) -> Self {
        Self { faults, ..Self::default() }
    }

    /// Handles power-on.
    pub(crate) fn power_on(&mut self) {
        self.written = None;
        self.age(true);
    }

    /// Keeps a calibration for the next commit.
    pub fn write(&mut self, calibration: Calibration) {
        self.written = Some(calibration);
    }

    /// Checksum of the written calibration, if there is one.
    #[must_use]
    pub(crate) fn written_checksum(&self) -> Option<u32> {
        self.written.as_ref().map(Calibration::checksum)
    }

    /// Stores the written calibration; returns the counter of the commit.
    pub fn commit(&mut self) -> u32 {
        let bytes = self.written.as_ref().and_then(|written| written.to_payload().ok()).unwrap_or_default();
        self.store(bytes.to_vec(), checksum(&bytes));
        self.age(false);
        self.commits
    }

    /// Handles a power loss in the middle of a commit: the second half of the slot is erased and empty.
    pub(crate) fn interrupt_commit(&mut self) {
        let bytes = self.written.as_ref().and_then(|written| written.to_payload().ok()).unwrap_or_default();
        let mut half = bytes.to_vec();
        half[bytes.len() / 2..].fill(0xff);
        self.store(half, checksum(&bytes));
    }

    fn store(&mut self, bytes: Vec<u8>, checksum: u32) {
        self.commits += 1;
        let free = self.in_force().map_or(0, |slot| 1 - slot);
        self.slots[free] = Some(Slot { counter: self.commits, checksum, bytes, bit_lost: false });
    }

    fn age(&mut self, after_power_cycle: bool) {
        let Some(lost) = self.faults.lost_bit.filter(|lost| lost.after_power_cycle == after_power_cycle) else {
            return;
        };
        for slot in self.slots.iter_mut().flatten().filter(|slot| !slot.bit_lost) {
            slot.bit_lost = true;
            if let Some(byte) = slot.bytes.get_mut(usize::from(lost.byte)) {
                *byte ^= 1 << (lost.bit & 7);
            }
        }
    }

    fn in_force(&self) -> Option<usize> {
        let counter = |slot: usize| self.slots[slot].as_ref().filter(|slot| slot.is_valid()).map(|slot| slot.counter);
        (0..2).filter(|slot| counter(*slot).is_some()).max_by_key(|slot| counter(*slot))
    }

    /// The calibration in force.
    #[must_use]
    pub(crate) fn calibration(&self) -> Option<Calibration> {
        let slot = self.slots[self.in_force()?].as_ref()?;
        Calibration::from_payload(&slot.bytes).ok()
    }

    /// The reply to the host's read request.
    #[must_use]
    pub(crate) fn read(&self) -> CalibrationReadReply {
        let newest = || (0..2).filter(|slot| self.slots[*slot].is_some()).max_by_key(|slot| self.counter(*slot));
        let (state, slot) = match (self.in_force(), newest()) {
            (Some(slot), _) => (CalibrationState::Valid, slot),
            (None, Some(slot)) => (CalibrationState::Damaged, slot),
            (None, None) => return CalibrationReadReply::default(),
        };
        let Some(slot) = &self.slots[slot] else { return CalibrationReadReply::default() };
        let mut reply = CalibrationReadReply {
            state: state as u8,
            counter: slot.counter,
            checksum: slot.checksum,
            ..CalibrationReadReply::default()
        };
        // The list has room for one calibration, and there is one.
        reply.calibration.extend(Calibration::from_payload(&slot.bytes));
        reply
    }

    fn counter(&self, slot: usize) -> u32 {
        self.slots[slot].as_ref().map_or(0, |slot| slot.counter)
    }

    /// The slots with a wrong checksum, for error records.
    #[must_use]
    pub(crate) fn damaged(&self) -> Vec<DamagedSlot> {
        let damaged = |(number, slot): (u32, &Option<Slot>)| {
            let slot = slot.as_ref().filter(|slot| !slot.is_valid())?;
            Some(DamagedSlot { slot: number, expected: slot.checksum, got: checksum(&slot.bytes) })
        };
        (0..).zip(&self.slots).filter_map(damaged).collect()
    }

    /// The firmware's compensation with the calibration in force; `None` without one.
    #[must_use]
    pub fn compensation(&self) -> Option<StoredCompensation> {
        Some(StoredCompensation::new(&self.calibration()?, self.faults.transposed))
    }
}

/// A calibration ready for use. It is fixed when a stream starts.
#[derive(Debug, Clone, Copy)]
pub struct StoredCompensation {
    accel: Matrix3<f64>,
    accel_offset: Vector3<f64>,
    gyro: Matrix3<f64>,
    gyro_offset: Vector3<f64>,
    gyro_per_force: Matrix3<f64>,
    mag_zero: [f64; 2],
    ky: f64,
    sin_alpha: f64,
    cos_alpha: f64,
}

impl StoredCompensation {
    fn new(calibration: &Calibration, transposed: bool) -> Self {
        let matrix = |rows: &[[f64; 3]; 3]| {
            let matrix = Matrix3::from_fn(|row, column| rows[row][column]);
            if transposed { matrix.transpose() } else { matrix }
        };
        Self {
            accel: matrix(&calibration.accel_matrix),
            accel_offset: calibration.accel_offset.into(),
            gyro: matrix(&calibration.gyro_matrix),
            gyro_offset: calibration.gyro_offset.into(),
            gyro_per_force: matrix(&calibration.gyro_per_force),
            mag_zero: [calibration.mag_dx, calibration.mag_dy],
            ky: calibration.mag_ky,
            sin_alpha: calibration.mag_sin_alpha,
            cos_alpha: (1.0 - calibration.mag_sin_alpha.powi(2)).sqrt(),
        }
    }

    /// Compensates a raw sample: `f = Ka N + nabla`, `w = Kg N - epsilon - Gamma f`, `y' = Ky (y - dY)`,
    /// `x' = ((x - dX) - y' sin(alpha)) / cos(alpha)`, `roll = atan2(-y', x')`.
    #[must_use]
    pub fn apply(&self, raw: &ImuSample) -> CompensatedSample {
        let counts = |codes: &[i32; 3]| Vector3::from(codes.map(f64::from));
        let force = self.accel * counts(&raw.accel) + self.accel_offset;
        let rate = self.gyro * counts(&raw.gyro) - self.gyro_offset - self.gyro_per_force * force;
        let [x, y, z] = raw.mag.map(|code| f64::from(code) / MAG_LSB_PER_GAUSS);
        let y = self.ky * (y - self.mag_zero[1]);
        let x = (x - self.mag_zero[0] - y * self.sin_alpha) / self.cos_alpha;
        let saturated = raw.gyro.iter().chain(&raw.accel).chain(&raw.mag).enumerate();
        // The cast limits a value to the range of the type.
        let scaled = |values: [f64; 3], scale: f64| values.map(|value| (value * scale).round() as i32);
        CompensatedSample {
            rate: scaled(rate.into(), RATE_PER_RPS),
            force: scaled(force.into(), FORCE_PER_MPS2),
            field: scaled([x, y, z], FIELD_PER_GAUSS),
            roll: ((-y).atan2(x) * ROLL_PER_RAD).round() as i32,
            saturated: saturated.fold(0, |bits, (channel, code)| {
                bits | u16::from(*code >= SATURATION || *code < -SATURATION) << channel
            }),
            gyro_temperature: raw.gyro_temperature,
            accel_temperature: raw.accel_temperature,
        }
    }
}
