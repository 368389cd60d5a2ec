//! `gnc.CaptureMark`: where a capture begins and ends.

use gnc_analysis::capture::{CaptureHead, HostView, Pose};
use gnc_protocol::stream::Losses;
use gnc_rig::Along;

use super::proto::{Fields, next};

/// A mark: the begin or the end of a capture.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum RawMark {
    /// From here on, messages belong to this capture.
    Begin(CaptureHead),
    /// The capture ends here, with its losses and the board's clock against the host's.
    End(Losses, HostView),
}

const BEGIN: u64 = 1;
const END: u64 = 2;

const ALONG: [(Along, &str); 3] = [(Along::Up, "up"), (Along::North, "north"), (Along::Polar, "polar")];

impl RawMark {
    pub(super) fn put(&self, out: &mut Vec<u8>) {
        let mut fields = Fields(out);
        match self {
            Self::Begin(CaptureHead { label, series, pose, rate_hz }) => {
                fields.unsigned(1, BEGIN).bytes(2, label.as_bytes());
                fields.unsigned(3, (*series).into()).unsigned(4, (*rate_hz).into());
                put_pose(&mut fields, pose);
            }
            Self::End(Losses { received, on_board, on_line }, host) => {
                fields.unsigned(1, END).unsigned(15, (*received).into());
                fields.unsigned(16, (*on_board).into()).unsigned(17, (*on_line).into());
                match host {
                    HostView::Compared { error_ppm, u_ppm } => fields.double(18, *error_ppm).double(19, *u_ppm),
                    HostView::Nothing(why) => fields.bytes(20, why.as_bytes()),
                };
            }
        }
    }

    /// `None` if the bytes are not such a message.
    pub(super) fn get(mut rest: &[u8]) -> Option<Self> {
        let mut flat = Flat::default();
        while let Some((field, value)) = next(&mut rest)? {
            match field {
                1 => flat.edge = value.unsigned()?,
                2 => flat.label = value.text()?,
                3 => flat.series = value.narrow()?,
                4 => flat.rate_hz = value.narrow()?,
                5 => flat.pose = value.text()?,
                6..=8 => flat.up[field as usize - 6] = value.double()?,
                9 => flat.heading_deg = value.double()?,
                10 => flat.axis = value.narrow()?,
                11 => flat.angle_deg = value.double()?,
                12 => flat.span_s = value.double()?,
                13 => flat.rate_dps = value.double()?,
                14 => flat.along = value.text()?,
                15 => flat.losses.received = value.narrow()?,
                16 => flat.losses.on_board = value.narrow()?,
                17 => flat.losses.on_line = value.narrow()?,
                18 => flat.host_error_ppm = value.double()?,
                19 => flat.host_u_ppm = Some(value.double()?),
                20 => flat.host_nothing = Some(value.text()?),
                _ => {}
            }
        }
        flat.mark()
    }
}

fn put_pose(fields: &mut Fields<'_>, pose: &Pose) {
    let name = |along: &Along| ALONG.iter().find(|(other, _)| other == along).map_or("", |(_, name)| name);
    match pose {
        Pose::Still { up, heading_deg } => {
            fields.bytes(5, b"still");
            for (field, part) in (6..).zip(up) {
                fields.double(field, *part);
            }
            fields.double(9, *heading_deg);
        }
        Pose::Rotating { axis, angle_deg, span_s, along } => {
            fields.bytes(5, b"rotating").unsigned(10, (*axis).into());
            fields.double(11, *angle_deg).double(12, *span_s).bytes(14, name(along).as_bytes());
        }
        Pose::Spinning { axis, rate_dps, along } => {
            fields.bytes(5, b"spinning").unsigned(10, (*axis).into());
            fields.double(13, *rate_dps).bytes(14, name(along).as_bytes());
        }
    }
}

/// All fields of the message, as protobuf has them: absent ones are zero.
#[derive(Debug, Default)]
struct Flat {
    edge: u64,
    label: String,
    series: u32,
    rate_hz: u16,
    pose: String,
    up: [f64; 3],
    heading_deg: f64,
    axis: u8,
    angle_deg: f64,
    span_s: f64,
    rate_dps: f64,
    along: String,
    losses: Losses,
    host_error_ppm: f64,
    host_u_ppm: Option<f64>,
    host_nothing: Option<String>,
}

impl Flat {
    fn mark(self) -> Option<RawMark> {
        match self.edge {
            BEGIN => {
                let pose = self.pose()?;
                Some(RawMark::Begin(CaptureHead {
                    label: self.label,
                    series: self.series,
                    pose,
                    rate_hz: self.rate_hz,
                }))
            }
            END => {
                let host = match (self.host_u_ppm, self.host_nothing) {
                    (Some(u_ppm), _) => HostView::Compared { error_ppm: self.host_error_ppm, u_ppm },
                    (None, Some(why)) => HostView::Nothing(why),
                    (None, None) => HostView::default(),
                };
                Some(RawMark::End(self.losses, host))
            }
            _ => None,
        }
    }

    fn pose(&self) -> Option<Pose> {
        let along = || ALONG.iter().find(|(_, name)| *name == self.along).map(|(along, _)| *along);
        let axis = || (self.axis < 3).then_some(self.axis);
        match self.pose.as_str() {
            "still" => Some(Pose::Still { up: self.up, heading_deg: self.heading_deg }),
            "rotating" => {
                Some(Pose::Rotating { axis: axis()?, angle_deg: self.angle_deg, span_s: self.span_s, along: along()? })
            }
            "spinning" => Some(Pose::Spinning { axis: axis()?, rate_dps: self.rate_dps, along: along()? }),
            _ => None,
        }
    }
}
