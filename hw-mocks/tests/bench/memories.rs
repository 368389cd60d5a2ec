//! RAM faults against the theory of memory tests, which says what each pattern finds; NOR flash against its data
//! sheet's rules.

use gnc_protocol::message::{
    ErrorKind, ErrorRecords, FlashBlankCheck, FlashErase, FlashId, FlashVerify, FlashWrite, RamPattern, RamTest,
};
use gnc_protocol::pattern::Xorshift32;
use hw_mocks::devices::flash::{FlashFaults, FlashMemory, SPI_FLASH};
use hw_mocks::devices::memory::{Memory, MemoryFaults, PatternRun};
use hw_mocks::noise::{Dice, RandomStream};

use crate::host::Host;

const N: u32 = 1 << 14;

/// Mismatches of solid, checkerboard, walking ones, address, March C- over a memory of N words of 32 bits.
fn mismatches(faults: &MemoryFaults) -> [u32; 5] {
    std::array::from_fn(|index| {
        let mut memory = Memory::new(N, 32, faults.clone(), || 0x1357_9bdf);
        let mut run = PatternRun::new(RamPattern::ALL[index]);
        let mut accesses = 0;
        while !run.is_done() {
            accesses += run.run(&mut memory, 1000);
        }
        assert_eq!(accesses, PatternRun::accesses(RamPattern::ALL[index], N));
        assert_eq!(run.reply().words, N);
        run.reply().mismatches
    })
}

#[test]
fn good_memory_has_no_mismatch() {
    assert_eq!(mismatches(&MemoryFaults::default()), [0; 5]);
}

/// A line stuck low fails wherever a one is read on it: all ones (N), 0xAA.. on an odd bit (N), the words whose walking
/// one is on it (N/32), half the addresses and half the complements (N), both r1 of March C- (2N).
#[test]
fn stuck_data_line_fails_every_pattern() {
    let faults = MemoryFaults { stuck_data_line: Some((7, false)), ..MemoryFaults::default() };
    assert_eq!(mismatches(&faults), [N, N, N / 32, N, 2 * N]);
}

/// Solid patterns write the same value everywhere and cannot show an address fault. Walking ones of period 32 cannot
/// show it in lines above the fifth. Three of four addresses share a cell, and only the last write to it is read back
/// right.
#[test]
fn shorted_address_lines_need_an_address_pattern_or_a_march() {
    let faults = MemoryFaults { shorted_address_lines: Some((6, 12)), ..MemoryFaults::default() };
    let [solid, checkerboard, walking, address, march] = mismatches(&faults);
    assert_eq!([solid, checkerboard, walking, address], [0, 0, 0, N]);
    assert!(march > 0);
}

/// Within one period of 32 words walking ones show it.
#[test]
fn low_address_line_fails_walking_ones_too() {
    let faults = MemoryFaults { stuck_address_line: Some((2, false)), ..MemoryFaults::default() };
    let [solid, checkerboard, walking, address, march] = mismatches(&faults);
    assert_eq!([solid, checkerboard, walking, address], [0, 0, N / 2, N]);
    assert!(march > 0);
}

/// A cell stuck at 0 fails each pattern as often as the pattern reads a one there: once; once on an odd bit; never
/// under walking ones of another bit; once in address or complement; twice in March C-.
#[test]
fn stuck_cell_fails_where_a_one_is_read() {
    let faults = MemoryFaults { stuck_cells: vec![(1000, 11, false)], ..MemoryFaults::default() };
    assert_eq!(mismatches(&faults), [1, 1, 0, 1, 2]);
}

/// A rising cell that flips the next one is masked if the next one is written afterwards. March C- reads before it
/// writes, in both directions, and finds every such pair (van de Goor).
#[test]
fn coupled_cells_need_the_march() {
    let faults = MemoryFaults { coupled_cells: vec![(500, 501, 9)], ..MemoryFaults::default() };
    let [solid, checkerboard, walking, address, march] = mismatches(&faults);
    assert_eq!([solid, checkerboard, walking, address], [0; 4]);
    assert!(march > 0);
    let reverse = MemoryFaults { coupled_cells: vec![(501, 500, 9)], ..MemoryFaults::default() };
    assert!(mismatches(&reverse)[4] > 0);
}

