//! The personalities that come with the library.

macro_rules! boards {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("boards/", $name, ".toml")))),*]
    };
}

/// Name and text of every embedded personality, the good module first.
pub(crate) const BOARDS: &[(&str, &str)] = boards![
    "good",
    "accel-noisy",
    "accel-saturated",
    "accel-swapped",
    "can-bad-transceiver",
    "can-bus-off",
    "can-flips-bits",
    "can-loses-frames",
    "can-swaps-frames",
    "core-2-dead",
    "core-2-multiplier",
    "dip-unwired",
    "gnss-loses-fix",
    "gnss-wrong-place",
    "good-2",
    "good-3",
    "good-4",
    "good-5",
    "gyro-dead",
    "gyro-noisy",
    "gyro-stuck",
    "gyro-swapped",
    "internal-flash-bad-bit",
    "internal-ram-stuck-cell",
    "io-open",
    "io-shorted",
    "late-board",
    "mag-saturated",
    "no-sky",
    "pps-missing",
    "rail-low",
    "reboots-in-sdram",
    "rs422-loses-bytes",
    "sci-flips-bits",
    "sci-loses-bytes",
    "sdram-address-open",
    "sdram-address-short",
    "sdram-cells-coupled",
    "sdram-data-line-stuck",
    "silent-board",
    "spi-flash-bad-sector",
    "spi-flash-slow",
    "spi-flips-bits",
    "supply-low",
    "timer-fast",
    "timer-misses-interrupts",
    "wrong-firmware",
    "wrong-serial-number",
];
