//! Messages and frames between the host and the slave test board.
