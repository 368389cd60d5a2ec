//! Section 17: CAN.

mod transfer;

use std::time::Duration;

use gnc_protocol::can::isotp::FlowSettings;
use gnc_protocol::can::{CanFrame, CanId, id};
use gnc_protocol::message::{
    Abort, CanCounters, LinkCounters, MakeSafe, ModulePower, StreamStart, StreamStop, capability,
};
use gnc_protocol::{Call as _, Kind, PROTOCOL_VERSION};
use tokio::time::Instant;

use crate::check::checks;
use crate::driver::{Asked, Driver, NO_MESSAGE, ms, name_of};
use crate::raw::{RawHeader, frame_bytes};
use crate::stop::{Verdict, demand, failed};
use transfer::{Transfer, begun, flow_after, send, send_by_hand, transfers};

checks! { 17:
    "can.capability" Session has_capability "a board that has CAN sets capability bit 1",
    "can.heartbeat" Session heartbeat "a heartbeat is two frames 0x011 in order, with the same beat, which counts up",
    "can.ids" Session ids "HELLO, MAKE_SAFE and ABORT are answered under 0x021, all else under 0x101",
    "can.transfers" Session whole "a message is a first frame of 8 bytes and consecutive frames 1..F, 0, 1..",
    "can.flow-control" Session flow_control "flow control comes at once, with status 0",
    "can.separation" Session separation "a sender keeps its frames STmin apart and waits for flow control after each block",
    "can.padding" Session padding "frames may be padded to 8 bytes with anything",
    "can.bad-checksum" Session bad_checksum "a message with a wrong checksum gets no answer",
    "can.unknown-kind" Session unknown_kind "a message of kind 8 to 15 is dropped",
    "can.out-of-turn" Session out_of_turn "a consecutive frame out of its turn: the receiver forgets the message, in silence",
    "can.stray" Session stray "a consecutive frame and flow control that nobody waits for mean nothing",
    "can.first-amid" Session first_amid "a first frame amid a message: the message before is forgotten, the new one begins",
    "can.single-frame" Session single_frame "receivers take a single frame, though no message of this version is that short",
    "can.too-long" Session too_long "a message of more than 524 bytes gets flow control with status 2",
    "can.foreign-ids" Session foreign_ids "both ends pass over ids that do not stand in the document, and extended ids of the same numbers",
    "can.urgent" Session urgent "the urgent channel overtakes a long request that is half way through",
    "can.link-counters" Session link_counters "LinkCounters count messages, and transfers that broke off are malformed",
    "can.imu" Powered imu_frames "an IMU sample is 0x200, 0x201, 0x202 in this order, with mark and clock before the first and each 64th",
    "can.echo" Powered echo "under power the module sends test frames back under their other ids, in their order",
    "can.no-echo" Session no_echo "without power no test frame comes back",
}

/// How long a message without an answer is watched.
const NO_ANSWER_WITHIN: Duration = Duration::from_millis(200);
/// "Flow control comes at once": as late as an answer may be, with what this computer adds.
const AT_ONCE: Duration = Duration::from_millis(70);
/// The longest HELLO, 95 bytes, takes 13 pauses of 20 ms.
const SEPARATED_WITHIN: Duration = Duration::from_millis(900);
/// From one heartbeat to the next, and a little.
const BEATS: Duration = Duration::from_millis(3200);
/// Test frames that are sent, fewer than an adapter holds.
const TEST_FRAMES: u8 = 24;
/// Samples from one mark to the next.
const MARK_EVERY: u32 = 64;
/// Bits of a sample's number in each of its frames.
const NUMBER: u64 = 0x3FF;

async fn has_capability(driver: &mut Driver) -> Verdict {
    let bits = driver.board().capabilities;
    demand(driver.can_do(capability::CAN), || format!("capabilities 0x{bits:X}, on CAN"))?;
    Ok(format!("0x{bits:X}"))
}

