//! What the doctor says of a board at the other end of a line in memory, on a clock that moves when both wait.

use std::time::Duration;

use gnc_link::memory::MemoryPort;
use gnc_link::{Link, Target};
use gnc_protocol::message::{BoardHello, Heartbeat, HostHello, MAGIC, capability, event};
use gnc_protocol::serial::{FrameDecoder, encode};
use gnc_protocol::wire::{Text, Wire as _};
use gnc_protocol::{Flags, Frame, Header, Kind, Payload};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream};
use tokio::time::{Instant, sleep, sleep_until};

use crate::doctor::board::{Heard, MayAsk, ask, findings};

/// Time between two heartbeats, by the interface document.
const BEAT: Duration = Duration::from_millis(1000);

/// A board that the test plays.
#[derive(Clone)]
struct Played {
    /// State of its heartbeats, by their number; `None` from that one on.
    states: fn(u32) -> Option<u8>,
    /// Version in the header of its heartbeats.
    version: u8,
    /// Bytes that it sends with each heartbeat.
    noise: &'static [u8],
    /// The versions that it speaks, and the one that it chooses; `None`: it does not hear HELLO.
    speaks: Option<(u8, u8, u8)>,
    takes: Duration,
    boot_id: u32,
}

impl Default for Played {
    fn default() -> Self {
        Self {
            states: |_| Some(0),
            version: 1,
            noise: b"",
            speaks: Some((1, 1, 1)),
            takes: Duration::from_millis(7),
            boot_id: 0xb007_1dea,
        }
    }
}

fn frame(kind: Kind, version: u8, request: u16, message: u16, payload: Payload) -> Vec<u8> {
    let header = Header { version, kind, flags: Flags::default(), request, message, sequence: 0 };
    encode(&Frame { header, payload }).to_vec()
}

impl Played {
    /// Plays until the station's end is dropped; returns the number of HELLOs that it heard.
    async fn play(self, mut end: DuplexStream) -> usize {
        let (mut decoder, mut heard, mut beats) = (FrameDecoder::default(), 0, 0);
        let mut beat_at = Instant::now() + BEAT / 2;
        let mut bytes = [0; 512];
        loop {
            tokio::select! {
                count = end.read(&mut bytes) => {
                    let count = count.unwrap_or(0);
                    if count == 0 {
                        return heard;
                    }
                    let mut rest = &bytes[..count];
                    while let Some(got) = decoder.next(&mut rest) {
                        let got = got.expect("a good frame");
                        assert_eq!(got.header.kind, Kind::Hello, "doctor says nothing but HELLO");
                        heard += 1;
                        let Some((chosen, lowest, highest)) = self.speaks else { continue };
                        let nonce = HostHello::from_payload(&got.payload).expect("a HELLO").nonce;
                        let hello = BoardHello {
                            magic: MAGIC, chosen, lowest, highest, nonce, boot_id: 0xb007_1dea,
                            capabilities: capability::POWER | capability::CAN,
                            serial: Text::try_from("SB-17").expect("short"),
                            firmware: Text::try_from("2.1").expect("short"),
                        };
                        sleep(self.takes).await;
                        let answer = frame(Kind::Hello, 0, got.header.request, 0, hello.to_payload().expect("it fits"));
                        let _ = end.write_all(&answer).await;
                    }
                }
                () = sleep_until(beat_at) => {
                    beat_at += BEAT;
                    let _ = end.write_all(self.noise).await;
                    if let Some(state) = (self.states)(beats) {
                        let beat = Heartbeat { boot_id: self.boot_id, board_time_us: 5, state };
                        let payload = beat.to_payload().expect("it fits");
                        let _ = end.write_all(&frame(Kind::Event, self.version, 0, event::HEARTBEAT, payload)).await;
                    }
                    beats += 1;
                }
            }
        }
    }
}

/// What the doctor says, and how many HELLOs the board heard.
async fn examined(board: Played, may_ask: MayAsk) -> (String, usize, Heard) {
    let port = MemoryPort::new("/dev/ttyUSB0", 921_600);
    let end = port.plug_in();
    let link = Link::open(&Target::Memory(port)).expect("a cable");
    let played = tokio::spawn(board.play(end));
    let heard = ask(link, 5, may_ask).await;
    let found = findings(&heard);
    super::speak_all(&found, &[]);
    let said: Vec<String> = found.iter().map(ToString::to_string).collect();
    (said.join("\n"), played.await.expect("the board"), heard)
}

