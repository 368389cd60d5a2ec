//! The descriptors of the messages, as protobuf describes itself (google/protobuf/descriptor.proto).

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
pub(super) fn descriptor_set(topic: Topic) -> Vec<u8> {
    let name = topic.message().trim_start_matches("gnc.");
    let message = build(|message| {
        message.bytes(1, name.as_bytes());
        for (number, (field, kind)) in (1..).zip(fields(topic)) {
            let field = build(|out| {
                out.bytes(1, field.as_bytes()).unsigned(3, number).unsigned(4, OPTIONAL).unsigned(5, *kind as u64);
            });
            message.bytes(2, &field);
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