async fn heartbeat(driver: &mut Driver) -> Verdict {
    driver.begin_tape();
    driver.listen(BEATS).await?;
    let of_beats = driver.tape().frames.iter().filter(|frame| frame.id() == CanId::Standard(id::BOARD_EVENTS));
    let frames: Vec<&[u8]> = of_beats.map(CanFrame::data).collect();
    let boot_id = driver.board().boot_id.to_le_bytes();
    let mut beats = Vec::new();
    let mut open = None;
    for data in frames {
        demand(data.len() == 8, || format!("a frame of {} bytes: {data:02X?}", data.len()))?;
        match data[0] {
            0 => {
                demand(data[2..6] == boot_id, || format!("boot id {:02X?}, HELLO said {boot_id:02X?}", &data[2..6]))?;
                demand(data[7] == 0, || format!("the last byte is {:02X}", data[7]))?;
                open = Some(data[1]);
            }
            // The tape may begin between the two.
            1 if open.is_none() && beats.is_empty() => {}
            1 => {
                demand(open.take() == Some(data[1]), || {
                    format!("the second frame of beat {} without the first", data[1])
                })?;
                beats.push(data[1]);
            }
            other => return failed(format!("a frame whose first byte is {other:02X}")),
        }
    }
    demand(beats.len() >= 2, || format!("{} heartbeats in {}", beats.len(), ms(BEATS)))?;
    for pair in beats.windows(2) {
        demand(pair[1] == pair[0].wrapping_add(1), || format!("beat {} was followed by {}", pair[0], pair[1]))?;
    }
    Ok(format!("beats {beats:?}"))
}

/// Some messages under both ids of the board.
async fn some_traffic(driver: &mut Driver) -> Verdict<()> {
    driver.begin_tape();
    let nonce = driver.nonce();
    driver.greet((1, 1), nonce, 1).await?;
    driver.ask(&LinkCounters {}).await?;
    driver.ask(&Abort { request: 0x7ABC }).await?;
    driver.ask(&MakeSafe {}).await?;
    let asked = driver.post_raw(NO_MESSAGE, &[0x5A; 512]);
    driver.refused(&asked, 2, "that no version has").await.map(|_| ())
}

async fn ids(driver: &mut Driver) -> Verdict {
    some_traffic(driver).await?;
    let known = [id::BOARD_EVENTS, id::URGENT_TO_HOST, id::WORK_TO_HOST];
    for frame in &driver.tape().frames {
        let stands = matches!(frame.id(), CanId::Standard(number) if known.contains(&number));
        demand(stands, || format!("a frame under {:?}", frame.id()))?;
    }
    let mut counts = [0, 0];
    for transfer in transfers(&driver.tape().frames)? {
        let Transfer { under, bytes } = transfer;
        let (kind, message) = (bytes[0] & 0x0F, u16::from_le_bytes([bytes[4], bytes[5]]));
        let urgent = kind == Kind::Hello as u8 || message == MakeSafe::ID || message == Abort::ID;
        let expected = if urgent { id::URGENT_TO_HOST } else { id::WORK_TO_HOST };
        demand(under == expected, || format!("a message of kind {kind}, {}, under 0x{under:03X}", name_of(message)))?;
        counts[usize::from(urgent)] += 1;
    }
    Ok(format!("{} messages under 0x021, {} under 0x101", counts[1], counts[0]))
}

async fn whole(driver: &mut Driver) -> Verdict {
    some_traffic(driver).await?;
    let transfers = transfers(&driver.tape().frames)?;
    demand(transfers.len() >= 8, || format!("{} messages of 9", transfers.len()))?;
    Ok(format!("{} messages", transfers.len()))
}

async fn flow_control(driver: &mut Driver) -> Verdict {
    some_traffic(driver).await?;
    let mut came = [0, 0];
    for frame in &driver.tape().frames {
        if let (CanId::Standard(under), [first, ..]) = (frame.id(), frame.data())
            && first >> 4 == 3
        {
            demand(frame.data().len() >= 3, || format!("flow control of {} bytes", frame.data().len()))?;
            demand(*first == 0x30, || format!("flow control with status {}", first & 0x0F))?;
            came[usize::from(under == id::URGENT_TO_HOST)] += 1;
        }
    }
    demand(came == [2, 3], || format!("{} under 0x101 and {} under 0x021, of 2 and 3 messages", came[0], came[1]))?;
    Ok(format!("once for each of 5 messages, within {}", ms(AT_ONCE)))
}

