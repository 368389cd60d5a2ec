//! Prints the JSON Schema of plans: `cargo run -p gnc-executive --example plan_schema > docs/plan.schema.json`.

#[allow(clippy::print_stdout, reason = "its output is what it is for")]
fn main() -> Result<(), serde_json::Error> {
    println!("{}", serde_json::to_string_pretty(&gnc_executive::plan::plan_schema())?);
    Ok(())
}
