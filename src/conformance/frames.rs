//! Section 3: frames on RS-422.

use std::time::Duration;

use gnc_protocol::frame::FrameError;
use gnc_protocol::message::{CpuWords, LinkCounters, event};
use gnc_protocol::wire::List;
use gnc_protocol::{Call as _, Kind, PROTOCOL_VERSION};
use tokio::time::Instant;

use crate::check::checks;
use crate::driver::{Asked, Driver, HEARTBEAT_WITHIN, Heard, NO_MESSAGE};
use crate::raw::{Ending, RawHeader, delimited, frame_bytes, stuff};
use crate::stop::{Verdict, demand, failed};

checks! { 3:
    "frames.delimiters" Session delimiters "a sender puts a 00 before and after each frame",
    "frames.clean" Session clean "between two delimiters stands a frame or nothing",
    "frames.checksum" Anyhow checksum "the checksum is CRC-32C over header and payload, least significant byte first",
    "frames.full-run" Session full_run "a receiver takes a frame that ends right behind a full run, with and without a last code 01",
    "frames.zeros" Session zeros "a receiver takes a frame of zeros, each an empty run",
    "frames.longest" Session longest "a receiver takes a frame of 524 bytes",
    "frames.empty-space" Session empty_space "empty space between two delimiters means nothing",
    "frames.shared-delimiter" Session shared_delimiter "a receiver collects bytes up to a 00: one between two frames is enough for it",
    "frames.pieces" Session pieces "a receiver collects bytes up to a 00, however long they take",
    "frames.rubbish" Session rubbish "rubbish up to a 00 costs no more than itself",
    "frames.cut" Session cut "the leading 00 ends a frame that was cut off",
    "frames.too-many-bytes" Session too_many_bytes "more than 527 bytes without a 00 are dropped up to the next 00",
    "frames.bad-checksum" Session bad_checksum "a frame with a wrong checksum gets no answer",
    "frames.broken-stuffing" Session broken_stuffing "a frame with broken stuffing gets no answer",
    "frames.short" Session short "fewer than 12 bytes are no frame",
    "frames.long" Session long "a frame of more than 524 bytes gets no answer, even with a good checksum",
    "frames.unknown-kind" Session unknown_kind "a frame of kind 8 to 15 is dropped",
    "frames.long-answer" Powered long_answer "a sender stuffs runs of 254 bytes and more",
}

/// How long a frame without an answer is watched: three times what section 7 allows.
const NO_ANSWER_WITHIN: Duration = Duration::from_millis(150);
/// Bytes of a frame between a zero in its header and its end, in the checks of full runs.
const RUN: usize = 254;

/// A REQUEST as bytes before stuffing, and what would answer it.
fn request(driver: &mut Driver, message: u16, payload: &[u8]) -> (Asked, Vec<u8>) {
    let asked = Asked { request: driver.next_request(), message, from: driver.mark(), sent: Instant::now() };
    let header =
        RawHeader { version: PROTOCOL_VERSION, kind: Kind::Request as u8, flags: 0, request: asked.request, message };
    let bytes = frame_bytes(header, driver.take_sequence(), payload);
    (asked, bytes)
}

/// A request that any board carries out at once.
fn good(driver: &mut Driver) -> (Asked, Vec<u8>) {
    let (asked, bytes) = request(driver, LinkCounters::ID, &[]);
    (asked, delimited(&stuff(&bytes, Ending::Bare)))
}

/// Ends the check as failed unless a good frame is answered.
async fn takes_a_good_frame(driver: &mut Driver, after: &str) -> Verdict<()> {
    let (asked, wire) = good(driver);
    answers(driver, asked, &wire, &format!("a good frame {after}")).await
}

async fn answers(driver: &mut Driver, asked: Asked, wire: &[u8], what: &str) -> Verdict<()> {
    driver.send_bytes(wire);
    match driver.end_of(&asked).await {
        Err(crate::stop::Stop::Failed(why)) => failed(format!("{what}: {why}")),
        other => other.map(|_| ()),
    }
}

async fn delimiters(driver: &mut Driver) -> Verdict {
    for _ in 0..3 {
        driver.ask(&LinkCounters {}).await?;
    }
    let bytes = &driver.tape().bytes;
    // What came before the first 00 began before the tape.
    let begin = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    let (mut zeros, mut frames) = (2, 0);
    for byte in &bytes[begin..] {
        if *byte == 0 {
            zeros += 1;
            continue;
        }
        if zeros > 0 {
            frames += 1;
            demand(zeros >= 2, || format!("a single 00 stands before frame {frames} of {} bytes", bytes.len()))?;
        }
        zeros = 0;
    }
    demand(frames >= 3, || format!("{frames} frames between delimiters, of three requests"))?;
    Ok(format!("{frames} frames, two 00 or more between any two"))
}

