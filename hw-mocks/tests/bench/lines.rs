//! IO lines and SPI against truth tables worked out by hand.

use gnc_protocol::message::{IoTest, SpiDirection};
use hw_mocks::devices::lines::{LineFaults, Lines};

fn io(faults: &LineFaults, driver: u8, reader: u8, level: u8) -> u8 {
    Lines::new(faults.clone()).io_test(&IoTest { driver, reader, level })
}

fn spi(faults: &LineFaults, direction: SpiDirection, data: &[u8]) -> Vec<u8> {
    Lines::new(faults.clone()).spi(direction, data).to_vec()
}

const BOTH: [SpiDirection; 2] = [SpiDirection::FromModule, SpiDirection::ToModule];

/// Driver and reader have the driven level, the two others the opposite.
#[test]
fn good_lines_follow_their_driver_and_no_other() {
    for (driver, reader) in (0..4).flat_map(|d| (0..4).map(move |r| (d, r))).filter(|(d, r)| d != r) {
        let pair = 1 << driver | 1 << reader;
        assert_eq!(io(&LineFaults::default(), driver, reader, 1), pair);
        assert_eq!(io(&LineFaults::default(), driver, reader, 0), 0b1111 ^ pair);
    }
}

/// Lines 2 and 3 are in contact: each of them, driven or read, takes the other with it.
#[test]
fn shorted_pair_moves_together() {
    let faults = LineFaults { shorted: vec![(2, 3)], ..LineFaults::default() };
    assert_eq!(io(&faults, 0, 1, 1), 0b0011);
    assert_eq!(io(&faults, 0, 1, 0), 0b1100);
    assert_eq!(io(&faults, 0, 2, 1), 0b1101);
    assert_eq!(io(&faults, 0, 2, 0), 0b0010);
    assert_eq!(io(&faults, 3, 1, 1), 0b1110);
    assert_eq!(io(&faults, 2, 3, 1), 0b1100);
}

/// The other pin does not reach a broken line, which stays at the level of its pull.
#[test]
fn open_line_stays_at_its_pull() {
    let faults = LineFaults { open: vec![1], ..LineFaults::default() };
    assert_eq!(io(&faults, 0, 1, 1), 0b0001);
    assert_eq!(io(&faults, 0, 1, 0), 0b1110);
    assert_eq!(io(&faults, 1, 2, 1), 0b0010);
    assert_eq!(io(&faults, 0, 2, 1), 0b0101);
}

/// Ground wins over a driver.
#[test]
fn line_on_ground_stays_low() {
    let faults = LineFaults { stuck: vec![(2, false)], ..LineFaults::default() };
    assert_eq!(io(&faults, 2, 0, 1), 0b0000);
    assert_eq!(io(&faults, 2, 0, 0), 0b1010);
    assert_eq!(io(&faults, 0, 1, 0), 0b1000);
}

#[test]
fn spi_carries_every_byte_both_ways() {
    let all: Vec<u8> = (0..=255).collect();
    for direction in BOTH {
        assert_eq!(spi(&LineFaults::default(), direction, &all), all);
        assert_eq!(spi(&LineFaults::default(), direction, &[]), []);
    }
}

/// SDI and SDO are in contact: the idle side holds the line low, and low wins.
#[test]
fn shorted_data_lines_read_zeros() {
    let faults = LineFaults { shorted: vec![(2, 3)], ..LineFaults::default() };
    for direction in BOTH {
        assert_eq!(spi(&faults, direction, &[0xff, 0x5a]), [0, 0]);
    }
}

/// Without a clock the board receives no byte. As sender it never shifts, so the module reads its first bit repeatedly.
#[test]
fn open_clock_stops_both_directions() {
    let faults = LineFaults { open: vec![1], ..LineFaults::default() };
    assert_eq!(spi(&faults, SpiDirection::FromModule, &[0xa5, 1]), []);
    assert_eq!(spi(&faults, SpiDirection::ToModule, &[0xa5, 1]), [0xff, 0xff]);
    assert_eq!(spi(&faults, SpiDirection::ToModule, &[0x25, 1]), [0, 0]);
}

/// Without a select the board neither listens nor shifts.
#[test]
fn open_select_stops_the_board() {
    let faults = LineFaults { open: vec![0], ..LineFaults::default() };
    assert_eq!(spi(&faults, SpiDirection::FromModule, &[0xa5]), []);
    assert_eq!(spi(&faults, SpiDirection::ToModule, &[0xa5]), [0xff]);
}

/// Lines 0 and 1 are in contact: while the select is low the clock is low too, so there is no edge.
#[test]
fn shorted_select_and_clock_carry_nothing() {
    let faults = LineFaults { shorted: vec![(0, 1)], ..LineFaults::default() };
    assert_eq!(spi(&faults, SpiDirection::FromModule, &[0xa5]), []);
}

/// The 1000th bit is bit 7 of byte 124 from the left, which is its lowest.
#[test]
fn flipped_bit_is_the_one_counted() {
    let faults = LineFaults { flip_every_bits: 1000, ..LineFaults::default() };
    let mut expected = vec![0xaa; 200];
    expected[124] ^= 1;
    assert_eq!(spi(&faults, SpiDirection::FromModule, &[0xaa; 200]), expected);
}
