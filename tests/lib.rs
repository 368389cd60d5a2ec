//! Whole-program tests against the simulated bench.
