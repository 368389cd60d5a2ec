//! Production test station for GNC modules.

pub mod compute;