async fn separation(driver: &mut Driver) -> Verdict {
    let nonce = driver.nonce();
    let mut said = Vec::new();
    for (block_size, st_min_ms) in [(0, 20), (1, 0), (2, 20)] {
        driver.ask_for(FlowSettings { block_size, st_min: st_min_ms });
        let sent = Instant::now();
        let from = driver.say_hello((1, 1), nonce, 1);
        let answer = driver.hello_after(from, SEPARATED_WITHIN).await;
        driver.ask_for(FlowSettings::default());
        let Some((frame, at)) = answer? else {
            return failed(format!("no answer to HELLO with blocks of {block_size} and {st_min_ms} ms apart"));
        };
        // Six bytes are in the first frame, seven in each after it. A pause stands between two frames of a block.
        let frames = u32::try_from((frame.payload.len() + 12 - 6).div_ceil(7)).unwrap_or(u32::MAX);
        let pauses = match u32::from(block_size) {
            0 => frames.saturating_sub(1),
            size => frames - frames.div_ceil(size),
        };
        let least = Duration::from_millis(st_min_ms.into()) * pauses;
        demand(at - sent >= least, || {
            format!("{frames} frames, {st_min_ms} ms apart, in blocks of {block_size} came within {}", ms(at - sent))
        })?;
        said.push(ms(at - sent));
    }
    Ok(format!("{}: 20 ms apart, one by one, both", said.join(", ")))
}

/// A REQUEST as the bytes of a message, and what would answer it.
fn request(driver: &mut Driver, kind: u8, message: u16, payload: &[u8]) -> (Asked, Vec<u8>) {
    let asked = Asked { request: driver.next_request(), message, from: driver.mark(), sent: Instant::now() };
    let header = RawHeader { version: PROTOCOL_VERSION, kind, flags: 0, request: asked.request, message };
    (asked, frame_bytes(header, 0, payload))
}

const REQUEST: u8 = Kind::Request as u8;

async fn padding(driver: &mut Driver) -> Verdict {
    let (asked, bytes) = request(driver, REQUEST, LinkCounters::ID, &[]);
    send_by_hand(driver, &bytes, Some(0xCC)).await?;
    driver.end_of(&asked).await?.body()?;
    let (asked, bytes) = request(driver, REQUEST, LinkCounters::ID, &[]);
    send_by_hand(driver, &bytes, None).await?;
    driver.end_of(&asked).await?.body()?;
    Ok("a request padded with CC and one without padding were done".to_owned())
}

/// Ends the check as failed unless a request is done.
async fn goes_on(driver: &mut Driver) -> Verdict<()> {
    driver.ask(&LinkCounters {}).await.map(|_| ())
}

async fn bad_checksum(driver: &mut Driver) -> Verdict {
    let (asked, mut bytes) = request(driver, REQUEST, LinkCounters::ID, &[]);
    if let Some(last) = bytes.last_mut() {
        *last ^= 0x10;
    }
    send_by_hand(driver, &bytes, None).await?;
    driver.unanswered(&asked, NO_ANSWER_WITHIN, "a message with a wrong checksum").await?;
    goes_on(driver).await?;
    Ok("no answer, and the next request was done".to_owned())
}

async fn unknown_kind(driver: &mut Driver) -> Verdict {
    for kind in [8, 15] {
        let (asked, bytes) = request(driver, kind, LinkCounters::ID, &[]);
        send_by_hand(driver, &bytes, None).await?;
        driver.unanswered(&asked, NO_ANSWER_WITHIN, &format!("a message of kind {kind}")).await?;
    }
    goes_on(driver).await?;
    Ok("kinds 8 and 15 got no answer".to_owned())
}

async fn out_of_turn(driver: &mut Driver) -> Verdict {
    let (asked, bytes) = request(driver, REQUEST, LinkCounters::ID, &[]);
    begun(driver, &bytes).await?;
    // The second of the consecutive frames where the first was due.
    send(driver, id::WORK_TO_BOARD, &[&[0x22], &bytes[6..12]].concat());
    driver.unanswered(&asked, NO_ANSWER_WITHIN, "a message with a frame out of its turn").await?;
    goes_on(driver).await?;
    Ok("no answer, and the next request was done".to_owned())
}

async fn stray(driver: &mut Driver) -> Verdict {
    for under in [id::WORK_TO_BOARD, id::URGENT_TO_BOARD] {
        send(driver, under, &[0x21, 1, 2, 3, 4, 5, 6, 7]);
        send(driver, under, &[0x30, 0, 0]);
        send(driver, under, &[0x31, 0, 0]);
    }
    goes_on(driver).await?;
    Ok("the next request was done".to_owned())
}

