//! Registers, memory and arithmetic of both cores, compared bit for bit with the host's own results.

use gnc_executive::catalogue::processor::CORES;
use gnc_executive::plan::Params;
use gnc_protocol::message::{CpuFloats, CpuIntegers, CpuWords, WordTarget};
use gnc_protocol::pattern::Xorshift32;
use gnc_protocol::wire::List;

use super::{ProcedureContext, ProcedureError, Recorder};

/// Fixed, so that every module gets the same operands and a record can be repeated by hand.
const OPERAND_SEED: u32 = 0x9e37_79b9;
/// Operands at the ends of their range, where carries, signs and rounding go wrong first.
const INTEGER_CORNERS: [[i32; 2]; 8] = [
    [0, 1],
    [1, -1],
    [i32::MAX, 1],
    [i32::MIN, -1],
    [i32::MIN, 1],
    [0x5555_5555, -0x5555_5556],
    [65_535, 65_537],
    [-7, 2],
];
const FLOAT_CORNERS: [[f64; 2]; 8] = [
    [0.0, 1.0],
    [1.0, 3.0],
    [-1.0, 3.0],
    [f64::MAX, 2.0],
    [f64::MIN_POSITIVE, 2.0],
    [1.0, f64::EPSILON],
    [9_007_199_254_740_993.0, 0.1],
    [-2.5, 1e-308],
];

pub(super) async fn run(
    bench: &ProcedureContext<'_>,
    params: &Params,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    let sets = usize::try_from(params.integer("operand_sets")?).unwrap_or(1);
    for (core, of_core) in (1..).zip(&CORES) {
        let registers = words(bench, core, WordTarget::Registers).await?;
        recorder.count(&of_core.register_errors, registers).await?;
        let memory = words(bench, core, WordTarget::Memory).await?;
        recorder.count(&of_core.memory_errors, memory).await?;
        recorder.count(&of_core.integer_errors, integers(bench, core, sets).await?).await?;
        recorder.count(&of_core.float_errors, floats(bench, core, sets).await?).await?;
    }
    Ok(())
}

/// Every bit high and low, alone and beside its neighbours.
async fn words(bench: &ProcedureContext<'_>, core: u8, target: WordTarget) -> Result<u64, ProcedureError> {
    let fixed = [0, u32::MAX, 0x5555_5555, 0xaaaa_aaaa];
    let words: List<u32, 64> =
        fixed.into_iter().chain((0..32).map(|bit| 1 << bit)).chain(Xorshift32::new(OPERAND_SEED).take(28)).collect();
    let request = CpuWords { core, target: target as u8, words };
    let read = bench.board.call(&request).await?.words;
    same_length("CpuWords", request.words.len(), read.len())?;
    Ok(request.words.iter().zip(&read).filter(|(wrote, read)| wrote != read).count() as u64)
}

async fn integers(bench: &ProcedureContext<'_>, core: u8, sets: usize) -> Result<u64, ProcedureError> {
    let mut random = Xorshift32::new(OPERAND_SEED).map(u32::cast_signed);
    let random = std::iter::from_fn(|| Some([random.next()?, random.next().filter(|b| *b != 0).unwrap_or(1)]));
    let operands: Vec<[i32; 2]> = INTEGER_CORNERS.into_iter().chain(random).take(sets).collect();
    let mut errors = 0;
    for pairs in operands.chunks(16) {
        let request = CpuIntegers { core, pairs: pairs.iter().copied().collect() };
        let results = bench.board.call(&request).await?.results;
        same_length("CpuIntegers", pairs.len(), results.len())?;
        for (&[a, b], got) in pairs.iter().zip(&results) {
            let expected =
                [a.wrapping_add(b), a.wrapping_sub(b), a.wrapping_mul(b), a.wrapping_div(b), a.wrapping_rem(b)];
            errors += expected.iter().zip(got).filter(|(expected, got)| expected != got).count() as u64;
        }
    }
    Ok(errors)
}

async fn floats(bench: &ProcedureContext<'_>, core: u8, sets: usize) -> Result<u64, ProcedureError> {
    let mut words = Xorshift32::new(OPERAND_SEED.rotate_left(16));
    let mut double = move || {
        let high = u64::from(words.next()?) << 32;
        Some(f64::from_bits(high | u64::from(words.next()?)))
    };
    let mut operand = move || loop {
        let value = double()?;
        if value.is_finite() && value != 0.0 {
            return Some(value);
        }
    };
    let random = std::iter::from_fn(move || Some([operand()?, operand()?]));
    let operands: Vec<[f64; 2]> = FLOAT_CORNERS.into_iter().chain(random).take(sets).collect();
    let mut errors = 0;
    for pairs in operands.chunks(15) {
        let request = CpuFloats { core, pairs: pairs.iter().copied().collect() };
        let results = bench.board.call(&request).await?.results;
        same_length("CpuFloats", pairs.len(), results.len())?;
        for (&[a, b], got) in pairs.iter().zip(&results) {
            let expected = [a + b, a - b, a * b, a / b];
            errors += expected.iter().zip(got).filter(|(a, b)| a.to_bits() != b.to_bits()).count() as u64;
        }
    }
    Ok(errors)
}

/// A count that differs is not an arithmetic error of the module: the board did not do what the station asked.
fn same_length(what: &'static str, asked: usize, got: usize) -> Result<(), ProcedureError> {
    if asked == got {
        return Ok(());
    }
    Err(ProcedureError::Nonsense { what, why: format!("{got} results for {asked} operands") })
}
