//! Ways to reach a slave board. A link carries frames and knows nothing of what they mean.

mod absence;
pub mod can;
mod link;
pub mod memory;
mod received;
pub mod serial;
mod target;

pub use absence::RETURNS_WITHIN;
pub use link::{Link, LinkError};
pub use received::{NoFrame, Received};
pub use target::Target;
