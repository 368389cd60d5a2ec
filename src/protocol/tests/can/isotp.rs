//! The two state machines against ISO 15765-2, frame by frame.

use std::time::Duration;

use gnc_protocol::can::isotp::{
    Failure, Flow, FlowSettings, IsoTpReceived, IsoTpReceiver, IsoTpSender, MAX_PDU, MAX_WAITS, N_BS, N_CR, SendError,
    StartError, separation,
};
use proptest::prelude::*;

const ZERO: Duration = Duration::ZERO;

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

fn counting(length: usize) -> Vec<u8> {
    (0..length).map(|at| at as u8).collect()
}

fn started(length: usize) -> IsoTpSender<MAX_PDU> {
    let mut sender = IsoTpSender::default();
    sender.start(&counting(length)).unwrap();
    sender
}

fn polled(sender: &mut IsoTpSender<MAX_PDU>, now: Duration) -> Option<Vec<u8>> {
    sender.poll(now).map(|data| data.to_vec())
}

#[test]
fn up_to_seven_bytes_go_in_one_frame() {
    for length in 1..=7 {
        let mut sender = started(length);
        let mut expected = vec![length as u8];
        expected.extend(counting(length));
        assert_eq!(polled(&mut sender, ZERO), Some(expected.clone()));
        assert!(sender.is_idle());
        let mut receiver = IsoTpReceiver::<MAX_PDU>::default();
        assert_eq!(receiver.receive(&expected, ZERO), IsoTpReceived::Complete);
        assert_eq!(receiver.pdu(), counting(length));
        expected.resize(8, 0xcc);
        assert_eq!(receiver.receive(&expected, ZERO), IsoTpReceived::Complete, "padded");
        assert_eq!(receiver.pdu(), counting(length));
    }
}

#[test]
fn eight_bytes_need_flow_control() {
    let mut sender = started(8);
    assert_eq!(polled(&mut sender, ZERO), Some(vec![0x10, 8, 0, 1, 2, 3, 4, 5]));
    assert_eq!(polled(&mut sender, ms(999)), None);
    assert_eq!(sender.expire(ms(999)), Ok(()));
    sender.flow(&[0x30, 0, 0], ms(999)).unwrap();
    assert_eq!(polled(&mut sender, ms(999)), Some(vec![0x21, 6, 7]));
    assert!(sender.is_idle());
}

#[test]
fn blocks_and_separation_are_kept() {
    // 6 bytes in the first frame, then 5 frames.
    let mut sender = started(6 + 7 * 4 + 1);
    sender.poll(ZERO).unwrap();
    sender.flow(&[0x30, 2, 10], ZERO).unwrap();
    assert_eq!(polled(&mut sender, ZERO).unwrap()[0], 0x21);
    assert_eq!(polled(&mut sender, ms(9)), None, "STmin is 10 ms");
    assert_eq!(sender.next_due(), Some(ms(10)));
    assert_eq!(polled(&mut sender, ms(10)).unwrap()[0], 0x22);
    assert_eq!(polled(&mut sender, ms(500)), None, "the block is over");
    sender.flow(&[0x30, 0, 0xf1], ms(500)).unwrap();
    assert_eq!(polled(&mut sender, ms(500)).unwrap()[0], 0x23);
    assert_eq!(sender.next_due(), Some(Duration::from_micros(500_100)));
    assert_eq!(polled(&mut sender, ms(501)).unwrap()[0], 0x24);
    assert_eq!(polled(&mut sender, ms(502)), Some(vec![0x25, 34]));
    assert!(sender.is_idle());
}

#[test]
fn bytes_of_st_min() {
    let expected = [(0, 0), (1, 1000), (0x7f, 127_000), (0xf1, 100), (0xf9, 900)];
    for (byte, us) in expected {
        assert_eq!(separation(byte), Duration::from_micros(us), "{byte:02x}");
    }
    for reserved in [0x80, 0xf0, 0xfa, 0xff] {
        assert_eq!(separation(reserved), ms(127), "{reserved:02x}");
    }
}

