//! IO lines, SPI, RS-422 and CAN.

use super::{Device, ItemSpec, MeasurementSpec, ParamKind, ParamSpec, Resource, Traces, count, text};
use crate::quantity::Unit;

/// Levels that do not read as they should.
pub const WRONG_READS: MeasurementSpec =
    count("wrong_reads", "A line reads another level than its partner drives: the faulty pairs name it.");
/// Faulty pairs driver>reader, or "none".
pub const FAULTY_PAIRS: MeasurementSpec =
    text("faulty_pairs", "Each pair is driver>reader: a line that is in all pairs is open, or its driver is bad.");
/// Pairs of lines that move together, or "none".
pub const SHORTED_LINES: MeasurementSpec =
    text("shorted_lines", "These lines move together: look for solder between them.");

/// The four IO lines, looped back on the board.
pub(super) static IO: ItemSpec = ItemSpec {
    title: "IO lines",
    params: &[],
    measurements: &[WRONG_READS, FAULTY_PAIRS, SHORTED_LINES],
    devices: &[Device::Slave],
    resources: &[Resource::IoPins],
    needs: &[],
    traces: Traces::NONE,
    timeout_s: 10.0,
};

/// Bits altered on the way out of the module.
pub const OUT_BIT_ERRORS: MeasurementSpec =
    count("out_bit_errors", "Bits change on their way out: check SDO, CLK and CS, then try a slower clock.");
/// Bits altered on the way into the module.
pub const IN_BIT_ERRORS: MeasurementSpec =
    count("in_bit_errors", "Bits change on their way in: check SDI, CLK and CS, then try a slower clock.");
/// Bits sent both ways.
pub const BITS_TESTED: MeasurementSpec = count("bits_tested", "The test ended early: see the error record.");

/// SPI, observed through the IO lines.
pub(super) static SPI: ItemSpec = ItemSpec {
    title: "SPI",
    params: &[ParamSpec {
        name: "clock",
        about: "clock of the bus",
        kind: ParamKind::Quantity { unit: Unit::Hertz, min: 1000.0, max: 50e6, default: 1e6 },
    }],
    measurements: &[OUT_BIT_ERRORS, IN_BIT_ERRORS, BITS_TESTED],
    devices: &[Device::Slave],
    resources: &[Resource::IoPins],
    needs: &[],
    traces: Traces::NONE,
    timeout_s: 10.0,
};

const NOISE: &str = "The line disturbs bytes: check cable, termination and ground, and the rate at both ends.";

/// Blocks that did not come back.
pub const BLOCKS_LOST: MeasurementSpec =
    count("blocks_lost", "Whole blocks are lost: check the cable, then the receiver of the module.");
/// Bytes that came back altered or did not come back.
pub const BYTES_WRONG: MeasurementSpec =
    count("bytes_wrong", "Bytes come back altered: suspect the module's SCI or its transceiver.");
/// Framing errors that the module counts.
pub const FRAMING_ERRORS: MeasurementSpec = count("framing_errors", NOISE);
/// Overruns that the module counts.
pub const OVERRUN_ERRORS: MeasurementSpec =
    count("overrun_errors", "The module does not fetch its bytes in time: suspect firmware or interrupts.");
/// Parity errors that the module counts.
pub const PARITY_ERRORS: MeasurementSpec = count("parity_errors", NOISE);
/// Bytes sent.
pub const BYTES_TESTED: MeasurementSpec = count("bytes_tested", "The test ended early: see the error record.");

/// RS-422 echo.
pub(super) static SCI: ItemSpec = ItemSpec {
    title: "SCI (RS-422) echo",
    params: &[ParamSpec {
        name: "rate",
        about: "rate of the line during the test",
        kind: ParamKind::Quantity { unit: Unit::BitPerSecond, min: 1200.0, max: 3e6, default: 115_200.0 },
    }],
    measurements: &[BLOCKS_LOST, BYTES_WRONG, FRAMING_ERRORS, OVERRUN_ERRORS, PARITY_ERRORS, BYTES_TESTED],
    devices: &[Device::Slave, Device::Rs422],
    resources: &[Resource::Link],
    needs: &[],
    traces: Traces::NONE,
    timeout_s: 30.0,
};

/// Test frames sent.
pub const FRAMES_SENT: MeasurementSpec = count("frames_sent", "The test ended early: see the error record.");
/// Test frames that did not come back.
pub const FRAMES_LOST: MeasurementSpec =
    count("frames_lost", "Frames do not come back: check cable and termination (60 ohm between the lines).");
/// Test frames that came back altered.
pub const FRAMES_ALTERED: MeasurementSpec =
    count("frames_altered", "Frames come back altered under a good CRC: suspect the module's CAN controller.");
/// Test frames that came back before an earlier one, or twice.
pub const FRAMES_OUT_OF_ORDER: MeasurementSpec =
    count("frames_out_of_order", "Frames overtake each other: suspect the module's mailboxes or firmware.");
/// The controller's error counter for sending.
pub const TX_ERROR_COUNTER: MeasurementSpec =
    count("tx_error_counter", "The module's controller counts errors on sending: check cable and termination.");
/// The controller's error counter for receiving.
pub const RX_ERROR_COUNTER: MeasurementSpec = count(
    "rx_error_counter",
    "The module's controller counts errors on receiving: check cable, termination, bit rate.",
);
/// Error frames that the host's adapter saw.
pub const ADAPTER_ERRORS: MeasurementSpec =
    count("adapter_errors", "The host's adapter saw error frames: check cable, termination, bit rate.");
/// Whether the controller left the bus: "yes" or "no".
pub const BUS_OFF: MeasurementSpec =
    text("bus_off", "The controller left the bus: look for a short between the lines, or a wrong bit rate.");

/// CAN echo.
pub(super) static CAN: ItemSpec = ItemSpec {
    title: "CAN echo",
    params: &[],
    measurements: &[
        FRAMES_SENT,
        FRAMES_LOST,
        FRAMES_ALTERED,
        FRAMES_OUT_OF_ORDER,
        TX_ERROR_COUNTER,
        RX_ERROR_COUNTER,
        ADAPTER_ERRORS,
        BUS_OFF,
    ],
    devices: &[Device::Slave, Device::Can, Device::BoardCan],
    resources: &[Resource::CanBus],
    needs: &[],
    traces: Traces::NONE,
    timeout_s: 30.0,
};
