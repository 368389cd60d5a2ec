//! Bytes of the RS-422 line: whatever they are and however they are cut, the same frames come out, and a frame that came
//! out goes in again.

#![no_main]

use gnc_protocol::Frame;
use gnc_protocol::message::{BoardHello, Heartbeat, HostHello, ResultHead};
use gnc_protocol::serial::{FrameDecoder, LineCounters, encode};
use gnc_protocol::stream::StreamFrame;
use gnc_protocol::wire::{FieldReader, Wire as _};
use libfuzzer_sys::fuzz_target;

fn decoded(pieces: &[&[u8]]) -> (Vec<Frame>, LineCounters) {
    let (mut decoder, mut frames) = (FrameDecoder::default(), Vec::new());
    for piece in pieces {
        let mut rest = *piece;
        while let Some(outcome) = decoder.next(&mut rest) {
            frames.extend(outcome);
        }
    }
    (frames, decoder.counters())
}

fuzz_target!(|input: (u16, &[u8])| {
    let (cut, bytes) = input;
    let (head, tail) = bytes.split_at(usize::from(cut).min(bytes.len()));
    let (frames, counters) = decoded(&[bytes]);
    assert_eq!((&frames, &counters), (&decoded(&[head, tail]).0, &decoded(&[head, tail]).1));
    assert_eq!(frames.len(), counters.frames as usize);
    for frame in &frames {
        assert_eq!(decoded(&[&encode(frame)]).0, std::slice::from_ref(frame));
        // What a station makes of a payload.
        let _ = StreamFrame::from_payload(&frame.payload);
        let _ = HostHello::from_payload(&frame.payload);
        let _ = BoardHello::from_payload(&frame.payload);
        let _ = Heartbeat::from_payload(&frame.payload);
        let _ = ResultHead::get(&mut FieldReader::new(&frame.payload));
    }
});
