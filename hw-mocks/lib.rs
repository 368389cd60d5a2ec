//! The simulated bench: a world with a truth, a slave board and a GNC module in it.
