//! Lines of an slcan adapter: the same items however they are cut, and a frame that came out goes in again.

#![no_main]

use gnc_protocol::can::slcan::{SlcanDecoder, SlcanEvent, encode};
use libfuzzer_sys::fuzz_target;

fn decoded(pieces: &[&[u8]]) -> Vec<SlcanEvent> {
    let (mut decoder, mut items) = (SlcanDecoder::default(), Vec::new());
    for piece in pieces {
        let mut rest = *piece;
        while let Some(item) = decoder.next(&mut rest) {
            items.push(item);
        }
    }
    items
}

fuzz_target!(|input: (u16, &[u8])| {
    let (cut, bytes) = input;
    let (head, tail) = bytes.split_at(usize::from(cut).min(bytes.len()));
    let items = decoded(&[bytes]);
    assert_eq!(items, decoded(&[head, tail]));
    for item in items {
        if let SlcanEvent::Frame(frame) = item {
            assert_eq!(decoded(&[&encode(&frame)]), [SlcanEvent::Frame(frame)]);
        }
    }
});
