//! The JSON Schema of plans, for editors: generated from the catalogue, so that it always agrees with the parser's
//! items, parameters and measurements.
//!
//! With it an editor completes keys and marks unknown ones. Only [`Plan::read`](super::Plan::read) checks units, order
//! of bounds and requirements.

use serde_json::{Map, Value, json};

use super::{DEFAULT_VALID_DAYS, MAX_REQUIRED_PLANS, MAX_VALID_DAYS};
use crate::catalogue::{ItemId, ItemSpec, MeasurementSpec, ParamKind};
use crate::limit::MeasurementKind;
use crate::quantity::Quantity;

/// The schema of a plan file, draft 2020-12.
pub fn plan_schema() -> Value {
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": "plan.schema.json",
        "title": "Test plan",
        "type": "object",
        "required": ["name", "version"],
        "additionalProperties": false,
        "properties": {
            "name": { "description": "Name of the plan: small letters, digits, - _ and .", "$ref": "#/$defs/name" },
            "version": { "description": "Version of the plan.", "type": "string" },
            "description": { "description": "What the plan is for.", "type": "string" },
            "on_fail": {
                "description": "What the run does after an item that is not good: run the next item, or stop.",
                "enum": ["continue", "stop"]
            },
            "resume": {
                "description": "How a run that takes over captures of an earlier one waits for the module's temperature.",
                "type": "object",
                "additionalProperties": false,
                "properties": {
                    "wait": { "description": "Longest wait of a run. If it is left out: 30 min.", "type": "string" },
                    "within": {
                        "description": "Difference from the temperature at the end of those captures. If it is left out: 0.5 degC.",
                        "type": "string"
                    }
                }
            },
            "serial_number": {
                "description": "A regular expression that the whole serial number of a module matches.",
                "type": "string"
            },
            "include": {
                "description": "Paths of other plans, relative to this file. Their items run before the items of this plan.",
                "type": "array",
                "items": { "type": "string" }
            },
            "requires_plan": {
                "description": "Names of plans that the module must have passed. Without a valid pass of each, no run begins.",
                "type": "array",
                "maxItems": MAX_REQUIRED_PLANS,
                "uniqueItems": true,
                "items": { "$ref": "#/$defs/name" }
            },
            "valid_days": {
                "description": "Days for which a pass of this plan, and of those that it requires, counts for a module.",
                "type": "integer", "minimum": 1, "maximum": MAX_VALID_DAYS, "default": DEFAULT_VALID_DAYS
            },
            "numbers": {
                "description": "Numbers that are asked for beside the serial number, by their keys.",
                "type": "object",
                "propertyNames": { "pattern": "^[a-z0-9_-]{1,24}$" },
                "additionalProperties": {
                    "type": "object",
                    "additionalProperties": false,
                    "properties": {
                        "kind": {
                            "description": "order: it stays until it is changed. subunit: it is in one module only.",
                            "enum": ["order", "subunit", "free"]
                        },
                        "label": {
                            "description": "Its name for people, in all languages or for each.",
                            "anyOf": [
                                { "type": "string" },
                                {
                                    "type": "object",
                                    "additionalProperties": false,
                                    "properties": {
                                        "en": { "type": "string" },
                                        "zh": { "type": "string" },
                                        "ru": { "type": "string" }
                                    }
                                }
                            ]
                        },
                        "pattern": {
                            "description": "A regular expression that the whole number matches.", "type": "string"
                        },
                        "required": { "description": "If true, no run begins without it.", "type": "boolean" }
                    }
                }
            },
            "requires_part": {
                "description": "If true, the station refuses modules whose part number has no table.",
                "type": "boolean"
            },
            "part": {
                "description": "Limits for modules by the part number that they say, in place of the limits of the items.",
                "type": "object",
                "additionalProperties": {
                    "type": "object",
                    "additionalProperties": false,
                    "properties": {
                        "limits": { "$ref": "#/$defs/limits_of_part" },
                        "revision": {
                            "description": "Limits for modules with this hardware revision, in place of those of the part.",
                            "type": "object",
                            "additionalProperties": {
                                "type": "object",
                                "additionalProperties": false,
                                "properties": { "limits": { "$ref": "#/$defs/limits_of_part" } }
                            }
                        }
                    }
                }
            },
            "item": {
                "description": "The items, in the order in which they run.",
                "type": "array",
                "items": { "oneOf": ItemId::ALL.map(item).to_vec() }
            }
        },
        "$defs": {
            "name": { "type": "string", "pattern": "^[a-z0-9][a-z0-9._-]{0,63}$" },
            "limit": {
                "description": "<= Q, >= Q, Q .. Q, Q +- Q, Q +- N %, == text; Q is a number with its unit",
                "type": "string",
                "pattern": "^\\s*(<=|>=|==|.*\\.\\.|.*\\+-)"
            },
            "limits_of_part": {
                "description": "The names of items, below each its measurements with their limits.",
                "type": "object",
                "additionalProperties": {
                    "type": "object",
                    "additionalProperties": { "$ref": "#/$defs/limit_or_band" }
                }
            },
            "limit_or_band": {
                "anyOf": [
                    { "$ref": "#/$defs/limit" },
                    {
                        "type": "object",
                        "required": ["limit"],
                        "additionalProperties": false,
                        "properties": {
                            "limit": { "description": "The limit.", "$ref": "#/$defs/limit" },
                            "marginal": {
                                "description": "Good values closer than this to a bound are marginal.",
                                "type": "string"
                            }
                        }
                    }
                ]
            }
        }
    })
}

