//! Live readings: numbers, and curves over the last minute.

use std::time::Duration;

use gnc_bench::guidance::field::roll_deg;
use gnc_board::StreamReading;
use gnc_nmea::Fix;
use gnc_protocol::calibration::ROLL_PER_RAD;
use gnc_protocol::stream::StreamId;
use gnc_rig::MODULE_AXES;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Style;
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Block, Chart, Dataset, GraphType};

use super::panels::{block, block_in};
use super::{WIDE, style, text};
use crate::tui::lang::fill;
use crate::tui::live::{LivePoint, LiveSample};
use crate::tui::model::{Glyphs, ScreenModel};

/// Time that the curves cover.
const SPAN: Duration = Duration::from_secs(60);
/// Width of the numbers.
const NUMBERS: u16 = 40;
/// Raw and compensated samples within this board time are of one attitude, microseconds.
const TOGETHER_US: u64 = 1_000_000;
/// Readings older than this are marked as old.
const FRESH: Duration = Duration::from_secs(2);

pub(super) fn draw(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    if model.live.is_empty() {
        let block = block(model.texts.live);
        let inner = block.inner(area);
        frame.render_widget(block, area);
        let lines = text::wrap(model.texts.no_live_yet, usize::from(inner.width));
        return text::lines(frame, lines.into_iter().map(Line::raw), inner);
    }
    let width = if area.width >= WIDE { NUMBERS + 10 } else { NUMBERS };
    let [numbers_area, charts_area] = Layout::horizontal([Constraint::Length(width), Constraint::Fill(1)]).areas(area);
    numbers(model, frame, numbers_area);
    charts(model, frame, charts_area);
}

fn numbers(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let block = block_in(&title(model), area);
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let cells = usize::from(inner.width);
    let roomy = inner.height >= 30;
    let mut lines = Vec::new();
    if let Some(imu) = model.live.imu() {
        lines.extend(vectors(model, &imu, roomy));
    }
    if let Some(roll) = roll(model) {
        lines.push(roll);
        gap(&mut lines, roomy);
    }
    lines.extend(gnss(model, cells));
    gap(&mut lines, roomy);
    lines.push(Line::styled(format!("{}  V", texts.ad_channels), style::strong()));
    lines.extend(ad(model));
    gap(&mut lines, roomy);
    lines.push(Line::styled(text::cut(texts.streams, cells), style::strong()));
    // On a small screen the figures matter more than their legend.
    if lines.len() + 1 + model.live.newest.streams.len() <= usize::from(inner.height) {
        lines.push(Line::styled(text::cut(texts.streams_legend, cells), style::faint()));
    }
    lines.extend(model.live.newest.streams.iter().map(|reading| stream(model, reading, cells)));
    text::lines(frame, lines, inner);
}

fn gap(lines: &mut Vec<Line<'static>>, roomy: bool) {
    if roomy {
        lines.push(Line::raw(""));
    }
}

/// The title, with the age of old readings.
fn title(model: &ScreenModel) -> String {
    let texts = model.texts;
    let age = model.now.since_start.saturating_sub(model.live.at.unwrap_or_default());
    let number = model.live_of.as_deref().map(|number| format!(" {}", text::shown(number))).unwrap_or_default();
    let what = match (model.watching, model.is_running()) {
        (true, _) => format!("{}{number}: {}", texts.watching, texts.no_verdict),
        (false, true) => texts.live.to_owned(),
        // The module is off, or its power is unknown: these values are not of now.
        (false, false) => format!("{}{number}", texts.last_values),
    };
    if age > FRESH { format!("{what} · {}", fill(texts.seconds_ago, &[&age.as_secs().to_string()])) } else { what }
}

/// Three axes each of rate, acceleration and field, and the temperatures.
fn vectors(model: &ScreenModel, imu: &LiveSample, roomy: bool) -> Vec<Line<'static>> {
    let texts = model.texts;
    let mut lines = Vec::new();
    let groups = [
        (texts.rate, "deg/s", imu.rate_dps, 4),
        (texts.acceleration, "g", imu.accel_g, 5),
        (texts.field, "gauss", imu.field_gauss, 5),
    ];
    for (label, unit, values, digits) in groups {
        lines.push(Line::from(vec![
            Span::styled(label, style::strong()),
            Span::styled(format!("  {unit}"), style::faint()),
        ]));
        let mut spans = Vec::new();
        for (axis, value) in values.into_iter().enumerate() {
            let name = MODULE_AXES[axis];
            spans.push(Span::styled(format!(" {name} "), style::axis(model.look, axis)));
            spans.push(Span::raw(format!("{value:>9.digits$}")));
        }
        lines.push(Line::from(spans));
        gap(&mut lines, roomy);
    }
    lines.push(Line::from(vec![
        Span::styled(texts.temperature, style::strong()),
        Span::raw(format!("  {:.2}  {:.2} °C", imu.gyro_temperature_c, imu.accel_temperature_c)),
    ]));
    gap(&mut lines, roomy);
    lines
}

