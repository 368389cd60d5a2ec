//! The passport as XML: the same keys and the same numbers as in JSON. Its form is `docs/passport.xsd`.
//!
//! An object is an element with one child element for each key. A list of numbers is a list of words, a list of lists
//! has a `row` for each list, a list of objects an `entry` for each object. Null is an empty element with `xsi:nil`.

use std::io;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event};
use serde_json::Value;

use super::Passport;

const ROOT: &str = "passport";
const NIL: (&str, &str) = ("xsi:nil", "true");
const INSTANCE: (&str, &str) = ("xmlns:xsi", "http://www.w3.org/2001/XMLSchema-instance");

/// Why a passport cannot be written as XML: a mistake in this program.
#[derive(Debug, thiserror::Error)]
pub enum XmlError {
    /// The passport cannot be turned into keys and values.
    #[error("the passport cannot be written as JSON")]
    Json(#[from] serde_json::Error),
    /// The XML cannot be written into memory.
    #[error("the passport cannot be written as XML")]
    Write(#[from] io::Error),
}

/// The passport as XML.
///
/// # Errors
/// [`XmlError`], a mistake in this program.
pub fn xml(passport: &Passport) -> Result<Vec<u8>, XmlError> {
    xml_of(&serde_json::to_value(passport)?)
}

/// A passport that was filed as JSON, as XML.
///
/// # Errors
/// [`XmlError`], a mistake in this program.
pub(crate) fn xml_of(passport: &Value) -> Result<Vec<u8>, XmlError> {
    let mut out = Writer::new_with_indent(Vec::new(), b' ', 2);
    out.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    let root = BytesStart::new(ROOT).with_attributes([INSTANCE]);
    element(&mut out, root, passport)?;
    let mut text = out.into_inner();
    text.push(b'\n');
    Ok(text)
}

fn element(out: &mut Writer<Vec<u8>>, start: BytesStart<'_>, value: &Value) -> io::Result<()> {
    let name = start.name().as_ref().to_owned();
    match value {
        Value::Null => return out.write_event(Event::Empty(start.with_attributes([NIL]))),
        Value::Object(map) => {
            out.write_event(Event::Start(start))?;
            for (key, value) in map {
                element(out, BytesStart::new(key.as_str()), value)?;
            }
        }
        Value::Array(values) if values.iter().any(|value| value.is_array() || value.is_object()) => {
            out.write_event(Event::Start(start))?;
            for value in values {
                element(out, BytesStart::new(if value.is_array() { "row" } else { "entry" }), value)?;
            }
        }
        other => {
            out.write_event(Event::Start(start))?;
            out.write_event(Event::Text(BytesText::new(&words(other))))?;
        }
    }
    out.write_event(Event::End(BytesEnd::new(name)))
}

fn words(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(values) => values.iter().map(words).collect::<Vec<_>>().join(" "),
        other => other.to_string(),
    }
}
