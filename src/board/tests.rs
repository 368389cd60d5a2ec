//! The conversation with a board that the test plays, over a bus in memory.

use std::collections::VecDeque;
use std::task::Poll;
use std::time::Duration;

use gnc_link::Link;
use gnc_link::can::{CanLink, MemoryEnd};
use gnc_protocol::can::endpoint::{Endpoint, EndpointRole};
use gnc_protocol::can::id::KEEP_ALIVE;
use gnc_protocol::can::{CanFrame, CanId};
use gnc_protocol::message::{
    Accept, BoardHello, HostHello, LinkCounters, LinkCountersReply, MAGIC, ResultHead, StreamStop,
};
use gnc_protocol::stream::{Format, StreamFrame, StreamHead, StreamId, stream_header};
use gnc_protocol::wire::{FieldWriter, List, Wire as _};
use gnc_protocol::{Call as _, FaultCode, Flags, Frame, Header, Kind, PROTOCOL_VERSION, Payload};
use tokio::sync::watch;
use tokio::time::Instant;

use super::*;

/// Which frames of the board go first.
#[derive(Clone, Copy, PartialEq)]
enum First {
    /// Those that were queued first.
    Oldest,
    /// Answers: their id is lower.
    Answers,
}

/// A board with this many pieces of the receiver's bytes to send at each request.
async fn talkative_board(mut end: MemoryEnd, pieces: u32, first: First) {
    let mut endpoint = Endpoint::new(EndpointRole::Board);
    let (mut urgent, mut waiting) = (VecDeque::<CanFrame>::new(), VecDeque::<CanFrame>::new());
    let mut said = 0;
    let began = Instant::now();
    loop {
        while let Some(frame) = endpoint.poll(began.elapsed()) {
            match first {
                First::Oldest => waiting.push_back(frame),
                First::Answers => urgent.push_back(frame),
            }
        }
        tokio::select! {
            room = end.to_host.reserve(), if !urgent.is_empty() || !waiting.is_empty() => {
                let Ok(room) = room else { return };
                if let Some(frame) = urgent.pop_front().or_else(|| waiting.pop_front()) {
                    room.send(frame);
                }
            }
            frame = end.from_host.recv() => {
                let Some(frame) = frame else { return };
                let Some(Ok(heard)) = endpoint.receive(&frame, began.elapsed()) else { continue };
                for answer in answers(&heard, &mut said, pieces) {
                    endpoint.send(&answer, &mut |raw| waiting.push_back(raw));
                }
            }
        }
    }
}

fn answers(heard: &Frame, said: &mut u32, pieces: u32) -> Vec<Frame> {
    let Header { kind, request, message, .. } = heard.header;
    let frame = |kind, payload: Payload| {
        let flags = Flags::default();
        Frame { header: Header { version: PROTOCOL_VERSION, kind, flags, request, message, sequence: 0 }, payload }
    };
    match kind {
        Kind::Hello => {
            let nonce = HostHello::from_payload(&heard.payload).unwrap().nonce;
            let (chosen, lowest, highest) = (PROTOCOL_VERSION, PROTOCOL_VERSION, PROTOCOL_VERSION);
            let hello =
                BoardHello { magic: MAGIC, chosen, lowest, highest, nonce, boot_id: 7, ..BoardHello::default() };
            vec![frame(Kind::Hello, hello.to_payload().unwrap())]
        }
        Kind::Request if !heard.header.flags.has(Flags::RESENT) => {
            let samples = (0..pieces).map(|_| {
                let (stream, format) = (StreamId::Gnss as u8, Format::Bytes as u8);
                let head = StreamHead { stream, format, count: 6, first: *said, board_time_us: 5, dropped: 0 };
                *said += 6;
                let samples = List::from_slice(b"$GNGGA").unwrap();
                let payload = StreamFrame { head, samples }.to_payload().unwrap();
                Frame { header: stream_header(StreamId::Gnss), payload }
            });
            let mut frames: Vec<Frame> = samples.collect();
            let mut result = FieldWriter::default();
            ResultHead { status: FaultCode::None, elapsed_us: 0 }.put(&mut result).unwrap();
            if message == StreamStop::ID {
                gnc_protocol::message::StreamStopReply { produced: *said, dropped: 0 }.put(&mut result).unwrap();
            } else {
                LinkCountersReply::default().put(&mut result).unwrap();
            }
            frames.push(frame(Kind::Accept, Accept::default().to_payload().unwrap()));
            frames.push(frame(Kind::Result, result.finish()));
            frames
        }
        _ => Vec::new(),
    }
}

