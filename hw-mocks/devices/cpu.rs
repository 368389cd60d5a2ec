//! The two cores: registers, memory and arithmetic.
//!
//! The host's processor computes here what the module's would: two's complement integers of 32 bits and IEEE 754
//! doubles, rounded to nearest even.

use gnc_protocol::message::{CpuFloats, CpuIntegers, CpuWords};
use gnc_protocol::wire::List;

/// Faults of the cores.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct CpuFaults {
    /// Whether core 1 or core 2 does not run.
    pub dead: [bool; 2],
    /// A bit of core 2's multiplier output that stays at 0.
    pub multiplier_bit: Option<u8>,
}

/// Both cores.
#[derive(Debug, Clone, Default)]
pub(crate) struct Cpu {
    faults: CpuFaults,
}

impl Cpu {
    /// Cores with their faults.
    #[must_use]
    pub(crate) fn new(faults: CpuFaults) -> Self {
        Self { faults }
    }

    /// Whether core 1 or 2 answers.
    #[must_use]
    pub(crate) fn answers(&self, core: u8) -> bool {
        !self.faults.dead.get(usize::from(core.wrapping_sub(1))).copied().unwrap_or(true)
    }

    /// Writes words and reads them back.
    #[must_use]
    pub(crate) fn words(&self, request: &CpuWords) -> List<u32, 64> {
        request.words.clone()
    }

    /// Sum, difference, product, quotient towards zero and remainder of each pair. The smallest number divided by -1 is
    /// itself with remainder 0, as the hardware wraps it.
    #[must_use]
    pub(crate) fn integers(&self, request: &CpuIntegers) -> List<[i32; 5], 16> {
        let mask = self.multiplier_mask(request.core);
        request
            .pairs
            .iter()
            .map(|&[a, b]| {
                let product = a.wrapping_mul(b) & mask;
                let (quotient, remainder) = if b == 0 { (0, 0) } else { (a.wrapping_div(b), a.wrapping_rem(b)) };
                [a.wrapping_add(b), a.wrapping_sub(b), product, quotient, remainder]
            })
            .collect()
    }

    /// Sum, difference, product and quotient of each pair.
    #[must_use]
    pub(crate) fn floats(&self, request: &CpuFloats) -> List<[f64; 4], 15> {
        request.pairs.iter().map(|&[a, b]| [a + b, a - b, a * b, a / b]).collect()
    }

    fn multiplier_mask(&self, core: u8) -> i32 {
        self.faults.multiplier_bit.filter(|_| core == 2).map_or(-1, |bit| !(1_i32 << (bit & 31)))
    }
}
