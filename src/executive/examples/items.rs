//! Prints the page of all items: `cargo run -q -p gnc-executive --example items > docs/items.md`.

#[allow(clippy::print_stdout, reason = "its output is what it is for")]
fn main() {
    print!("{}", gnc_executive::catalogue::page());
}
