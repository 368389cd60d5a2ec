//! Internal RAM and SDRAM, pattern by pattern over every word.

use gnc_executive::catalogue::memory::{
    MISMATCHES_ADDRESS, MISMATCHES_CHECKERBOARD, MISMATCHES_MARCH_C, MISMATCHES_SOLID, MISMATCHES_WALKING_ONES,
    TEST_TIME, WORDS_TESTED,
};
use gnc_executive::plan::Params;
use gnc_executive::quantity::Unit;
use gnc_protocol::message::{Ram, RamPattern, RamTest};

use super::{ProcedureContext, ProcedureError, Recorder};

pub(super) async fn run(
    bench: &ProcedureContext<'_>,
    ram: Ram,
    params: &Params,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    let mut words = u32::MAX;
    let mut busy_s = 0.0;
    for name in params.choices("patterns")? {
        let (pattern, mismatches) = match *name {
            "solid" => (RamPattern::Solid, &MISMATCHES_SOLID),
            "checkerboard" => (RamPattern::Checkerboard, &MISMATCHES_CHECKERBOARD),
            "walking-ones" => (RamPattern::WalkingOnes, &MISMATCHES_WALKING_ONES),
            "address" => (RamPattern::Address, &MISMATCHES_ADDRESS),
            "march-c" => (RamPattern::MarchC, &MISMATCHES_MARCH_C),
            // The plan was checked against the catalogue.
            _ => continue,
        };
        let request = RamTest { ram: ram as u8, pattern: pattern as u8 };
        let (found, answer) = bench.board.ask(&request).await?;
        words = words.min(found.words);
        busy_s += answer.elapsed.as_secs_f64();
        recorder.count(mismatches, found.mismatches.into()).await?;
        if found.mismatches > 0 {
            let (place, expected, got) = (found.first_place, found.expected, found.got);
            let note = format!(
                "{name}: first at word {place:#08x}, expected {expected:#010x}, read {got:#010x}, bits {:#010x}",
                expected ^ got
            );
            recorder.note(&note).await?;
        }
    }
    recorder.count(&WORDS_TESTED, words.into()).await?;
    Ok(recorder.number(&TEST_TIME, busy_s, Unit::Second).await?)
}
