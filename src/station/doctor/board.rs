//! Asks the board at the other end of a line who it is: listens for heartbeats, then says HELLO.
//!
//! A HELLO begins a session, and so ends one that another program has. Without power and requests such a session ends by
//! itself two seconds later.

use std::time::Duration;

use gnc_link::{Link, NoFrame};
use gnc_protocol::message::{BoardHello, Heartbeat, HostHello, MAGIC, capability, event};
use gnc_protocol::wire::Wire as _;
use gnc_protocol::{Flags, Frame, Header, Kind, PROTOCOL_VERSION, timing};
use gnc_text::printable;
use tokio::time::{Instant, timeout_at};

use super::Finding;

/// Longest time to listen for a heartbeat of a board without a session. Three heartbeats missed mean that there is none,
/// and the watchdog ends a session whose host is gone within two seconds.
const LISTEN_FOR: Duration = Duration::from_millis(3500);
/// Time between two HELLOs; longer on a slow line. The interface document asks for it.
const HELLO_EVERY: Duration = Duration::from_millis(250);
/// Time for which HELLO is repeated: a board that is starting listens after two seconds.
const HELLO_FOR: Duration = Duration::from_millis(2500);
/// Payload of the longer HELLO, which is the board's, at most.
const HELLO_BYTES: usize = 128;
/// Part of an answer's time that this computer and its adapter may take: a latency timer of 16 ms both ways, and a busy
/// computer.
const HOST_SLACK: Duration = Duration::from_millis(100);
/// One damaged frame may be the rest of a frame: the port may have opened in the middle of it.
const CUT_OFF: u32 = 1;

/// Whether HELLO may be said.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MayAsk {
    /// Nobody else uses the line. A board that works for somebody is still not asked.
    Yes,
    /// Somebody may use the line: only the heartbeat of a board without work shows that no session is broken off.
    AfterHeartbeat,
    /// Somebody uses a line to the board.
    No,
}

/// What was heard of a board.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Heard {
    /// The port or interface, for people.
    pub(super) line: String,
    /// Whether it is a CAN bus.
    pub(super) is_can: bool,
    /// How long the line was listened to before the first HELLO.
    pub(super) listened: Duration,
    /// Bytes that came; on CAN, frames under any id.
    pub(super) came: u64,
    /// Whole frames of the board.
    pub(super) frames: u32,
    /// Frames that were damaged.
    pub(super) damaged: u32,
    /// The last heartbeat.
    pub(super) beat: Option<Heartbeat>,
    /// The version in the header of a frame that is not a HELLO, if it is not this station's.
    pub(super) foreign_version: Option<u8>,
    /// HELLOs that were said.
    pub(super) asked: u32,
    /// The answer to HELLO, and its time.
    pub(super) answer: Option<(BoardHello, Duration)>,
    /// An answer to HELLO that cannot be read.
    pub(super) unreadable: bool,
    /// The time that the interface document allows for an answer on this line, and the slack of this computer.
    pub(super) allowed: Duration,
    /// Why the link ended.
    pub(super) broke: Option<String>,
}

impl Heard {
    /// What the board does for somebody else: then a HELLO would break it off.
    fn works_for_another(&self) -> Option<&'static str> {
        let state = self.beat.as_ref()?.state;
        [(1, "has a session"), (2, "has the module under power"), (4, "runs a request"), (8, "sends samples")]
            .into_iter()
            .find_map(|(bit, what)| (state & bit != 0).then_some(what))
    }
}

/// Listens to a line and then says HELLO, unless that may break off a session. `nonce` must not be that of an earlier
/// session.
pub(super) async fn ask(mut link: Link, nonce: u32, may_ask: MayAsk) -> Heard {
    let allowed = timing::ACCEPT_WITHIN + link.exchange_time(HELLO_BYTES) + HOST_SLACK;
    let is_can = matches!(link, Link::Can(_));
    let mut heard = Heard { line: link.name(), is_can, allowed, ..Heard::default() };
    let began = Instant::now();
    listen(&mut link, &mut heard, began + LISTEN_FOR).await;
    heard.listened = began.elapsed();
    let may_ask = match may_ask {
        MayAsk::Yes => heard.works_for_another().is_none(),
        MayAsk::AfterHeartbeat => heard.beat.is_some() && heard.works_for_another().is_none(),
        MayAsk::No => false,
    };
    if may_ask && heard.broke.is_none() {
        greet(&mut link, &mut heard, nonce).await;
    }
    let counters = link.counters();
    heard.came = link.came();
    heard.damaged = counters.bad_checksum + counters.malformed;
    link.close().await;
    heard
}

/// Listens until a board without work has shown itself.
async fn listen(link: &mut Link, heard: &mut Heard, until: Instant) {
    while let Some(frame) = next(link, heard, until).await {
        take(heard, &frame);
        if heard.beat.is_some() && heard.works_for_another().is_none() {
            return;
        }
    }
}

