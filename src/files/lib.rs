//! Files that others may have made or exchanged. Each read has a guard: only a regular file is read, a pipe or a device is
//! refused at once, and the bytes that are read have a bound, whatever the size claims. Below a root no link is followed.
//! A file that is written anew appears under its name only when all of it is written, and never through a link.
//!
//! It knows no plan and no record: a place for rules that the records folder, plans and the simulated bench share.

mod open;
mod part;

pub use open::{
    Reach, Refused, below, is_refused, named, named_beginning, open, own, read, read_beginning, read_below, text, whole,
};
pub use part::{PART, Part, append, create_new, put};
