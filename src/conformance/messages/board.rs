//! Messages of the board itself.

use gnc_protocol::message::{
    ErrorRecords, FlashId, FlashVerify, Identity, LinkCounters, LinkCountersReply, ModulePower, PowerReply, capability,
};
use gnc_protocol::{Call as _, Frame, Kind, PROTOCOL_VERSION};

use crate::driver::Driver;
use crate::raw::{Ending, RawHeader, delimited, frame_bytes, stuff};
use crate::stop::{Verdict, demand, failed, not_applicable};

/// A supply of 5 V and the current of a module, with room for a bad one; other units are a thousand times off.
const SUPPLY_UV: std::ops::RangeInclusive<u32> = 3_000_000..=7_000_000;
const SUPPLY_UA: std::ops::RangeInclusive<u32> = 1_000..=5_000_000;

pub(super) async fn power_on(driver: &mut Driver) -> Verdict {
    if !driver.can_do(capability::POWER) {
        let asked = driver.post(&ModulePower { on: 1 });
        driver.refused(&asked, 9, "on a board without capability bit 0").await?;
        return Ok("NAK 9, since the board has no capability bit 0".to_owned());
    }
    let PowerReply { supply_uv, supply_ua } = driver.ask(&ModulePower { on: 1 }).await?;
    demand(SUPPLY_UV.contains(&supply_uv), || format!("supply_uv {supply_uv}: is it in microvolts?"))?;
    demand(SUPPLY_UA.contains(&supply_ua), || format!("supply_ua {supply_ua}: is it in microamperes?"))?;
    Ok(format!("{supply_uv} uV, {supply_ua} uA"))
}

pub(super) async fn power_twice(driver: &mut Driver) -> Verdict {
    driver.needs(capability::POWER)?;
    driver.ask(&ModulePower { on: 1 }).await?;
    driver.disturb();
    driver.ask(&ModulePower { on: 0 }).await?;
    driver.ask(&ModulePower { on: 0 }).await?;
    Ok("on twice, off twice, status 0".to_owned())
}

pub(super) async fn power_off(driver: &mut Driver) -> Verdict {
    driver.needs(capability::POWER)?;
    driver.disturb();
    driver.ask(&ModulePower { on: 0 }).await?;
    let asked = driver.post(&Identity {});
    driver.refused(&asked, 6, "after ModulePower off").await?;
    Ok("NAK 6".to_owned())
}

pub(super) async fn error_records(driver: &mut Driver) -> Verdict {
    for from in [0, 1, u16::MAX] {
        let reply = driver.ask(&ErrorRecords { from }).await?;
        let (total, records) = (reply.total, reply.records.len());
        demand((total, records) == (0, 0), || format!("from {from}: total {total}, {records} records"))?;
    }
    Ok("total 0, no record".to_owned())
}

/// A seed that no check writes, so that a sector holds another pattern.
const NEVER_WRITTEN: u32 = 0x0BAD_5EED;

pub(super) async fn error_records_from(driver: &mut Driver) -> Verdict {
    if driver.ask(&FlashId { flash: 0 }).await?.scratch_sectors == 0 {
        return not_applicable("the SPI flash has no scratch sector in which a check could find a mismatch");
    }
    driver.open().await?;
    driver.power_on().await?;
    // A supply that is out of range makes a record at power-on.
    let before = driver.ask(&ErrorRecords { from: 0 }).await?.total;
    let mut asked = Vec::new();
    for _ in 0..3 {
        let answer = driver.call(&FlashVerify { flash: 0, sector: 0, seed: NEVER_WRITTEN }).await?;
        demand(answer.reply::<FlashVerify>()?.mismatches > 0, || "a seed that nobody wrote was found".to_owned())?;
        asked.push((answer.asked.request, FlashVerify::ID));
    }
    for (skipped, from) in (0..).zip(before..=before + 3) {
        let reply = driver.ask(&ErrorRecords { from }).await?;
        let indexes: Vec<u16> = reply.records.iter().map(|record| record.index).collect();
        let expected: Vec<u16> = (from..before + 3).collect();
        demand(reply.total == before + 3 && indexes == expected, || {
            format!("from {from}: total {}, records {indexes:?} instead of {expected:?}", reply.total)
        })?;
        let of: Vec<_> = reply.records.iter().map(|record| (record.request, record.message)).collect();
        demand(of == asked[skipped..], || format!("records of requests {of:?} instead of {asked:?}"))?;
    }
    driver.open().await?;
    let total = driver.ask(&ErrorRecords { from: 0 }).await?.total;
    demand(total == 0, || format!("{total} records in a new session"))?;
    Ok("3 records of 3 mismatches, none in the next session".to_owned())
}

