//! SPI wired to the IO lines: each side must receive what the other sends.

use gnc_executive::catalogue::ports::{BITS_TESTED, IN_BIT_ERRORS, OUT_BIT_ERRORS};
use gnc_executive::plan::Params;
use gnc_executive::quantity::Unit;
use gnc_protocol::message::{SpiDirection, SpiTransfer};
use gnc_protocol::wire::List;

use super::{ProcedureContext, ProcedureError, Recorder};

pub(super) async fn run(
    bench: &ProcedureContext<'_>,
    params: &Params,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    let clock_hz = params.quantity("clock", Unit::Hertz)? as u32;
    // Level and alternating lines, each bit alone, and every value of a byte.
    let lone_bits = (0..8).flat_map(|bit| [1 << bit, !(1 << bit)]);
    let first: List<u8, 256> = [0x00, 0xff, 0x55, 0xaa].into_iter().chain(lone_bits).collect();
    let second: List<u8, 256> = (0..=u8::MAX).collect();
    let mut bits = 0;
    for (direction, measurement) in
        [(SpiDirection::FromModule, &OUT_BIT_ERRORS), (SpiDirection::ToModule, &IN_BIT_ERRORS)]
    {
        let mut errors = 0;
        for data in [&first, &second] {
            let request = SpiTransfer { direction: direction as u8, clock_hz, data: data.clone() };
            let seen = bench.board.call(&request).await?.data;
            errors += bit_errors(data, &seen);
            bits += data.len() as u64 * 8;
        }
        recorder.count(measurement, errors).await?;
    }
    Ok(recorder.count(&BITS_TESTED, bits).await?)
}

/// Number of wrong bits; a missing or additional byte counts as eight.
fn bit_errors(sent: &[u8], seen: &[u8]) -> u64 {
    let altered: u32 = sent.iter().zip(seen).map(|(sent, seen)| (sent ^ seen).count_ones()).sum();
    u64::from(altered) + 8 * sent.len().abs_diff(seen.len()) as u64
}
