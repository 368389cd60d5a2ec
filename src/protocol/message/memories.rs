//! The tests of the module's memories.

use crate::wire::{wire_enum, wire_struct};

wire_enum! {
    /// Memories of [`RamTest`].
    Ram: u8 {
        /// The processor's own memory: 65,536 words of 16 bits.
        Internal = 0,
        /// The SDRAM: 1,048,576 words of 32 bits.
        Sdram = 1,
    }
}
wire_enum! {
    /// Patterns of [`RamTest`]. Each is written and read back in the order that the interface document gives.
    RamPattern: u8 {
        /// All zeros, then all ones.
        Solid = 0,
        /// 0x55.., then 0xAA...
        Checkerboard = 1,
        /// A one walking through the word, starting at another bit from word to word.
        WalkingOnes = 2,
        /// Each word's own address, then its complement.
        Address = 3,
        /// March C-: up w0; up r0 w1; up r1 w0; down r0 w1; down r1 w0; down r0.
        MarchC = 4,
    }
}
wire_struct! { /// See [`super::Request::RamTest`].
    RamTest {
        /// A number of [`Ram`].
        ram: u8,
        /// A number of [`RamPattern`].
        pattern: u8,
    }
}
wire_struct! { /// Answers [`RamTest`], [`FlashBlankCheck`] and [`FlashVerify`].
    MismatchReply {
        /// Words compared at least once.
        words: u32,
        /// Comparisons that failed.
        mismatches: u32,
        /// Index of the first word that failed, 0 if none.
        first_place: u32,
        /// What should have been there.
        expected: u32,
        /// What was there.
        got: u32,
    }
}

wire_enum! {
    /// Flash memories.
    Flash: u8 {
        /// On the module's SPI bus: sectors of 4096 bytes, in words of 32 bits.
        Spi = 0,
        /// In the processor: sectors of 16,384 bytes, in words of 32 bits.
        Internal = 1,
    }
}
wire_struct! { /// See [`super::Request::FlashId`].
    FlashId {
        /// A number of [`Flash`].
        flash: u8,
    }
}
wire_struct! { /// Answers [`FlashId`].
    FlashIdReply {
        /// JEDEC id: manufacturer, type, capacity; zeros for the internal flash.
        jedec: [u8; 3],
        /// Bytes of a sector.
        sector_bytes: u32,
        /// Number of scratch sectors; they are counted from 0.
        scratch_sectors: u16,
    }
}
wire_struct! { /// See [`super::Request::FlashErase`].
    FlashErase {
        /// A number of [`Flash`].
        flash: u8,
        /// Scratch sector.
        sector: u16,
    }
}
wire_struct! { /// Answers [`FlashErase`] and [`FlashWrite`].
    DurationReply {
        /// Time that the flash was busy, by the slave's clock, in microseconds.
        duration_us: u32,
    }
}
wire_struct! { /// See [`super::Request::FlashBlankCheck`].
    FlashBlankCheck {
        /// A number of [`Flash`].
        flash: u8,
        /// Scratch sector.
        sector: u16,
    }
}
wire_struct! { /// See [`super::Request::FlashWrite`].
    FlashWrite {
        /// A number of [`Flash`].
        flash: u8,
        /// Scratch sector.
        sector: u16,
        /// Seed of [`crate::pattern::Xorshift32`], not 0.
        seed: u32,
    }
}
wire_struct! { /// See [`super::Request::FlashVerify`].
    FlashVerify {
        /// A number of [`Flash`].
        flash: u8,
        /// Scratch sector.
        sector: u16,
        /// Seed of [`crate::pattern::Xorshift32`], not 0.
        seed: u32,
    }
}
