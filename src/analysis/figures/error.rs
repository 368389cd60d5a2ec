//! The reasons why no figure comes from captures.

use gnc_executive::catalogue::ItemId;
use gnc_executive::plan::ParamError;
use gnc_metrology::Refusal;
use gnc_metrology::sample_clock::ClockFault;
use gnc_protocol::stream::Losses;

/// The reason why no figure comes from captures. [`FigureError::try_this`] says what the operator can try.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FigureError {
    /// The item has no figures from captures.
    #[error("{item} has no figures from captures")]
    NoAnalysis {
        /// The item.
        item: ItemId,
    },
    /// The plan was not checked against the catalogue: a mistake in this program.
    #[error(transparent)]
    Param(#[from] ParamError),
    /// The method refuses the record.
    #[error("{place}: {refusal}")]
    Refused {
        /// The capture, or the figure.
        place: String,
        /// The method's reason.
        refusal: Refusal,
    },
    /// Samples are missing inside a window that a figure needs.
    #[error("{label}: samples are missing: {} lost on the board, {} on the line", losses.on_board, losses.on_line)]
    Lost {
        /// The capture.
        label: String,
        /// The missing samples.
        losses: Losses,
    },
    /// The samples are not on the grid of the board's own clock, so that no rate is known.
    #[error("{label}: {fault}")]
    Clock {
        /// The capture.
        label: String,
        /// The fault in the times of the capture.
        fault: ClockFault,
    },
    /// A capture that the figure needs is missing.
    #[error("no capture of {what}")]
    Missing {
        /// What the missing capture should be of.
        what: String,
    },
    /// A capture does not fit the item.
    #[error("{label} does not fit: {why}")]
    Unfit {
        /// The capture.
        label: String,
        /// The reason why it does not fit.
        why: String,
    },
    /// A capture is shorter than the plan says.
    #[error("{label} has {samples} samples, the plan asks for {needed}")]
    Short {
        /// The capture.
        label: String,
        /// Samples of the capture.
        samples: usize,
        /// Samples by the plan.
        needed: usize,
    },
    /// A channel that the figure uses reached the end of its range.
    #[error("{label}: {channel} is saturated in {samples} samples")]
    Saturated {
        /// The capture.
        label: String,
        /// The channel.
        channel: String,
        /// How many samples show it.
        samples: usize,
    },
    /// A channel that the figure uses shows one value all the time.
    #[error("{label}: {channel} stands still at {code}")]
    Stuck {
        /// The capture.
        label: String,
        /// The channel.
        channel: String,
        /// Code of that value.
        code: i32,
    },
    /// The module moved where it should lie still.
    #[error("{label}: the module moved: means of {channel} spread by {spread:.3} of the {limit:.3} allowed")]
    Moved {
        /// The capture.
        label: String,
        /// The channel.
        channel: String,
        /// Largest minus smallest block mean, deg/s or g.
        spread: f64,
        /// Limit of the spread.
        limit: f64,
    },
    /// Some attitudes have a field that differs from that of the others.
    #[error(
        "the field differs from that of the other attitudes, where noise and the bench explain {limit_mgauss:.3} mgauss: {}",
        list(attitudes)
    )]
    Disturbed {
        /// Captures of these attitudes, and their differences, mgauss.
        attitudes: Vec<(String, f64)>,
        /// Limit of the difference, mgauss.
        limit_mgauss: f64,
    },
    /// The stream is coarser than the step that it should show.
    #[error("{channel}: the stream has {bits:.1} bits over the range, and resolution needs at least 18")]
    Coarse {
        /// The channel.
        channel: String,
        /// Bits that its codes show.
        bits: f64,
    },
    /// No item before this one found the calibration that this item works with.
    #[error("no calibration from {item}")]
    NotCalibrated {
        /// The item to run first.
        item: ItemId,
    },
    /// The findings of an item before this one cannot be read.
    #[error("the calibration of {item} cannot be read: {why}")]
    BadCalibration {
        /// Name of the item.
        item: String,
        /// The reason.
        why: String,
    },
    /// The bench file does not give the place of the bench.
    #[error("the place of the bench is not known")]
    NoPlace,
    /// The receiver gave no usable output.
    #[error("{got} epochs with a fix, needs at least {needed}")]
    FewEpochs {
        /// Epochs with a fix.
        got: usize,
        /// Epochs needed.
        needed: usize,
    },
}

/// Lists the attitudes with their differences.
fn list(attitudes: &[(String, f64)]) -> String {
    attitudes.iter().map(|(label, off)| format!("{label} by {off:+.3} mgauss")).collect::<Vec<_>>().join(", ")
}

impl FigureError {
    /// Returns a function that gives a refusal its place.
    pub(super) fn refused(place: impl Into<String>) -> impl FnOnce(Refusal) -> Self {
        let place = place.into();
        move |refusal| Self::Refused { place, refusal }
    }

    /// Returns what the operator can try.
    #[must_use]
    pub fn try_this(&self) -> &'static str {
        match self {
            Self::NoAnalysis { .. } | Self::Param(_) => "report this: the station should not have accepted the plan",
            Self::Refused { refusal, .. } => refusal.hint(),
            Self::Lost { .. } => "check the cable and its termination, or take a slower stream; then capture again",
            Self::Clock { fault, .. } => fault.hint(),
            Self::Missing { .. } | Self::Unfit { .. } => "capture again, with the parameters of this plan",
            Self::Short { .. } => "capture again, as long as the plan says",
            Self::Saturated { .. } => "turn more slowly, or take a wider range",
            Self::Stuck { .. } => "suspect the sensor or its line: run the item imu",
            Self::Moved { .. } => "let the table come to rest, keep hands off, and capture again",
            Self::Disturbed { .. } => {
                "look for iron, tools or currents near the bench in that attitude, and capture again; if the field of this \
                 bench changes by more, raise ambient_u under [fixture] in the bench file"
            }
            Self::Coarse { .. } => "stream the sensor with more bits; this one cannot show the step",
            Self::NotCalibrated { item } => match item {
                ItemId::SixPosition => "run six-position first; it must be good",
                ItemId::GyroStill => "run gyro-still first; it must be good",
                ItemId::Rotation => "run rotation first; it must be good",
                _ => "run that item first; it must be good",
            },
            Self::BadCalibration { .. } => "verify the record, and calibrate again",
            Self::NoPlace => "write latitude, longitude and height under [site] of the bench file",
            Self::FewEpochs { .. } => "check antenna and sky, and collect longer",
        }
    }
}