async fn first_amid(driver: &mut Driver) -> Verdict {
    let (asked, bytes) = request(driver, REQUEST, NO_MESSAGE, &[0x11; 100]);
    begun(driver, &bytes).await?;
    send(driver, id::WORK_TO_BOARD, &[&[0x21], &bytes[6..13]].concat());
    goes_on(driver).await?;
    driver.unanswered(&asked, NO_ANSWER_WITHIN, "a message that was left half way").await?;
    Ok("the new one was done, the one before got no answer".to_owned())
}

async fn single_frame(driver: &mut Driver) -> Verdict {
    for under in [id::WORK_TO_BOARD, id::URGENT_TO_BOARD] {
        send(driver, under, &[0x07, 0x11, 0, 1, 0, 5, 0, 9]);
    }
    driver.listen(NO_ANSWER_WITHIN).await?;
    let answer = driver.heard().iter().find(|heard| heard.of(Kind::Event).is_none());
    demand(answer.is_none(), || format!("a single frame was answered; {}", driver.came(0)))?;
    goes_on(driver).await?;
    Ok("two of them got no answer, and the next request was done".to_owned())
}

async fn too_long(driver: &mut Driver) -> Verdict {
    driver.begin_tape();
    send(driver, id::WORK_TO_BOARD, &[0x12, 0x0D, 0x11, 0, 1, 0, 5, 0]);
    let flow = flow_after(driver).await?;
    demand(flow == Some(0x32), || match flow {
        Some(first) => format!("525 bytes got flow control with status {}", first & 0x0F),
        None => "525 bytes got no flow control".to_owned(),
    })?;
    goes_on(driver).await?;
    Ok("525 bytes got status 2".to_owned())
}

async fn foreign_ids(driver: &mut Driver) -> Verdict {
    let numbers = [0x000_u16, 0x012, 0x123, 0x2FF, 0x7FF];
    for number in numbers {
        send(driver, number, &[0x10, 0x0C, 1, 2, 3, 4, 5, 6]);
    }
    for number in [id::KEEP_ALIVE, id::URGENT_TO_BOARD, id::WORK_TO_BOARD] {
        if let Some(extended) = CanFrame::new(CanId::Extended(number.into()), &[0x10, 0x0C, 1, 2, 3, 4, 5, 6]) {
            driver.send_can(extended);
        }
    }
    driver.begin_tape();
    driver.listen(NO_ANSWER_WITHIN).await?;
    let answer = driver.tape().frames.iter().find(|frame| frame.id() != CanId::Standard(id::BOARD_EVENTS));
    demand(answer.is_none(), || format!("a frame under {:?} came", answer.map(CanFrame::id)))?;
    goes_on(driver).await?;
    Ok(format!("{} frames changed nothing", numbers.len() + 3))
}

async fn urgent(driver: &mut Driver) -> Verdict {
    let (asked, bytes) = request(driver, REQUEST, NO_MESSAGE, &[0x22; 400]);
    begun(driver, &bytes).await?;
    driver.ask(&Abort { request: 0x7ABC }).await?;
    for (number, piece) in (1_u8..).zip(bytes[6..].chunks(7)) {
        send(driver, id::WORK_TO_BOARD, &[&[0x20 | number & 0x0F], piece].concat());
    }
    driver.refused(&asked, 2, "that no version has").await?;
    Ok("ABORT was answered between the frames of a request, which was then answered too".to_owned())
}

async fn link_counters(driver: &mut Driver) -> Verdict {
    let before = driver.ask(&LinkCounters {}).await?;
    let (_, bytes) = request(driver, REQUEST, NO_MESSAGE, &[0x33; 30]);
    begun(driver, &bytes).await?;
    send(driver, id::WORK_TO_BOARD, &[0x25, 1, 2, 3, 4, 5, 6, 7]);
    // A heartbeat is no message.
    driver.heartbeat().await?;
    let after = driver.ask(&LinkCounters {}).await?;
    let rows = [
        ("frames", after.frames.wrapping_sub(before.frames), 1),
        ("bad_checksum", after.bad_checksum.wrapping_sub(before.bad_checksum), 0),
        ("malformed", after.malformed.wrapping_sub(before.malformed), 1),
        // The RESULT of the first question, the ACCEPT of the second.
        ("sent", after.sent.wrapping_sub(before.sent), 2),
    ];
    for (name, came, expected) in rows {
        demand(came == expected, || format!("{name} grew by {came} instead of {expected}"))?;
    }
    Ok("frames +1, malformed +1, sent +2".to_owned())
}

