//! The JSON Schema of events: of the lines of a journal, and of `--events`.
//!
//! What an event shares with the record of a run is described there, in `docs/run.schema.json`.

use serde_json::{Map, Value, json};

use super::{EVENTS_SCHEMA, EventKind, SELECTION_SCHEMA};
use crate::catalogue::ItemId;

/// The schema of records, which holds the shared descriptions.
const RUN_SCHEMA: &str = include_str!("../../../docs/run.schema.json");
/// The shared descriptions.
const SHARED: [&str; 14] = [
    "outcome",
    "plan",
    "part",
    "numbers",
    "site",
    "recomputed",
    "program",
    "bench",
    "board",
    "loop",
    "cause",
    "measurement",
    "error",
    "error_record",
];

/// The schema of an event, draft 2020-12.
///
/// # Errors
/// `docs/run.schema.json` was not JSON when this program was built.
pub fn events_schema() -> Result<Value, serde_json::Error> {
    let run: Value = serde_json::from_str(RUN_SCHEMA)?;
    let mut defs: Map<String, Value> =
        SHARED.iter().map(|name| ((*name).to_owned(), run["$defs"][*name].clone())).collect();
    defs.insert("header".to_owned(), header());
    defs.insert("planned_item".to_owned(), planned_item());
    for (name, description, fields) in kinds(&run) {
        defs.insert(format!("event_{name}"), event(name, description, fields));
    }
    let each: Vec<Value> =
        EventKind::NAMES.iter().map(|name| json!({ "$ref": format!("#/$defs/event_{name}") })).collect();
    Ok(json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": "events.schema.json",
        "title": "Event of a run",
        "description": "One line of events.jsonl and of `gnc-station --auto PLAN --events`. The first line of a run is run_started and names the version of this form. Later versions only add fields and kinds: a reader should ignore those that it does not know.",
        "oneOf": each,
        "$defs": defs
    }))
}

/// What names the picture of a question.
const PICTURE: &str = "SHA-256 of the picture that the question shows, as it was when the plan was checked.";
/// What names the question of a request.
const QUESTION: &str =
    "Name of the plan's question, or of the last one if all answers are looked over; absent for other requests.";

