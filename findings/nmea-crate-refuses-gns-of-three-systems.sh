#!/usr/bin/env bash
# The crate nmea refuses a GNS sentence with a mode letter for each of more than two systems.
#
# The mode field of GNS has one letter for each system in the order GPS, GLONASS, Galileo, BeiDou, QZSS, NavIC: NMEA 0183
# version 4.10 and later lets receivers add letters at its end. Receivers of four systems say `AAAN` or the like in every epoch,
# and many of them say GNS in place of GGA. The crate takes two letters and then wants a comma, so a program
# that uses it hears such a receiver and never finds a fix.
#
# Seen here: the crate reads GNS with `AA`; with `AAN` and `AAAN` it gives an error. All checksums are right.
#
# What to do instead: read the fields of the sentence by other means where the crate refuses it.
#
# This script builds a program with nmea 0.8.0 in a temporary folder. It exits with 0 if the behaviour is as described, with 1 if it
# changed.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir "$folder/src"
cat > "$folder/Cargo.toml" <<'TOML'
[package]
name = "finding"
version = "0.0.0"
edition = "2024"
[dependencies]
nmea = { version = "=0.8.0", default-features = false, features = ["GNS"] }
TOML
cat > "$folder/src/main.rs" <<'RUST'
fn main() {
    let gns = |modes: &str| format!("GNGNS,120000.00,4807.03800,N,01131.00000,E,{modes},12,0.9,545.4,46.9,,");
    let cases = [
        ("GNS, two systems", gns("AA"), true),
        ("GNS, three systems", gns("AAN"), false),
        ("GNS, four systems", gns("AAAN"), false),
    ];
    let mut changed = false;
    for (what, body, expected) in cases {
        let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
        let sentence = format!("${body}*{sum:02X}");
        let read = nmea::parse_str(&sentence);
        println!("  {what:<22} {sentence}\n    {}", if read.is_ok() { "read" } else { "refused" });
        changed |= read.is_ok() != expected;
    }
    if changed {
        println!("the behaviour changed");
        std::process::exit(1);
    }
    println!("as described");
}
RUST
echo "nmea 0.8.0"
cargo run --quiet --manifest-path "$folder/Cargo.toml"
