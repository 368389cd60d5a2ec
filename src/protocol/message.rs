//! The messages: ids, requests and results, field by field as in the interface document.
//!
//! The board measures and reports; it never judges. It sends values as raw as it has them.

mod memories;
mod session;

pub use memories::{
    DurationReply, Flash, FlashBlankCheck, FlashErase, FlashId, FlashIdReply, FlashVerify, FlashWrite, MismatchReply,
    Ram, RamPattern, RamTest,
};
pub use session::{Accept, BoardHello, Heartbeat, HostHello, MAGIC, Nak, Progress, ResultHead, capability, event};

use crate::calibration::{
    CalibrationCommit, CalibrationCommitReply, CalibrationRead, CalibrationReadReply, CalibrationWrite,
};
use crate::wire::{List, Text, Wire, WireError, wire_enum, wire_struct};

/// A request with the result that answers it.
pub trait Call: Wire {
    /// Its message id.
    const ID: u16;
    /// The body of its RESULT.
    type Reply: Wire;
    /// Its name in texts.
    const NAME: &'static str;
}

macro_rules! calls {
    ($($(#[$meta:meta])* $id:literal $name:ident => $reply:ty),* $(,)?) => {
        $(impl Call for $name { const ID: u16 = $id; type Reply = $reply; const NAME: &'static str = stringify!($name); })*

        /// Any request.
        #[derive(Debug, Clone, PartialEq)]
        pub enum Request { $($(#[$meta])* $name($name)),* }

        impl Request {
            /// The ids and names of all requests.
            pub const IDS: &'static [(u16, &'static str)] = &[$(($id, stringify!($name))),*];

            /// Reads the payload of the request `id`; `None` if there is no such message.
            pub fn decode(id: u16, payload: &[u8]) -> Option<Result<Self, WireError>> {
                match id {
                    $($id => Some($name::from_payload(payload).map(Self::$name)),)*
                    _ => None,
                }
            }

            /// The message id.
            #[must_use]
            pub fn id(&self) -> u16 {
                match self { $(Self::$name(_) => $id),* }
            }
        }
    };
}

calls! {
    /// Stops streams, aborts requests, releases IO lines and switches the module's power off.
    0x0001 MakeSafe => (),
    /// Ends one running request.
    0x0002 Abort => AbortReply,
    /// Switches the module's supply.
    0x0003 ModulePower => PowerReply,
    /// Reads the board's records of what it found wrong.
    0x0004 ErrorRecords => ErrorRecordsReply,
    /// Reads the board's own counters of the link.
    0x0005 LinkCounters => LinkCountersReply,
    /// Asks the module for its identity.
    0x0010 Identity => IdentityReply,
    /// Writes words and reads them back.
    0x0011 CpuWords => CpuWordsReply,
    /// 32-bit integer arithmetic.
    0x0012 CpuIntegers => CpuIntegersReply,
    /// Double arithmetic.
    0x0013 CpuFloats => CpuFloatsReply,
    /// Runs a timer repeatedly and measures each interval.
    0x0014 TimerMeasure => TimerMeasureReply,
    /// Runs one pattern over a whole memory.
    0x0015 RamTest => MismatchReply,
    /// Reads a flash's identification.
    0x0016 FlashId => FlashIdReply,
    /// Erases a scratch sector.
    0x0017 FlashErase => DurationReply,
    /// Counts words of a sector that are not erased.
    0x0018 FlashBlankCheck => MismatchReply,
    /// Fills an erased scratch sector with a pattern.
    0x0019 FlashWrite => DurationReply,
    /// Compares a sector with a pattern.
    0x001a FlashVerify => MismatchReply,
    /// Samples analogue inputs.
    0x001b AdRead => AdReadReply,
    /// Connects two IO lines, drives one and reads all four.
    0x001c IoTest => IoTestReply,
    /// Sends bytes over SPI and reports what the far side saw.
    0x001d SpiTransfer => SpiTransferReply,
    /// Sends bytes through the module's SCI and reports what came back.
    0x001e SciEcho => SciEchoReply,
    /// Restarts the GNSS receiver.
    0x001f GnssRestart => (),
    /// Starts a stream.
    0x0020 StreamStart => StreamStartReply,
    /// Stops a stream.
    0x0021 StreamStop => StreamStopReply,
    /// Reads the error counters of the module's CAN controller.
    0x0022 CanCounters => CanCountersReply,
    /// Brings a calibration into the board's memory.
    0x0023 CalibrationWrite => (),
    /// Stores in the module the calibration that was written last.
    0x0024 CalibrationCommit => CalibrationCommitReply,
    /// Reads the calibration stored in the module.
    0x0025 CalibrationRead => CalibrationReadReply,
}

wire_struct! { /// See [`Request::MakeSafe`].
MakeSafe {} }
wire_struct! { /// See [`Request::Abort`].
    Abort {
        /// The request to end.
        request: u16,
    }
}
wire_struct! { /// Answers [`Abort`].
    AbortReply {
        /// 1 if it was running; 0 if it had ended or never ran.
        was_running: u8,
    }
}
wire_struct! { /// See [`Request::ModulePower`].
    ModulePower {
        /// 1 on, 0 off. The result comes when the supply has settled.
        on: u8,
    }
}
wire_struct! { /// Answers [`ModulePower`].
    PowerReply {
        /// Supply at the socket, in microvolts.
        supply_uv: u32,
        /// Current into the module, in microamperes.
        supply_ua: u32,
    }
}
wire_struct! { /// See [`Request::ErrorRecords`].
    ErrorRecords {
        /// Index of the first record wanted.
        from: u16,
    }
}
wire_struct! {
    /// What the board found wrong, for fault analysis.
    ErrorRecord {
        /// Counts from 0 since the session's start.
        index: u16,
        /// The request during which the board found it.
        request: u16,
        /// That request's message id.
        message: u16,
        /// What was wrong: a number of [`ErrorKind`].
        kind: u16,
        /// Board time when the board found it, in microseconds.
        board_time_us: u64,
        /// Where: an address, a line or a byte's index, depending on the kind.
        place: u32,
        /// What should have been there.
        expected: u32,
        /// What was there.
        got: u32,
    }
}
wire_struct! { /// Answers [`ErrorRecords`].
    ErrorRecordsReply {
        /// Records made since the session's start; the board keeps the last 64.
        total: u16,
        /// Records from the index asked for (or the oldest kept) on.
        records: List<ErrorRecord, 16>,
    }
}
wire_enum! {
    /// What an [`ErrorRecord`] is about.
    ErrorKind: u16 {
        /// A memory word read back differently; place is the word's index.
        MemoryMismatch = 1,
        /// A flash word not erased; place is the word's index in the sector.
        FlashNotBlank = 2,
        /// A flash word read back differently; place is the word's index in the sector.
        FlashMismatch = 3,
        /// An erase or write took longer than the flash's data sheet allows; expected and got are in microseconds.
        FlashSlow = 4,
        /// An IO line did not follow; place is driver * 16 + reader, expected and got are levels of all lines.
        IoMismatch = 5,
        /// An SPI byte arrived altered; place is the byte's index.
        SpiMismatch = 6,
        /// An SCI byte arrived altered or not at all; place is the byte's index, got is 0x100 for a lost byte.
        SciMismatch = 7,
        /// A timer's interrupt did not come; place is the timer, expected and got are counts.
        TimerInterrupts = 8,
        /// Supply outside 4.5 to 5.5 V when power was switched on; expected and got are in microvolts.
        Supply = 9,
        /// A stored calibration does not match its checksum; place is its slot, expected is the checksum stored with
        /// it, got is the checksum of the bytes as read.
        CalibrationDamaged = 10,
    }
}
wire_struct! { /// See [`Request::LinkCounters`].
LinkCounters {} }
wire_struct! { /// Answers [`LinkCounters`]; all since the board's start.
    LinkCountersReply {
        /// Good frames from the host.
        frames: u32,
        /// Frames with a wrong checksum.
        bad_checksum: u32,
        /// Other rubbish between delimiters.
        malformed: u32,
        /// Frames missing by their sequence numbers.
        missing: u32,
        /// Frames sent to the host.
        sent: u32,
    }
}
wire_struct! { /// See [`Request::Identity`].
Identity {} }
wire_struct! { /// Answers [`Identity`].
    IdentityReply {
        /// Serial number of the module.
        serial_number: Text<64>,
        /// Part number.
        part: Text<32>,
        /// Hardware revision.
        hardware: Text<32>,
        /// Firmware version of the module.
        firmware: Text<32>,
        /// Protocol version between slave and module.
        protocol: u8,
    }
}

wire_enum! {
    /// What [`CpuWords`] writes to.
    WordTarget: u8 {
        /// General registers.
        Registers = 0,
        /// A block of the core's own memory.
        Memory = 1,
    }
}
wire_struct! { /// See [`Request::CpuWords`].
    CpuWords {
        /// Core 1 or 2.
        core: u8,
        /// A number of [`WordTarget`].
        target: u8,
        /// Words to write.
        words: List<u32, 64>,
    }
}
wire_struct! { /// Answers [`CpuWords`].
    CpuWordsReply {
        /// Words read back, in order.
        words: List<u32, 64>,
    }
}
wire_struct! { /// See [`Request::CpuIntegers`].
    CpuIntegers {
        /// Core 1 or 2.
        core: u8,
        /// Operands a and b; b is not 0.
        pairs: List<[i32; 2], 16>,
    }
}
wire_struct! { /// Answers [`CpuIntegers`].
    CpuIntegersReply {
        /// For each pair a+b, a-b, a*b (the low 32 bits of each, two's complement), a/b towards zero, and the
        /// remainder with the sign of a. The smallest number divided by -1 gives itself, with remainder 0.
        results: List<[i32; 5], 16>,
    }
}
wire_struct! { /// See [`Request::CpuFloats`].
    CpuFloats {
        /// Core 1 or 2.
        core: u8,
        /// Operands a and b, finite, b is not 0.
        pairs: List<[f64; 2], 15>,
    }
}
wire_struct! { /// Answers [`CpuFloats`].
    CpuFloatsReply {
        /// For each pair a+b, a-b, a*b, a/b in IEEE 754 double precision, rounded to nearest even.
        results: List<[f64; 4], 15>,
    }
}
wire_struct! { /// See [`Request::TimerMeasure`].
    TimerMeasure {
        /// 0 to 2.
        timer: u8,
        /// Nominal interval in microseconds, 100 to 100,000.
        period_us: u32,
        /// Intervals, 1 to 100.
        count: u16,
    }
}
wire_struct! { /// Answers [`TimerMeasure`].
    TimerMeasureReply {
        /// Interrupts that came.
        interrupts: u16,
        /// Each interval by the slave's reference clock, in nanoseconds.
        intervals_ns: List<u32, 100>,
    }
}

wire_struct! { /// See [`Request::AdRead`].
    AdRead {
        /// Bit 0 is channel 1, bit 7 is channel 8.
        channels: u8,
        /// Samples of each channel, 1 to 1000, taken at 10 kHz.
        samples: u16,
    }
}
wire_struct! {
    /// One channel's samples.
    AdChannel {
        /// 1 to 8.
        channel: u8,
        /// Mean, in microvolts.
        mean_uv: i32,
        /// Smallest sample.
        min_uv: i32,
        /// Largest sample.
        max_uv: i32,
    }
}
wire_struct! { /// Answers [`AdRead`].
    AdReadReply {
        /// The channels asked for, in rising order.
        channels: List<AdChannel, 8>,
    }
}
wire_struct! { /// See [`Request::IoTest`].
    IoTest {
        /// Line that drives, 0 to 3.
        driver: u8,
        /// Another line, 0 to 3, that is connected to it.
        reader: u8,
        /// 0 or 1. The lines that are not driven are pulled to the other level.
        level: u8,
    }
}
wire_struct! { /// Answers [`IoTest`].
    IoTestReply {
        /// Level of line n in bit n.
        levels: u8,
    }
}
wire_enum! {
    /// Which side of the SPI sends.
    SpiDirection: u8 {
        /// The module sends on SDO, the IO lines listen.
        FromModule = 0,
        /// The IO lines send on SDI, the module listens.
        ToModule = 1,
    }
}
wire_struct! { /// See [`Request::SpiTransfer`].
    SpiTransfer {
        /// A number of [`SpiDirection`].
        direction: u8,
        /// Clock, 10,000 to 10,000,000 Hz.
        clock_hz: u32,
        /// Bytes to send.
        data: List<u8, 256>,
    }
}
wire_struct! { /// Answers [`SpiTransfer`].
    SpiTransferReply {
        /// Bytes that the far side saw.
        data: List<u8, 256>,
    }
}
wire_struct! { /// See [`Request::SciEcho`].
    SciEcho {
        /// Rate of the module's SCI, 9,600 to 2,000,000 baud.
        rate_baud: u32,
        /// Bytes to send.
        data: List<u8, 256>,
    }
}
wire_struct! { /// Answers [`SciEcho`].
    SciEchoReply {
        /// Framing errors counted by the module's SCI during this block.
        framing_errors: u16,
        /// Parity errors.
        parity_errors: u16,
        /// Overruns.
        overruns: u16,
        /// Bytes that came back.
        data: List<u8, 256>,
    }
}
wire_enum! {
    /// What the GNSS receiver forgets at a restart.
    GnssStart: u8 {
        /// Nothing: ephemeris, time and position are kept.
        Hot = 1,
        /// The ephemeris.
        Warm = 2,
        /// Everything.
        Cold = 3,
    }
}
wire_struct! { /// See [`Request::GnssRestart`].
    GnssRestart {
        /// A number of [`GnssStart`].
        start: u8,
    }
}
wire_struct! { /// See [`Request::StreamStart`].
    StreamStart {
        /// A number of [`crate::stream::StreamId`].
        stream: u8,
        /// Samples a second for the IMU and compensated samples, 1 to 1000; 0 for the others.
        rate_hz: u16,
        /// Samples (GNSS: bytes) after which the stream ends by itself; 0: at StreamStop.
        count: u32,
        /// Samples in a frame, IMU 1 to 12, compensated 1 to 10; 0: the board's choice.
        samples_per_frame: u8,
    }
}
wire_struct! { /// Answers [`StreamStart`].
    StreamStartReply {
        /// A number of [`crate::stream::Format`].
        format: u8,
        /// Samples in a frame.
        samples_per_frame: u8,
        /// Mean share of the link that the stream takes.
        load_permille: u16,
    }
}
wire_struct! { /// See [`Request::StreamStop`].
    StreamStop {
        /// A number of [`crate::stream::StreamId`].
        stream: u8,
    }
}
wire_struct! { /// Answers [`StreamStop`].
    StreamStopReply {
        /// Samples (GNSS: bytes) produced since its start.
        produced: u32,
        /// Samples dropped on the board; `produced` includes them.
        dropped: u32,
    }
}
wire_struct! { /// See [`Request::CanCounters`].
CanCounters {} }
wire_enum! {
    /// What a CAN controller may still do.
    CanState: u8 {
        /// Everything.
        ErrorActive = 0,
        /// Everything, but it no longer disturbs frames of others: a counter is above 127.
        ErrorPassive = 1,
        /// Nothing: its transmit counter has passed 255.
        BusOff = 2,
    }
}
wire_struct! { /// Answers [`CanCounters`].
    CanCountersReply {
        /// A number of [`CanState`].
        state: u8,
        /// Transmit error counter.
        tx_errors: u16,
        /// Receive error counter.
        rx_errors: u16,
        /// Test frames that the module received since its power-on.
        received: u32,
        /// Test frames that the module sent back.
        echoed: u32,
    }
}
