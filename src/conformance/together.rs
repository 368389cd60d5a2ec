//! Section 8: what may run together.

use std::time::Duration;

use gnc_protocol::message::{
    Abort, AdRead, CpuWords, ErrorRecords, FlashErase, FlashId, Identity, IoTest, LinkCounters, ModulePower, RamTest,
    SciEcho, SpiTransfer, TimerMeasure, capability,
};
use gnc_protocol::wire::Wire as _;
use gnc_protocol::{Call, Kind};

use crate::check::checks;
use crate::driver::{Asked, Driver, ms, name_of};
use crate::examples::{list, slow};
use crate::stop::{Verdict, demand, failed, not_applicable};

checks! { 8:
    "together.four" Powered four "up to 4 requests run at once, a fifth gets NAK 5",
    "together.resource" Powered resource "two requests that need one resource exclude each other: the later one gets NAK 5",
    "together.power" Powered power "ModulePower excludes, and is excluded by, every request that needs a device",
    "together.none" Powered none "ErrorRecords, LinkCounters, Abort run beside everything",
    "together.not-queued" Powered not_queued "the board queues nothing: what got NAK 5 is possible when the resource is free",
    "together.aborted-flash" Powered aborted_flash "an aborted FlashErase leaves that flash busy until it has finished its work",
}

/// Longest time in which an aborted erase finishes: ten times a slow part.
const ERASE_WITHIN: Duration = Duration::from_secs(10);

/// A request by its message and payload.
type Raw = (u16, Vec<u8>);

fn raw<C: Call>(call: &C) -> Raw {
    (C::ID, call.to_payload().unwrap_or_default().to_vec())
}

/// Four requests of four resources that take 0.1 s and more, the longest first.
fn four_slow() -> [Raw; 4] {
    let bytes = || list(0..=u8::MAX);
    [
        raw(&TimerMeasure { timer: 0, period_us: 100_000, count: 10 }),
        raw(&SciEcho { rate_baud: 9600, data: bytes() }),
        raw(&SpiTransfer { direction: 0, clock_hz: 10_000, data: bytes() }),
        raw(&AdRead { channels: 0xFF, samples: 1000 }),
    ]
}

/// Begins requests one after the other.
pub(crate) async fn begin_four(driver: &mut Driver) -> Verdict<Vec<Asked>> {
    let mut running = Vec::new();
    for (message, payload) in four_slow() {
        let asked = driver.post_raw(message, &payload);
        driver.accepted(&asked).await?;
        running.push(asked);
    }
    Ok(running)
}

/// Waits until all have ended.
pub(crate) async fn all_end(driver: &mut Driver, running: &[Asked]) -> Verdict<()> {
    for asked in running {
        driver.end_of(asked).await?;
    }
    Ok(())
}

/// Whether none of these requests has ended yet.
pub(crate) fn all_run(driver: &Driver, running: &[Asked]) -> bool {
    let ended = |asked: &Asked| {
        driver.heard()[asked.from..].iter().any(|heard| {
            heard.is(Kind::Result, asked.message)
                && heard.of(Kind::Result).is_some_and(|frame| frame.header.request == asked.request)
        })
    };
    !running.iter().any(ended)
}

async fn four(driver: &mut Driver) -> Verdict {
    let running = begin_four(driver).await?;
    let fifth = driver.post(&CpuWords { core: 1, target: 0, words: list([1]) });
    let place = driver.first_answer(&fifth).await?;
    if !all_run(driver, &running) {
        all_end(driver, &running).await?;
        return not_applicable("one of the four ended before the fifth came: this module is too quick");
    }
    if driver.heard()[place].of(Kind::Nak).is_none() {
        return failed("a fifth request beside four got no NAK 5");
    }
    driver.refused(&fifth, 5, "as the fifth").await?;
    all_end(driver, &running).await?;
    Ok("4 ran and ended, the fifth got NAK 5".to_owned())
}

async fn resource(driver: &mut Driver) -> Verdict {
    let bytes = || list(0..=u8::MAX);
    let spi = SpiTransfer { direction: 0, clock_hz: 10_000, data: bytes() };
    let pairs: [(&str, Raw, Raw); 6] = [
        ("timers", raw(&slow()), raw(&TimerMeasure { timer: 1, period_us: 100, count: 1 })),
        ("AD converter", raw(&AdRead { channels: 1, samples: 1000 }), raw(&AdRead { channels: 2, samples: 1 })),
        (
            "SCI",
            raw(&SciEcho { rate_baud: 9600, data: bytes() }),
            raw(&SciEcho { rate_baud: 115_200, data: list([1]) }),
        ),
        ("IO pins", raw(&spi), raw(&IoTest { driver: 0, reader: 1, level: 1 })),
        ("SDRAM", raw(&RamTest { ram: 1, pattern: 4 }), raw(&RamTest { ram: 1, pattern: 2 })),
        ("SPI flash", raw(&FlashErase { flash: 0, sector: 0 }), raw(&FlashId { flash: 0 })),
    ];
    let mut tried = Vec::new();
    for (resource, first, second) in pairs {
        let asked = driver.post_raw(first.0, &first.1);
        let place = driver.first_answer(&asked).await?;
        if driver.heard()[place].of(Kind::Nak).is_some() {
            continue;
        }
        let other = driver.post_raw(second.0, &second.1);
        let answered = driver.first_answer(&other).await?;
        if all_run(driver, &[asked]) {
            demand(driver.heard()[answered].of(Kind::Nak).is_some(), || {
                format!("{}: {} was accepted while {} ran", resource, name_of(second.0), name_of(first.0))
            })?;
            driver.refused(&other, 5, &format!("while {} held the {resource}", name_of(first.0))).await?;
            tried.push(resource);
        }
        driver.end_of(&asked).await?;
        driver.end_of(&other).await?;
    }
    demand(!tried.is_empty(), || "no request ran long enough".to_owned())?;
    Ok(tried.join(", "))
}