#[test]
fn a_sender_gives_up() {
    let waiting = || {
        let mut sender = started(100);
        sender.poll(ZERO).unwrap();
        sender
    };
    let mut sender = waiting();
    assert_eq!(sender.expire(N_BS), Err(SendError::FlowTimeout));
    assert!(sender.is_idle());
    assert_eq!(sender.expire(N_BS), Ok(()), "once");

    assert_eq!(waiting().flow(&[0x32, 0, 0], ZERO), Err(SendError::Overflow));
    assert_eq!(waiting().flow(&[0x33, 0, 0], ZERO), Err(SendError::BadFlow));
    assert_eq!(waiting().flow(&[0x30, 0], ZERO), Err(SendError::BadFlow));

    let mut sender = waiting();
    for wait in 0..u64::from(MAX_WAITS) {
        assert_eq!(sender.flow(&[0x31, 0, 0], ms(900 * wait)), Ok(()), "each wait begins the time anew");
        assert_eq!(sender.expire(ms(900 * wait + 999)), Ok(()));
    }
    assert_eq!(sender.flow(&[0x31, 0, 0], ms(9000)), Err(SendError::TooManyWaits));
}

#[test]
fn what_a_sender_does_not_take() {
    let mut sender = started(100);
    assert_eq!(sender.start(&[1]), Err(StartError::Busy));
    sender.cancel();
    assert_eq!(sender.start(&[]), Err(StartError::Empty));
    assert_eq!(sender.start(&[0; 4096]), Err(StartError::TooLong { length: 4096 }));
    assert_eq!(IsoTpSender::<64>::default().start(&[0; 65]), Err(StartError::TooLong { length: 65 }));
    assert_eq!(sender.flow(&[0x33], ZERO), Ok(()), "nobody waits for it");
}

fn go(block_size: u8, st_min: u8) -> IsoTpReceived {
    IsoTpReceived::Flow(Flow::Continue { block_size, st_min })
}

#[test]
fn a_receiver_asks_block_by_block() {
    let mut receiver = IsoTpReceiver::<MAX_PDU>::new(FlowSettings { block_size: 2, st_min: 5 });
    assert_eq!(receiver.receive(&[0x10, 6 + 7 * 3, 0, 1, 2, 3, 4, 5], ZERO), go(2, 5));
    assert_eq!(receiver.receive(&[0x21, 6, 7, 8, 9, 10, 11, 12], ms(1)), IsoTpReceived::Nothing);
    assert_eq!(receiver.receive(&[0x22, 13, 14, 15, 16, 17, 18, 19], ms(2)), go(2, 5));
    assert_eq!(receiver.receive(&[0x23, 20, 21, 22, 23, 24, 25, 26], ms(3)), IsoTpReceived::Complete);
    assert_eq!(receiver.pdu(), counting(27));
    assert_eq!(receiver.receive(&[0x24, 0], ms(4)), IsoTpReceived::Nothing, "no message runs");
}

#[test]
fn what_breaks_a_message() {
    let begun = || {
        let mut receiver = IsoTpReceiver::<64>::default();
        assert_eq!(receiver.receive(&[0x10, 20, 0, 1, 2, 3, 4, 5], ZERO), go(0, 0));
        receiver
    };
    let mut receiver = begun();
    let sequence = Failure::Sequence { expected: 1, got: 2 };
    assert_eq!(receiver.receive(&[0x22, 0, 0, 0, 0, 0, 0, 0], ZERO), IsoTpReceived::Failed(sequence));
    assert!(receiver.is_idle());

    let mut receiver = begun();
    assert_eq!(receiver.expire(N_CR - ms(1)), Ok(()));
    assert_eq!(receiver.expire(N_CR), Err(Failure::Timeout));
    assert!(receiver.is_idle());

    let mut receiver = begun();
    assert_eq!(
        receiver.receive(&[0x21, 6, 7], ZERO),
        IsoTpReceived::Failed(Failure::Malformed),
        "too short, passed over"
    );
    assert_eq!(receiver.receive(&[0x21, 6, 7, 8, 9, 10, 11, 12], ZERO), IsoTpReceived::Nothing);
    assert_eq!(receiver.receive(&[2, 0xaa, 0xbb], ZERO), IsoTpReceived::Complete, "a new message ends the one before");
    assert_eq!((receiver.pdu(), receiver.interrupted()), (&[0xaa, 0xbb][..], 1));

    let mut receiver = IsoTpReceiver::<64>::default();
    let too_long = |length| IsoTpReceived::Failed(Failure::TooLong { length });
    assert_eq!(receiver.receive(&[0x10, 65, 0, 0, 0, 0, 0, 0], ZERO), too_long(65));
    assert_eq!(receiver.receive(&[0x10, 0, 0, 1, 0, 0, 0, 0], ZERO), too_long(65_536), "32-bit length");
    for strange in
        [&[][..], &[0], &[8, 1, 2, 3, 4, 5, 6, 7], &[3, 1, 2], &[0x10, 7, 0, 0, 0, 0, 0, 0], &[0x10, 20, 0], &[0x40]]
    {
        assert_eq!(receiver.receive(strange, ZERO), IsoTpReceived::Failed(Failure::Malformed), "{strange:02x?}");
    }
}

