//! Tests the simulated bench against independent expectations. Seeds are fixed and printed. Time is virtual, except in
//! tests of a real pseudo-terminal, where every wait has a deadline.

// All of it is test code, but clippy recognises test code only under `cfg(test)`.
#[cfg(test)]
mod board;
#[cfg(test)]
mod breaches;
#[cfg(test)]
mod calibration;
#[cfg(test)]
mod can;
#[cfg(test)]
mod faults;
#[cfg(test)]
mod filtered;
#[cfg(test)]
mod gnss;
#[cfg(test)]
mod host;
#[cfg(test)]
mod lines;
#[cfg(test)]
mod memories;
#[cfg(test)]
mod personalities;
#[cfg(test)]
mod pty;
#[cfg(test)]
mod real_sensors;
#[cfg(test)]
mod sensor_faults;
#[cfg(test)]
mod sensors;
#[cfg(test)]
mod turntable;
