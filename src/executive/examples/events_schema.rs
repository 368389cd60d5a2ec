//! Prints the JSON Schema of events: `cargo run -p gnc-executive --example events_schema > docs/events.schema.json`.

#[expect(clippy::print_stdout, reason = "its output is what it is for")]
fn main() -> Result<(), serde_json::Error> {
    println!("{}", serde_json::to_string_pretty(&gnc_executive::event::events_schema()?)?);
    Ok(())
}