async fn clean(driver: &mut Driver) -> Verdict {
    for _ in 0..3 {
        driver.ask(&LinkCounters {}).await?;
    }
    driver.until(0, HEARTBEAT_WITHIN, |heard| heard.is(Kind::Event, event::HEARTBEAT)).await?;
    let broken = driver.heard().iter().filter(|heard| heard.frame.is_err()).count();
    demand(broken == 0, || driver.came(0))?;
    Ok(format!("{} frames, nothing else", driver.heard().len()))
}

/// It looks at what the board sends by itself, so that it says what is wrong where no session can be opened.
async fn checksum(driver: &mut Driver) -> Verdict {
    let nonce = driver.new_nonce();
    driver.say_hello((1, 1), nonce, 0);
    driver.until(0, HEARTBEAT_WITHIN, |heard| heard.is(Kind::Event, event::HEARTBEAT)).await?;
    let is_wrong = |heard: &&Heard| matches!(heard.frame, Err(FrameError::Checksum { .. }));
    let (all, wrong) = (driver.heard().len(), driver.heard().iter().filter(is_wrong).count());
    demand(wrong == 0, || format!("{wrong} of {all} frames have a wrong checksum; compare it with the vectors"))?;
    demand(driver.heard().iter().any(|heard| heard.frame.is_ok()), || driver.came(0))?;
    Ok(format!("good in {all} frames"))
}

async fn full_run(driver: &mut Driver) -> Verdict {
    for ending in [Ending::Bare, Ending::LastCode] {
        let (asked, bytes) = frame_with_full_run(driver);
        let stuffed = stuff(&bytes, ending);
        let what = match ending {
            Ending::Bare => "a frame that ends right behind a full run",
            Ending::LastCode => "the same with a last code 01",
        };
        answers(driver, asked, &delimited(&stuffed), what).await?;
    }
    Ok("answered with and without".to_owned())
}

/// A REQUEST of no message whose last 254 bytes are not zero, while the byte before them is.
fn frame_with_full_run(driver: &mut Driver) -> (Asked, Vec<u8>) {
    let header = |request| RawHeader {
        version: PROTOCOL_VERSION,
        kind: Kind::Request as u8,
        flags: 0,
        request,
        message: NO_MESSAGE,
    };
    // The run begins behind the flags.
    let payload = RUN + 2 - 12;
    let request = driver.next_request() | 0x0101;
    let sequence = driver.take_sequence() | 0x0101;
    driver.set_sequence(sequence.wrapping_add(1));
    let found = (1..=u8::MAX).map(|byte| frame_bytes(header(request), sequence, &vec![byte; payload]));
    let bytes = found.into_iter().find(|bytes| bytes[2..].iter().all(|byte| *byte != 0)).unwrap_or_default();
    let (from, sent) = (driver.mark(), Instant::now());
    (Asked { request, message: NO_MESSAGE, from, sent }, bytes)
}

async fn zeros(driver: &mut Driver) -> Verdict {
    let (asked, bytes) = request(driver, NO_MESSAGE, &[0; 300]);
    answers(driver, asked, &delimited(&stuff(&bytes, Ending::Bare)), "a frame of 300 zeros").await?;
    Ok("300 zeros were taken".to_owned())
}

async fn longest(driver: &mut Driver) -> Verdict {
    for byte in [0x55, 0] {
        let (asked, bytes) = request(driver, NO_MESSAGE, &[byte; 512]);
        answers(driver, asked, &delimited(&stuff(&bytes, Ending::Bare)), "a frame of 524 bytes").await?;
    }
    Ok("two frames of 524 bytes were taken".to_owned())
}

async fn empty_space(driver: &mut Driver) -> Verdict {
    let (asked, wire) = good(driver);
    let mut bytes = vec![0; 40];
    bytes.extend_from_slice(&wire);
    answers(driver, asked, &bytes, "a frame behind 40 delimiters").await?;
    Ok("40 delimiters before a frame".to_owned())
}

async fn shared_delimiter(driver: &mut Driver) -> Verdict {
    let ((first, wire), (second, mut next)) = (good(driver), good(driver));
    next.remove(0);
    driver.send_bytes(&[wire, next].concat());
    for asked in [first, second] {
        driver.end_of(&asked).await?;
    }
    Ok("both frames were answered".to_owned())
}

async fn pieces(driver: &mut Driver) -> Verdict {
    let (asked, wire) = good(driver);
    for piece in wire.chunks(4) {
        driver.send_bytes(piece);
        driver.listen(Duration::from_millis(30)).await?;
    }
    driver.end_of(&asked).await?;
    Ok(format!("a frame in pieces over {} ms", wire.len().div_ceil(4) * 30))
}

