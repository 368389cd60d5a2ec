//! Internal RAM and SDRAM, pattern by pattern over every word.

use gnc_executive::plan::Params;
use gnc_executive::quantity::Unit;
use gnc_protocol::message::{Ram, RamPattern, RamTest};

use super::{Bench, ProcedureError, Recorder};

pub(super) async fn run(
    bench: &Bench<'_>,
    ram: Ram,
    params: &Params,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    let mut words = u32::MAX;
    let mut busy_s = 0.0;
    for name in params.choices("patterns")? {
        let pattern = match *name {
            "solid" => RamPattern::Solid,
            "checkerboard" => RamPattern::Checkerboard,
            "walking-ones" => RamPattern::WalkingOnes,
            "address" => RamPattern::Address,
            "march-c" => RamPattern::MarchC,
            // The plan was checked against the catalogue.
            _ => continue,
        };
        let request = RamTest { ram: ram as u8, pattern: pattern as u8 };
        let (found, answer) = bench.board.ask(&request).await?;
        words = words.min(found.words);
        busy_s += answer.elapsed.as_secs_f64();
        let measurement = format!("mismatches_{}", name.replace('-', "_"));
        recorder.count(&measurement, found.mismatches.into()).await?;
        if found.mismatches > 0 {
            let (place, expected, got) = (found.first_place, found.expected, found.got);
            let note = format!(
                "{name}: first at word {place:#08x}, expected {expected:#010x}, read {got:#010x}, bits {:#010x}",
                expected ^ got
            );
            recorder.note(&note).await?;
        }
    }
    recorder.count("words_tested", words.into()).await?;
    Ok(recorder.number("test_time", busy_s, Unit::Second).await?)
}