/// The counters, and how many frames the board had sent by then: at least and at most. A heartbeat between ACCEPT and
/// RESULT may be counted or not.
async fn counted(driver: &mut Driver) -> Verdict<(LinkCountersReply, u32, u32)> {
    let answer = driver.call(&LinkCounters {}).await?;
    let request = answer.asked.request;
    let place = |kind| {
        driver
            .heard()
            .iter()
            .position(|heard| heard.of(kind).is_some_and(|frame: &Frame| frame.header.request == request))
    };
    let (Some(accept), Some(result)) = (place(Kind::Accept), place(Kind::Result)) else {
        return failed("no ACCEPT of LinkCounters");
    };
    let frames = |up_to: usize| {
        let good = driver.heard()[..up_to].iter().filter(|heard| heard.frame.is_ok()).count();
        u32::try_from(good).unwrap_or(u32::MAX)
    };
    Ok((answer.reply::<LinkCounters>()?, frames(accept + 1), frames(result)))
}

pub(super) async fn link_counters(driver: &mut Driver) -> Verdict {
    driver.on_rs422()?;
    // A keep-alive that goes out by itself would count too.
    driver.keep_alive_now();
    let (before, least_before, most_before) = counted(driver).await?;
    for _ in 0..3 {
        driver.send_keep_alive();
    }
    let header = |kind| RawHeader { version: PROTOCOL_VERSION, kind, flags: 0, request: 0, message: LinkCounters::ID };
    // An echo is good, a frame of unknown kind malformed: it takes its number and is not missing.
    for kind in [Kind::Result as u8, 9] {
        let bytes = frame_bytes(header(kind), driver.take_sequence(), &[]);
        driver.send_bytes(&delimited(&stuff(&bytes, Ending::Bare)));
    }
    // A frame with a wrong checksum counts once there and once as missing.
    let mut bytes = frame_bytes(header(Kind::Request as u8), driver.take_sequence(), &[]);
    bytes[0] ^= 0x40;
    driver.send_bytes(&delimited(&stuff(&bytes, Ending::Bare)));
    // Rubbish is malformed, once between two delimiters.
    driver.send_bytes(&[0, 0x55, 0x66, 0, 0, 0]);
    // Four numbers that were never sent.
    for _ in 0..4 {
        driver.take_sequence();
    }
    let (after, least_after, most_after) = counted(driver).await?;
    let grew = |then: u32, now: u32| now.wrapping_sub(then);
    let rows = [
        ("frames", grew(before.frames, after.frames), 5..=5),
        ("bad_checksum", grew(before.bad_checksum, after.bad_checksum), 1..=1),
        ("malformed", grew(before.malformed, after.malformed), 2..=2),
        ("missing", grew(before.missing, after.missing), 5..=5),
        ("sent", grew(before.sent, after.sent), least_after - most_before..=most_after - least_before),
    ];
    for (name, came, expected) in &rows {
        demand(expected.contains(came), || format!("{name} grew by {came} instead of {}", expected.end()))?;
    }
    let words: Vec<String> = rows.iter().map(|(name, came, _)| format!("{name} +{came}")).collect();
    Ok(words.join(", "))
}
