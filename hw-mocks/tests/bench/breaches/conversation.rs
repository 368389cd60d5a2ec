//! Times, the life of a request, HELLO.

use std::ops::RangeInclusive;
use std::time::Duration;

use gnc_protocol::Call as _;
use gnc_protocol::calibration::CalibrationRead;
use gnc_protocol::can::CanId;
use gnc_protocol::can::id::{BOARD_EVENTS, IMU_GYRO};
use gnc_protocol::frame::{Flags, Kind, Payload};
use gnc_protocol::message::{
    Abort, AdRead, BoardHello, CanCounters, Identity, MakeSafe, ModulePower, StreamStart, TimerMeasure, event,
};
use gnc_protocol::wire::{FieldReader, Wire};

use super::record::{BOTH, Link, Noted, Record, WAY, ms};
use super::{Case, Rule, check};

/// A request of half a second and one of two.
const SHORT: TimerMeasure = TimerMeasure { timer: 0, period_us: 100_000, count: 5 };
const LONG: TimerMeasure = TimerMeasure { timer: 0, period_us: 100_000, count: 20 };
/// The interval of a timer of a good module is 12 ppm too long: 2 s take 24 us more, rounded down.
const LONG_US: RangeInclusive<u32> = 2_000_023..=2_000_024;
/// The id of the request that is sent twice.
const TWICE: u16 = 2;
/// A message that no board knows.
const UNKNOWN: u16 = 0x7777;

/// One session with everything in it.
fn session(personality: &str, link: Link) -> Record {
    let mut host = Record::new(personality, link);
    host.run(ms(120));
    host.hello(7);
    host.run(ms(300));
    host.post(&ModulePower { on: 1 });
    host.run(ms(400));
    let twice = host.post(&Identity {});
    assert_eq!(twice, TWICE);
    host.run(ms(300));
    host.again(twice, &Identity {});
    host.run(ms(300));
    host.post(&LONG);
    host.run(ms(2400));
    // The second one ends first.
    host.post(&SHORT);
    host.run(ms(50));
    host.post(&Identity {});
    host.run(ms(900));
    host.post(&AdRead { channels: 0, samples: 1 });
    host.run(ms(200));
    let aborted = host.post(&LONG);
    host.run(ms(200));
    host.post(&Abort { request: aborted });
    host.run(ms(300));
    host.post(&StreamStart { stream: 1, rate_hz: 100, count: 20, samples_per_frame: 0 });
    host.run(ms(500));
    host.post(&MakeSafe {});
    host.run(ms(700));
    host.send(Kind::Request, 999, UNKNOWN, Payload::new());
    host.run(ms(200));
    host.fall_silent();
    host.run(ms(4000));
    host
}

/// Whether all gaps between moments are at most this long.
fn never_apart(moments: impl IntoIterator<Item = Duration>, longest: Duration) -> bool {
    moments.into_iter().collect::<Vec<_>>().windows(2).all(|pair| pair[1] - pair[0] <= longest)
}

fn is_new_result(noted: &&Noted) -> bool {
    noted.frame.header.kind == Kind::Result && !noted.frame.header.flags.has(Flags::REPLAYED)
}

fn answered_in_time(record: &Record) -> bool {
    record.requests().into_iter().all(|(at, id, _)| {
        let first =
            record.answers(id).into_iter().find(|noted| matches!(noted.frame.header.kind, Kind::Accept | Kind::Nak));
        first.is_none_or(|first| first.at - at <= ms(50) + WAY)
    })
}

fn accepted_before_result(record: &Record) -> bool {
    record.requests().into_iter().all(|(_, id, _)| {
        let kinds: Vec<Kind> = record.answers(id).iter().map(|noted| noted.frame.header.kind).collect();
        let place = |kind| kinds.iter().position(|known| *known == kind);
        place(Kind::Result).is_none_or(|result| place(Kind::Accept).is_some_and(|accept| accept < result))
    })
}

/// The id of the long request.
fn long(record: &Record) -> u16 {
    record.requests().iter().find(|(_, _, message)| *message == TimerMeasure::ID).unwrap().1
}

fn progress_in_time(record: &Record) -> bool {
    let answers = record.answers(long(record));
    let is_sign = |noted: &&&Noted| noted.frame.header.kind != Kind::Nak;
    let sent = record
        .sent
        .iter()
        .find(|noted| noted.frame.header.request == long(record) && noted.frame.header.kind == Kind::Request)
        .unwrap()
        .at;
    never_apart([sent].into_iter().chain(answers.iter().filter(is_sign).map(|noted| noted.at)), ms(500) + WAY)
}