/// The roll angle: that of the host by the correction that the module keeps, and that of the board. `None` until the
/// correction was read. A stale raw or compensated sample is left out, since it is of another attitude.
pub(super) fn roll(model: &ScreenModel) -> Option<Line<'static>> {
    let (texts, newest) = (model.texts, &model.live.newest);
    let correction = newest.correction.as_ref()?;
    let times = [newest.imu.as_ref().map(|(us, _)| *us), newest.compensated.as_ref().map(|(us, _)| *us)];
    let last_us = times.into_iter().flatten().max()?;
    let [raw, compensated] = times.map(|us| us.is_some_and(|us| us + TOGETHER_US >= last_us));
    let angle = |angle_deg: Option<f64>| angle_deg.map_or_else(|| "-".to_owned(), |deg| format!("{deg:+.2}°"));
    let imu = model.live.imu().filter(|_| raw);
    let host = imu.map(|imu| roll_deg(correction, [imu.field_gauss[0], imu.field_gauss[1]]));
    let board = newest.compensated.as_ref().filter(|_| compensated);
    let board = board.map(|(_, sample)| (f64::from(sample.roll) / ROLL_PER_RAD).to_degrees());
    let said = format!("  {} {}  {} {}", texts.by_host, angle(host), texts.board_says, angle(board));
    Some(Line::from(vec![Span::styled(texts.roll, style::strong()), Span::raw(said)]))
}

fn gnss(model: &ScreenModel, cells: usize) -> Vec<Line<'static>> {
    let texts = model.texts;
    let newest = &model.live.newest;
    let head =
        |fix: String| Line::from(vec![Span::styled(format!("{}  ", texts.gnss), style::strong()), Span::raw(fix)]);
    let Some(gnss) = &newest.gnss else {
        return vec![head("-".to_owned()), Line::raw("")];
    };
    let fix = match gnss.fix {
        Fix::ThreeD | Fix::TwoD => gnss.fix.name(),
        Fix::DimensionsUnknown => "?D",
        Fix::None | Fix::Estimated | Fix::Manual | Fix::Simulated => texts.no_fix,
    };
    let satellites = gnss.satellites_used.map_or("-".to_owned(), |count| count.to_string());
    let hdop = gnss.hdop.map_or("-".to_owned(), |hdop| format!("{hdop:.1}"));
    let pulses = format!(" HDOP {hdop}  1PPS {} {}", newest.pulses, texts.pulses);
    let place = match (gnss.latitude_deg, gnss.longitude_deg, gnss.height_m) {
        (Some(latitude), Some(longitude), height) => {
            let height = height.map(|height| format!("  {height:.1} m")).unwrap_or_default();
            format!(" {latitude:.6}  {longitude:.6}{height}")
        }
        _ => String::new(),
    };
    let lines = [pulses, place].into_iter().map(|line| Line::raw(text::cut(&line, cells)));
    [head(format!("{fix}  {satellites} {}", texts.satellites))].into_iter().chain(lines).collect()
}

/// Channels 1 to 8, four to a line.
fn ad(model: &ScreenModel) -> Vec<Line<'static>> {
    let volts = model.live.newest.ad_v;
    let rows = volts.chunks(4).enumerate().map(|(row, chunk)| {
        let each = chunk.iter().enumerate().map(|(index, volt)| {
            let value = volt.map_or("-".to_owned(), |volt| format!("{volt:.3}"));
            format!(" {} {value:>6}", row * 4 + index + 1)
        });
        Line::raw(each.collect::<String>())
    });
    rows.collect()
}

