//! The simulated bench against independent expectations. Seeds are fixed and printed; time is virtual, except where a
//! real pseudo-terminal is the thing under test, and every wait there has a deadline.

mod board;
mod gnss;
mod host;
mod lines;
mod memories;
mod personalities;
mod pty;
mod sensors;