/// A field of an event: its name, whether it is always there, and its schema.
type Field = (&'static str, bool, Value);

fn object(title: &str, description: &str, fields: &[Field]) -> Value {
    let required: Vec<&str> = fields.iter().filter(|(_, required, _)| *required).map(|(name, _, _)| *name).collect();
    let properties: Map<String, Value> =
        fields.iter().map(|(name, _, schema)| ((*name).to_owned(), schema.clone())).collect();
    json!({
        "title": title,
        "description": description,
        "type": "object",
        "required": required,
        "additionalProperties": false,
        "properties": properties
    })
}

fn event(name: &str, description: &str, fields: Vec<Field>) -> Value {
    let mut all: Vec<Field> = vec![
        (
            "seq",
            true,
            json!({ "description": "Position in the run, from 0, without gaps.", "type": "integer", "minimum": 0 }),
        ),
        (
            "at",
            true,
            json!({
                "description": "Local time with offset, RFC 3339. It may jump when a person sets the clock.",
                "type": "string",
                "format": "date-time"
            }),
        ),
        (
            "elapsed_us",
            true,
            json!({
                "description": "Microseconds since the start of the run by a clock that never jumps.",
                "type": "integer",
                "minimum": 0
            }),
        ),
        ("kind", true, json!({ "const": name })),
    ];
    all.extend(fields);
    object(name, description, &all)
}

fn shared(name: &str, description: &str) -> Value {
    json!({ "description": description, "$ref": format!("#/$defs/{name}") })
}

fn text(description: &str) -> Value {
    json!({ "description": description, "type": "string" })
}

fn nullable(description: &str, kind: &str) -> Value {
    json!({ "description": description, "type": [kind, "null"] })
}

fn nullable_shared(description: &str, name: &str) -> Value {
    json!({ "description": description, "anyOf": [{ "type": "null" }, { "$ref": format!("#/$defs/{name}") }] })
}

/// The item and the attempt to which an event belongs.
fn attempt() -> [Field; 2] {
    let attempt = json!({ "description": "Number of the attempt, from 1.", "type": "integer", "minimum": 1 });
    [("item", true, text("Name of the item in the plan.")), ("attempt", true, attempt)]
}

fn of_attempt(fields: impl IntoIterator<Item = Field>) -> Vec<Field> {
    attempt().into_iter().chain(fields).collect()
}

/// All kinds with what they mean and their own fields.
fn kinds(run: &Value) -> Vec<(&'static str, &'static str, Vec<Field>)> {
    let whose = || nullable("Name of the item to which this belongs; null if it belongs to none.", "string");
    vec![
        (
            "run_started",
            "The run begins: once, and first.",
            vec![
                ("header", true, shared("header", "Who tests what, where, with what.")),
                (
                    "items",
                    true,
                    json!({
                        "description": "The items in the order of the plan, those that are not selected included.",
                        "type": "array",
                        "items": { "$ref": "#/$defs/planned_item" }
                    }),
                ),
            ],
        ),
        ("board_found", "The slave board answered.", board(run)),
        (
            "board_rebooted",
            "The slave board answers with another boot id: it has restarted.",
            vec![
                ("item", true, nullable("The item whose request caused it; null if that is not known.", "string")),
                ("boot_id", true, text("The new boot id.")),
            ],
        ),
        (
            "board_breach",
            "The slave board broke a rule of the interface document: once when the run notices it, and again at the end of the run with the last count.",
            breach(),
        ),
        (
            "other_module",
            "The module in the socket is not the one that was scanned. The run says nothing of either.",
            vec![
                ("scanned", true, text("The serial number that was scanned.")),
                ("found", true, text("The serial number that the module in the socket says.")),
                (
                    "exchanged",
                    false,
                    json!({ "description": "Whether the scanned module was in the socket before, so that it was exchanged during the run; absent for false.", "type": "boolean" }),
                ),
            ],
        ),
        (
            "limits_chosen",
            "The plan has limits by part number, and the station chose those for the module: at most once, before the first item.",
            vec![
                (
                    "part",
                    true,
                    nullable_shared(
                        "The table of the plan that counts, as the plan names it; null if only the limits of the items count.",
                        "part",
                    ),
                ),
                (
                    "module",
                    true,
                    shared("part", "What the module says that it is, or what was asked for if it says nothing."),
                ),
            ],
        ),
        ("power", "The module's supply was switched.", power()),
        ("item_started", "An attempt of an item begins.", of_attempt([])),
        (
            "measured",
            "A value was measured and judged.",
            of_attempt([("measurement", true, shared("measurement", "The value with its judgement."))]),
        ),
        (
            "found",
            "Results of an analysis beside the measurements, once for each round of the attempt.",
            of_attempt([("details", true, json!({ "description": "In the form of the item." }))]),
        ),
        (
            "captured",
            "Raw samples of an attempt are on disk: when a capture is complete, and when its file is.",
            captured(),
        ),
        (
            "error_record",
            "The slave board made an error record for fault analysis.",
            of_attempt([("record", true, shared("error_record", "The record."))]),
        ),
        (
            "attempt_ended",
            "An attempt ended.",
            of_attempt([
                ("outcome", true, shared("outcome", "How it ended.")),
                (
                    "error",
                    true,
                    nullable_shared("Why the station could not tell; null if the measurements say it all.", "error"),
                ),
            ]),
        ),
        (
            "item_ended",
            "An item ended; no attempt of it follows.",
            vec![
                ("item", true, text("Name of the item in the plan.")),
                ("outcome", true, shared("outcome", "The outcome of the last attempt, or skipped.")),
                ("cause", true, nullable_shared("Why it was skipped; null if it was not.", "cause")),
            ],
        ),
        (
            "prompted",
            "The station asked a person to do something.",
            vec![
                ("item", true, whose()),
                ("text", true, text("What to do.")),
                ("question", false, text(QUESTION)),
                ("picture_sha256", false, text(PICTURE)),
            ],
        ),
        (
            "answered",
            "The request was answered.",
            vec![
                ("item", true, whose()),
                ("answer", true, text("The answer; empty for a simple \"done\".")),
                ("question", false, text(QUESTION)),
            ],
        ),
        (
            "note",
            "Useful information that is not a verdict.",
            vec![
                ("level", true, json!({ "description": "How much it matters.", "enum": ["info", "warning", "error"] })),
                ("text", true, text("One sentence.")),
                ("item", true, whose()),
            ],
        ),
        (
            "stop_requested",
            "A person or a signal asks the run to end.",
            vec![
                (
                    "how",
                    true,
                    json!({
                        "description": "in_order: items in flight end, then teardown runs. at_once: the station only makes the board safe.",
                        "enum": ["in_order", "at_once"]
                    }),
                ),
                ("by", true, text("What requested it: ctrl-C, SIGTERM.")),
            ],
        ),
        (
            "run_ended",
            "The run ended: once, and last. A run without it was interrupted.",
            vec![
                ("outcome", true, nullable_shared("How it ended; null if only chosen items were to run.", "outcome")),
                ("selection_outcome", false, shared("outcome", "How the chosen items ended; absent for a whole plan.")),
            ],
        ),
    ]
}

/// The board's own fields, as in the record.
fn board(run: &Value) -> Vec<Field> {
    let of = |name: &'static str| (name, true, run["$defs"]["board"]["properties"][name].clone());
    ["board_serial", "firmware", "protocol", "boot_id", "link"].map(of).to_vec()
}

fn breach() -> Vec<Field> {
    let section = json!({
        "description": "Section of the interface document (docs/ICD.md).", "type": "integer", "minimum": 1, "maximum": 255
    });
    let safety = json!({
        "description": "True if people or the module are in danger; absent if not.", "const": true
    });
    vec![
        ("section", true, section),
        ("what", true, text("What the board does against it.")),
        ("count", true, json!({ "description": "How often it did so up to now.", "type": "integer", "minimum": 1 })),
        ("worst", false, text("The worst value, or the first case in words; absent if there is neither.")),
        ("safety", false, safety),
    ]
}

fn captured() -> Vec<Field> {
    let digest =
        |description: &str| json!({ "description": description, "type": "string", "pattern": "^[0-9a-f]{64}$" });
    of_attempt([
        ("file", true, text("The file, relative to the folder of the run.")),
        (
            "bytes",
            true,
            json!({ "description": "Number of its bytes that are on disk. It only grows, so they stay its first ones.", "type": "integer", "minimum": 0 }),
        ),
        ("sha256", true, digest("SHA-256 of these bytes.")),
        ("journal_sha256", true, digest("SHA-256 of all lines of the journal before this one.")),
        (
            "signature",
            false,
            json!({
                "description": "Ed25519 signature of the station; absent if it has no key. It is of the words gnc-station, captured, 1, journal_sha256, sha256, bytes and file, with a space between.",
                "type": "string",
                "pattern": "^[0-9a-f]{128}$"
            }),
        ),
    ])
}

fn power() -> Vec<Field> {
    vec![
        ("on", true, json!({ "description": "Whether the module is powered.", "type": "boolean" })),
        ("supply", true, text("What switches it.")),
        ("voltage_v", true, nullable("Measured voltage; null if the supply does not tell.", "number")),
        ("current_a", true, nullable("Measured current; null if the supply does not tell.", "number")),
        (
            "calibration",
            false,
            text(
                "The calibration that the module keeps, at power-on: its checksum, none or damaged; absent if the board supports none.",
            ),
        ),
    ]
}

fn header() -> Value {
    let selection = json!({
        "description": "Names of the chosen items; null for the whole plan.",
        "anyOf": [{ "type": "null" }, { "type": "array", "items": { "type": "string" } }]
    });
    let fields = vec![
        (
            "schema",
            true,
            json!({ "description": "Version of the form of all events of the run.", "enum": [EVENTS_SCHEMA, SELECTION_SCHEMA] }),
        ),
        ("serial_number", true, text("Serial number as scanned or typed in; it may hold any character.")),
        (
            "part",
            false,
            shared("part", "The part number that was asked for, with its revision if one was; absent if none was."),
        ),
        ("numbers", false, shared("numbers", "Numbers of orders, sub-units and others; absent if none were given.")),
        ("operator", true, nullable("Who tests; null if not given.", "string")),
        ("station", true, text("Id of the station.")),
        ("program", true, shared("program", "The program that runs the test.")),
        ("bench", true, shared("bench", "The bench. A simulated or an unproven one is never evidence about a module.")),
        ("site", false, shared("site", "Place of the bench, as its file states it.")),
        ("plan", true, shared("plan", "The plan that is followed.")),
        ("recomputed", false, shared("recomputed", "The run whose raw record was judged again.")),
        ("resumed", false, shared("recomputed", "The interrupted run from which captures are taken over.")),
        ("selection", true, selection),
        ("loop", true, nullable_shared("Number of this run in a loop; null outside of one.", "loop")),
    ];
    object("Head of a run", "Who tests what, where, with what.", &fields)
}

fn planned_item() -> Value {
    let fields = vec![
        ("name", true, text("Unique name in the plan.")),
        (
            "id",
            true,
            json!({ "description": "Which item of the catalogue.", "enum": ItemId::ALL.map(ItemId::as_str).to_vec() }),
        ),
        ("title", true, text("Title for people.")),
        ("phase", true, json!({ "description": "Phase of the run.", "enum": ["setup", "test", "teardown"] })),
        ("optional", true, json!({ "description": "Whether the run is complete without it.", "type": "boolean" })),
        ("selected", true, json!({ "description": "Whether this run includes it.", "type": "boolean" })),
    ];
    object("Planned item", "An item of the plan.", &fields)
}

#[cfg(test)]
mod tests;