fn stream(model: &ScreenModel, reading: &StreamReading, cells: usize) -> Line<'static> {
    let name = match reading.id {
        StreamId::Imu => "IMU",
        StreamId::Gnss => "GNSS",
        StreamId::Pps => "1PPS",
        StreamId::Compensated => "COMP",
    };
    // Nothing comes any more where nothing is on.
    let on = model.watching || model.is_running();
    let rate = if on { format!("{:>7.1}/s", reading.rate_hz) } else { format!("{:>7}  ", "-") };
    let lost = reading.on_board + reading.on_line;
    let line = format!(" {name:<5}{rate} {:>9}  {}/{}", reading.received, reading.on_board, reading.on_line);
    let style =
        if lost > 0 { style::weight(model.look, crate::tui::model::MessageWeight::Warning) } else { Style::new() };
    Line::styled(text::cut(&line, cells), style)
}

fn charts(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let [rate, accel, field] =
        Layout::vertical([Constraint::Fill(1), Constraint::Fill(1), Constraint::Fill(1)]).areas(area);
    chart(model, frame, rate, &format!("{}  deg/s", texts.rate), |imu| imu.rate_dps);
    chart(model, frame, accel, &format!("{}  g", texts.acceleration), |imu| imu.accel_g);
    chart(model, frame, field, &format!("{}  gauss", texts.field), |imu| imu.field_gauss);
}

fn chart(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, title: &str, of: impl Fn(&LiveSample) -> [f64; 3]) {
    let now = model.live.points.back().map_or(Duration::ZERO, |point| point.at);
    let age_s = |point: &LivePoint| now.saturating_sub(point.at).as_secs_f64();
    let in_sight = || model.live.points.iter().filter(|point| now.saturating_sub(point.at) <= SPAN);
    let axes: [Vec<(f64, f64)>; 3] =
        [0, 1, 2].map(|axis| in_sight().map(|point| (-age_s(point), of(&point.imu)[axis])).collect());
    let (low, high) = bounds(axes.iter().flatten().map(|(_, value)| *value));
    let marker = if model.look.glyphs == Glyphs::Unicode { Marker::Braille } else { Marker::Block };
    let datasets = axes.iter().enumerate().map(|(axis, points)| {
        let dataset = Dataset::default().marker(marker).graph_type(GraphType::Line);
        dataset.style(style::axis(model.look, axis)).data(points)
    });
    let time = format!("-{} s", SPAN.as_secs());
    let block = Block::bordered().title(format!(" {title} "));
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let [curves, ends] = Layout::horizontal([Constraint::Fill(1), Constraint::Length(2)]).areas(inner);
    let chart = Chart::new(datasets.collect())
        .x_axis(Axis::default().bounds([-SPAN.as_secs_f64(), 0.0]).labels([time, "0".to_owned()]))
        .y_axis(Axis::default().bounds([low, high]).labels([label(low), label(high)]));
    frame.render_widget(chart, curves);
    let newest = axes.map(|points| points.last().map(|(_, value)| *value));
    names_of_curves(model, frame, ends, newest, (low, high));
}

/// Writes the name of each curve beside its end, since colours must not be the only sign.
pub(super) fn names_of_curves(
    model: &ScreenModel,
    frame: &mut Frame<'_>,
    area: Rect,
    newest: [Option<f64>; 3],
    (low, high): (f64, f64),
) {
    // The axis and its labels take the last two rows.
    let rows = area.height.saturating_sub(2);
    if rows == 0 {
        return;
    }
    let mut taken = Vec::new();
    for (axis, value) in newest.into_iter().enumerate() {
        let Some(value) = value.filter(|value| value.is_finite()) else { continue };
        let wanted = ((high - value) / (high - low) * f64::from(rows - 1)).round() as u16;
        // Curves that end together have their names in the nearest free rows.
        let mut free: Vec<u16> = (0..rows).filter(|row| !taken.contains(row)).collect();
        free.sort_by_key(|row| row.abs_diff(wanted));
        let Some(row) = free.first().copied() else { return };
        taken.push(row);
        let place = Rect { y: area.y + row, height: 1, ..area };
        let name = Span::styled([" X", " Y", " Z"][axis], style::axis(model.look, axis).patch(style::strong()));
        frame.render_widget(name, place);
    }
}

fn label(value: f64) -> String {
    format!("{value:>8.3}")
}

/// The range of all values with a little air. It is never empty: the noise of a still module fills the chart.
fn bounds(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let finite = values.filter(|value| value.is_finite());
    let (low, high) =
        finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    if low > high {
        return (-1.0, 1.0);
    }
    let air = ((high - low) * 0.05).max(1e-3);
    (low - air, high + air)
}
