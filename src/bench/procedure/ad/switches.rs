//! One DIP switch on at a time: its channel must follow, and no other channel may move.
//!
//! A person may confirm without moving a switch. That says nothing of the module, so the person is asked again. A
//! channel whose switch was moved and that does not follow is a fault of the module. What tells the two apart is the
//! rest of the channels: a switch that was moved changes at least one of them.

use std::ops::RangeInclusive;

use gnc_executive::catalogue::sensors::{CROSSTALK, SWITCHED};
use gnc_executive::quantity::Unit;

use super::read;
use crate::fixture::SwitchReading;
use crate::procedure::{ProcedureContext, ProcedureError, Recorder};

/// Channels behind DIP switches 1 to 5.
const CHANNELS: RangeInclusive<u8> = 4..=8;
/// The reference to which a channel is tied while its switch is off (interface document, section 14).
const OFF_V: f64 = 2.0;
/// A channel farther from the reference reads as switched on. The rail next to the reference is 0.8 V away.
const ON_FROM_V: f64 = 0.4;
/// A channel that changed by less reads as before. The noise of a mean is below a millivolt, and a switch changes its
/// channel by 0.8 V or more.
const SAME_WITHIN_V: f64 = 0.1;
/// Times that a request is repeated while the switches read as before.
const AGAIN: u32 = 2;

/// Voltages of the eight channels.
type Readings = [f64; 8];

fn of_switches(volts: &Readings) -> [f64; 5] {
    let [_, _, _, switches @ ..] = *volts;
    switches
}

fn reads_on(volts: &Readings) -> [bool; 5] {
    of_switches(volts).map(|volt| (volt - OFF_V).abs() > ON_FROM_V)
}

/// The state that was asked for.
fn wanted(on: Option<u8>) -> [bool; 5] {
    std::array::from_fn(|index| on == Some(index as u8 + 1))
}

/// The switches that do not read as they were asked for.
fn not_as_asked(volts: &Readings, on: Option<u8>) -> Vec<SwitchReading> {
    let (seen, wanted) = (reads_on(volts), wanted(on));
    let reading =
        |index: usize| SwitchReading { switch: index as u8 + 1, on: seen[index], volt: of_switches(volts)[index] };
    (0..seen.len()).filter(|index| seen[*index] != wanted[*index]).map(reading).collect()
}

/// What the readings after a request say of the person who was asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Deed {
    /// A switch was moved, or all are as they were asked for.
    Moved,
    /// Nothing has changed. No switch was moved, or the one that was moved has no effect.
    AsBefore,
    /// Nothing has changed, and a switch that follows is still where it was. So no switch was moved.
    NotMoved,
}

/// Compares the readings after a request with those before. `off` are the readings with all switches off.
fn deed(volts: &Readings, on: Option<u8>, before: Option<&Readings>, off: Option<&Readings>) -> Deed {
    let seen = reads_on(volts);
    if seen == wanted(on) {
        return Deed::Moved;
    }
    let (Some(before), Some(off)) = (before, off) else {
        // At the first request nothing is known of the switches. One channel that reads on may be at fault; not all five.
        return if seen == [true; 5] { Deed::NotMoved } else { Deed::Moved };
    };
    let same = |(now, before): (f64, f64)| (now - before).abs() < SAME_WITHIN_V;
    if !of_switches(volts).into_iter().zip(of_switches(before)).all(same) {
        return Deed::Moved;
    }
    // A channel that read off with all switches off, and reads on now, follows its switch.
    let follows = |index: usize| seen[index] && !reads_on(off)[index] && !wanted(on)[index];
    if (0..seen.len()).any(follows) { Deed::NotMoved } else { Deed::AsBefore }
}

/// Carries out the steps and files what was read.
pub(super) async fn run(
    bench: &ProcedureContext<'_>,
    samples: u16,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    let (off, _) = set(bench, samples, recorder, None, None, None).await?;
    let (mut before, mut any_moved) = (off, false);
    let mut steps = Vec::new();
    let mut filed = 0;
    for switch in 1..=SWITCHED.len() as u8 {
        let (on, deed) = set(bench, samples, recorder, Some(switch), Some(&before), Some(&off)).await?;
        any_moved |= deed == Deed::Moved;
        before = on;
        steps.push(on);
        // Until a switch was moved, the readings may say nothing of the module.
        while any_moved && filed < steps.len() {
            let index = 3 + filed;
            recorder.number(&SWITCHED[filed].on, steps[filed][index], Unit::Volt).await?;
            recorder.number(&SWITCHED[filed].off, off[index], Unit::Volt).await?;
            filed += 1;
        }
    }
    if !any_moved {
        return Err(not_moved(&before, Some(SWITCHED.len() as u8)));
    }
    bench.fixture.only_switch(None, recorder).await?;
    Ok(recorder.number(&CROSSTALK, crosstalk_v(&off, &steps) * 1e3, Unit::Millivolt).await?)
}

