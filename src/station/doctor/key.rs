//! Tries the station's key, and reads the keys that it trusts, as a run would.

use std::path::Path;

use gnc_executive::bench::BenchFile;
use gnc_records::store::{KeyError, StationKey};
use gnc_text::{shown_path, with_causes};

use super::Finding;
use crate::setup;

/// Reads the key that the bench file names, signs a few bytes with it, and holds them against the public half beside it.
pub(super) fn look(bench: &BenchFile, folder: &Path) -> Vec<Finding> {
    let Some(named) = &bench.key else { return Vec::new() };
    let path = folder.join(named);
    let key = match setup::key(bench, Some(folder)) {
        Ok(Some(key)) => key,
        Ok(None) => return Vec::new(),
        Err(refusal) => return vec![Finding::bad(refusal.what, refusal.try_this)],
    };
    let shown = shown_path(&path);
    let what = format!("the key {shown} signs; the fingerprint of its public half is {}", key.public().fingerprint());
    let mut findings = vec![Finding::good(what)];
    findings.extend(match StationKey::public_beside(&path) {
        Ok(None) => None,
        Ok(Some((_, public))) if key.is_proved_by(&public) => None,
        Ok(Some((beside, public))) => Some(Finding::warning(
            format!(
                "{} is the public half of another key ({}), so it does not prove the runs that {shown} signs",
                shown_path(&beside),
                public.fingerprint()
            ),
            format!(
                "openssl pkey -inform DER -in {shown} -pubout -outform DER -out FILE; keep the old half for its runs"
            ),
        )),
        Err(error) => Some(unreadable(&error)),
    });
    findings
}

/// Reads the public keys of other stations that the bench file names: a run reads them all, and begins with none missing.
pub(super) fn trusted(bench: &BenchFile, folder: &Path) -> Vec<Finding> {
    let look = |named: &String| match setup::trusted_key(named, Some(folder)) {
        Ok(key) => Finding::good(format!(
            "the key {} is trusted with the fingerprint {}",
            shown_path(&folder.join(named)),
            key.fingerprint()
        )),
        Err(refusal) => Finding::bad(refusal.what, refusal.try_this),
    };
    bench.trusted_keys.iter().map(look).collect()
}

fn unreadable(error: &KeyError) -> Finding {
    Finding::warning(with_causes(error), error.try_this())
}