async fn rubbish(driver: &mut Driver) -> Verdict {
    let rubbish: [&[u8]; 4] =
        [&[0xA5; 40], &[0xFF; 3], b"boot: hello world\r\n", &[1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1]];
    for bytes in rubbish {
        driver.send_bytes(bytes);
        driver.send_bytes(&[0]);
        takes_a_good_frame(driver, &format!("behind {} bytes of rubbish and 00", bytes.len())).await?;
    }
    Ok(format!("good frames behind {} kinds of rubbish were answered", rubbish.len()))
}

async fn cut(driver: &mut Driver) -> Verdict {
    for kept in [2, 5, 9] {
        let (_, wire) = good(driver);
        driver.send_bytes(&wire[..kept]);
        takes_a_good_frame(driver, &format!("behind {kept} bytes of another")).await?;
    }
    Ok("3 frames behind half ones were answered".to_owned())
}

async fn too_many_bytes(driver: &mut Driver) -> Verdict {
    for count in [528, 3000] {
        driver.send_bytes(&vec![0x11; count]);
        driver.send_bytes(&[0]);
        takes_a_good_frame(driver, &format!("behind {count} bytes without a 00")).await?;
    }
    Ok("good frames behind 528 and 3000 bytes were answered".to_owned())
}

async fn bad_checksum(driver: &mut Driver) -> Verdict {
    for bit in [0, 31] {
        let (asked, mut bytes) = request(driver, LinkCounters::ID, &[]);
        let last = bytes.len() - 4 + bit / 8;
        bytes[last] ^= 1 << (bit % 8);
        driver.send_bytes(&delimited(&stuff(&bytes, Ending::Bare)));
        driver.unanswered(&asked, NO_ANSWER_WITHIN, &format!("a REQUEST with bit {bit} of its checksum wrong")).await?;
    }
    takes_a_good_frame(driver, "behind them").await?;
    Ok("2 of them got no answer".to_owned())
}

async fn broken_stuffing(driver: &mut Driver) -> Verdict {
    let (asked, bytes) = request(driver, LinkCounters::ID, &[]);
    let mut stuffed = stuff(&bytes, Ending::Bare);
    stuffed.pop();
    driver.send_bytes(&delimited(&stuffed));
    driver.unanswered(&asked, NO_ANSWER_WITHIN, "a REQUEST whose last run is a byte short").await?;
    takes_a_good_frame(driver, "behind it").await?;
    Ok("no answer, and the next frame was taken".to_owned())
}

async fn short(driver: &mut Driver) -> Verdict {
    let from = driver.mark();
    // A checksum of nothing is 0; of seven bytes it is good too.
    let mut seven = vec![0x11, 0, 1, 0, 5, 0, 9];
    let crc = gnc_protocol::frame::checksum(&seven);
    seven.extend_from_slice(&crc.to_le_bytes());
    for bytes in [&[0; 4][..], &seven] {
        driver.send_bytes(&delimited(&stuff(bytes, Ending::Bare)));
    }
    driver.listen(NO_ANSWER_WITHIN).await?;
    let answer = driver.heard()[from..].iter().find(|heard| heard.frame.is_ok() && heard.of(Kind::Event).is_none());
    demand(answer.is_none(), || format!("a frame of 4 or 11 bytes was answered; {}", driver.came(from)))?;
    takes_a_good_frame(driver, "behind them").await?;
    Ok("frames of 4 and 11 bytes got no answer".to_owned())
}

async fn long(driver: &mut Driver) -> Verdict {
    let (asked, bytes) = request(driver, NO_MESSAGE, &[0x33; 513]);
    driver.send_bytes(&delimited(&stuff(&bytes, Ending::Bare)));
    driver.unanswered(&asked, NO_ANSWER_WITHIN, "a frame of 525 bytes").await?;
    takes_a_good_frame(driver, "behind it").await?;
    Ok("525 bytes got no answer".to_owned())
}

async fn unknown_kind(driver: &mut Driver) -> Verdict {
    for kind in 8..=15 {
        let request = driver.next_request();
        let asked = Asked { request, message: LinkCounters::ID, from: driver.mark(), sent: Instant::now() };
        let header = RawHeader { version: PROTOCOL_VERSION, kind, flags: 0, request, message: LinkCounters::ID };
        let bytes = frame_bytes(header, driver.take_sequence(), &[]);
        driver.send_bytes(&delimited(&stuff(&bytes, Ending::Bare)));
        driver.unanswered(&asked, NO_ANSWER_WITHIN / 3, &format!("a frame of kind {kind}")).await?;
    }
    takes_a_good_frame(driver, "behind them").await?;
    Ok("8 kinds got no answer".to_owned())
}

async fn long_answer(driver: &mut Driver) -> Verdict {
    let words: List<u32, 64> = (0..64).map(|index| 0x0101_0101 * (index % 255 + 1)).collect();
    let came = driver.ask(&CpuWords { core: 1, target: 1, words: words.clone() }).await?.words;
    demand(came == words, || format!("{} words came back, not the 64 that were sent", came.len()))?;
    Ok("256 bytes without a 00 came back".to_owned())
}