async fn greet(link: &mut Link, heard: &mut Heard, nonce: u32) {
    let every = HELLO_EVERY.max(link.exchange_time(HELLO_BYTES) * 5);
    let began = Instant::now();
    let mut said = Vec::new();
    while began.elapsed() < HELLO_FOR && heard.answer.is_none() && heard.broke.is_none() {
        heard.asked += 1;
        // The board echoes the number, so an answer that is late still tells which HELLO it answers.
        said.push(Instant::now());
        link.send(&hello(heard.asked as u16, nonce));
        let until = Instant::now() + every;
        while let Some(frame) = next(link, heard, until).await {
            take(heard, &frame);
            if frame.header.kind != Kind::Hello {
                continue;
            }
            let Ok(hello) = BoardHello::from_payload(&frame.payload) else {
                heard.unreadable = true;
                continue;
            };
            let at = usize::from(frame.header.request).checked_sub(1).and_then(|place| said.get(place));
            if hello.magic == MAGIC && hello.nonce == nonce {
                let took = at.or(said.first()).map_or(Duration::ZERO, Instant::elapsed);
                heard.answer = Some((hello, took));
                return;
            }
        }
    }
}

fn hello(request: u16, nonce: u32) -> Frame {
    let hello = HostHello { magic: MAGIC, lowest: PROTOCOL_VERSION, highest: PROTOCOL_VERSION, nonce };
    let (kind, flags) = (Kind::Hello, Flags::default());
    let header = Header { version: 0, kind, flags, request, message: 0, sequence: request };
    Frame { header, payload: hello.to_payload().unwrap_or_default() }
}

/// The next whole frame; `None` when the time is over or the line is gone.
async fn next(link: &mut Link, heard: &mut Heard, until: Instant) -> Option<Frame> {
    loop {
        match timeout_at(until, link.next(true)).await {
            Err(_) => return None,
            Ok(Ok(Ok(frame))) => return Some(frame),
            Ok(Ok(Err(NoFrame::Damaged { .. } | NoFrame::Back { .. }))) => {}
            Ok(Ok(Err(NoFrame::Away))) => {
                heard.broke = Some("it went away".to_owned());
                return None;
            }
            Ok(Err(error)) => {
                heard.broke = Some(error.to_string());
                return None;
            }
        }
    }
}

fn take(heard: &mut Heard, frame: &Frame) {
    heard.frames = heard.frames.saturating_add(1);
    let Header { version, kind, message, .. } = frame.header;
    if kind != Kind::Hello && version != PROTOCOL_VERSION {
        heard.foreign_version = Some(version);
    }
    if kind == Kind::Event && message == event::HEARTBEAT {
        heard.beat = Heartbeat::from_payload(&frame.payload).ok();
    }
}

/// The findings from what was heard.
pub(super) fn findings(heard: &Heard) -> Vec<Finding> {
    let line = &heard.line;
    if let Some(why) = &heard.broke {
        return vec![Finding::bad(format!("{line}: {why}"), "check the adapter's plug and cable")];
    }
    let mut found = Vec::new();
    match &heard.answer {
        Some((hello, took)) => found.extend(answered(heard, hello, *took)),
        None => found.push(unanswered(heard)),
    }
    if heard.damaged > CUT_OFF && heard.frames > 0 {
        let what = format!("{line}: {} frames came damaged, {} whole", heard.damaged, heard.frames);
        found.push(Finding::warning(what, if heard.is_can { DAMAGED_CAN } else { DAMAGED_SERIAL }));
    }
    found
}

const DAMAGED_SERIAL: &str = "check cable, termination and ground; a second program that reads the port takes bytes away too, and root sees \
                              those of all users: `sudo gnc-station doctor`";
const DAMAGED_CAN: &str = "measure 60 ohm between CAN_H and CAN_L with the power off; check the cable";
const DEAF_SERIAL: &str =
    "the board does not hear this computer: check the pair from the adapter's transmitter to the board's receiver";
const DEAF_CAN: &str = "compare the board's firmware with the interface document, section 17";
const SILENT_SERIAL: &str =
    "is the board under power? check the pair from the board's transmitter to the adapter's receiver";
const SILENT_CAN: &str = "is the board under power, and does its firmware have CAN? check the cable";
const GARBLED: &str = "are both ends set to the same rate? RS-422: are A and B of a pair swapped?";
const OTHER_VERSION: &str = "update the board's firmware or the station so that they share a version";

