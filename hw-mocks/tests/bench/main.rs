//! The simulated bench against independent expectations. Seeds are fixed and printed; time is virtual, except where a
//! real pseudo-terminal is the thing under test, and every wait there has a deadline.

// All of it is test code; clippy takes only what stands under `cfg(test)` for that.
#[cfg(test)]
mod board;
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
