//! Allan deviations over the averaging time, both by their logarithms, as they grow.

use gnc_bench::guidance::allan::AllanView;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::symbols::Marker;
use ratatui::widgets::{Axis, Block, Chart, Dataset, GraphType};

use super::live::names_of_curves;
use super::style;
use crate::tui::model::{Glyphs, ScreenModel};

/// Cells of one label of the averaging time, with a gap.
const LABEL: u16 = 8;

/// Draws the deviations of a capture of `span_s` seconds.
pub(super) fn draw(model: &ScreenModel, allan: &AllanView, span_s: f64, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let [gyro, accel] = Layout::vertical([Constraint::Fill(1), Constraint::Fill(1)]).areas(area);
    let title = |sensors: &str, unit: &str| format!("{}, {sensors}  {unit}", texts.allan);
    chart(model, frame, gyro, &title(texts.gyroscopes, "deg/h"), &allan.gyro_dph, span_s);
    chart(model, frame, accel, &title(texts.accelerometers, "mg"), &allan.accel_mg, span_s);
}

fn chart(
    model: &ScreenModel,
    frame: &mut Frame<'_>,
    area: Rect,
    title: &str,
    curves: &[Vec<(f64, f64)>; 3],
    span_s: f64,
) {
    let block = Block::bordered().title(format!(" {title} "));
    let inner = block.inner(area);
    frame.render_widget(block, area);
    // A deviation of zero has no logarithm.
    let curves = curves.each_ref().map(|curve| {
        let drawn = curve.iter().filter(|(tau_s, dev)| *tau_s > 0.0 && *dev > 0.0);
        drawn.map(|(tau_s, dev)| (tau_s.log10(), dev.log10())).collect::<Vec<_>>()
    });
    let range = |pick: &dyn Fn(&(f64, f64)) -> f64| {
        let values = || curves.iter().flatten().map(pick);
        (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max))
    };
    let (shortest, _) = range(&|point| point.0);
    let (least, most) = range(&|point| point.1);
    if !(shortest.is_finite() && least.is_finite()) || inner.height < 4 {
        return;
    }
    let times = Decades::new((shortest, (span_s / 4.0).max(1.0).log10()), inner.width / LABEL);
    let devs = Decades::new((least, most), (inner.height - 2) / 2 + 1);
    let marker = if model.look.glyphs == Glyphs::Unicode { Marker::Braille } else { Marker::Dot };
    let datasets = curves.iter().enumerate().map(|(axis, points)| {
        let dataset = Dataset::default().marker(marker).graph_type(GraphType::Line);
        dataset.style(style::axis(model.look, axis)).data(points)
    });
    let [drawn, ends] = Layout::horizontal([Constraint::Fill(1), Constraint::Length(2)]).areas(inner);
    let chart = Chart::new(datasets.collect())
        .x_axis(Axis::default().bounds(times.bounds()).labels(times.labels(" s")))
        .y_axis(Axis::default().bounds(devs.bounds()).labels(devs.labels("")));
    frame.render_widget(chart, drawn);
    let newest = curves.map(|points| points.last().map(|(_, dev)| *dev));
    let [low, high] = devs.bounds();
    names_of_curves(model, frame, ends, newest, (low, high));
}

/// Whole decades that hold a range; every `step`-th one has a label.
#[derive(Debug, PartialEq, Eq)]
struct Decades {
    low: i32,
    step: i32,
    steps: i32,
}

impl Decades {
    /// The decades of a range of logarithms, with at most `labels` labels.
    fn new((low, high): (f64, f64), labels: u16) -> Self {
        let (low, high) = (low.floor() as i32, high.ceil() as i32);
        let decades = (high - low).max(1);
        let most = i32::from(labels.max(2)) - 1;
        let step = (decades + most - 1) / most;
        Self { low, step, steps: (decades + step - 1) / step }
    }

    fn bounds(&self) -> [f64; 2] {
        [f64::from(self.low), f64::from(self.low + self.step * self.steps)]
    }

    fn labels(&self, unit: &str) -> Vec<String> {
        (0..=self.steps).map(|index| format!("{}{unit}", 10_f64.powi(self.low + index * self.step))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decades_hold_the_range_and_have_room_for_their_labels() {
        let check = |range, labels, expected: &[&str]| {
            let decades = Decades::new(range, labels);
            assert_eq!(decades.labels(""), expected, "{range:?} {labels}");
            let [low, high] = decades.bounds();
            assert!(low <= range.0 && high >= range.1 && expected.len() <= usize::from(labels.max(2)));
        };
        check((-2.3, 2.9), 9, &["0.001", "0.01", "0.1", "1", "10", "100", "1000"]);
        check((-2.3, 2.9), 4, &["0.001", "0.1", "10", "1000"]);
        check((-2.3, 2.9), 3, &["0.001", "1", "1000"]);
        check((0.2, 0.4), 5, &["1", "10"]);
        check((-2.3, 3.1), 1, &["0.001", "10000"]);
    }
}