async fn check(board: Played, expected: &[&str]) {
    let (said, ..) = examined(board, MayAsk::Yes).await;
    assert_eq!(said.lines().count(), expected.len(), "{said}");
    for (line, expected) in said.lines().zip(expected) {
        assert!(line.starts_with(expected), "{line}\ninstead of\n{expected}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_good_board_says_who_it_is() {
    check(
        Played::default(),
        &["ok       port /dev/ttyUSB0: board SB-17 (firmware 2.1) answers HELLO in 7 ms: boot id b0071dea, protocol version 1, switches the \
           module's supply, has CAN"],
    )
    .await;
}

/// The time is that from the HELLO that was answered, also if an earlier one was lost.
#[tokio::test(start_paused = true)]
async fn a_slow_answer_is_timed_from_its_own_hello() {
    let slow = Played { takes: Duration::from_millis(600), ..Played::default() };
    check(
        slow,
        &[
            "ok       port /dev/ttyUSB0: board SB-17 (firmware 2.1) answers HELLO in 600 ms",
            "warning  port /dev/ttyUSB0: the answer to HELLO took 600 ms",
        ],
    )
    .await;
}

#[tokio::test(start_paused = true)]
async fn ways_of_silence_are_told_apart() {
    let mute = Played { states: |_| None, speaks: None, ..Played::default() };
    check(
        mute.clone(),
        &["BAD      port /dev/ttyUSB0: nothing came in 3.5 s; no answer to 10 HELLO; mend: is the board under power?"],
    )
    .await;
    let talks = Played { noise: b"U-Boot> ", ..mute.clone() };
    check(
        talks,
        &["BAD      port /dev/ttyUSB0: 48 bytes came, and no frame of the board among them; no answer to 10 HELLO"],
    )
    .await;
    let damaged = Played { noise: b"\0\x05abcdefgh\0", ..mute.clone() };
    check(damaged, &["BAD      port /dev/ttyUSB0: 66 bytes came with 6 damaged frames and none whole"]).await;
    let deaf = Played { states: |_| Some(0), ..mute.clone() };
    check(deaf, &["BAD      port /dev/ttyUSB0: a board with boot id b0071dea sends heartbeats; no answer to 10 HELLO; mend: the board does not hear"]).await;
    let beatless = Played { states: |_| None, ..Played::default() };
    check(
        beatless,
        &[
            "ok       port /dev/ttyUSB0: board SB-17",
            "BAD      port /dev/ttyUSB0: the board answers HELLO, but sent no heartbeat in 3500 ms",
        ],
    )
    .await;
}

#[tokio::test(start_paused = true)]
async fn another_version_is_said() {
    let later = Played { speaks: Some((0, 2, 3)), ..Played::default() };
    check(later, &["BAD      port /dev/ttyUSB0: board SB-17 (firmware 2.1) speaks protocol versions 2 to 3, this station speaks version 1"]).await;
    let foreign = Played { version: 2, speaks: None, ..Played::default() };
    check(foreign, &["BAD      port /dev/ttyUSB0: frames of protocol version 2 come, this station speaks version 1; no answer to 10 HELLO"]).await;
}

/// A good board on a line on which frames are damaged, and a boot id that changes between heartbeat and HELLO.
#[tokio::test(start_paused = true)]
async fn trouble_beside_an_answer_is_said() {
    let noisy = Played { noise: b"\0abc\0def\0", ..Played::default() };
    check(
        noisy,
        &[
            "ok       port /dev/ttyUSB0: board SB-17",
            "warning  port /dev/ttyUSB0: 2 frames came damaged, 2 whole; mend: check cable",
        ],
    )
    .await;
    let other = Played { boot_id: 7, ..Played::default() };
    check(
        other,
        &[
            "ok       port /dev/ttyUSB0: board SB-17",
            "warning  port /dev/ttyUSB0: the boot id is 00000007 in the heartbeat and b0071dea",
        ],
    )
    .await;
}

/// A HELLO ends a session. So no byte goes to a board that works for another program, or where another program may be.
#[tokio::test(start_paused = true)]
async fn a_board_at_work_is_not_asked() {
    for (state, does) in
        [(1, "has a session"), (2, "has the module under power"), (4, "runs a request"), (8, "sends samples")]
    {
        let states = [|_| Some(1), |_| Some(2), |_| Some(4), |_| Some(8)][u8::ilog2(state) as usize];
        let (said, hellos, _) = examined(Played { states, ..Played::default() }, MayAsk::Yes).await;
        assert!(
            said.contains(&format!("warning  port /dev/ttyUSB0: the board {does}, so another program works with it")),
            "{said}"
        );
        assert_eq!(hellos, 0, "{said}");
    }
    let (said, hellos, _) = examined(Played::default(), MayAsk::No).await;
    assert!(
        said.starts_with("ok       port /dev/ttyUSB0: a board with boot id b0071dea sends heartbeats; not asked"),
        "{said}"
    );
    assert_eq!(hellos, 0);
    let mute = Played { states: |_| None, ..Played::default() };
    assert_eq!(examined(mute, MayAsk::AfterHeartbeat).await.1, 0);
    assert_eq!(examined(Played::default(), MayAsk::AfterHeartbeat).await.1, 1);
}

/// The watchdog ends a session whose host is gone: the board is asked after that.
#[tokio::test(start_paused = true)]
async fn a_session_that_ends_meanwhile_does_not_count() {
    let states = |beat| Some(u8::from(beat < 2));
    let (said, hellos, heard) = examined(Played { states, ..Played::default() }, MayAsk::Yes).await;
    assert!(said.starts_with("ok       port /dev/ttyUSB0: board SB-17"), "{said}");
    assert_eq!((hellos, heard.listened), (1, Duration::from_millis(2500)));
}
