//! The devices of the module and of the slave board: each a model of what the thing does, with its faults inside.

pub mod ad;
pub mod calibration;
pub mod can;
pub mod cpu;
pub mod flash;
pub mod gnss;
pub mod inertial;
pub mod lines;
pub mod memory;
pub mod nmea;
pub mod playback;
pub mod sci;
pub mod sky;
pub mod supply;
pub mod timer;
