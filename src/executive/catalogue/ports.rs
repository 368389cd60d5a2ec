//! IO lines, SPI, RS-422 and CAN.

use super::{Device, ItemSpec, ParamKind, ParamSpec, Resource, count, text};
use crate::quantity::Unit;

/// The four IO lines, looped on the board.
pub(super) static IO: ItemSpec = ItemSpec {
    title: "IO lines",
    params: &[],
    measurements: &[
        count("wrong_reads", "A line reads another level than its partner drives: the faulty pairs name it."),
        text("faulty_pairs", "Pairs are driver>reader: one line in all of them is open, or its driver is bad."),
        text("shorted_lines", "These lines move together: look for solder between them."),
    ],
    devices: &[Device::Slave],
    resources: &[Resource::IoPins],
    timeout_s: 10.0,
};

/// SPI, observed through the IO lines.
pub(super) static SPI: ItemSpec = ItemSpec {
    title: "SPI",
    params: &[ParamSpec {
        name: "clock",
        about: "clock of the bus",
        kind: ParamKind::Quantity { unit: Unit::Hertz, min: 1000.0, max: 50e6, default: 1e6 },
    }],
    measurements: &[
        count("out_bit_errors", "Bits change on their way out: check SDO, CLK and CS, then try a slower clock."),
        count("in_bit_errors", "Bits change on their way in: check SDI, CLK and CS, then try a slower clock."),
        count("bits_tested", "The test ended early: see the error record."),
    ],
    devices: &[Device::Slave],
    resources: &[Resource::IoPins],
    timeout_s: 10.0,
};

const NOISE: &str = "The line disturbs bytes: check cable, termination and ground, and the rate at both ends.";

/// RS-422 echo.
pub(super) static SCI: ItemSpec = ItemSpec {
    title: "SCI (RS-422) echo",
    params: &[ParamSpec {
        name: "rate",
        about: "rate of the line during the test",
        kind: ParamKind::Quantity { unit: Unit::BitPerSecond, min: 1200.0, max: 3e6, default: 115_200.0 },
    }],
    measurements: &[
        count("blocks_lost", "Whole blocks vanish: check the cable, then the receiver of the module."),
        count("bytes_wrong", "Bytes come back altered: suspect the module's SCI or its transceiver."),
        count("framing_errors", NOISE),
        count("overrun_errors", "The module does not fetch its bytes in time: suspect firmware or interrupts."),
        count("parity_errors", NOISE),
        count("bytes_tested", "The test ended early: see the error record."),
    ],
    devices: &[Device::Slave, Device::Rs422],
    resources: &[Resource::Link],
    timeout_s: 30.0,
};

/// CAN echo.
pub(super) static CAN: ItemSpec = ItemSpec {
    title: "CAN echo",
    params: &[],
    measurements: &[
        count("frames_sent", "The test ended early: see the error record."),
        count("frames_lost", "Frames do not come back: check cable and termination (60 ohm between the lines)."),
        count("frames_altered", "Frames come back altered under a good CRC: suspect the module's CAN controller."),
        count("frames_out_of_order", "Frames overtake each other: suspect the module's mailboxes or firmware."),
        count("tx_error_counter", "The module's controller counts errors on sending: check cable and termination."),
        count(
            "rx_error_counter",
            "The module's controller counts errors on receiving: check cable, termination, bit rate.",
        ),
        count("adapter_errors", "The host's adapter saw error frames: check cable, termination, bit rate."),
        text("bus_off", "The controller left the bus: look for a short between the lines or another bit rate."),
    ],
    devices: &[Device::Slave, Device::Can],
    resources: &[Resource::CanBus],
    timeout_s: 30.0,
};
