//! The devices of the module and of the slave board. Each is a model of the device with its faults.

pub(crate) mod ad;
pub mod calibration;
pub(crate) mod can;
pub(crate) mod cpu;
pub mod flash;
pub(crate) mod gnss;
pub mod inertial;
pub mod lines;
pub mod memory;
pub mod nmea;
pub(crate) mod playback;
pub(crate) mod sci;
pub mod sky;
pub(crate) mod start;
pub(crate) mod supply;
pub(crate) mod timer;
