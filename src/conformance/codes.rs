//! Section 12: codes, and their order.

use gnc_protocol::message::{AdRead, LinkCounters, Nak};
use gnc_protocol::wire::Wire as _;
use gnc_protocol::{Call as _, Kind, PROTOCOL_VERSION};

use crate::check::checks;
use crate::driver::{Driver, NO_MESSAGE};
use crate::examples::slow;
use crate::stop::{Verdict, demand, failed, not_applicable};
use crate::together::{all_end, all_run, begin_four};

checks! { 12:
    "nak.layout" Session layout "a NAK is a code and a text of at most 160 bytes",
    "nak.unknown-message" Session unknown_message "an unknown message gets NAK 2, whatever its payload",
    "nak.version-first" Powered version_first "of several reasons another version counts before an id that runs",
    "nak.running-id-first" Powered running_id_first "an id that runs under another message counts before an unknown message and a bad payload",
    "nak.before-busy" Powered before_busy "an unknown message and a bad payload count before four requests that run",
    "nak.kept-before-busy" Powered kept_before_busy "a kept result is repeated while four requests run",
    "status.known" Powered known_status "statuses of a RESULT are 0 to 3",
}

async fn layout(driver: &mut Driver) -> Verdict {
    let asked = driver.post_raw(NO_MESSAGE, &[]);
    let place = driver.first_answer(&asked).await?;
    let Some(frame) = driver.heard()[place].of(Kind::Nak) else { return failed(driver.came(place)) };
    let Ok(nak) = Nak::from_payload(&frame.payload) else {
        return failed(format!("{} bytes do not read as code and text", frame.payload.len()));
    };
    demand((1..=10).contains(&nak.code), || format!("code {} has no meaning in this version", nak.code))?;
    Ok(format!("code {}, {} bytes of text", nak.code, nak.text.len()))
}

async fn unknown_message(driver: &mut Driver) -> Verdict {
    for message in [0, 0x0006, 0x0026, NO_MESSAGE, 0xFFFF] {
        for payload in [&[][..], &[1; 40]] {
            let asked = driver.post_raw(message, payload);
            driver.refused(&asked, 2, "that no version has").await?;
        }
    }
    Ok("5 messages".to_owned())
}

async fn version_first(driver: &mut Driver) -> Verdict {
    let asked = driver.post(&slow());
    driver.accepted(&asked).await?;
    let other = driver.post_as(PROTOCOL_VERSION + 1, 0, asked.request, LinkCounters::ID, &[]);
    driver.refused(&other, 2, "of version 2 under an id that runs").await?;
    driver.end_of(&asked).await?.body()?;
    Ok("NAK 2".to_owned())
}

async fn running_id_first(driver: &mut Driver) -> Verdict {
    let asked = driver.post(&slow());
    driver.accepted(&asked).await?;
    for (message, payload) in [(NO_MESSAGE, &[][..]), (LinkCounters::ID, &[1, 2, 3])] {
        let other = driver.post_as(PROTOCOL_VERSION, 0, asked.request, message, payload);
        driver.refused(&other, 4, "under an id that runs under another message").await?;
    }
    driver.end_of(&asked).await?.body()?;
    Ok("NAK 4 twice".to_owned())
}

async fn before_busy(driver: &mut Driver) -> Verdict {
    let running = begin_four(driver).await?;
    let unknown = driver.post_raw(NO_MESSAGE, &[]);
    let bad = driver.post_raw(AdRead::ID, &[1]);
    driver.refused(&unknown, 2, "while four run").await?;
    driver.refused(&bad, 3, "with too short a payload while four run").await?;
    let four = all_run(driver, &running);
    all_end(driver, &running).await?;
    if !four {
        return not_applicable("one of the four ended before: this module is too quick");
    }
    Ok("NAK 2 and NAK 3 while four run".to_owned())
}

async fn kept_before_busy(driver: &mut Driver) -> Verdict {
    let before = driver.call(&LinkCounters {}).await?;
    before.body()?;
    let running = begin_four(driver).await?;
    let again = driver.post_again(&before.asked, &LinkCounters {});
    let after = driver.end_of(&again).await?;
    let four = all_run(driver, &running);
    demand(after.is_replayed(), || format!("it was answered by {}", after.words()))?;
    all_end(driver, &running).await?;
    if !four {
        return not_applicable("one of the four ended before: this module is too quick");
    }
    Ok("REPLAYED while four run".to_owned())
}

async fn known_status(driver: &mut Driver) -> Verdict {
    let running = begin_four(driver).await?;
    let mut statuses = Vec::new();
    for asked in &running {
        match driver.end_of(asked).await?.end {
            crate::driver::End::Result { status, .. } => statuses.push(status),
            crate::driver::End::Nak { code, .. } => return failed(format!("NAK {code} after ACCEPT")),
        }
    }
    demand(statuses.iter().all(|status| *status <= 3), || format!("statuses {statuses:?}"))?;
    Ok(format!("{statuses:?}"))
}