fn beats_each_second(record: &Record) -> bool {
    let beats: Vec<Duration> = record.beats().iter().map(|(at, _)| *at).collect();
    beats.len() > 1 && beats.windows(2).all(|pair| (pair[1] - pair[0]).abs_diff(ms(1000)) <= ms(20))
}

fn beats_from_the_start(record: &Record) -> bool {
    record.beats().first().is_some_and(|(at, _)| *at < ms(100))
}

fn watchdog_in_time(record: &Record) -> bool {
    let bites: Vec<Duration> = record
        .of(Kind::Event)
        .filter(|noted| noted.frame.header.message == event::WATCHDOG)
        .map(|noted| noted.at)
        .collect();
    bites.len() == 1 && (bites[0] - record.alive_at).abs_diff(ms(1750)) <= WAY
}

fn safe_in_time(record: &Record) -> bool {
    let sent = |&&(_, _, message): &&(Duration, u16, u16)| message == MakeSafe::ID;
    let (at, id, _) = *record.requests().iter().find(sent).unwrap();
    let ended = record.answers(id).iter().find(|noted| noted.frame.header.kind == Kind::Result).map(|noted| noted.at);
    let off = record.power.iter().find(|(off_at, on)| !on && *off_at >= at).map(|(off_at, _)| *off_at);
    ended.is_some_and(|ended| ended - at <= ms(250) && off.is_some_and(|off| off <= ended))
}

fn only_ids_asked_for(record: &Record) -> bool {
    let ids: Vec<u16> = record.sent.iter().map(|noted| noted.frame.header.request).collect();
    record
        .came
        .iter()
        .filter(|noted| noted.frame.header.kind != Kind::Stream)
        .all(|noted| ids.contains(&noted.frame.header.request))
}

fn results_carry_their_message(record: &Record) -> bool {
    let messages: Vec<u16> = record.requests().iter().map(|request| request.2).collect();
    record.of(Kind::Result).all(|noted| messages.contains(&noted.frame.header.message))
}

fn results_carry_their_id(record: &Record) -> bool {
    let asked: Vec<(u16, u16)> = record.requests().iter().map(|request| (request.1, request.2)).collect();
    record.of(Kind::Result).all(|noted| {
        let header = noted.frame.header;
        let known = asked.iter().any(|(id, _)| *id == header.request)
            && asked.iter().any(|(_, message)| *message == header.message);
        !known || asked.contains(&(header.request, header.message))
    })
}

fn version_in_force(record: &Record) -> bool {
    record.came.iter().all(|noted| noted.frame.header.version == u8::from(noted.frame.header.kind != Kind::Hello))
}

/// RS-422 counts all frames; on CAN each channel of messages counts its own, and signs of life and samples none.
fn numbers_rise_by_one(record: &Record) -> bool {
    let channel = |noted: &&Noted| {
        let header = noted.frame.header;
        match record.link {
            Link::Serial => Some(0),
            Link::Can if matches!(header.kind, Kind::Event | Kind::Stream) => None,
            Link::Can => Some(1 + u8::from(header.kind == Kind::Hello || header.message <= Abort::ID)),
        }
    };
    (0..3).all(|wanted| {
        let frames = record.came.iter().filter(|noted| channel(noted) == Some(wanted));
        let numbers: Vec<u16> = frames.map(|noted| noted.frame.header.sequence).collect();
        numbers.windows(2).all(|pair| pair[1] == pair[0].wrapping_add(1))
    })
}

fn streams_have_no_request(record: &Record) -> bool {
    record.of(Kind::Stream).all(|noted| noted.frame.header.request == 0)
}

fn one_result_each(record: &Record) -> bool {
    record.requests().into_iter().all(|(_, id, _)| {
        // The one that was sent twice has a rule of its own.
        id == TWICE || record.answers(id).into_iter().filter(is_new_result).count() <= 1
    })
}

fn elapsed_is_board_time(record: &Record) -> bool {
    let answers = record.answers(long(record));
    let result = answers.iter().find(|noted| noted.frame.header.kind == Kind::Result);
    let elapsed_us = |payload: &[u8]| u32::from_le_bytes([payload[2], payload[3], payload[4], payload[5]]);
    result.is_none_or(|noted| LONG_US.contains(&elapsed_us(&noted.frame.payload)))
}

fn progress_up_to_1000(record: &Record) -> bool {
    record.of(Kind::Progress).all(|noted| u16::from_le_bytes([noted.frame.payload[0], noted.frame.payload[1]]) <= 1000)
}

