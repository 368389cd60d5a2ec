//! Prints the page of all sentences: `cargo run -q -p gnc-station --example messages > docs/messages.md`.

#[expect(clippy::print_stdout, reason = "its output is what it is for")]
fn main() {
    print!("{}", gnc_station::messages_page());
}
