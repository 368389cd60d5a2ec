//! The run that a raw file is of. A file that is carried to another run, or a run whose journal is written anew, contradicts it.

use std::collections::BTreeMap;

use mcap::records::Metadata;

/// The run that a file is of.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RawOrigin {
    /// The module, as it was scanned when the run began.
    pub serial_number: String,
    /// The plan.
    pub plan: String,
    /// The station.
    pub station: String,
    /// When the run began, as RFC 3339 writes it.
    pub started: String,
    /// SHA-256 of the first line of the run's journal, with its end. The chain has it in the line of the run's beginning.
    pub journal_sha256: String,
}

impl RawOrigin {
    /// Name of the metadata record.
    pub(super) const NAME: &str = "gnc.run";

    pub(super) fn record(&self) -> Metadata {
        let Self { serial_number, plan, station, started, journal_sha256 } = self;
        let fields = [
            ("serial_number", serial_number),
            ("plan", plan),
            ("station", station),
            ("started", started),
            ("journal_sha256", journal_sha256),
        ];
        let metadata = fields.map(|(key, value)| (key.to_owned(), value.clone())).into();
        Metadata { name: Self::NAME.to_owned(), metadata }
    }

    /// A record without a field has an empty one, which fits no run.
    pub(super) fn read(mut fields: BTreeMap<String, String>) -> Self {
        let mut field = |name: &str| fields.remove(name).unwrap_or_default();
        Self {
            serial_number: field("serial_number"),
            plan: field("plan"),
            station: field("station"),
            started: field("started"),
            journal_sha256: field("journal_sha256"),
        }
    }
}
