//! A serial port that is only read, such as that of a barcode reader. It may be unplugged for any time.

use std::future::pending;
use std::path::PathBuf;
use std::time::Duration;

use tokio::io::AsyncReadExt as _;
use tokio::time::{Instant, sleep_until};
use tokio_serial::SerialStream;

use super::OpenError;
use super::port::{is_pseudo_terminal, open_stream};

/// Time between two looks for a port that is not there. A person who plugs a scanner in waits no longer.
const LOOK_EVERY: Duration = Duration::from_millis(250);
/// Bytes read at once: the longest codes have some thousand.
const READ_AT_ONCE: usize = 1024;

/// What came from the port.
#[derive(Debug)]
pub enum Heard {
    /// Bytes.
    Bytes(Vec<u8>),
    /// The port is not there or cannot be used. The listener goes on looking for it, and says this once.
    Away(OpenError),
    /// The port is there again.
    Back,
}

/// Listens to a port, and opens it again whenever it is back.
#[derive(Debug)]
pub struct Listener {
    port: PathBuf,
    rate_baud: u32,
    state: State,
}

#[derive(Debug)]
enum State {
    Open(SerialStream),
    /// The port is opened at this time; `told`: its absence was reported.
    Away {
        look_at: Instant,
        told: bool,
    },
    /// A pseudo-terminal that is gone: another program may get its name.
    Over,
}

impl Listener {
    /// A listener that has not opened its port yet.
    #[must_use]
    pub fn new(port: PathBuf, rate_baud: u32) -> Self {
        Self { port, rate_baud, state: State::Away { look_at: Instant::now(), told: false } }
    }

    /// Waits for what comes next. A caller that drops this wait half way loses nothing.
    pub async fn next(&mut self) -> Heard {
        loop {
            match &mut self.state {
                State::Open(stream) => {
                    let mut bytes = vec![0; READ_AT_ONCE];
                    if let Ok(count @ 1..) = stream.read(&mut bytes).await {
                        bytes.truncate(count);
                        return Heard::Bytes(bytes);
                    }
                    // This closes the descriptor. Otherwise the kernel would give the scanner another name when it is back.
                    let told = true;
                    self.state = match is_pseudo_terminal(&self.port) {
                        true => State::Over,
                        false => State::Away { look_at: Instant::now() + LOOK_EVERY, told },
                    };
                    return Heard::Away(OpenError::Missing { port: self.port.clone() });
                }
                State::Away { look_at, told } => {
                    sleep_until(*look_at).await;
                    let was_told = *told;
                    match open_stream(&self.port, self.rate_baud) {
                        Ok(stream) => {
                            self.state = State::Open(stream);
                            if was_told {
                                return Heard::Back;
                            }
                        }
                        Err(error) => {
                            self.state = State::Away { look_at: Instant::now() + LOOK_EVERY, told: true };
                            if !was_told {
                                return Heard::Away(error);
                            }
                        }
                    }
                }
                State::Over => pending::<()>().await,
            }
        }
    }
}