async fn imu_frames(driver: &mut Driver) -> Verdict {
    driver.begin_tape();
    driver.ask(&StreamStart { stream: 1, rate_hz: 200, count: 150, samples_per_frame: 1 }).await?;
    driver.listen(Duration::from_millis(900)).await?;
    driver.ask(&StreamStop { stream: 1 }).await?;
    let of_imu = driver.tape().frames.iter().filter_map(|frame| match frame.id() {
        CanId::Standard(number @ id::IMU_GYRO..=id::IMU_CLOCK) => Some((number, frame.data())),
        _ => None,
    });
    let (mut sample, mut marked, mut part) = (0_u32, None, 0);
    for (number, data) in of_imu {
        let Ok(data) = <[u8; 8]>::try_from(data) else {
            return failed(format!("a frame 0x{number:03X} of {} bytes", data.len()));
        };
        let word = u64::from_le_bytes(data);
        match number {
            id::IMU_MARK | id::IMU_CLOCK => {
                demand(part == 0, || format!("0x{number:03X} amid sample {sample}"))?;
                if number == id::IMU_MARK {
                    demand(word as u32 == sample, || format!("the mark says {} before sample {sample}", word as u32))?;
                }
                marked = Some(number);
            }
            _ => {
                let expected = id::IMU_GYRO + part;
                demand(number == expected, || {
                    format!("0x{number:03X} where 0x{expected:03X} of sample {sample} is due")
                })?;
                let came = (word & NUMBER) as u32;
                demand(came == sample % 1024, || format!("number {came} in 0x{number:03X} of sample {sample}"))?;
                let due = part == 0 && sample.is_multiple_of(MARK_EVERY);
                demand(!due || marked == Some(id::IMU_CLOCK), || format!("no mark and clock before sample {sample}"))?;
                marked = None;
                part = (part + 1) % 3;
                sample += u32::from(part == 0);
            }
        }
    }
    demand(sample == 150, || format!("{sample} samples of 150"))?;
    Ok("150 samples, marks and clocks at 0, 64, 128".to_owned())
}

/// Sends test frames; the echoes that come back.
async fn echoes(driver: &mut Driver) -> Verdict<(Vec<CanFrame>, Vec<CanFrame>)> {
    let mut sent = Vec::new();
    for index in 0..TEST_FRAMES {
        let id = if index % 3 == 2 {
            CanId::Extended(0x1ABC_0000 + u32::from(index) * 2711)
        } else {
            CanId::Standard(0x700 + u16::from(index % 16))
        };
        let data: Vec<u8> = (0..index % 9).map(|byte| byte * 31 + index).collect();
        sent.extend(CanFrame::new(id, &data));
    }
    let came = driver.test_frames(&sent, NO_ANSWER_WITHIN).await?;
    Ok((sent, came))
}

async fn echo(driver: &mut Driver) -> Verdict {
    let before = driver.ask(&CanCounters {}).await?;
    let (sent, came) = echoes(driver).await?;
    demand(came.len() == sent.len(), || format!("{} of {} came back", came.len(), sent.len()))?;
    for (sent, came) in sent.iter().zip(&came) {
        let expected = match sent.id() {
            CanId::Standard(number) => CanId::Standard(number + 0x10),
            CanId::Extended(number) => CanId::Extended(number + 0x10000),
        };
        demand(came.id() == expected && came.data() == sent.data(), || {
            format!("{:?} {:02X?} came back as {:?} {:02X?}", sent.id(), sent.data(), came.id(), came.data())
        })?;
    }
    let after = driver.ask(&CanCounters {}).await?;
    let (received, echoed) = (after.received.wrapping_sub(before.received), after.echoed.wrapping_sub(before.echoed));
    let count = u32::from(TEST_FRAMES);
    demand((received, echoed) == (count, count), || {
        format!("CanCounters grew by {received} received and {echoed} sent back of {count}")
    })?;
    Ok(format!("{count} of {count}, in their order"))
}

async fn no_echo(driver: &mut Driver) -> Verdict {
    driver.needs(capability::POWER)?;
    driver.ask(&ModulePower { on: 0 }).await?;
    let (sent, came) = echoes(driver).await?;
    demand(came.is_empty(), || format!("{} of {} came back without power", came.len(), sent.len()))?;
    Ok(format!("0 of {}", sent.len()))
}