async fn power(driver: &mut Driver) -> Verdict {
    driver.needs(capability::POWER)?;
    let asked = driver.post(&slow());
    driver.accepted(&asked).await?;
    for on in [1, 0] {
        let other = driver.post(&ModulePower { on });
        driver.refused(&other, 5, "while TimerMeasure ran").await?;
    }
    driver.end_of(&asked).await?.body()?;
    let switching = driver.post(&ModulePower { on: 1 });
    driver.accepted(&switching).await?;
    let other = driver.post(&ModulePower { on: 1 });
    let place = driver.first_answer(&other).await?;
    if all_run(driver, &[switching]) {
        demand(driver.heard()[place].of(Kind::Nak).is_some(), || {
            "a second ModulePower was accepted beside one".to_owned()
        })?;
        driver.refused(&other, 5, "beside ModulePower").await?;
    }
    driver.end_of(&switching).await?.body()?;
    driver.end_of(&other).await?;
    Ok("NAK 5 beside TimerMeasure and beside ModulePower".to_owned())
}

async fn none(driver: &mut Driver) -> Verdict {
    let asked = driver.post(&slow());
    driver.accepted(&asked).await?;
    driver.ask(&ErrorRecords { from: 0 }).await?;
    driver.ask(&LinkCounters {}).await?;
    driver.ask(&Abort { request: 0x7ABC }).await?;
    driver.ask(&Identity {}).await?;
    demand(all_run(driver, &[asked]), || "TimerMeasure of 500 ms ended before them".to_owned())?;
    driver.end_of(&asked).await?.body()?;
    Ok("they and Identity were done while TimerMeasure ran".to_owned())
}

async fn not_queued(driver: &mut Driver) -> Verdict {
    let quick = TimerMeasure { timer: 1, period_us: 1000, count: 1 };
    let asked = driver.post(&slow());
    driver.accepted(&asked).await?;
    let other = driver.post(&quick);
    driver.refused(&other, 5, "while TimerMeasure ran").await?;
    let from = driver.mark();
    driver.end_of(&asked).await?.body()?;
    driver.listen(Duration::from_millis(200)).await?;
    let late = driver.heard()[from..].iter().filter_map(|heard| heard.frame.as_ref().ok());
    let late = late.filter(|frame| frame.header.kind != Kind::Event && frame.header.request == other.request).count();
    demand(late == 0, || format!("{late} more answers to what got NAK 5"))?;
    driver.ask(&quick).await?;
    Ok("NAK 5, and done when asked again".to_owned())
}

async fn aborted_flash(driver: &mut Driver) -> Verdict {
    let id = driver.ask(&FlashId { flash: 1 }).await?;
    if id.scratch_sectors == 0 {
        return not_applicable("the internal flash has no scratch sector");
    }
    let erase = driver.post(&FlashErase { flash: 1, sector: 0 });
    let accepted = driver.accepted(&erase).await?;
    let accept = driver.heard()[erase.from..].iter().find_map(|heard| heard.of(Kind::Accept));
    let expected_ms = accept.and_then(|frame| u32::from_payload(&frame.payload).ok()).unwrap_or(0);
    driver.ask(&Abort { request: erase.request }).await?;
    let mut busy = 0;
    loop {
        let answer = driver.call(&FlashId { flash: 1 }).await?;
        match answer.nak() {
            Some(5) => busy += 1,
            Some(code) => return failed(format!("NAK {code} where the flash is busy or free")),
            None => {
                let after = answer.asked.sent - accepted;
                let early = busy == 0 && after < Duration::from_millis(u64::from(expected_ms) / 2);
                demand(!early, || {
                    format!(
                        "the flash was free {} after an erase of {expected_ms} ms began that was aborted",
                        ms(after)
                    )
                })?;
                if busy == 0 {
                    return not_applicable(format!("the flash had finished its work {} after it began", ms(after)));
                }
                // The sector holds anything now.
                driver.ask(&FlashErase { flash: 1, sector: 0 }).await?;
                return Ok(format!("NAK 5 up to {} after it began", ms(after)));
            }
        }
        demand(accepted.elapsed() < ERASE_WITHIN, || format!("the flash is busy for more than {}", ms(ERASE_WITHIN)))?;
        driver.listen(Duration::from_millis(10)).await?;
    }
}