/// Asks for a state of the switches and reads the channels; asks again while nothing has changed.
async fn set(
    bench: &ProcedureContext<'_>,
    samples: u16,
    recorder: &Recorder<'_>,
    on: Option<u8>,
    before: Option<&Readings>,
    off: Option<&Readings>,
) -> Result<(Readings, Deed), ProcedureError> {
    bench.fixture.only_switch(on, recorder).await?;
    let mut volts = read(bench, samples).await?;
    for _ in 0..AGAIN {
        if deed(&volts, on, before, off) == Deed::Moved {
            break;
        }
        bench.fixture.only_switch_again(on, not_as_asked(&volts, on), recorder).await?;
        volts = read(bench, samples).await?;
    }
    match deed(&volts, on, before, off) {
        Deed::NotMoved => Err(not_moved(&volts, on)),
        deed => Ok((volts, deed)),
    }
}

fn not_moved(volts: &Readings, on: Option<u8>) -> ProcedureError {
    ProcedureError::SwitchesNotMoved { asked: AGAIN + 1, still: not_as_asked(volts, on) }
}

/// Largest change of a channel whose own switch is off.
fn crosstalk_v(off: &Readings, steps: &[Readings]) -> f64 {
    let mut largest_v: f64 = 0.0;
    for (own, on) in CHANNELS.zip(steps) {
        for other in CHANNELS.filter(|other| *other != own).map(|other| usize::from(other - 1)) {
            largest_v = largest_v.max((on[other] - off[other]).abs());
        }
    }
    largest_v
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Readings of a good module with these switches on, by the table of the interface document.
    fn with(on: &[u8]) -> Readings {
        let levels_v = [5.0, 3.3, 1.2, 0.0, 0.02];
        std::array::from_fn(|index| match index.checked_sub(3) {
            None => 2.5,
            Some(switch) if on.contains(&(switch as u8 + 1)) => levels_v[switch],
            Some(_) => 2.0,
        })
    }

    #[track_caller]
    fn check(now: &[u8], asked: Option<u8>, before: Option<&[u8]>, off: &[u8], expected: Deed) {
        let before = before.map(with);
        let off_readings = before.is_some().then(|| with(off));
        assert_eq!(deed(&with(now), asked, before.as_ref(), off_readings.as_ref()), expected);
    }

    #[test]
    fn a_forgotten_switch_is_told_from_a_fault() {
        use Deed::{AsBefore, Moved, NotMoved};
        // The first request: all off.
        check(&[], None, None, &[], Moved);
        check(&[1, 2, 3, 4, 5], None, None, &[], NotMoved);
        check(&[2], None, None, &[], Moved);
        // In order.
        check(&[1], Some(1), Some(&[]), &[], Moved);
        check(&[2], Some(2), Some(&[1]), &[], Moved);
        // Forgotten: the switch before is still on.
        check(&[1], Some(2), Some(&[1]), &[], NotMoved);
        check(&[4], Some(5), Some(&[4]), &[], NotMoved);
        // Switch 2 has no effect: its predecessor went off, so a person was there.
        check(&[], Some(2), Some(&[1]), &[], Moved);
        // Switch 1 has no effect, or the operator did not move it.
        check(&[], Some(1), Some(&[]), &[], AsBefore);
        // Switch 3 reads on whatever it does, and switch 2 has no effect: nothing that follows is still on.
        check(&[3], Some(2), Some(&[3]), &[3], AsBefore);
        // Two channels are joined.
        check(&[1, 2], Some(1), Some(&[]), &[], Moved);
    }

    #[test]
    fn the_readings_that_are_wrong_are_named() {
        let still = not_as_asked(&with(&[2]), Some(3));
        let told: Vec<String> = still.iter().map(ToString::to_string).collect();
        assert_eq!(told, ["DIP switch 2 still reads ON (3.300 V).", "DIP switch 3 still reads OFF (2.000 V)."]);
        assert_eq!(not_as_asked(&with(&[3]), Some(3)), []);
    }

    /// Channel 6 moves by 30 mV with switch 1.
    #[test]
    fn crosstalk_is_the_largest_change_of_another_channel() {
        let mut steps: Vec<Readings> = (1..=5).map(|switch| with(&[switch])).collect();
        steps[0][5] += 0.03;
        assert!((crosstalk_v(&with(&[]), &steps) - 0.03).abs() < 1e-12);
    }
}
