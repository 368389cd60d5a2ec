//! Section 5: how payloads are laid out.

use gnc_protocol::Call as _;
use gnc_protocol::message::{CpuFloats, CpuIntegers, CpuWords, SciEcho, SpiTransfer};

use crate::check::checks;
use crate::driver::Driver;
use crate::examples::examples;
use crate::stop::Verdict;

checks! { 5:
    "payload.short" Session short "a payload that is too short gets NAK 3, in every message",
    "payload.long" Session long "a payload must end with its last field: one byte more gets NAK 3, in every message",
    "payload.count" Session count "a count above its bound gets NAK 3",
    "payload.count-beyond" Session count_beyond "a list that ends before its count gets NAK 3",
}

async fn short(driver: &mut Driver) -> Verdict {
    let mut tried = 0;
    for (message, payload) in examples() {
        if let [cut @ .., _] = payload.as_slice() {
            let asked = driver.post_raw(message, cut);
            driver.refused(&asked, 3, "with a byte too few").await?;
            tried += 1;
        }
    }
    Ok(format!("{tried} messages with a byte too few got NAK 3"))
}

async fn long(driver: &mut Driver) -> Verdict {
    let mut tried = 0;
    for (message, mut payload) in examples() {
        payload.push(0);
        let asked = driver.post_raw(message, &payload);
        driver.refused(&asked, 3, "with a byte too many").await?;
        tried += 1;
    }
    Ok(format!("{tried} messages with a byte too many got NAK 3"))
}

/// Bytes before a list or block, its bound, and bytes of an element.
const LISTS: [(u16, &[u8], u16, usize); 5] = [
    (CpuWords::ID, &[1, 0], 64, 4),
    (CpuIntegers::ID, &[1], 16, 8),
    (CpuFloats::ID, &[1], 15, 16),
    (SpiTransfer::ID, &[0, 0x40, 0x42, 0x0F, 0], 256, 1),
    (SciEcho::ID, &[0, 0xC2, 1, 0], 256, 1),
];

async fn count(driver: &mut Driver) -> Verdict {
    for (message, head, most, bytes) in LISTS {
        let payload = [head, &(most + 1).to_le_bytes(), &vec![0x3F; bytes * usize::from(most + 1)]].concat();
        let asked = driver.post_raw(message, &payload);
        driver.refused(&asked, 3, &format!("with {} elements", most + 1)).await?;
    }
    Ok(format!("{} messages with one element too many got NAK 3", LISTS.len()))
}

async fn count_beyond(driver: &mut Driver) -> Verdict {
    for (message, head, _, bytes) in LISTS {
        let payload = [head, &5_u16.to_le_bytes(), &vec![0x3F; bytes * 2]].concat();
        let asked = driver.post_raw(message, &payload);
        driver.refused(&asked, 3, "with a count of 5 and two elements").await?;
    }
    Ok(format!("{} messages got NAK 3", LISTS.len()))
}
