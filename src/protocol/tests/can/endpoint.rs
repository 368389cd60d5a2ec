//! Both ends of the link together.

use std::time::Duration;

use gnc_protocol::can::endpoint::{Endpoint, EndpointRole, QUEUE};
use gnc_protocol::can::{CanFrame, CanId};
use gnc_protocol::message::{HostHello, Identity, MAGIC, MakeSafe, SciEcho};
use gnc_protocol::wire::Wire;
use gnc_protocol::{Call, Flags, Frame, Header, Kind, PROTOCOL_VERSION, Payload};
use proptest::prelude::*;

const ZERO: Duration = Duration::ZERO;

fn request(message: u16, request: u16, payload: Payload) -> Frame {
    let (kind, flags) = (Kind::Request, Flags::default());
    Frame { header: Header { version: PROTOCOL_VERSION, kind, flags, request, message, sequence: 0 }, payload }
}

fn hello(nonce: u32) -> Frame {
    let payload = HostHello { magic: MAGIC, lowest: 1, highest: 1, nonce }.to_payload().unwrap();
    let (kind, flags) = (Kind::Hello, Flags::default());
    Frame { header: Header { version: 0, kind, flags, request: 0, message: 0, sequence: 0 }, payload }
}

fn long() -> Frame {
    let data = (0..=255).collect();
    request(SciEcho::ID, 7, SciEcho { rate_baud: 115_200, data }.to_payload().unwrap())
}

fn post(endpoint: &mut Endpoint, frame: &Frame) {
    endpoint.send(frame, &mut |raw| panic!("a raw frame: {raw:?}"));
}

/// Frames go back and forth until both ends have no more to send; `keep` says which frames get through.
fn settle(host: &mut Endpoint, board: &mut Endpoint, now: Duration, keep: &mut impl FnMut() -> bool) -> Vec<Frame> {
    let mut heard = Vec::new();
    loop {
        let (to_board, to_host) = (host.poll(now), board.poll(now));
        if to_board.is_none() && to_host.is_none() {
            return heard;
        }
        let to_board = to_board.filter(|_| keep());
        let to_host = to_host.filter(|_| keep());
        heard.extend(to_board.and_then(|frame| board.receive(&frame, now)).and_then(Result::ok));
        heard.extend(to_host.and_then(|frame| host.receive(&frame, now)).and_then(Result::ok));
    }
}

fn ends() -> (Endpoint, Endpoint) {
    (Endpoint::new(EndpointRole::Host), Endpoint::new(EndpointRole::Board))
}

/// A message that makes the board safe overtakes a long request on its way.
#[test]
fn make_safe_overtakes() {
    let (mut host, mut board) = ends();
    post(&mut host, &long());
    let first = host.poll(ZERO).unwrap();
    assert_eq!(first.id(), CanId::Standard(0x100));
    board.receive(&first, ZERO);
    host.receive(&board.poll(ZERO).unwrap(), ZERO);
    assert_eq!(host.poll(ZERO).unwrap().data()[0], 0x21, "the long one goes on");
    post(&mut host, &request(MakeSafe::ID, 8, Payload::new()));
    assert_eq!(host.poll(ZERO).unwrap().id(), CanId::Standard(0x20));
}

/// An unfetched answer does not delay the HELLO of the next host.
#[test]
fn a_hello_opens_the_way() {
    let (_, mut board) = ends();
    let mut answer = hello(1);
    answer.header.request = 1;
    post(&mut board, &answer);
    post(&mut board, &answer);
    assert_eq!(board.poll(ZERO).unwrap().data()[0], 0x10);
    assert_eq!(board.poll(ZERO), None, "it waits for flow control");
    let mut host = Endpoint::new(EndpointRole::Host);
    post(&mut host, &hello(2));
    let heard = settle(&mut host, &mut board, ZERO, &mut || true);
    assert_eq!(heard, [hello(2)], "the old answers are gone");
    post(&mut board, &answer);
    assert_eq!(settle(&mut host, &mut board, ZERO, &mut || true).len(), 1);
}

#[test]
fn messages_are_numbered_channel_by_channel() {
    let (mut host, mut board) = ends();
    for number in 0..3 {
        post(&mut host, &request(Identity::ID, number, Payload::new()));
        post(&mut host, &request(MakeSafe::ID, 100 + number, Payload::new()));
    }
    let heard = settle(&mut host, &mut board, ZERO, &mut || true);
    let of = |message| -> Vec<u16> {
        heard.iter().filter(|frame| frame.header.message == message).map(|frame| frame.header.sequence).collect()
    };
    assert_eq!((of(Identity::ID), of(MakeSafe::ID)), (vec![0, 1, 2], vec![0, 1, 2]));
    assert_eq!((board.counters().frames, board.counters().missing), (6, 0));
}

/// A lost message is counted as missing when the next one comes.
#[test]
fn lost_messages_are_counted() {
    let (mut host, mut board) = ends();
    let one = request(Identity::ID, 1, Payload::new());
    post(&mut host, &one);
    assert_eq!(settle(&mut host, &mut board, ZERO, &mut || true).len(), 1);
    post(&mut host, &one);
    assert_eq!(settle(&mut host, &mut board, ZERO, &mut || false).len(), 0, "its first frame is lost");
    let later = Duration::from_secs(1);
    post(&mut host, &one);
    assert_eq!(settle(&mut host, &mut board, later, &mut || true).len(), 1, "after N_Bs the next one goes");
    assert_eq!((board.counters().missing, host.transfers().not_sent), (1, 1));
}

#[test]
fn what_waits_is_bounded() {
    let (mut host, _) = ends();
    (0..100).for_each(|number| post(&mut host, &request(Identity::ID, number, Payload::new())));
    assert_eq!(host.transfers().crowded_out as usize, 100 - QUEUE);
}

proptest! {
    /// Losses cost messages and never alter one. When the line is good again, the next message arrives.
    #[test]
    fn losses_cost_messages_only(pattern in proptest::collection::vec(any::<bool>(), 1..200)) {
        let (mut host, mut board) = ends();
        let mut kept = pattern.iter().copied();
        for number in 0..10 {
            let now = Duration::from_secs(2 * number);
            let mut frame = long();
            frame.header.request = number as u16;
            post(&mut host, &frame);
            for heard in settle(&mut host, &mut board, now, &mut || kept.next().unwrap_or(true)) {
                prop_assert_eq!(heard.payload, frame.payload.clone());
            }
        }
        let last = request(Identity::ID, 99, Payload::new());
        post(&mut host, &last);
        let heard = settle(&mut host, &mut board, Duration::from_secs(100), &mut || true);
        prop_assert_eq!(heard.last().map(|frame| frame.header.request), Some(99));
    }

    #[test]
    fn any_frames_are_survived(frames in proptest::collection::vec((prop_oneof![0..0x30_u16, 0xf8..0x108_u16, 0x1f8..0x218_u16], proptest::collection::vec(any::<u8>(), 0..=8)), 0..200)) {
        let (mut host, mut board) = ends();
        post(&mut host, &long());
        for (at, (id, data)) in frames.iter().enumerate() {
            let now = Duration::from_millis(at as u64 * 40);
            let frame = CanFrame::new(CanId::Standard(*id), data).unwrap();
            for end in [&mut host, &mut board] {
                let _ = end.receive(&frame, now);
                for _ in 0..200 {
                    if end.poll(now).is_none() {
                        break;
                    }
                }
            }
        }
    }
}