/// Sends a message over a line that loses the frames with the numbers in `lost`; returns what arrived.
fn over_a_line(message: &[u8], settings: FlowSettings, lost: &[usize]) -> Option<Vec<u8>> {
    let mut sender = IsoTpSender::<MAX_PDU>::default();
    let mut receiver = IsoTpReceiver::<MAX_PDU>::new(settings);
    sender.start(message).unwrap();
    let (mut now, mut count) = (ZERO, 0);
    loop {
        let mut flow = None;
        while let Some(data) = sender.poll(now) {
            count += 1;
            if lost.contains(&count) {
                continue;
            }
            match receiver.receive(&data, now) {
                IsoTpReceived::Complete => return Some(receiver.pdu().to_vec()),
                IsoTpReceived::Flow(asked) => flow = Some(asked),
                IsoTpReceived::Nothing | IsoTpReceived::Failed(_) => {}
            }
        }
        if let Some(flow) = flow {
            count += 1;
            if !lost.contains(&count) {
                let _ = sender.flow(&flow.to_bytes(), now);
            }
        }
        let due = [sender.next_due(), receiver.next_due()].into_iter().flatten().min()?;
        assert!(due >= now && count < 10_000, "it stalls at {now:?}");
        now = due;
        let _ = (sender.expire(now), receiver.expire(now));
    }
}

proptest! {
    #[test]
    fn any_message_arrives_whatever_the_receiver_asks_for(
        length in prop_oneof![1..30_usize, 500..540_usize, 4000..=MAX_PDU],
        block_size in any::<u8>(),
        st_min in any::<u8>(),
    ) {
        let message = counting(length);
        prop_assert_eq!(over_a_line(&message, FlowSettings { block_size, st_min }, &[]), Some(message));
    }

    /// A loss costs the message. It never gives another message and never blocks.
    #[test]
    fn losses_end_in_nothing_or_the_message(length in 1..300_usize, block_size in 0..9_u8, lost in proptest::collection::vec(1..60_usize, 0..4)) {
        let message = counting(length);
        if let Some(got) = over_a_line(&message, FlowSettings { block_size, st_min: 0 }, &lost) {
            prop_assert_eq!(got, message);
        }
    }

    #[test]
    fn any_frames_are_survived(frames in proptest::collection::vec((proptest::collection::vec(any::<u8>(), 0..=8), 0..1500_u64), 0..60)) {
        let (mut sender, mut receiver) = (started(200), IsoTpReceiver::<128>::default());
        let mut now = ZERO;
        for (data, wait) in frames {
            now += ms(wait);
            let _ = (sender.expire(now), receiver.expire(now), sender.poll(now));
            let _ = sender.flow(&data, now);
            if let IsoTpReceived::Complete = receiver.receive(&data, now) {
                prop_assert!((1..=128).contains(&receiver.pdu().len()));
            }
        }
        // After any frames, both ends stop by themselves.
        let end = now + N_BS + N_CR + Duration::from_secs(60);
        for _ in 0..300 {
            let _ = (sender.poll(end), sender.expire(end), receiver.expire(end));
        }
        prop_assert!(receiver.is_idle());
    }
}
