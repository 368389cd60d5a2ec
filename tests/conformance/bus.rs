//! Boards that break a rule of CAN.

use gnc_protocol::can::{CanFrame, CanId};

use super::breaches::fails_on;
use super::rig::{Breach, Wire};

#[test]
fn an_echo_with_other_data() {
    let altered = Breach::on_can(|frame| match frame.id() {
        CanId::Standard(0x710..=0x71F) if frame.data().len() > 2 => {
            let mut data = frame.data().to_vec();
            data[2] ^= 4;
            CanFrame::new(frame.id(), &data).into_iter().collect()
        }
        _ => vec![frame],
    });
    fails_on(Wire::Can, altered, &["can.echo"]);
}

#[test]
fn heartbeats_whose_beat_stands() {
    let standing = Breach::on_can(|frame| match frame.id() {
        CanId::Standard(0x011) if frame.data().len() == 8 => {
            let mut data = frame.data().to_vec();
            data[1] = 1;
            CanFrame::new(frame.id(), &data).into_iter().collect()
        }
        _ => vec![frame],
    });
    fails_on(Wire::Can, standing, &["can.heartbeat"]);
}

#[test]
fn samples_of_the_bus_in_another_order() {
    let mut held = None;
    let swapped = Breach::on_can(move |frame| match frame.id() {
        CanId::Standard(0x200) => {
            held = Some(frame);
            Vec::new()
        }
        CanId::Standard(0x201) => [Some(frame), held.take()].into_iter().flatten().collect(),
        _ => vec![frame],
    });
    fails_on(Wire::Can, swapped, &["can.imu"]);
}

#[test]
fn a_sender_that_makes_no_pauses() {
    // It takes every flow control for "go on, without a pause".
    let hasty = |frame: CanFrame| match frame.data() {
        [first, _, _, ..] if first >> 4 == 3 => CanFrame::new(frame.id(), &[*first, 0, 0]).unwrap(),
        _ => frame,
    };
    let breach = Breach { can_to_board: Some(hasty), ..Breach::default() };
    fails_on(Wire::Can, breach, &["can.separation"]);
}
