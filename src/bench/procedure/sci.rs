//! The module's SCI echoes blocks of several lengths: every byte must come back, and the error counters must stay zero.

use gnc_executive::catalogue::ports::{
    BLOCKS_LOST, BYTES_TESTED, BYTES_WRONG, FRAMING_ERRORS, OVERRUN_ERRORS, PARITY_ERRORS,
};
use gnc_executive::plan::Params;
use gnc_executive::quantity::Unit;
use gnc_protocol::message::SciEcho;
use gnc_protocol::pattern::Xorshift32;
use gnc_protocol::wire::List;

use super::{ProcedureContext, ProcedureError, Recorder};

/// One byte, lengths around the depth of a 16-byte FIFO, an odd length, and the longest block.
const LENGTHS: [usize; 6] = [1, 15, 16, 17, 101, 256];

pub(super) async fn run(
    bench: &ProcedureContext<'_>,
    params: &Params,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    let rate_baud = params.quantity("rate", Unit::BitPerSecond)? as u32;
    let every_byte: List<u8, 256> = (0..=u8::MAX).collect();
    let mixed = LENGTHS.map(|length| Xorshift32::new(length as u32).map(|word| word as u8).take(length).collect());
    let (mut lost, mut wrong, mut bytes) = (0, 0, 0);
    let (mut framing, mut overruns, mut parity) = (0u64, 0u64, 0u64);
    for data in std::iter::once(every_byte).chain(mixed) {
        let reply = bench.board.call(&SciEcho { rate_baud, data: data.clone() }).await?;
        bytes += data.len() as u64;
        lost += u64::from(reply.data.is_empty());
        if !reply.data.is_empty() {
            let altered = data.iter().zip(&reply.data).filter(|(sent, back)| sent != back).count();
            wrong += (altered + data.len().abs_diff(reply.data.len())) as u64;
        }
        framing += u64::from(reply.framing_errors);
        overruns += u64::from(reply.overruns);
        parity += u64::from(reply.parity_errors);
    }
    recorder.count(&BLOCKS_LOST, lost).await?;
    recorder.count(&BYTES_WRONG, wrong).await?;
    recorder.count(&FRAMING_ERRORS, framing).await?;
    recorder.count(&OVERRUN_ERRORS, overruns).await?;
    recorder.count(&PARITY_ERRORS, parity).await?;
    Ok(recorder.count(&BYTES_TESTED, bytes).await?)
}
