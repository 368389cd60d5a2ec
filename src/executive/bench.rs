//! The bench file: where the bench stands and how the station reaches its board.
//!
//! ```toml
//! [station]
//! id = "line-2"                      # required
//! records = "records"                # folder of the records, relative to this file
//! key = "station.key"                # optional: signs each run that is closed
//! trusted_keys = ["line-1.key.pub"]  # optional: public keys of other stations whose passes count here
//! serial_number = "SN-[0-9]{4}"      # optional: a regular expression that the whole number of each module matches
//! plan = "plans/functional.toml"     # optional: the plan with which the screen opens, relative to this file
//!
//! [plans]                            # optional: the plans of this bench and no others, by the digests of their texts
//! acceptance = "sha256:0123..."      # `gnc-station plan check --sim` prints the line
//!
//! [operator]                         # optional
//! required = true                    # no run begins without a name
//! name = "A. Chen"                   # the operator, if the command line and the screen name none
//!
//! [verdict]                          # optional
//! bell = true                        # the terminal rings at each verdict and each question
//! hook = ["./light.sh", "socket-1"]  # a program that reads each verdict as JSON from its standard input
//! hook_time = "10 s"                 # it is killed after this time
//!
//! [screen]                           # optional
//! pictures = "auto"                  # how pictures of questions are drawn: kitty, iterm2, sixel, off
//!
//! [shift]                            # optional: without it a shift begins at midnight
//! begins = ["06:00", "14:00", "22:00"]
//!
//! [numbers.order]                    # optional: a number that is asked for beside the serial number, see `numbers.rs`
//! kind = "order"
//! pattern = "PO-[0-9]{4}"
//!
//! [site]                             # optional
//! name = "hall 3"
//! latitude = "39.9042 deg"           # surveyed place of the antenna
//! longitude = "116.4074 deg"
//! height = "44 m"
//! gravity = "9.80151 m/s^2"          # local gravity, where it was measured
//! field = "0.55 gauss"               # total magnetic field
//!
//! [fixture]                          # optional, see [`BenchImperfections`]: how the module's seat is mounted, what fields the bench adds
//! mounting = ["0.012 deg", "-0.018 deg", "0 deg"]
//! mounting_u = "0.002 deg"
//!
//! [socket]                           # optional; --sim needs none
//! link = "rs422"                     # or "can": then it has neither port nor rate
//! port = "/dev/ttyUSB0"              # required
//! rate = "921600 bit/s"
//!
//! [can]                              # optional: without it items that need CAN cannot run
//! port = "can0"                      # an interface of the kernel, or "slcan:/dev/ttyACM0"
//!
//! [scanner]                          # optional: a barcode reader at a serial port, beside one that types as a keyboard
//! port = "/dev/ttyACM0"              # required
//! rate = "9600 bit/s"
//! ```

mod habits;
mod imperfections;
mod pinned;

use chrono::NaiveTime;
use gnc_config::{Mistakes, SourceText, Span, TomlTable, read};
use gnc_text::quoted;
use serde::{Deserialize, Serialize};

pub use habits::{DrawPictures, Hook, OperatorHabit, VerdictHabit};
pub use imperfections::BenchImperfections;
pub use pinned::{PinError, PinnedPlans, ShortDigest};

use crate::numbers::{self, NumberField};
use crate::quantity::{Dimension, Unit, bounded_at, quantity_at};
use crate::serial_number::{self, SerialNumberPattern};

/// Largest size of a bench file in bytes; a usual one has about 1 kB.
pub const MAX_BENCH_BYTES: usize = 64 << 10;

/// Rate of the RS-422 link if the bench file does not give one.
pub(crate) const DEFAULT_RATE_BPS: u32 = 921_600;

/// Rate of a scanner if the bench file does not give one: with which most leave the works.
pub(crate) const DEFAULT_SCANNER_RATE_BPS: u32 = 9600;

/// Largest number of characters of a name or path.
const TEXT_CHARACTERS: usize = 1024;

/// A checked bench file.
#[derive(Clone, Debug, PartialEq)]
pub struct BenchFile {
    /// Name of the station.
    pub station_id: String,
    /// Folder of the records as written; `None` if the program chooses it.
    pub records: Option<String>,
    /// File of the station's key as written; `None` if the station signs nothing.
    pub key: Option<String>,
    /// Files of the public keys of other stations whose passes count here, as written.
    pub trusted_keys: Vec<String>,
    /// The plan with which the screen opens, as written; `None` if the program chooses it.
    pub plan: Option<String>,
    /// The plans that the bench runs, if it does not run any.
    pub plans: PinnedPlans,
    /// Who tests.
    pub operator: OperatorHabit,
    /// What follows a verdict.
    pub verdict: VerdictHabit,
    /// How the screen draws the pictures of questions.
    pub pictures: DrawPictures,
    /// When shifts begin, in the order of the day; empty if one begins at midnight.
    pub shifts: Vec<NaiveTime>,
    /// What the serial number of each module must match.
    pub serial_number: Option<SerialNumberPattern>,
    /// Numbers beside the serial number that every run is asked for.
    pub numbers: Vec<NumberField>,
    /// Where the bench stands.
    pub site: Option<BenchSite>,
    /// How the station reaches the board; `None` on a bench that only simulates.
    pub socket: Option<TestSocket>,
    /// The CAN bus; `None` on a bench without CAN.
    pub can: Option<CanSettings>,
    /// The scanner at a serial port, if there is one.
    pub scanner: Option<ScannerSettings>,
}

