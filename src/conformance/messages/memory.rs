//! Memories: patterns over RAM and flash.

use gnc_protocol::message::{
    ErrorRecords, FlashBlankCheck, FlashErase, FlashId, FlashIdReply, FlashVerify, FlashWrite, MismatchReply, RamTest,
};

use crate::driver::{Driver, name_of};
use crate::stop::{Verdict, demand, failed, not_applicable};

/// Words of the memories.
const INTERNAL_WORDS: u32 = 65_536;
const SDRAM_WORDS: u32 = 1_048_576;
/// Patterns of RamTest.
const PATTERNS: u8 = 5;
/// Bytes of a sector: SPI, internal.
const SECTOR_BYTES: [u32; 2] = [4096, 16_384];
/// Kind of the error record of a flash that reads another pattern.
const FLASH_MISMATCH: u16 = 3;

/// The pattern of a seed, as the document writes it.
fn pattern(seed: u32, words: u32) -> Vec<u32> {
    let mut x = seed;
    let next = |_| {
        x ^= x << 13;
        x ^= x >> 17;
        x ^= x << 5;
        x
    };
    (0..words).map(next).collect()
}

async fn patterns(driver: &mut Driver, ram: u8, words: u32) -> Verdict {
    for pattern in 0..PATTERNS {
        let reply = driver.ask(&RamTest { ram, pattern }).await?;
        demand(reply.words == words, || format!("pattern {pattern}: {} words instead of {words}", reply.words))?;
        is_mismatch(&reply, words, &format!("pattern {pattern}"))?;
    }
    Ok(format!("{words} words, {PATTERNS} patterns"))
}

/// Ends the check as failed if a Mismatch contradicts itself.
fn is_mismatch(reply: &MismatchReply, words: u32, what: &str) -> Verdict<()> {
    let MismatchReply { mismatches, first_place, expected, got, .. } = *reply;
    if mismatches == 0 {
        let zeros = (first_place, expected, got) == (0, 0, 0);
        return demand(zeros, || format!("{what}: no mismatch, but place {first_place}, {expected:08X}, {got:08X}"));
    }
    demand(first_place < words && expected != got, || {
        format!("{what}: {mismatches} mismatches, the first at {first_place}: {expected:08X}, {got:08X}")
    })
}

/// A request to a flash takes at most this much more than ten times the time for which the flash is busy (section 11).
const AROUND_ERASE_US: u32 = 20_000;

pub(super) async fn ram(driver: &mut Driver) -> Verdict {
    patterns(driver, 0, INTERNAL_WORDS).await
}

pub(super) async fn ram_sdram(driver: &mut Driver) -> Verdict {
    patterns(driver, 1, SDRAM_WORDS).await
}

pub(super) async fn flash_id(driver: &mut Driver) -> Verdict {
    let mut said = Vec::new();
    for (flash, bytes) in [0, 1].into_iter().zip(SECTOR_BYTES) {
        let FlashIdReply { jedec, sector_bytes, scratch_sectors } = driver.ask(&FlashId { flash }).await?;
        demand(sector_bytes == bytes, || format!("flash {flash}: sectors of {sector_bytes} bytes instead of {bytes}"))?;
        demand(flash == 0 || jedec == [0; 3], || format!("internal flash: JEDEC id {jedec:02X?} instead of zeros"))?;
        said.push(format!("{jedec:02X?} with {scratch_sectors} scratch sectors"));
    }
    Ok(said.join(", "))
}

pub(super) async fn flash_protected(driver: &mut Driver) -> Verdict {
    for flash in [0, 1] {
        let sectors = driver.ask(&FlashId { flash }).await?.scratch_sectors;
        for sector in [sectors, u16::MAX] {
            let (s0, s1) = (sector.to_le_bytes()[0], sector.to_le_bytes()[1]);
            for (message, payload) in [
                (0x0017, &[flash, s0, s1][..]),
                (0x0018, &[flash, s0, s1]),
                (0x0019, &[flash, s0, s1, 1, 0, 0, 0]),
                (0x001A, &[flash, s0, s1, 1, 0, 0, 0]),
            ] {
                let asked = driver.post_raw(message, payload);
                driver.refused(&asked, 7, &format!("of flash {flash}, sector {sector}")).await?;
            }
        }
    }
    Ok("NAK 7 to 4 messages".to_owned())
}

/// Ends the check unless a flash has a scratch sector.
async fn has_scratch(driver: &mut Driver, flash: u8) -> Verdict<bool> {
    Ok(driver.ask(&FlashId { flash }).await?.scratch_sectors > 0)
}