fn nothing_after_the_result(record: &Record) -> bool {
    record.requests().into_iter().filter(|(_, id, _)| *id != TWICE).all(|(_, id, _)| {
        let kinds: Vec<Kind> = record.answers(id).iter().map(|noted| noted.frame.header.kind).collect();
        let result = kinds.iter().position(|kind| *kind == Kind::Result);
        result.is_none_or(|result| !kinds[result..].contains(&Kind::Progress))
    })
}

fn known_status(record: &Record) -> bool {
    record.of(Kind::Result).all(|noted| u16::from_le_bytes([noted.frame.payload[0], noted.frame.payload[1]]) <= 3)
}

fn known_code(record: &Record) -> bool {
    record.of(Kind::Nak).all(|noted| u16::from_le_bytes([noted.frame.payload[0], noted.frame.payload[1]]) <= 10)
}

/// What came after the second copy of the request that was sent twice.
fn after_second_copy(record: &Record) -> Vec<&Noted> {
    let mut copies = record
        .sent
        .iter()
        .filter(|noted| noted.frame.header.kind == Kind::Request && noted.frame.header.request == TWICE);
    let second = copies.next_back().unwrap().at;
    record.answers(TWICE).into_iter().filter(|noted| noted.at > second).collect()
}

fn a_second_copy_starts_nothing(record: &Record) -> bool {
    !after_second_copy(record).iter().any(|noted| noted.frame.header.kind == Kind::Accept)
}

fn a_replay_is_marked(record: &Record) -> bool {
    let after = after_second_copy(record);
    let ran = after.iter().any(|noted| noted.frame.header.kind == Kind::Accept);
    ran || after
        .iter()
        .filter(|noted| noted.frame.header.kind == Kind::Result)
        .all(|noted| noted.frame.header.flags.has(Flags::REPLAYED))
}

/// The board's HELLO, by its fields alone, and how many bytes are left behind them.
fn hello(record: &Record) -> Option<(Duration, BoardHello, usize)> {
    let noted = record.of(Kind::Hello).next()?;
    let mut reader = FieldReader::new(&noted.frame.payload);
    let hello = BoardHello::get(&mut reader).ok()?;
    Some((noted.at, hello, reader.take_rest().len()))
}

fn hello_in_time(record: &Record) -> bool {
    let asked = record.sent.iter().find(|noted| noted.frame.header.kind == Kind::Hello).unwrap().at;
    hello(record).is_some_and(|(at, _, _)| at - asked <= ms(50) + WAY)
}

fn hello_says(record: &Record, right: impl Fn(&BoardHello) -> bool) -> bool {
    hello(record).is_none_or(|(_, hello, _)| right(&hello))
}

const RULES: [Rule; 27] = [
    ("ACCEPT and NAK within 50 ms", answered_in_time),
    ("ACCEPT before RESULT", accepted_before_result),
    ("PROGRESS within 500 ms", progress_in_time),
    ("a heartbeat each second", beats_each_second),
    ("a heartbeat at the start", beats_from_the_start),
    ("the watchdog at 1750 ms", watchdog_in_time),
    ("MAKE_SAFE within 250 ms", safe_in_time),
    ("no id but those asked for", only_ids_asked_for),
    ("the message of the request", results_carry_their_message),
    ("the id of the request", results_carry_their_id),
    ("the version in force", version_in_force),
    ("numbers rise by one", numbers_rise_by_one),
    ("streams have request id 0", streams_have_no_request),
    ("one RESULT each", one_result_each),
    ("elapsed_us is board time", elapsed_is_board_time),
    ("done_permille up to 1000", progress_up_to_1000),
    ("RESULT is the end", nothing_after_the_result),
    ("a status of the document", known_status),
    ("a NAK code of the document", known_code),
    ("a second copy starts nothing", a_second_copy_starts_nothing),
    ("a replay is marked", a_replay_is_marked),
    ("HELLO within 50 ms", hello_in_time),
    ("HELLO echoes the nonce", |record| hello_says(record, |hello| hello.nonce == 7)),
    ("HELLO and heartbeat tell one boot id", |record| {
        let beats = record.beats();
        hello_says(record, |hello| beats.iter().all(|(_, beat)| beat.boot_id == hello.boot_id))
    }),
    ("HELLO ends with its last field", |record| hello(record).is_none_or(|(_, _, left)| left == 0)),
    ("the version chosen is the highest of both", |record| hello_says(record, |hello| hello.chosen == 1)),
    ("the version chosen is in the range told", |record| {
        hello_says(record, |hello| (hello.lowest..=hello.highest).contains(&hello.chosen))
    }),
];

