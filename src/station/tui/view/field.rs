//! The field across the axis of a spin: raw points with the ellipse through them, and what its correction makes of
//! them.

use gnc_bench::guidance::field::{FieldView, RoughEllipse, roll_deg};
use gnc_protocol::calibration::ROLL_PER_RAD;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Color;
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::canvas::{Canvas, Context, Line as Stroke, Points};

use super::panels::block;
use super::{style, text};
use crate::tui::model::{Glyphs, ScreenModel};

/// Rows of the figures below the plots.
const FIGURES: u16 = 3;
/// Room round the ellipse.
const AIR: f64 = 1.15;
/// A zero this many semi-axes away is left out of sight: otherwise the ellipse would be drawn as a dot.
const FAR: f64 = 4.0;
/// Strokes of a drawn ellipse.
const STROKES: u32 = 72;

pub(super) fn draw(model: &ScreenModel, field: &FieldView, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let [plots, figures_area] = Layout::vertical([Constraint::Fill(1), Constraint::Length(FIGURES)]).areas(area);
    let [raw, corrected] = Layout::horizontal([Constraint::Fill(1), Constraint::Fill(1)]).areas(plots);
    let (middle, half) = sight(field);
    plot(model, frame, raw, texts.raw, (middle, half), |context, colours| {
        cross(context, [0.0; 2], half * 2.0, colours.faint);
        if let Some(ellipse) = &field.ellipse {
            curve(context, |angle| ellipse.at(angle), colours.fit);
            cross(context, ellipse.centre, half * 0.1, colours.fit);
        }
        points(context, field.points.iter().copied(), colours.points);
    });
    if let Some(ellipse) = &field.ellipse {
        let half = ellipse.radius * AIR;
        plot(model, frame, corrected, texts.corrected, ([0.0; 2], half), |context, colours| {
            cross(context, [0.0; 2], half * 2.0, colours.faint);
            curve(context, |angle| [ellipse.radius * angle.cos(), ellipse.radius * angle.sin()], colours.fit);
            points(context, field.points.iter().map(|point| correct(ellipse, *point)), colours.points);
            let [x2, y2] = correct(ellipse, field.newest);
            context.draw(&Stroke { x1: 0.0, y1: 0.0, x2, y2, color: colours.fit });
        });
    } else {
        let block = block(texts.corrected);
        let inner = block.inner(corrected);
        frame.render_widget(block, corrected);
        let lines = text::wrap(texts.no_ellipse, usize::from(inner.width));
        let faint = lines.into_iter().map(|line| Line::styled(line, style::faint()));
        text::lines(frame, faint.collect::<Vec<_>>(), inner);
    }
    let cells = usize::from(figures_area.width);
    text::lines(frame, figures(model, field, cells), figures_area);
}

fn correct(ellipse: &RoughEllipse, [x, y]: [f64; 2]) -> [f64; 2] {
    let (x, y) = ellipse.correction.apply(x, y);
    [x, y]
}

/// Middle and half width of the part of the raw field in sight: the ellipse, and also zero unless it is far away.
fn sight(field: &FieldView) -> ([f64; 2], f64) {
    if let Some(ellipse) = &field.ellipse {
        let [major, _] = ellipse.semi_axes;
        let away = ellipse.centre[0].hypot(ellipse.centre[1]);
        return if away > FAR * major { (ellipse.centre, major * AIR) } else { ([0.0; 2], (away + major) * AIR) };
    }
    let largest = field.points.iter().flatten().fold(0.0, |most: f64, value| most.max(value.abs()));
    ([0.0; 2], largest.max(1e-3) * AIR)
}

struct Colours {
    points: Color,
    fit: Color,
    faint: Color,
}

