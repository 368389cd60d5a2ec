//! Bench files: refused with mistakes that can be shown, or with numbers in them that are those of a place on the earth.

#![no_main]

#[path = "shared/mistakes.rs"]
mod mistakes;

use gnc_executive::bench::{BenchFile, TestSocket};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    match BenchFile::read("bench.toml", bytes.to_vec()) {
        Ok(file) => fit(&file),
        Err(mistakes) => mistakes::can_be_shown(&mistakes),
    }
});

fn fit(file: &BenchFile) {
    if let Some(site) = &file.site {
        if let Some(place) = site.place {
            assert!(place.latitude_deg.abs() <= 90.0 && place.longitude_deg.abs() <= 180.0, "{place:?}");
            assert!((-1000.0..=9000.0).contains(&place.height_m), "{place:?}");
        }
        assert!(site.gravity_mps2.is_none_or(|gravity| (9.7..=9.9).contains(&gravity)), "{site:?}");
        assert!(site.field_gauss.is_none_or(|field| (0.0..=6.0).contains(&field)), "{site:?}");
    }
    if let Some(TestSocket::Rs422 { rate_bps, .. }) = file.socket {
        assert!((1200..=4_000_000).contains(&rate_bps));
    }
    assert!(file.socket != Some(TestSocket::Can) || file.can.is_some());
    let port = match &file.socket {
        Some(TestSocket::Rs422 { port, .. }) => Some(port),
        _ => None,
    };
    let texts = [Some(&file.station_id), file.records.as_ref(), file.key.as_ref(), port];
    let name = file.site.as_ref().and_then(|site| site.name.as_ref());
    for text in texts.into_iter().chain([name, file.can.as_ref().map(|can| &can.port)]).flatten() {
        assert!(!text.contains(char::is_control), "{text:?}");
    }
}
