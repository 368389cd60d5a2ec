//! A serial cable in this program's memory. Station and bench share one clock. If this clock moves only while both
//! wait, a run repeats exactly.

use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::io::DuplexStream;

/// Bytes that may wait for the reader, in each direction: as many as a pseudo-terminal holds.
const HELD: usize = 4096;

/// The place where the station finds a cable's end. A cable that was pulled out comes back under the same name.
#[derive(Debug, Clone)]
pub struct MemoryPort {
    name: &'static str,
    rate_baud: u32,
    /// The station's end, until it is opened.
    plugged: Arc<Mutex<Option<DuplexStream>>>,
}

impl MemoryPort {
    /// Makes a place without a cable. The rate is the one that the bench states for its cable.
    #[must_use]
    pub fn new(name: &'static str, rate_baud: u32) -> Self {
        Self { name, rate_baud, plugged: Arc::default() }
    }

    /// Plugs a cable in and returns its other end. Dropping that end pulls the cable out.
    #[must_use]
    pub fn plug_in(&self) -> DuplexStream {
        let (station, bench) = tokio::io::duplex(HELD);
        *self.plugged() = Some(station);
        bench
    }

    /// Pulls out a cable if the station has not opened it.
    pub fn unplug(&self) {
        *self.plugged() = None;
    }

    pub(super) fn open(&self) -> Option<DuplexStream> {
        self.plugged().take()
    }

    pub(super) fn rate_baud(&self) -> u32 {
        self.rate_baud
    }

    fn plugged(&self) -> MutexGuard<'_, Option<DuplexStream>> {
        self.plugged.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Display for MemoryPort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl PartialEq for MemoryPort {
    /// Whether both are the same place.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.plugged, &other.plugged)
    }
}

impl Eq for MemoryPort {}