fn item(id: ItemId) -> Value {
    let spec = id.spec();
    let mut schema = json!({
        "title": spec.title,
        "type": "object",
        "required": ["id"],
        "additionalProperties": false,
        "properties": {
            "id": { "description": spec.title, "const": id.as_str() },
            "name": { "description": "Unique name. If it is left out, the id is the name.", "$ref": "#/$defs/name" },
            "phase": {
                "description": "setup: all tests need this item. teardown: this item always runs at the end.",
                "enum": ["setup", "test", "teardown"]
            },
            "optional": { "description": "If true, a bench that lacks a device of the item skips it. If not, the station refuses the plan.", "type": "boolean" },
            "requires": {
                "description": "Names of earlier items. This item is skipped unless they are all good.",
                "type": "array",
                "items": { "type": "string" }
            },
            "attempts": { "description": "How many times an errored item may run.", "type": "integer", "minimum": 1, "maximum": 10 },
            "retry_failed": { "description": "Whether a failed item is tried again too.", "type": "boolean" },
            "repeats": { "description": "How many times the item measures within an attempt.", "type": "integer", "minimum": 1, "maximum": 1000 },
            "timeout": {
                "description": format!("Longest board time of an attempt. If it is left out: {} s.", spec.timeout_s),
                "type": "string"
            },
            "decision": {
                "description": "simple: the value decides. guard-band: the whole coverage interval of a figure must be within its limit.",
                "enum": ["simple", "guard-band"]
            },
            "prompt": { "description": "What the operator must do before the first attempt.", "type": "string" },
            "params": params(spec),
            "limits": limits(spec)
        }
    });
    if id == ItemId::Prompt {
        schema["required"] = json!(["id", "ask"]);
        if let Some(properties) = schema["properties"].as_object_mut() {
            properties.remove("timeout");
            properties.insert("ask".to_owned(), questions());
            let about = "Limits of the answers. Each key is the name of a question.";
            let limit = json!({ "$ref": "#/$defs/limit_or_band" });
            let limits = json!({ "description": about, "type": "object", "additionalProperties": limit });
            properties.insert("limits".to_owned(), limits);
        }
    }
    schema
}

/// The questions of an item that asks.
fn questions() -> Value {
    let text = |about: &str| json!({ "description": about, "type": "string" });
    let texts = |about: &str| json!({ "description": about, "type": "array", "items": { "type": "string" } });
    json!({
        "description": "The questions, in the order in which they are asked.",
        "type": "array",
        "minItems": 1,
        "items": {
            "type": "object",
            "required": ["name", "en", "kind"],
            "additionalProperties": false,
            "properties": {
                "name": {
                    "description": "Unique name in the plan. The answer is a measurement of this name.",
                    "type": "string", "pattern": "^[a-z][a-z0-9_]{0,63}$"
                },
                "en": text("The question in English."),
                "zh": text("The question in Chinese."),
                "ru": text("The question in Russian."),
                "kind": { "description": "What counts as an answer.", "enum": ["text", "number", "choice", "done"] },
                "pattern": text("A regular expression that the whole text matches."),
                "unit": text("The unit of the number, if the answer names none."),
                "choices": texts("The choices."),
                "good": texts("The choices that pass."),
                "picture": text("Path of a picture, relative to this file.")
            }
        }
    })
}

fn params(spec: &ItemSpec) -> Value {
    let properties: Map<String, Value> = spec
        .params
        .iter()
        .map(|param| {
            let mut schema = match param.kind {
                ParamKind::Integer { min, max, default } => {
                    json!({ "type": "integer", "minimum": min, "maximum": max, "default": default })
                }
                ParamKind::Integers { min, max, default } => json!({
                    "type": "array", "minItems": 1, "uniqueItems": true, "default": default,
                    "items": { "type": "integer", "minimum": min, "maximum": max }
                }),
                ParamKind::Quantity { unit, default, .. } => {
                    json!({ "type": "string", "default": Quantity::new(default, unit).to_string() })
                }
                ParamKind::Choice { of, default } => json!({ "enum": of, "default": default }),
                ParamKind::Choices { of, default } => json!({
                    "type": "array", "minItems": 1, "uniqueItems": true, "default": default, "items": { "enum": of }
                }),
                ParamKind::Source { .. } => json!({ "$ref": "#/$defs/name" }),
            };
            let about = match param.kind {
                ParamKind::Quantity { unit, min, max, .. } => {
                    format!("{}, {} to {}", param.about, Quantity::new(min, unit), Quantity::new(max, unit))
                }
                _ => param.about.to_owned(),
            };
            schema["description"] = Value::String(about);
            (param.name.to_owned(), schema)
        })
        .collect();
    json!({
        "description": "Parameters of the item.",
        "type": "object",
        "additionalProperties": false,
        "properties": properties
    })
}

fn limits(spec: &ItemSpec) -> Value {
    let about = |measurement: &MeasurementSpec| match measurement.kind {
        MeasurementKind::Text => "Text.".to_owned(),
        MeasurementKind::Number(dimension) if measurement.unit.symbol().is_empty() => format!("A {dimension}."),
        MeasurementKind::Number(dimension) => format!("{}, shown in {}.", dimension.with_article(), measurement.unit),
    };
    let properties: Map<String, Value> = spec
        .measurements
        .iter()
        .map(|measurement| {
            let schema = json!({ "description": about(measurement), "$ref": "#/$defs/limit_or_band" });
            (measurement.name.to_owned(), schema)
        })
        .collect();
    json!({
        "description": "Limits of the measured values. A key with * is for every measurement that it matches.",
        "type": "object",
        "additionalProperties": false,
        "properties": properties,
        "patternProperties": { "\\*": { "$ref": "#/$defs/limit_or_band" } }
    })
}