/// A task awaits an answer and blocks a listener until the answer has come. A runner does so when it reads the error
/// records of one item while another item listens to the receiver. The answer comes past the samples, and no sample is
/// lost.
#[tokio::test(start_paused = true)]
async fn an_answer_does_not_wait_for_a_listener_who_is_behind() {
    let (link, end) = CanLink::in_memory();
    let played = tokio::spawn(talkative_board(end, 3000, First::Oldest));
    let board = BoardClient::connect(Link::Can(Box::new(link)), 1, Default::default()).await.unwrap();
    let lease = BoardLease::new(&board, watch::channel(Advance::default()).0);
    let stream = lease.listen(StreamId::Gnss).await.unwrap();
    for _ in 0..2 {
        lease.call(&LinkCounters {}).await.unwrap();
    }
    let closed = lease.stop_stream(stream).await.unwrap();
    assert_eq!((closed.produced, closed.losses.received, closed.losses.any()), (54_000, 54_000, false));
    assert_eq!(board.close().await.resent, 0);
    played.abort();
}

/// An attempt was cut off and its stream is ended for it. Bytes that the board's answer overtook come before the lease is
/// clear: a stream that begins after that would take them for its own.
#[tokio::test(start_paused = true)]
async fn what_an_answer_overtook_does_not_reach_the_next_stream() {
    let (link, end) = CanLink::in_memory();
    let played = tokio::spawn(talkative_board(end, 3000, First::Answers));
    let board = BoardClient::connect(Link::Can(Box::new(link)), 1, Default::default()).await.unwrap();
    let lease = BoardLease::new(&board, watch::channel(Advance::default()).0);
    drop(lease.listen(StreamId::Gnss).await.unwrap());
    lease.clear().await;
    let mut next = lease.listen(StreamId::Gnss).await.unwrap();
    let late = tokio::time::timeout(Duration::from_secs(1), next.next()).await;
    assert!(late.is_err(), "{late:?}");
    played.abort();
}

/// Plays a board that never stops talking, on a computer whose clock goes on while the runtime has no time for its
/// timers. Returns how many keep-alives the board hears in three seconds.
async fn keep_alives_of_three_seconds(mut end: MemoryEnd) -> u32 {
    let mut endpoint = Endpoint::new(EndpointRole::Board);
    let (began, mut heard) = (Instant::now(), 0);
    let (mut said, mut answered) = (0, false);
    while began.elapsed() < Duration::from_secs(3) {
        while let Ok(frame) = end.from_host.try_recv() {
            heard += u32::from(frame.id() == CanId::Standard(KEEP_ALIVE));
            if let Some(Ok(frame)) = endpoint.receive(&frame, began.elapsed()) {
                for answer in answers(&frame, &mut said, 0) {
                    answered = true;
                    endpoint.send(&answer, &mut |_| {});
                }
            }
        }
        while let Some(frame) = endpoint.poll(began.elapsed()) {
            let _ = end.to_host.try_send(frame);
        }
        if answered {
            let foreign = CanFrame::new(CanId::Standard(0x7ff), &[]).unwrap();
            let _ = end.to_host.try_send(foreign);
            // The timer is only begun: waiting for its end would let the runtime look at its timers.
            tokio::select! {
                biased;
                () = tokio::time::advance(Duration::from_millis(10)) => {}
                () = std::future::ready(()) => {}
            }
        }
        again().await;
    }
    heard
}

/// Gives other tasks a turn, and is ready at once.
async fn again() {
    let mut polled = false;
    std::future::poll_fn(|context| {
        context.waker().wake_by_ref();
        if std::mem::replace(&mut polled, true) { Poll::Ready(()) } else { Poll::Pending }
    })
    .await;
}

/// The board's watchdog hears the station while samples keep the runtime from its timers.
#[test]
fn signs_of_life_do_not_wait_for_the_runtimes_timers() {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_time()
        .start_paused(true)
        .event_interval(1 << 20)
        .build()
        .unwrap();
    let heard = runtime.block_on(async {
        let (link, end) = CanLink::in_memory();
        let board = tokio::spawn(keep_alives_of_three_seconds(end));
        let conversation = BoardClient::connect(Link::Can(Box::new(link)), 1, Default::default()).await.unwrap();
        let heard = board.await.unwrap();
        drop(conversation);
        heard
    });
    assert!((5..=7).contains(&heard), "{heard} keep-alives in three seconds, one every half second");
}