fn answered(heard: &Heard, hello: &BoardHello, took: Duration) -> Vec<Finding> {
    let line = &heard.line;
    let who = format!("board {} (firmware {})", printable(hello.serial.as_str()), printable(hello.firmware.as_str()));
    let (lowest, highest) = (hello.lowest, hello.highest);
    let versions =
        if lowest == highest { format!("version {lowest}") } else { format!("versions {lowest} to {highest}") };
    if hello.chosen != PROTOCOL_VERSION {
        let what = format!("{line}: {who} speaks protocol {versions}, this station speaks version {PROTOCOL_VERSION}");
        return vec![Finding::bad(what, OTHER_VERSION)];
    }
    let what = format!(
        "{line}: {who} answers HELLO in {} ms: boot id {:08x}, protocol {versions}, {}",
        took.as_millis(),
        hello.boot_id,
        capabilities(hello.capabilities)
    );
    let mut found = vec![Finding::good(what)];
    if took > heard.allowed {
        let what = format!(
            "{line}: the answer to HELLO took {} ms, more than {} ms",
            took.as_millis(),
            heard.allowed.as_millis()
        );
        found.push(Finding::warning(
            what,
            "see if this computer is busy; the board must answer within 50 ms (interface document)",
        ));
    }
    match &heard.beat {
        None => {
            let what =
                format!("{line}: the board answers HELLO, but sent no heartbeat in {} ms", heard.listened.as_millis());
            found.push(Finding::bad(
                what,
                "compare the board's firmware with the interface document: a heartbeat each second",
            ));
        }
        Some(beat) if beat.boot_id != hello.boot_id => {
            let what = format!(
                "{line}: the boot id is {:08x} in the heartbeat and {:08x} in the answer to HELLO",
                beat.boot_id, hello.boot_id
            );
            let mend =
                "if the board did not restart just now, compare its firmware with the interface document, section 6";
            found.push(Finding::warning(what, mend));
        }
        Some(_) => {}
    }
    found
}

fn unanswered(heard: &Heard) -> Finding {
    let Heard { line, came, damaged, .. } = heard;
    let kind = if heard.is_can { "frames" } else { "bytes" };
    let waited = format!("{:.1} s", heard.listened.as_secs_f64());
    if let Some(does) = heard.works_for_another() {
        let what = format!(
            "{line}: the board {does}, so another program works with it; no HELLO was said, since that would end its session"
        );
        return Finding::warning(what, "wait until that run has ended, then ask again");
    }
    let asked = match heard.asked {
        0 => "not asked".to_owned(),
        asked => format!("no answer to {asked} HELLO"),
    };
    if let Some(version) = heard.foreign_version {
        let what = format!(
            "{line}: frames of protocol version {version} come, this station speaks version {PROTOCOL_VERSION}; {asked}"
        );
        return Finding::bad(what, OTHER_VERSION);
    }
    if heard.unreadable {
        let what = format!("{line}: the board's answer to HELLO cannot be read");
        return Finding::bad(what, "compare the board's firmware with the interface document, section 6");
    }
    if let Some(beat) = &heard.beat {
        let what = format!("{line}: a board with boot id {:08x} sends heartbeats; {asked}", beat.boot_id);
        return if heard.asked > 0 {
            Finding::bad(what, if heard.is_can { DEAF_CAN } else { DEAF_SERIAL })
        } else {
            Finding::good(what)
        };
    }
    match (came, heard.frames, damaged) {
        (0, ..) => {
            let what = format!("{line}: nothing came in {waited}; {asked}");
            Finding::bad(what, if heard.is_can { SILENT_CAN } else { SILENT_SERIAL })
        }
        (_, 1.., _) => {
            let what = format!("{line}: the board sends frames, but no heartbeat in {waited}; {asked}");
            Finding::bad(what, "compare the board's firmware with the interface document: a heartbeat each second")
        }
        (_, 0, 0..=CUT_OFF) => {
            let mend = if heard.is_can {
                "no frame has an id of the board: see that the board is on this bus"
            } else {
                GARBLED
            };
            Finding::bad(format!("{line}: {came} {kind} came, and no frame of the board among them; {asked}"), mend)
        }
        (_, 0, _) => {
            let what = format!("{line}: {came} {kind} came with {damaged} damaged frames and none whole; {asked}");
            Finding::bad(what, if heard.is_can { DAMAGED_CAN } else { GARBLED })
        }
    }
}

/// What the board can do, in words.
fn capabilities(bits: u32) -> String {
    let known = [
        (capability::POWER, "switches the module's supply"),
        (capability::CAN, "has CAN"),
        (capability::CALIBRATION, "keeps a calibration"),
        (capability::REPEATED_READINGS, "its sensors have an oscillator of their own"),
    ];
    let told: Vec<&str> = known.into_iter().filter_map(|(bit, what)| (bits & bit != 0).then_some(what)).collect();
    let unknown = bits & !known.into_iter().fold(0, |all, (bit, _)| all | bit);
    let mut told = if told.is_empty() { "without any capability".to_owned() } else { told.join(", ") };
    if unknown != 0 {
        told.push_str(&format!(", unknown capabilities {unknown:#x}"));
    }
    told
}
