//! ISO-TP by hand, and as it is seen on the bus.

use std::time::Duration;

use gnc_protocol::can::{CanFrame, CanId, id};
use tokio::time::Instant;

use crate::driver::{Driver, ms};
use crate::stop::{Verdict, demand, failed};

/// Bytes of a message in its first frame, and in each after it.
const IN_FIRST: usize = 6;
const IN_NEXT: usize = 7;
/// Lengths of messages of this version.
const LENGTHS: std::ops::RangeInclusive<usize> = 12..=524;
/// How long a sender waits for flow control: N_Bs of the document.
const FLOW_WITHIN: Duration = Duration::from_millis(1000);
/// Steps in which flow control is awaited.
const LOOK: Duration = Duration::from_millis(5);

/// A message as it was seen on the bus.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Transfer {
    pub(super) under: u16,
    pub(super) bytes: Vec<u8>,
}

/// Sends a frame: its id, and at most eight bytes.
pub(super) fn send(driver: &mut Driver, number: u16, data: &[u8]) {
    if let Some(frame) = CanFrame::new(CanId::Standard(number), data) {
        driver.send_can(frame);
    }
}

/// Sends the first frame of a message.
fn send_first(driver: &mut Driver, bytes: &[u8]) {
    let [low, high] = u16::try_from(bytes.len()).unwrap_or(u16::MAX).to_le_bytes();
    send(driver, id::WORK_TO_BOARD, &[&[0x10 | high & 0x0F, low], &bytes[..IN_FIRST]].concat());
}

/// Flow control under 0x101 since the tape was begun: its first byte.
pub(super) async fn flow_after(driver: &mut Driver) -> Verdict<Option<u8>> {
    let mut waited = Duration::ZERO;
    loop {
        let flow = driver.tape().frames.iter().find_map(|frame| match (frame.id(), frame.data()) {
            (CanId::Standard(id::WORK_TO_HOST), [first, ..]) if first >> 4 == 3 => Some(*first),
            _ => None,
        });
        if flow.is_some() || waited >= FLOW_WITHIN {
            return Ok(flow);
        }
        driver.listen(LOOK).await?;
        waited += LOOK;
    }
}

/// Sends the first frame of a request and waits for its flow control; how long that took, to within 5 ms.
pub(super) async fn begun(driver: &mut Driver, bytes: &[u8]) -> Verdict<Duration> {
    driver.begin_tape();
    let sent = Instant::now();
    send_first(driver, bytes);
    match flow_after(driver).await? {
        Some(0x30) => Ok(sent.elapsed()),
        Some(other) => failed(format!("a first frame of {} bytes got flow control {other:02X}", bytes.len())),
        None => {
            failed(format!("a first frame of {} bytes got no flow control within {}", bytes.len(), ms(FLOW_WITHIN)))
        }
    }
}

/// Sends a whole request, its frames filled up to eight bytes with `padding`.
pub(super) async fn send_by_hand(driver: &mut Driver, bytes: &[u8], padding: Option<u8>) -> Verdict<()> {
    begun(driver, bytes).await?;
    for (number, piece) in (1_u8..).zip(bytes[IN_FIRST..].chunks(IN_NEXT)) {
        let mut data = [&[0x20 | number & 0x0F], piece].concat();
        if let Some(padding) = padding {
            data.resize(8, padding);
        }
        send(driver, id::WORK_TO_BOARD, &data);
    }
    Ok(())
}

/// All messages of the board in these frames; the first one of each id may have begun before them.
pub(super) fn transfers(frames: &[CanFrame]) -> Verdict<Vec<Transfer>> {
    let mut whole = Vec::new();
    for under in [id::URGENT_TO_HOST, id::WORK_TO_HOST] {
        let mut open: Option<(usize, Vec<u8>, u8)> = None;
        for frame in frames.iter().filter(|frame| frame.id() == CanId::Standard(under)) {
            let data = frame.data();
            match (data.first().map(|first| (first >> 4, first & 0x0F)), &mut open) {
                (Some((1, high)), _) => {
                    demand(data.len() == 8, || format!("a first frame of {} bytes under 0x{under:03X}", data.len()))?;
                    let length = usize::from(high) << 8 | usize::from(data[1]);
                    demand(LENGTHS.contains(&length), || format!("a message of {length} bytes under 0x{under:03X}"))?;
                    demand(open.is_none(), || format!("a message under 0x{under:03X} was left half way"))?;
                    open = Some((length, data[2..].to_vec(), 1));
                }
                (Some((2, number)), Some((length, bytes, expected))) => {
                    demand(number == *expected, || {
                        format!("consecutive frame {number:X} where {expected:X} is due under 0x{under:03X}")
                    })?;
                    *expected = (*expected + 1) & 0x0F;
                    let left = *length - bytes.len();
                    demand(data.len() > left.min(IN_NEXT), || {
                        format!("a consecutive frame of {} bytes with {left} left under 0x{under:03X}", data.len())
                    })?;
                    bytes.extend_from_slice(&data[1..=left.min(IN_NEXT)]);
                    if bytes.len() == *length {
                        whole.push(Transfer { under, bytes: bytes.clone() });
                        open = None;
                    }
                }
                _ => {}
            }
        }
    }
    Ok(whole)
}
