//! What breaches make of a single frame, whenever it is sent.

use gnc_protocol::Call as _;
use gnc_protocol::frame::{Flags, Frame, Header, Kind, PROTOCOL_VERSION, Payload};
use gnc_protocol::message::{Abort, BoardHello, Heartbeat, Nak, Progress, event};
use gnc_protocol::wire::Wire;

use super::{Breaches, HelloBreaches};

/// A bit by which two boot ids differ.
const OTHER_BOOT_ID: u32 = 1;
/// The text behind a status that means nothing.
const STRANGE_STATUS: &[u8] = b"\x0fa status unknown";

/// A frame of the board without a number yet.
pub(super) fn frame_of(kind: Kind, request: u16, message: u16, body: &impl Wire) -> Option<Frame> {
    let header = Header { version: PROTOCOL_VERSION, kind, flags: Flags::default(), request, message, sequence: 0 };
    Some(Frame { header, payload: body.to_payload().ok()? })
}

/// Whether the message has a channel of its own on CAN. Its id is never altered: the frame would change its channel.
fn is_urgent(message: u16) -> bool {
    message <= Abort::ID
}

/// Spoils what the frame says.
pub(super) fn spoil(breaches: &Breaches, frame: &mut Frame, results: u32) {
    let talk = &breaches.talk;
    match frame.header.kind {
        Kind::Hello => hello(&breaches.hello, &mut frame.payload),
        Kind::Nak => {
            if let (Some(code), Ok(nak)) = (talk.nak_code, Nak::from_payload(&frame.payload)) {
                replace(&mut frame.payload, &Nak { code, ..nak });
            }
        }
        Kind::Progress => {
            if let (Some(done_permille), Ok(progress)) =
                (talk.progress_permille, Progress::from_payload(&frame.payload))
            {
                replace(&mut frame.payload, &Progress { done_permille, ..progress });
            }
        }
        Kind::Result => {
            if talk.wrong_message_id && !is_urgent(frame.header.message) {
                frame.header.message = frame.header.message.wrapping_add(1);
            }
            if talk.replay_without_flag {
                frame.header.flags.0 &= !Flags::REPLAYED.0;
            }
            if let Some(times) = talk.elapsed_us_times {
                elapsed(&mut frame.payload, times);
            }
            let every = talk.result_status_every.max(1);
            if let Some(status) = talk.result_status.filter(|_| super::is_nth(results, every)) {
                let elapsed = frame.payload.get(2..6).map(<[u8]>::to_vec).unwrap_or_default();
                frame.payload.clear();
                // Two bytes, four and a short text: they fit.
                let _ = frame.payload.extend_from_slice(&status.to_le_bytes());
                let _ = frame.payload.extend_from_slice(&elapsed);
                let _ = frame.payload.extend_from_slice(STRANGE_STATUS);
            }
        }
        Kind::Event if frame.header.message == event::HEARTBEAT => {
            if let Ok(beat) = Heartbeat::from_payload(&frame.payload) {
                let state = (beat.state | breaches.state.bits_set) & !breaches.state.bits_cleared;
                replace(&mut frame.payload, &Heartbeat { state, ..beat });
            }
        }
        Kind::Stream if talk.stream_request_id != 0 => frame.header.request = talk.stream_request_id,
        Kind::Request | Kind::Accept | Kind::Event | Kind::Stream => {}
    }
    if let Some(version) = talk.header_version.filter(|_| frame.header.kind != Kind::Hello) {
        frame.header.version = version;
    }
}

fn replace(payload: &mut Payload, body: &impl Wire) {
    if let Ok(new) = body.to_payload() {
        *payload = new;
    }
}

/// Multiplies the board time that a RESULT tells.
fn elapsed(payload: &mut Payload, times: f64) {
    if let Some(bytes) = payload.get_mut(2..6).and_then(|bytes| <&mut [u8; 4]>::try_from(bytes).ok()) {
        // The cast ends at the largest number of the field.
        *bytes = ((f64::from(u32::from_le_bytes(*bytes)) * times) as u32).to_le_bytes();
    }
}

fn hello(breaches: &HelloBreaches, payload: &mut Payload) {
    let Ok(mut hello) = BoardHello::from_payload(payload) else { return };
    hello.nonce = hello.nonce.wrapping_add(u32::from(breaches.wrong_nonce));
    if breaches.other_boot_id_in_hello {
        hello.boot_id ^= OTHER_BOOT_ID;
    }
    if let Some(versions) = breaches.hello_versions {
        (hello.lowest, hello.highest) = versions;
    }
    hello.chosen = breaches.hello_chosen.unwrap_or(hello.chosen);
    replace(payload, &hello);
    for _ in 0..breaches.hello_extra_bytes {
        // A HELLO and the most bytes that a personality may ask for fit into a payload.
        let _ = payload.push(0);
    }
}