/// Where a bench stands.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BenchSite {
    /// Name for records.
    pub name: Option<String>,
    /// Surveyed place of the antenna, if it is known.
    pub place: Option<SitePlace>,
    /// Local gravity in m/s^2, if it was measured.
    pub gravity_mps2: Option<f64>,
    /// Total magnetic field in gauss, if it was measured.
    pub field_gauss: Option<f64>,
    /// Imperfections of the bench, if its file states them; otherwise [`BenchImperfections::default`] counts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fixture: Option<BenchImperfections>,
}

impl BenchSite {
    /// Imperfections of the bench: as its file states them, or the defaults.
    pub fn fixture(site: Option<&BenchSite>) -> BenchImperfections {
        site.and_then(|site| site.fixture).unwrap_or_default()
    }
}

/// A surveyed place, WGS 84.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SitePlace {
    /// Latitude, north positive.
    pub latitude_deg: f64,
    /// Longitude, east positive.
    pub longitude_deg: f64,
    /// Height above the ellipsoid.
    pub height_m: f64,
}

/// A test socket with its slave board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TestSocket {
    /// RS-422.
    Rs422 {
        /// The serial port.
        port: String,
        /// Its rate.
        rate_bps: u32,
    },
    /// The bus of [`BenchFile::can`].
    Can,
}

/// The CAN bus of a bench.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CanSettings {
    /// An interface of the kernel, or `slcan:` and a serial port.
    pub port: String,
}

/// A barcode reader at a serial port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScannerSettings {
    /// The serial port.
    pub port: String,
    /// Its rate.
    pub rate_bps: u32,
}

impl BenchFile {
    /// Reads a bench file; `name` is the user's name for it.
    ///
    /// # Errors
    /// All mistakes of meaning, or the first syntax error alone.
    pub fn read(name: &str, bytes: Vec<u8>) -> Result<BenchFile, Mistakes> {
        read(&SourceText::new(name, bytes, MAX_BENCH_BYTES)?, |root| {
            let station = root.within("station", station).unwrap_or_else(|| {
                if !root.has("station") {
                    root.mistake("the table [station] is missing", "write [station] and id = \"line-2\" below it");
                }
                Station::default()
            });
            let site = root.within("site", site);
            // A bench file may state its fixture without its place.
            let site = match (site, root.within("fixture", imperfections::fixture)) {
                (None, None) => None,
                (site, fixture) => Some(BenchSite { fixture, ..site.unwrap_or_default() }),
            };
            let has_can = root.has("can");
            let socket = root.within("socket", |table| socket(table, has_can)).flatten();
            let can = root.within("can", can).flatten();
            let others = [
                socket.as_ref().and_then(|socket| match socket {
                    TestSocket::Rs422 { port, .. } => Some(("board", port.as_str())),
                    TestSocket::Can => None,
                }),
                can.as_ref().and_then(|can| Some(("CAN bus", can.port.strip_prefix("slcan:")?))),
            ];
            let scanner = root.within("scanner", |table| scanner(table, &others)).flatten();
            let operator = root.within("operator", habits::operator).unwrap_or_default();
            let verdict = root.within("verdict", habits::verdict).unwrap_or_default();
            let pictures = root.within("screen", habits::pictures).unwrap_or_default();
            let shifts = root.within("shift", habits::shifts).unwrap_or_default();
            let numbers = numbers::read(root);
            let plans = pinned::plans(root);
            let Station { id: station_id, records, key, trusted_keys, plan, serial_number } = station;
            BenchFile {
                station_id,
                records,
                key,
                trusted_keys,
                plan,
                plans,
                operator,
                verdict,
                pictures,
                shifts,
                serial_number,
                numbers,
                site,
                socket,
                can,
                scanner,
            }
        })
    }
}

/// The table [station].
#[derive(Default)]
struct Station {
    id: String,
    records: Option<String>,
    key: Option<String>,
    trusted_keys: Vec<String>,
    plan: Option<String>,
    serial_number: Option<SerialNumberPattern>,
}

