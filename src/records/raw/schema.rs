//! The descriptors of the messages, in protobuf's own description format (google/protobuf/descriptor.proto).

use super::Topic;
use super::proto::Fields;

/// Types of fields: numbers of `FieldDescriptorProto.Type`.
#[derive(Clone, Copy)]
enum Type {
    Double = 1,
    Uint64 = 4,
    String = 9,
    Bytes = 12,
    Uint32 = 13,
    Sfixed32 = 15,
    Sint32 = 17,
}

/// `LABEL_OPTIONAL`, which every field of proto3 has.
const OPTIONAL: u64 = 1;

/// Numbers of the fields of `FieldDescriptorProto`, or of `DescriptorProto` if noted.
mod number {
    pub(super) const NAME: u32 = 1;
    pub(super) const NUMBER: u32 = 3;
    pub(super) const LABEL: u32 = 4;
    pub(super) const TYPE: u32 = 5;
    pub(super) const ONEOF_INDEX: u32 = 9;
    pub(super) const PROTO3_OPTIONAL: u32 = 17;
    /// Of `DescriptorProto`.
    pub(super) const FIELD: u32 = 2;
    /// Of `DescriptorProto`.
    pub(super) const ONEOF_DECL: u32 = 8;
}

/// Fields in the order of their numbers, from 1, as `docs/raw.proto` has them.
fn fields(topic: Topic) -> &'static [(&'static str, Type)] {
    use Type::{Bytes, Double, Sfixed32, Sint32, String, Uint32, Uint64};
    match topic {
        Topic::Capture => &[
            ("edge", Uint32),
            ("label", String),
            ("series", Uint32),
            ("rate_hz", Uint32),
            ("pose", String),
            ("up_x", Double),
            ("up_y", Double),
            ("up_z", Double),
            ("heading_deg", Double),
            ("axis", Uint32),
            ("angle_deg", Double),
            ("span_s", Double),
            ("rate_dps", Double),
            ("along", String),
            ("received", Uint32),
            ("lost_on_board", Uint32),
            ("lost_on_line", Uint32),
            ("host_error_ppm", Double),
            ("host_u_ppm", Double),
            ("host_nothing", String),
        ],
        Topic::Imu => &[
            ("gyro_x", Sfixed32),
            ("gyro_y", Sfixed32),
            ("gyro_z", Sfixed32),
            ("accel_x", Sfixed32),
            ("accel_y", Sfixed32),
            ("accel_z", Sfixed32),
            ("mag_x", Sfixed32),
            ("mag_y", Sfixed32),
            ("mag_z", Sfixed32),
            ("gyro_temperature", Sint32),
            ("accel_temperature", Sint32),
        ],
        Topic::Gnss => &[("board_time_us", Uint64), ("data", Bytes)],
        Topic::Pps => &[("board_time_ns", Uint64)],
        Topic::Compensated => &[
            ("rate_x", Sfixed32),
            ("rate_y", Sfixed32),
            ("rate_z", Sfixed32),
            ("force_x", Sfixed32),
            ("force_y", Sfixed32),
            ("force_z", Sfixed32),
            ("field_x", Sfixed32),
            ("field_y", Sfixed32),
            ("field_z", Sfixed32),
            ("gyro_temperature", Sint32),
            ("accel_temperature", Sint32),
            ("roll", Sfixed32),
            ("saturated", Uint32),
        ],
    }
}

/// A `FileDescriptorSet` with the one file that declares the topic's message.
///
/// Every field is `optional`: with implicit presence, other decoders leave out a count of exactly 0. Such a field has
/// its own oneof, which no source declares ("synthetic": protobuf, `docs/implementing_proto3_presence.md`).
pub(super) fn descriptor_set(topic: Topic) -> Vec<u8> {
    let name = topic.message().trim_start_matches("gnc.");
    let message = build(|message| {
        message.bytes(number::NAME, name.as_bytes());
        for (index, (field, kind)) in (0..).zip(fields(topic)) {
            let field = build(|out| {
                out.bytes(number::NAME, field.as_bytes()).unsigned(number::NUMBER, index + 1);
                out.unsigned(number::LABEL, OPTIONAL).unsigned(number::TYPE, *kind as u64);
                out.unsigned(number::ONEOF_INDEX, index).unsigned(number::PROTO3_OPTIONAL, 1);
            });
            message.bytes(number::FIELD, &field);
        }
        for (field, _) in fields(topic) {
            let oneof = build(|out| {
                out.bytes(number::NAME, format!("_{field}").as_bytes());
            });
            message.bytes(number::ONEOF_DECL, &oneof);
        }
    });
    let file = build(|file| {
        file.bytes(1, format!("gnc/{name}.proto").as_bytes()).bytes(2, b"gnc").bytes(4, &message);
        file.bytes(12, b"proto3");
    });
    build(|set| {
        set.bytes(1, &file);
    })
}

fn build(put: impl FnOnce(&mut Fields<'_>)) -> Vec<u8> {
    let mut bytes = Vec::new();
    put(&mut Fields(&mut bytes));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The document for people agrees with the files: names, types and numbers, all with explicit presence.
    #[test]
    fn the_document_has_the_same_fields() {
        let mut documented = Vec::new();
        let mut message = "";
        for line in include_str!("../../../docs/raw.proto").lines() {
            let words: Vec<&str> = line.split_whitespace().collect();
            match words.as_slice() {
                ["message", name, "{"] => message = name,
                ["optional", kind, name, "=", number, ..] => {
                    documented.push(format!("{message}.{name} {kind} {}", number.trim_end_matches(';')));
                }
                _ => assert!(!line.contains(" = ") || line.starts_with("syntax"), "no explicit presence: {line}"),
            }
        }
        let kind = |kind: Type| match kind {
            Type::Double => "double",
            Type::Uint64 => "uint64",
            Type::String => "string",
            Type::Bytes => "bytes",
            Type::Uint32 => "uint32",
            Type::Sfixed32 => "sfixed32",
            Type::Sint32 => "sint32",
        };
        let mut told: Vec<String> = Vec::new();
        for topic in Topic::ALL {
            let message = topic.message().trim_start_matches("gnc.");
            let fields = (1..).zip(fields(topic));
            told.extend(fields.map(|(number, (name, of))| format!("{message}.{name} {} {number}", kind(*of))));
        }
        documented.sort();
        told.sort();
        assert_eq!(documented, told);
    }
}
