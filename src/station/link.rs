//! Ways to reach a slave board. A link carries frames and knows nothing of what they mean.

pub mod serial;