/// A square plot in gauss: both axes have the same scale.
fn plot(
    model: &ScreenModel,
    frame: &mut Frame<'_>,
    area: Rect,
    title: &str,
    (middle, half): ([f64; 2], f64),
    paint: impl Fn(&mut Context<'_>, &Colours),
) {
    // The scale stays where the name has no room.
    let scale = format!(" ±{half:.2}");
    let name = text::cut(title, usize::from(area.width).saturating_sub(4 + text::width(&scale)));
    let block = block(&format!("{name}{scale}"));
    let inner = block.inner(area);
    frame.render_widget(block, area);
    if inner.width == 0 || inner.height == 0 {
        return;
    }
    let colour = |colour| if model.look.colour { colour } else { Color::Reset };
    let colours = Colours { points: colour(Color::Cyan), fit: colour(Color::Yellow), faint: colour(Color::DarkGray) };
    let marker = if model.look.glyphs == Glyphs::Unicode { Marker::Braille } else { Marker::Dot };
    // A cell is about twice as high as it is wide.
    let (cells, rows) = (f64::from(inner.width), 2.0 * f64::from(inner.height));
    let scale = half / cells.min(rows);
    let (width, height) = (cells * scale, rows * scale);
    let canvas = Canvas::default()
        .marker(marker)
        .x_bounds([middle[0] - width, middle[0] + width])
        .y_bounds([middle[1] - height, middle[1] + height])
        .paint(|context| paint(context, &colours));
    frame.render_widget(canvas, inner);
}

fn points(context: &mut Context<'_>, points: impl Iterator<Item = [f64; 2]>, color: Color) {
    let coords: Vec<(f64, f64)> = points.map(|[x, y]| (x, y)).collect();
    context.draw(&Points { coords: &coords, color });
}

fn curve(context: &mut Context<'_>, at: impl Fn(f64) -> [f64; 2], color: Color) {
    let angle = |stroke: u32| f64::from(stroke) * std::f64::consts::TAU / f64::from(STROKES);
    for stroke in 0..STROKES {
        let ([x1, y1], [x2, y2]) = (at(angle(stroke)), at(angle(stroke + 1)));
        context.draw(&Stroke { x1, y1, x2, y2, color });
    }
}

fn cross(context: &mut Context<'_>, [x, y]: [f64; 2], half: f64, color: Color) {
    context.draw(&Stroke { x1: x - half, y1: y, x2: x + half, y2: y, color });
    context.draw(&Stroke { x1: x, y1: y - half, x2: x, y2: y + half, color });
}

/// The figures of the ellipse so far, and the roll angle: that of the host by the running correction, and that of the
/// board, if the board sends any.
fn figures(model: &ScreenModel, field: &FieldView, cells: usize) -> Vec<Line<'static>> {
    let texts = model.texts;
    let (mut centre, mut ratio, mut host) = ("-".to_owned(), "-".to_owned(), texts.not_available.to_owned());
    if let Some(ellipse) = &field.ellipse {
        let [x, y] = ellipse.centre;
        let alpha_deg = ellipse.correction.sin_alpha.asin().to_degrees();
        centre = format!("{x:+.4} {y:+.4} gauss");
        ratio = format!("{:.4}  alpha {alpha_deg:+.2}°", ellipse.correction.ky);
        host = format!("{:+.1}°", roll_deg(&ellipse.correction, field.newest));
    }
    let board = model.live.newest.compensated.as_ref();
    let board = board.map(|(_, sample)| format!("{:+.1}°", (f64::from(sample.roll) / ROLL_PER_RAD).to_degrees()));
    let board = board.unwrap_or_else(|| texts.not_available.to_owned());
    let roll = format!("{} {host}  {} {board}", texts.by_host, texts.board_says);
    let each = [(texts.centre, centre), (texts.sensitivity_ratio, ratio), (texts.roll, roll)];
    let line = |(label, value): (&str, String)| {
        let room = cells.saturating_sub(text::width(label) + 2);
        Line::from(vec![Span::styled(format!(" {label} "), style::faint()), Span::raw(text::cut(&value, room))])
    };
    each.into_iter().map(line).collect()
}
