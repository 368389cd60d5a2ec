//! The module in the socket, with what the slave board keeps around it.

use gnc_protocol::message::{Flash, IdentityReply, PowerReply, Ram};
use gnc_protocol::wire::text;

use crate::devices::ad::Ad;
use crate::devices::calibration::CalibrationMemory;
use crate::devices::can::CanController;
use crate::devices::cpu::Cpu;
use crate::devices::flash::{FlashMemory, INTERNAL_FLASH, SPI_FLASH};
use crate::devices::gnss::SimulatedReceiver;
use crate::devices::inertial::Sensors;
use crate::devices::lines::Lines;
use crate::devices::memory::{INTERNAL_WORDS, Memory, SDRAM_WORDS};
use crate::devices::sci::Sci;
use crate::devices::start::Start;
use crate::devices::supply::SupplyModel;
use crate::devices::timer::Timers;
use crate::noise::{Dice, RandomStream};
use crate::personality::Personality;

/// The module with all its devices.
#[derive(Debug, Clone)]
pub(crate) struct Module {
    /// Its identity.
    pub identity: IdentityReply,
    /// Both cores.
    pub cpu: Cpu,
    /// Timers.
    pub timers: Timers,
    /// The processor's own memory.
    pub internal_ram: Memory,
    /// SDRAM.
    pub sdram: Memory,
    /// Flash on the SPI bus.
    pub spi_flash: FlashMemory,
    /// Flash in the processor.
    pub internal_flash: FlashMemory,
    /// Gyroscopes, accelerometers, magnetometer.
    pub sensors: Sensors,
    /// The memory for its calibration.
    pub calibration: CalibrationMemory,
    /// GNSS receiver.
    pub gnss: SimulatedReceiver,
    /// AD converter with the board's DIP switches.
    pub ad: Ad,
    /// IO lines.
    pub lines: Lines,
    /// RS-422.
    pub sci: Sci,
    /// CAN.
    pub can: CanController,
    /// Its start behaviour.
    pub start: Start,
    supply: SupplyModel,
    supply_dice: Dice,
    /// The last reading of the meter with power on.
    supply_seen: Option<PowerReply>,
}

impl Module {
    /// The module of a personality. It reports `serial_number` unless the personality fixes one.
    #[must_use]
    pub(crate) fn new(personality: &Personality, serial_number: &str, seed: u64) -> Self {
        let model = &personality.model;
        let mut content = Dice::new(seed, RandomStream::Content);
        let mut rails = model.rails;
        rails.v5_v = rails.v5_v.min(model.supply.voltage_v);
        Self {
            identity: IdentityReply {
                serial_number: text(model.serial_number.as_deref().unwrap_or(serial_number)),
                part: text(&model.part),
                hardware: text(&model.hardware),
                firmware: text(&model.firmware),
                protocol: model.protocol,
            },
            cpu: Cpu::new(model.cpu),
            timers: Timers::new(model.timers, seed),
            internal_ram: Memory::new(INTERNAL_WORDS, 16, model.internal_ram.clone(), || content.word()),
            sdram: Memory::new(SDRAM_WORDS, 32, model.sdram.clone(), || content.word()),
            spi_flash: FlashMemory::new(SPI_FLASH, model.spi_flash.clone(), Dice::new(seed, RandomStream::SpiFlash)),
            internal_flash: FlashMemory::new(
                INTERNAL_FLASH,
                model.internal_flash.clone(),
                Dice::new(seed, RandomStream::InternalFlash),
            ),
            sensors: Sensors::new(model.sensors, model.sensor_faults, seed),
            calibration: CalibrationMemory::new(model.calibration),
            gnss: SimulatedReceiver::new(model.gnss, model.playback.clone(), seed),
            ad: Ad::new(rails, model.unwired_switches, seed),
            lines: Lines::new(model.lines.clone()),
            sci: Sci::new(model.sci),
            can: CanController::new(model.can),
            start: Start::new(model.start),
            supply: model.supply,
            supply_dice: Dice::new(seed, RandomStream::Supply),
            supply_seen: None,
        }
    }

    /// Handles power-on at `now_s`.
    pub(crate) fn power_on(&mut self, now_s: f64) {
        self.start.power_on(now_s);
        if self.start.is_swapped() {
            self.identity.serial_number = text("SIM-OTHER");
        }
        self.sensors.power_on(now_s);
        self.calibration.power_on();
        self.can.power_on();
        self.gnss.power_on(now_s);
    }

    /// The board's reading of the supply.
    pub(crate) fn supply(&mut self, on: bool) -> PowerReply {
        if let Some(seen) = self.supply_seen.clone().filter(|_| on && self.supply.meter_holds) {
            return seen;
        }
        let micro = |value: f64| (value.max(0.0) * 1e6).round() as u32;
        // The board's meter scatters by 1 mV and 0.5 mA.
        let volts =
            if on { self.supply.voltage_v } else { self.supply.off_voltage_v } + 1e-3 * self.supply_dice.normal();
        let amperes =
            if on { self.supply.current_a } else { self.supply.off_current_a } + 0.5e-3 * self.supply_dice.normal();
        let reading = PowerReply { supply_uv: micro(volts), supply_ua: micro(amperes) };
        if on {
            self.supply_seen = Some(reading.clone());
        }
        reading
    }

    /// A RAM by its number on the wire.
    pub(crate) fn ram(&mut self, ram: Ram) -> &mut Memory {
        match ram {
            Ram::Internal => &mut self.internal_ram,
            Ram::Sdram => &mut self.sdram,
        }
    }

    /// A flash by its number on the wire.
    pub(crate) fn flash(&mut self, flash: Flash) -> &mut FlashMemory {
        match flash {
            Flash::Spi => &mut self.spi_flash,
            Flash::Internal => &mut self.internal_flash,
        }
    }
}
