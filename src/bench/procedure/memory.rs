//! Internal RAM and SDRAM, pattern by pattern over every word, and what the mismatches have in common.

use gnc_executive::catalogue::memory::{
    FAULT, MISMATCHES_ADDRESS, MISMATCHES_CHECKERBOARD, MISMATCHES_MARCH_C, MISMATCHES_SOLID, MISMATCHES_WALKING_ONES,
    TEST_TIME, WORDS_TESTED,
};
use gnc_executive::plan::Params;
use gnc_executive::quantity::Unit;
use gnc_protocol::message::{MismatchReply, Ram, RamPattern, RamTest};

use super::{ProcedureContext, ProcedureError, Recorder};

pub(super) async fn run(
    bench: &ProcedureContext<'_>,
    ram: Ram,
    params: &Params,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    let mut words = u32::MAX;
    let mut busy_s = 0.0;
    let mut failing = Vec::new();
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
            failing.push(found);
        }
    }
    recorder.count(&WORDS_TESTED, words.into()).await?;
    recorder.text(&FAULT, &fault(&failing)).await?;
    Ok(recorder.number(&TEST_TIME, busy_s, Unit::Second).await?)
}

/// Reads of one word in a pattern, at most: March C- reads each word five times.
const READS_OF_A_WORD: u32 = 5;

/// What the mismatches of several patterns have in common.
fn fault(failing: &[MismatchReply]) -> String {
    let Some(first) = failing.first() else { return "none".to_owned() };
    let bits = |found: &MismatchReply| found.expected ^ found.got;
    let one_bit = bits(first).is_power_of_two() && failing.iter().all(|found| bits(found) == bits(first));
    let one_word =
        failing.iter().all(|found| found.first_place == first.first_place && found.mismatches <= READS_OF_A_WORD);
    let (place, bit) = (first.first_place, bits(first).trailing_zeros());
    match (one_bit, one_word) {
        (true, true) => format!("one cell: bit {bit} of word {place:#08x}"),
        (true, false) => format!("bit {bit} of several words: its data line"),
        (false, true) => format!("one word: {place:#08x}"),
        (false, false) => "several bits of several words".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(first_place: u32, expected: u32, got: u32, mismatches: u32) -> MismatchReply {
        MismatchReply { words: 65_536, mismatches, first_place, expected, got }
    }

    #[test]
    fn one_cause_is_told_once() {
        let cell =
            [found(40_000, 0xffff, 0xf7ff, 1), found(40_000, 0xaaaa, 0xa2aa, 1), found(40_000, 0xffff, 0xf7ff, 2)];
        assert_eq!(fault(&cell), "one cell: bit 11 of word 0x009c40");
        let line = [found(0, 0xffff_ffff, 0xffff_ff7f, 1_048_576), found(7, 0x80, 0, 32_768)];
        assert_eq!(fault(&line), "bit 7 of several words: its data line");
        assert_eq!(fault(&[found(5, 0x00ff, 0x0100, 1)]), "one word: 0x000005");
        assert_eq!(fault(&[found(5, 0x00ff, 0x0100, 9), found(8, 1, 0, 1)]), "several bits of several words");
        assert_eq!(fault(&[]), "none");
    }
}