const SERIAL: &[Link] = &[Link::Serial];

const CASES: [Case; 36] = [
    ("accept_after_ms = 80", &BOTH, &["ACCEPT and NAK within 50 ms"]),
    ("accept_after_ms = 80\naccept_late_every = 3", &BOTH, &["ACCEPT and NAK within 50 ms"]),
    ("progress_every_ms = 900", &BOTH, &["PROGRESS within 500 ms"]),
    ("progress_every_ms = 0", &BOTH, &["PROGRESS within 500 ms"]),
    ("heartbeat_every_ms = 1500", &BOTH, &["a heartbeat each second"]),
    ("heartbeat_every_ms = 300", &BOTH, &["a heartbeat each second"]),
    ("heartbeat_every_ms = 0", &BOTH, &["a heartbeat each second", "a heartbeat at the start"]),
    ("lost_first_heartbeats = 2", &BOTH, &["a heartbeat at the start"]),
    ("watchdog_ms = 1200", &BOTH, &["the watchdog at 1750 ms"]),
    ("watchdog_ms = 3000", &BOTH, &["the watchdog at 1750 ms"]),
    ("watchdog_ms = 0", &BOTH, &["the watchdog at 1750 ms"]),
    ("make_safe_after_ms = 400", &BOTH, &["MAKE_SAFE within 250 ms"]),
    ("no_accept = true", &BOTH, &["ACCEPT before RESULT"]),
    ("answers_nobody = \"accept\"", &BOTH, &["no id but those asked for"]),
    ("answers_nobody = \"result\"", &BOTH, &["no id but those asked for"]),
    (
        "swaps_request_ids = true",
        &BOTH, // PROGRESS of the one that still runs follows the RESULT under its id.
        &["the id of the request", "RESULT is the end"],
    ),
    ("wrong_message_id = true", &BOTH, &["the message of the request"]),
    ("header_version = 2", &BOTH, &["the version in force"]),
    ("sequence_stands_every = 3", &BOTH, &["numbers rise by one"]),
    ("sequence_back_every = 3", &BOTH, &["numbers rise by one"]),
    ("stream_request_id = 7", SERIAL, &["streams have request id 0"]),
    ("double_result = true", &BOTH, &["one RESULT each"]),
    ("elapsed_us_times = 0", &BOTH, &["elapsed_us is board time"]),
    ("elapsed_us_times = 100", &BOTH, &["elapsed_us is board time"]),
    ("progress_permille = 1100", &BOTH, &["done_permille up to 1000"]),
    ("progress_after_result = true", &BOTH, &["RESULT is the end"]),
    ("result_status = 77\nresult_status_every = 2", &BOTH, &["a status of the document"]),
    ("nak_code = 99", &BOTH, &["a NAK code of the document"]),
    ("replay_runs_again = true", &BOTH, &["a second copy starts nothing"]),
    ("replay_without_flag = true", &BOTH, &["a replay is marked"]),
    ("hello_after_ms = 80", &BOTH, &["HELLO within 50 ms"]),
    ("wrong_nonce = true", &BOTH, &["HELLO echoes the nonce"]),
    ("other_boot_id_in_hello = true", &BOTH, &["HELLO and heartbeat tell one boot id"]),
    ("hello_extra_bytes = 1", &BOTH, &["HELLO ends with its last field"]),
    (
        "hello_chosen = 2",
        &BOTH,
        &["the version chosen is the highest of both", "the version chosen is in the range told"],
    ),
    ("hello_versions = [2, 1]", &BOTH, &["the version chosen is in the range told"]),
];

#[test]
fn each_board_breaks_its_rule_of_the_conversation_and_no_other() {
    check(&RULES, &CASES, session);
}

/// A board that does not hear HELLO lives: its heartbeats come.
#[test]
fn a_board_is_deaf_to_hello_alone() {
    for link in BOTH {
        let mut host = Record::new("[board]\ndeaf_to_hello = true\n", link);
        host.hello(7);
        host.run(ms(100));
        let power = host.post(&ModulePower { on: 1 });
        host.run(ms(3000));
        assert_eq!(host.of(Kind::Hello).count(), 0);
        assert_eq!(host.answers(power)[0].frame.payload[0], 1, "no session");
        assert!(beats_each_second(&host) && beats_from_the_start(&host));
    }
}

