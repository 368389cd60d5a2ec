//! Drawn pictures of a request: the DIP switches, the table from above, the module on it.

use gnc_bench::fixture::Ask;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Color;
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::canvas::{Canvas, Circle, Line as Stroke};

use super::{module, style, text};
use crate::tui::model::{Glyphs, ScreenModel};

/// Rows that the picture of a request needs.
pub(super) fn rows(ask: &Ask) -> u16 {
    match ask {
        Ask::Switches(_) | Ask::SwitchesAgain { .. } => 6,
        Ask::Heading { .. } => 9,
        Ask::Lay(_) | Ask::Turn { orientation: Some(_), .. } | Ask::Spin { orientation: Some(_), .. } => 10,
        Ask::Turn { orientation: None, .. } | Ask::Spin { orientation: None, .. } | Ask::StopTable => 0,
        Ask::Words(_) | Ask::Question(_) | Ask::LookOver(_) => 0,
        Ask::Resumed { next, .. } => rows(next),
    }
}

/// Draws the picture of a request.
pub(super) fn draw(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, ask: &Ask) {
    match ask {
        Ask::Switches(on) | Ask::SwitchesAgain { on, .. } => switches(model, frame, area, *on),
        Ask::Heading { deg } => heading(model, frame, area, *deg),
        Ask::Lay(orientation) => module::draw(model, frame, area, orientation, None),
        Ask::Turn { orientation: Some(orientation), angle_deg, .. } => {
            module::draw(model, frame, area, orientation, Some(angle_deg.signum()));
        }
        Ask::Spin { orientation: Some(orientation), rate_dps } => {
            module::draw(model, frame, area, orientation, Some(rate_dps.signum()));
        }
        Ask::Turn { orientation: None, .. } | Ask::Spin { orientation: None, .. } | Ask::StopTable => {}
        Ask::Words(_) | Ask::Question(_) | Ask::LookOver(_) => {}
        Ask::Resumed { next, .. } => draw(model, frame, area, next),
    }
}

/// Five switches, each with its knob up or down.
fn switches(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, on: Option<u8>) {
    let texts = model.texts;
    let each = |what: &dyn Fn(u8) -> Span<'static>| {
        (1..=5).flat_map(|number| [what(number), Span::raw(" ")]).collect::<Vec<_>>()
    };
    let knob = |up: bool| {
        move |number: u8| {
            let there = (Some(number) == on) == up;
            let style = if there { style::accent(model.look).patch(style::strong()) } else { style::faint() };
            Span::styled(if there { "│█│" } else { "│ │" }, style)
        }
    };
    let line = |mut spans: Vec<Span<'static>>, label: &str| {
        spans.push(Span::raw(format!(" {label}")));
        Line::from(spans)
    };
    let lines = vec![
        line(each(&|_| Span::raw("┌─┐")), ""),
        line(each(&knob(true)), texts.on),
        line(each(&knob(false)), texts.off),
        line(each(&|_| Span::raw("└─┘")), ""),
        line(
            each(&|number| {
                Span::styled(format!(" {number} "), if Some(number) == on { style::strong() } else { style::faint() })
            }),
            "",
        ),
    ];
    let width = 5 * 4 + 2 + super::text::width(texts.on).max(super::text::width(texts.off)) as u16;
    let place = Rect { x: area.x + area.width.saturating_sub(width) / 2, width: width.min(area.width), ..area };
    text::lines(frame, lines, place);
}

/// The table from above: its mark at the top, and where the module's reference axis is to point.
fn heading(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, deg: f64) {
    let marker = if model.look.glyphs == Glyphs::Unicode { Marker::Braille } else { Marker::Block };
    let colour = |colour| if model.look.colour { colour } else { Color::Reset };
    let (sin, cos) = deg.to_radians().sin_cos();
    let half = f64::from(area.height);
    // A cell is about twice as high as it is wide.
    let aspect = f64::from(area.width) / (2.0 * f64::from(area.height.max(1)));
    let bounds = [-half * aspect.max(1.0), half * aspect.max(1.0)];
    let canvas = Canvas::default().marker(marker).x_bounds(bounds).y_bounds([-half, half]).paint(move |context| {
        let radius = half * 0.8;
        context.draw(&Circle { x: 0.0, y: 0.0, radius, color: colour(Color::Gray) });
        context.draw(&Stroke { x1: 0.0, y1: radius, x2: 0.0, y2: half, color: colour(Color::Yellow) });
        let (x, y) = (radius * 0.9 * sin, radius * 0.9 * cos);
        context.draw(&Stroke { x1: 0.0, y1: 0.0, x2: x, y2: y, color: colour(Color::Cyan) });
        // The head of the arrow.
        for turn in [2.6_f64, -2.6] {
            let (turned_sin, turned_cos) = (deg.to_radians() + turn).sin_cos();
            let (tip_x, tip_y) = (x + radius * 0.3 * turned_sin, y + radius * 0.3 * turned_cos);
            context.draw(&Stroke { x1: x, y1: y, x2: tip_x, y2: tip_y, color: colour(Color::Cyan) });
        }
        context.print(radius + 2.0, 0.0, Line::raw("90°"));
        context.print(1.5, half * 0.9, Line::raw("0°"));
    });
    frame.render_widget(canvas, area);
}