fn station(table: &TomlTable<'_, '_>) -> Station {
    let id = checked(table, table.required_text("id", "write id = \"line-2\" below [station]"));
    let name = |key| checked(table, table.text(key));
    let serial_number = serial_number::pattern(table, "serial_number", "SN-[0-9]{4}");
    let trusted_keys = table.texts("trusted_keys").into_iter().filter_map(|written| checked(table, Some(written)));
    Station {
        id: id.unwrap_or_default(),
        records: name("records"),
        key: name("key"),
        trusted_keys: trusted_keys.collect(),
        plan: name("plan"),
        serial_number,
    }
}

fn site(table: &TomlTable<'_, '_>) -> BenchSite {
    let latitude_deg = bounded_at(table, "latitude", Unit::Degree, (-90.0, 90.0));
    let longitude_deg = bounded_at(table, "longitude", Unit::Degree, (-180.0, 180.0));
    // The range goes from the shore of the Dead Sea to the highest town, with some room.
    let height_m = bounded_at(table, "height", Unit::Metre, (-1000.0, 9000.0));
    let written = ["latitude", "longitude", "height"].map(|key| table.has(key));
    if written.contains(&true) && written.contains(&false) {
        table.mistake("the place of the antenna is incomplete", "write latitude, longitude and height");
    }
    let place = match (latitude_deg, longitude_deg, height_m) {
        (Some(latitude_deg), Some(longitude_deg), Some(height_m)) => {
            Some(SitePlace { latitude_deg, longitude_deg, height_m })
        }
        _ => None,
    };
    BenchSite {
        name: checked(table, table.text("name")),
        place,
        // Gravity on the surface of the earth lies between 9.76 and 9.84 m/s^2.
        gravity_mps2: bounded_at(table, "gravity", Unit::MetrePerSecondSquared, (9.7, 9.9)),
        // The earth's field lies between 0.22 and 0.67 gauss; a shielded room or a coil may change it.
        field_gauss: bounded_at(table, "field", Unit::Gauss, (0.0, 6.0)),
        fixture: None,
    }
}

fn can(table: &TomlTable<'_, '_>) -> Option<CanSettings> {
    let hint = "write port = \"can0\" or port = \"slcan:/dev/ttyACM0\" below [can]";
    checked(table, table.required_text("port", hint)).map(|port| CanSettings { port })
}

fn socket(table: &TomlTable<'_, '_>, has_can: bool) -> Option<TestSocket> {
    if let Some(link) = table.entry("link") {
        match link.text() {
            None | Some("rs422") => {}
            Some("can") => {
                if !has_can {
                    link.mistake("there is no CAN bus", "write [can] and port = \"can0\" below it");
                }
                return Some(TestSocket::Can);
            }
            Some(other) => link.mistake(format!("link is {}", quoted(other)), "it may be \"rs422\" or \"can\""),
        }
    }
    let port = table.required_text("port", "write port = \"/dev/ttyUSB0\" below [socket]");
    let port = checked(table, port);
    let rate_bps = rate_bps(table, DEFAULT_RATE_BPS);
    Some(TestSocket::Rs422 { port: port?, rate_bps })
}

/// Reads the scanner; `others` are the ports of the bench and what is at them.
fn scanner(table: &TomlTable<'_, '_>, others: &[Option<(&str, &str)>]) -> Option<ScannerSettings> {
    let written = table.required_text("port", "write port = \"/dev/ttyACM0\" below [scanner]");
    if let Some((port, span)) = written.clone()
        && let Some((what, _)) = others.iter().flatten().find(|(_, other)| *other == port)
    {
        let hint = "name the port of the scanner; `gnc-station ports` lists the ports";
        table.mistake_at(span, format!("the {what} is at {} too", quoted(port)), hint);
    }
    let rate_bps = rate_bps(table, DEFAULT_SCANNER_RATE_BPS);
    checked(table, written).map(|port| ScannerSettings { port, rate_bps })
}

/// Reads the rate of a serial port.
fn rate_bps(table: &TomlTable<'_, '_>, absent: u32) -> u32 {
    quantity_at(table, "rate", Dimension::BitRate).map_or(absent, |(rate, span)| {
        let bps = rate.si();
        if !(1200.0..=4e6).contains(&bps) || bps.fract() != 0.0 {
            table.mistake_at(
                span,
                format!("rate is {rate}"),
                "it may be a whole number from 1200 bit/s to 4000000 bit/s",
            );
        }
        bps as u32
    })
}

/// Reads a name or path; refuses an unfit one.
fn checked(table: &TomlTable<'_, '_>, written: Option<(&str, Span)>) -> Option<String> {
    let (text, span) = written?;
    if text.chars().any(char::is_control) || text.chars().count() > TEXT_CHARACTERS {
        table.mistake_at(
            span,
            format!("{} cannot be used as a name", quoted(text)),
            "write it without control characters",
        );
    }
    Some(text.to_owned())
}

#[cfg(test)]
mod tests;
