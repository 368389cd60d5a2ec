//! Production test station for GNC modules.