#[test]
fn board_reports_the_first_mismatch_and_keeps_a_record() {
    let mut host = Host::powered("sdram-data-line-stuck");
    let (elapsed_us, reply) = host.timed(&RamTest { ram: 1, pattern: RamPattern::MarchC as u8 });
    // 10 N accesses of 30 ns.
    assert_eq!(elapsed_us, 314_572);
    assert_eq!((reply.words, reply.mismatches), (1 << 20, 2 << 20));
    assert_eq!((reply.first_place, reply.expected, reply.got), (0, 0xffff_ffff, 0xffff_ff7f));
    let log = host.ask(&ErrorRecords { from: 0 });
    assert_eq!((log.total, log.records.len()), (1, 1));
    let record = &log.records[0];
    assert_eq!((record.kind, record.message), (ErrorKind::MemoryMismatch as u16, 0x15));
    assert_eq!((record.place, record.expected, record.got), (0, 0xffff_ffff, 0xffff_ff7f));
    assert_eq!(host.ask(&RamTest { ram: 0, pattern: 4 }).mismatches, 0);
}

fn flash() -> FlashMemory {
    FlashMemory::new(SPI_FLASH, FlashFaults::default(), Dice::new(1, RandomStream::SpiFlash))
}

#[test]
fn nor_flash_sets_bits_only_by_erasing() {
    let mut flash = flash();
    assert!(flash.blank_check(3).mismatches > 0, "a used flash is not blank");
    flash.erase(3);
    assert_eq!(flash.blank_check(3).mismatches, 0);
    flash.write(3, 77);
    assert_eq!(flash.verify(3, 77).mismatches, 0);
    // Written twice without an erase, each word is the AND of both patterns.
    flash.write(3, 78);
    for (word, (a, b)) in Xorshift32::new(77).zip(Xorshift32::new(78)).take(1024).enumerate() {
        assert_eq!(flash.read(3, word as u32), a & b);
    }
    assert!(flash.verify(3, 78).mismatches > 1000);
    assert!(flash.blank_check(2).mismatches > 0, "the neighbour is untouched");
}

#[test]
fn interrupted_erase_leaves_half_a_sector() {
    let mut flash = flash();
    flash.erase(0);
    flash.write(0, 5);
    flash.interrupt_erase(0);
    let reply = flash.blank_check(0);
    assert_eq!(reply.first_place, 512);
}

#[test]
fn bad_bits_show_in_blank_check_and_in_verify() {
    let mut host = Host::powered("spi-flash-bad-sector");
    host.ask(&FlashErase { flash: 0, sector: 0 });
    let blank = host.ask(&FlashBlankCheck { flash: 0, sector: 0 });
    assert_eq!((blank.mismatches, blank.first_place, blank.got), (1, 17, 0xffff_fff7));
    // Find a seed whose pattern needs a zero where the bit reads one, and a one where it reads zero.
    let seed = (1..).find(|seed| {
        let words: Vec<u32> = Xorshift32::new(*seed).take(1024).collect();
        words[17] >> 3 & 1 == 1 && words[901] >> 30 & 1 == 0
    });
    let seed = seed.unwrap();
    host.ask(&FlashWrite { flash: 0, sector: 0, seed });
    assert_eq!(host.ask(&FlashVerify { flash: 0, sector: 0, seed }).mismatches, 2);
    // Other sectors are sound.
    host.ask(&FlashErase { flash: 0, sector: 1 });
    assert_eq!(host.ask(&FlashBlankCheck { flash: 0, sector: 1 }).mismatches, 0);
}

#[test]
fn flash_times_and_ids_are_the_parts() {
    let mut host = Host::powered("good");
    let id = host.ask(&FlashId { flash: 0 });
    assert_eq!((id.jedec, id.sector_bytes, id.scratch_sectors), ([0xef, 0x40, 0x18], 4096, 8));
    let (elapsed_us, erase) = host.timed(&FlashErase { flash: 0, sector: 2 });
    assert_eq!(elapsed_us, erase.duration_us);
    assert!((54_000..66_000).contains(&erase.duration_us), "{}", erase.duration_us);
    let slow = Host::powered("spi-flash-slow").ask(&FlashErase { flash: 0, sector: 2 });
    assert!((540_000..660_000).contains(&slow.duration_us), "{}", slow.duration_us);
}

#[test]
fn repeated_request_is_answered_from_memory_and_erases_once() {
    let mut host = Host::powered("good");
    let first = host.call(&FlashErase { flash: 0, sector: 0 }).unwrap();
    host.request -= 1;
    let again = host.call(&FlashErase { flash: 0, sector: 0 }).unwrap();
    assert_eq!(first, again);
    assert_eq!(host.bench.truth().spi_flash_erases, 1);
}
