//! This program, as `--version` and records name it. `build.rs` finds the commit.

use chrono::DateTime;
use gnc_executive::event::{BuildInfo, ProgramVersion};

/// Version and commit, for people.
pub(crate) const SHOWN: &str = env!("GNC_VERSION");

/// This program, as records name it.
pub(crate) fn program() -> ProgramVersion {
    let name = env!("CARGO_PKG_NAME").to_owned();
    ProgramVersion { name, version: env!("CARGO_PKG_VERSION").to_owned(), build: build() }
}

/// The sources of this program; `None` if they were built without git.
fn build() -> Option<BuildInfo> {
    let committed = DateTime::parse_from_rfc3339(env!("GNC_COMMITTED")).ok()?;
    let modified = !env!("GNC_MODIFIED").is_empty();
    Some(BuildInfo { commit: env!("GNC_COMMIT").to_owned(), committed, modified })
}