/// Boards without a switch, without CAN, without a calibration: they say so and act so.
#[test]
fn a_board_lacks_what_its_capabilities_lack() {
    let capabilities = |record: &Record| hello(record).unwrap().1.capabilities;
    let code = |record: &Record, id| {
        let answer = record.answers(id)[0];
        (answer.frame.header.kind == Kind::Nak).then(|| answer.frame.payload[0])
    };
    let ask = |keys: &str, link| {
        let mut host = Record::new(&format!("[board]\n{keys}\n"), link);
        host.hello(7);
        host.run(ms(100));
        host
    };
    for link in BOTH {
        let mut host = ask("no_power_switch = true", link);
        let (power, who) = (host.post(&ModulePower { on: 1 }), host.post(&Identity {}));
        host.run(ms(300));
        assert_eq!((capabilities(&host), code(&host, power), code(&host, who)), (0b110, Some(9), None));
        host.post(&MakeSafe {});
        host.run(ms(1000));
        assert!(host.beats().iter().all(|(_, beat)| beat.state & 2 != 0), "always under power");

        let mut host = ask("no_calibration = true", link);
        host.post(&ModulePower { on: 1 });
        host.run(ms(300));
        let read = host.post(&CalibrationRead {});
        let stream = host.post(&StreamStart { stream: 4, rate_hz: 100, count: 0, samples_per_frame: 0 });
        host.run(ms(300));
        assert_eq!((capabilities(&host), code(&host, read), code(&host, stream)), (0b011, Some(9), Some(9)));
    }
    let mut host = ask("no_can = true", Link::Serial);
    host.post(&ModulePower { on: 1 });
    host.run(ms(300));
    let counters = host.post(&CanCounters {});
    host.run(ms(1000));
    assert_eq!((capabilities(&host), code(&host, counters), host.can_frames.len()), (0b101, Some(9), 0));
    let mut mute = ask("no_can = true", Link::Can);
    mute.run(ms(2000));
    assert_eq!(mute.can_frames.len(), 0);
    // A good board speaks on both links from its start on.
    let mut good = ask("", Link::Can);
    good.run(ms(1000));
    assert!(good.can_frames.iter().any(|frame| frame.id() == CanId::Standard(BOARD_EVENTS)));
    assert!(!good.can_frames.iter().any(|frame| frame.id() == CanId::Standard(IMU_GYRO)));
}

/// The times are those of the keys, to the way on the line.
#[test]
fn late_is_as_late_as_the_key_says() {
    let near = |span: Duration, wanted: u64| span.abs_diff(ms(wanted)) <= 2 * WAY;
    for link in BOTH {
        let record = |keys: &str| session(&format!("[board]\n{keys}\n"), link);

        let late = record("accept_after_ms = 80\naccept_late_every = 3");
        let first = |(at, id, _): (Duration, u16, u16)| late.answers(id).first().map(|noted| noted.at - at);
        let delays: Vec<Duration> = late.requests().into_iter().filter_map(first).collect();
        let (third, others): (Vec<Duration>, Vec<Duration>) = delays.iter().partition(|delay| near(**delay, 80));
        // The second copy of a request that ended gets no ACCEPT, and is not counted.
        assert!(third.len() == delays.len() / 3 && others.iter().all(|delay| *delay <= WAY), "{link:?}: {delays:?}");

        let slow = record("progress_every_ms = 900");
        let signs: Vec<Duration> = slow.answers(long(&slow)).iter().map(|noted| noted.at).collect();
        assert!(near(signs[1] - signs[0], 900) && near(signs[2] - signs[1], 900), "{link:?}: {signs:?}");

        let rare = record("heartbeat_every_ms = 1500");
        let beats = rare.beats();
        assert!(beats.windows(2).all(|pair| (pair[1].0 - pair[0].0).abs_diff(ms(1500)) <= WAY), "{link:?}");

        for wanted in [1200, 3000] {
            let watched = record(&format!("watchdog_ms = {wanted}"));
            let bite = watched.of(Kind::Event).find(|noted| noted.frame.header.message == event::WATCHDOG).unwrap();
            assert!(near(bite.at - watched.alive_at, wanted), "{link:?}");
        }

        let unsafe_for = record("make_safe_after_ms = 400");
        let (asked, id, _) = *unsafe_for.requests().iter().find(|request| request.2 == MakeSafe::ID).unwrap();
        let (off, on) = *unsafe_for.power.last().unwrap();
        let ended = unsafe_for.answers(id).last().unwrap().at;
        assert!(!on && near(off - asked, 400) && near(ended - asked, 400), "{link:?}");
    }
}