pub(super) async fn flash_pattern(driver: &mut Driver) -> Verdict {
    let mut tried = 0;
    for (flash, bytes) in [0, 1].into_iter().zip(SECTOR_BYTES) {
        if !has_scratch(driver, flash).await? {
            continue;
        }
        let (sector, words) = (0, bytes / 4);
        let erased = driver.call(&FlashErase { flash, sector }).await?;
        let duration_us = erased.reply::<FlashErase>()?.duration_us;
        demand(duration_us <= erased.elapsed_us().saturating_add(1000), || {
            format!("flash {flash}: busy for {duration_us} us in an elapsed_us of {}", erased.elapsed_us())
        })?;
        demand(erased.elapsed_us() <= duration_us.saturating_mul(10).saturating_add(AROUND_ERASE_US), || {
            format!("flash {flash}: busy for only {duration_us} us of an elapsed_us of {}", erased.elapsed_us())
        })?;
        let blank = driver.ask(&FlashBlankCheck { flash, sector }).await?;
        demand((blank.words, blank.mismatches) == (words, 0), || {
            format!("flash {flash} erased: {} of {} words are not blank", blank.mismatches, blank.words)
        })?;
        driver.ask(&FlashWrite { flash, sector, seed: 1 }).await?;
        let same = driver.ask(&FlashVerify { flash, sector, seed: 1 }).await?;
        demand((same.words, same.mismatches) == (words, 0), || {
            format!("flash {flash} written: {} of {} words differ", same.mismatches, same.words)
        })?;
        compared(driver, flash, words, &pattern(1, words)).await?;
        tried += 1;
    }
    if tried == 0 {
        return not_applicable("no flash has a scratch sector");
    }
    Ok(format!("{tried} flashes erased, blank, written, verified, and compared with another seed"))
}

/// Compares a sector that holds `holds` with the pattern of another seed. The place of the first difference, both words
/// and the count are known, so that they show the pattern that was written.
async fn compared(driver: &mut Driver, flash: u8, words: u32, holds: &[u32]) -> Verdict<()> {
    let seed = 2_463_534_242;
    let expected = pattern(seed, words);
    let differ: Vec<usize> = (0..holds.len()).filter(|index| holds[*index] != expected[*index]).collect();
    let Some(first) = differ.first().copied() else { return failed("the two patterns are equal") };
    let answer = driver.call(&FlashVerify { flash, sector: 0, seed }).await?;
    let reply = answer.reply::<FlashVerify>()?;
    let wanted = MismatchReply {
        words,
        mismatches: u32::try_from(differ.len()).unwrap_or(u32::MAX),
        first_place: u32::try_from(first).unwrap_or(u32::MAX),
        expected: expected[first],
        got: holds[first],
    };
    demand(reply == wanted, || {
        format!(
            "flash {flash}: {} of {} words differ, the first at {}: {:08X} expected, {:08X} got; it must be {} of {} at {}: {:08X}, {:08X}",
            reply.mismatches,
            reply.words,
            reply.first_place,
            reply.expected,
            reply.got,
            wanted.mismatches,
            wanted.words,
            wanted.first_place,
            wanted.expected,
            wanted.got
        )
    })?;
    let records = driver.ask(&ErrorRecords { from: 0 }).await?.records;
    let noted = records.iter().any(|record| {
        record.kind == FLASH_MISMATCH
            && (record.request, record.message) == (answer.asked.request, answer.asked.message)
            && (record.place, record.expected, record.got) == (wanted.first_place, wanted.expected, wanted.got)
    });
    // More than sixteen records need a second question; no check before this one makes so many.
    demand(noted || records.len() == 16, || {
        format!("flash {flash}: no error record of kind 3 of the first difference of {}", name_of(answer.asked.message))
    })
}

pub(super) async fn flash_and(driver: &mut Driver) -> Verdict {
    let flash = 0;
    if !has_scratch(driver, flash).await? {
        return not_applicable("the SPI flash has no scratch sector");
    }
    driver.ask(&FlashErase { flash, sector: 0 }).await?;
    let words = SECTOR_BYTES[0] / 4;
    for seed in [1, 7] {
        driver.ask(&FlashWrite { flash, sector: 0, seed }).await?;
    }
    let holds: Vec<u32> = pattern(1, words).iter().zip(pattern(7, words)).map(|(one, other)| one & other).collect();
    compared(driver, flash, words, &holds).await?;
    driver.ask(&FlashErase { flash, sector: 0 }).await?;
    Ok("seed 1, then 7 without an erase: every word is the AND of both".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The table of the interface document.
    #[test]
    fn the_pattern_is_that_of_the_document() {
        assert_eq!(pattern(1, 4), [0x0004_2021, 0x0408_0601, 0x9DCC_A8C5, 0x1255_994F]);
        assert_eq!(pattern(2_463_534_242, 2), [0x2B1F_4D63, 0x94DA_CB7A]);
    }
}
