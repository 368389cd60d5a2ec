//! The ids of the interface document. A lower id goes first: signs of life and messages that make the board safe before
//! everything else, requests and results before samples, test frames last.

use super::CanId;

/// Host: keep-alive, a raw frame without data.
pub const KEEP_ALIVE: u16 = 0x010;
/// Board: heartbeat and watchdog, raw frames.
pub const BOARD_EVENTS: u16 = 0x011;
/// Host, ISO-TP: HELLO, MAKE_SAFE, ABORT; flow control for their answers.
pub const URGENT_TO_BOARD: u16 = 0x020;
/// Board, ISO-TP: the answers to those; flow control.
pub const URGENT_TO_HOST: u16 = 0x021;
/// Host, ISO-TP: all other requests; flow control.
pub const WORK_TO_BOARD: u16 = 0x100;
/// Board, ISO-TP: the answers to those; flow control.
pub const WORK_TO_HOST: u16 = 0x101;
/// Board: gyroscopes of an IMU sample.
pub const IMU_GYRO: u16 = 0x200;
/// Board: accelerometers of an IMU sample.
pub const IMU_ACCEL: u16 = 0x201;
/// Board: magnetometer of an IMU sample.
pub const IMU_MAG: u16 = 0x202;
/// Board: whole number and temperatures of the IMU sample that follows.
pub const IMU_MARK: u16 = 0x203;
/// Board: board time of the IMU sample that follows, samples dropped.
pub const IMU_CLOCK: u16 = 0x204;
/// Board: bytes of the GNSS receiver.
pub const GNSS_BYTES: u16 = 0x210;
/// Board: board time of the GNSS bytes that follow.
pub const GNSS_CLOCK: u16 = 0x211;
/// Board: a capture of 1PPS.
pub const PPS: u16 = 0x212;
/// Board: a piece of a compensated sample.
pub const COMPENSATED: u16 = 0x220;
/// Board: whole number of the compensated sample that follows, samples dropped.
pub const COMPENSATED_MARK: u16 = 0x221;
/// Board: board time of the compensated sample that follows.
pub const COMPENSATED_CLOCK: u16 = 0x222;

/// First standard id that the module echoes; there are sixteen.
pub const ECHO_STANDARD: u16 = 0x700;
/// First extended id that the module echoes; there are 65,536.
pub const ECHO_EXTENDED: u32 = 0x1abc_0000;
const ECHO_STANDARD_COUNT: u16 = 0x10;
const ECHO_EXTENDED_COUNT: u32 = 0x1_0000;

/// The id of the echo of a test frame with this id; `None` if the module echoes no frames of this id.
#[must_use]
pub const fn echo_of(id: CanId) -> Option<CanId> {
    match id {
        CanId::Standard(id) if id >= ECHO_STANDARD && id < ECHO_STANDARD + ECHO_STANDARD_COUNT => {
            Some(CanId::Standard(id + ECHO_STANDARD_COUNT))
        }
        CanId::Extended(id) if id >= ECHO_EXTENDED && id < ECHO_EXTENDED + ECHO_EXTENDED_COUNT => {
            Some(CanId::Extended(id + ECHO_EXTENDED_COUNT))
        }
        _ => None,
    }
}

/// Whether a frame has an id under which the module sends test frames back.
#[must_use]
pub const fn is_echo(id: CanId) -> bool {
    match id {
        CanId::Standard(id) => echo_of(CanId::Standard(id.wrapping_sub(ECHO_STANDARD_COUNT))).is_some(),
        CanId::Extended(id) => echo_of(CanId::Extended(id.wrapping_sub(ECHO_EXTENDED_COUNT))).is_some(),
    }
}
