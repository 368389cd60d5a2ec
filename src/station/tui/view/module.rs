//! The module on the table, drawn from beside it: a box with its axes, the way to the north, and the sense of a turn.

use gnc_rig::{MODULE_AXES, Orientation};
use nalgebra::Vector3;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Color;
use ratatui::symbols::Marker;
use ratatui::text::Line;
use ratatui::widgets::canvas::{Canvas, Context, Line as Stroke, Points};

use super::attitude::{Direction, ModuleOnTable, seen, towards_eye};
use super::style;
use crate::tui::model::{Glyphs, ScreenModel};

/// Half lengths of the module's edges, in halves of its height: 26 x 26 x 32 mm.
const HALF: [f64; 3] = [0.81, 0.81, 1.0];
/// Ends of the drawn axes, and of their names.
const ARROW: f64 = 2.0;
const NAME: f64 = 2.35;
/// Circle of a turn about the table's axis: how far out, its radius, and how much of it is drawn.
const TURN_AT: f64 = 1.6;
const TURN_RADIUS: f64 = 0.8;
const TURN_DEG: f64 = 290.0;
/// Half of what is in sight, upwards and sideways.
const SIGHT: [f64; 2] = [2.4, 2.5];
/// Steps of an arrow that may pass behind the module, and of a circle.
const STEPS: usize = 60;

/// Draws a module in an orientation, and the sense in which it turns about the table's axis.
pub(super) fn draw(
    model: &ScreenModel,
    frame: &mut Frame<'_>,
    area: Rect,
    orientation: &Orientation,
    turn: Option<f64>,
) {
    if area.width == 0 || area.height == 0 {
        return;
    }
    let marker = if model.look.glyphs == Glyphs::Unicode { Marker::Braille } else { Marker::Dot };
    let colour = |colour| if model.look.colour { colour } else { Color::Reset };
    let attitude = ModuleOnTable::of(orientation);
    // A cell is about twice as high as it is wide.
    let (cells, rows) = (f64::from(area.width), 2.0 * f64::from(area.height));
    let scale = (SIGHT[0] / rows).max(SIGHT[1] / cells);
    let (width, height) = (cells * scale, rows * scale);
    let north = model.texts.north;
    let canvas =
        Canvas::default().marker(marker).x_bounds([-width, width]).y_bounds([-height, height]).paint(move |context| {
            let body = Body::of(&attitude);
            compass(context, north, colour(Color::DarkGray), (width, height));
            body.edges(context, Color::Reset);
            for (axis, name) in MODULE_AXES.into_iter().enumerate() {
                let axis_colour = style::axis(model.look, axis).fg.unwrap_or(Color::Reset);
                let direction = attitude.axes[axis];
                body.arrow(context, direction, HALF[axis], axis_colour);
                let [x, y, _] = seen(&(direction * NAME));
                context.print(x, y, Line::styled(name, style::axis(model.look, axis).patch(style::strong())));
            }
            if let Some(sense) = turn {
                body.turn(context, attitude.table, sense, colour(Color::Yellow));
            }
        });
    frame.render_widget(canvas, area);
}

/// The box, face by face.
struct Body {
    /// Corners of each face in order round it, as they are seen, and whether it is turned towards the eye.
    faces: [([[f64; 2]; 4], bool); 6],
}

impl Body {
    fn of(attitude: &ModuleOnTable) -> Self {
        let half: [Direction; 3] = std::array::from_fn(|axis| attitude.axes[axis] * HALF[axis]);
        let faces = std::array::from_fn(|face| {
            let (axis, sign) = (face / 2, if face % 2 == 0 { 1.0 } else { -1.0 });
            let (a, b) = (half[(axis + 1) % 3], half[(axis + 2) % 3]);
            let middle = half[axis] * sign;
            let corners = [a + b, b - a, -a - b, a - b].map(|corner| {
                let [x, y, _] = seen(&(middle + corner));
                [x, y]
            });
            (corners, seen(&middle)[2] > 1e-9)
        });
        Self { faces }
    }

    /// The edges that are in sight.
    fn edges(&self, context: &mut Context<'_>, color: Color) {
        for (corners, _) in self.faces.iter().filter(|(_, towards)| *towards) {
            for index in 0..4 {
                let ([x1, y1], [x2, y2]) = (corners[index], corners[(index + 1) % 4]);
                context.draw(&Stroke { x1, y1, x2, y2, color });
            }
        }
    }

    /// An arrow outwards from the middle of a face; what lies behind the box is not drawn.
    fn arrow(&self, context: &mut Context<'_>, direction: Direction, from: f64, color: Color) {
        let hidden = seen(&direction)[2] < 0.0;
        let shaft = (0..=STEPS).map(|step| from + (ARROW - from) * step as f64 / STEPS as f64);
        let points: Vec<(f64, f64)> =
            shaft.map(|at| flat(&(direction * at))).filter(|p| !hidden || !self.covers(*p)).collect();
        context.draw(&Points { coords: &points, color });
        head(context, flat(&(direction * (ARROW - 0.4))), flat(&(direction * ARROW)), color);
    }

    /// Part of a circle about the table's axis with an arrow in the sense of the turn. The gap is on the side of the
    /// eye.
    fn turn(&self, context: &mut Context<'_>, table: Direction, sense: f64, color: Color) {
        let eye = towards_eye();
        let Some(front) = (eye - table * table.dot(&eye)).try_normalize(1e-6) else { return };
        let side = table.cross(&front);
        let hidden = seen(&table)[2] < 0.0;
        let at = |part: f64| {
            let from_deg = (360.0 - TURN_DEG) / 2.0;
            let (sin, cos) = (sense * (from_deg + part * TURN_DEG).to_radians()).sin_cos();
            flat(&(table * TURN_AT + (front * cos + side * sin) * TURN_RADIUS))
        };
        let circle = (0..=STEPS).map(|step| at(step as f64 / STEPS as f64));
        let points: Vec<(f64, f64)> = circle.filter(|point| !hidden || !self.covers(*point)).collect();
        context.draw(&Points { coords: &points, color });
        head(context, at(0.9), at(1.0), color);
    }

    /// Whether a point of the picture is covered by the box.
    fn covers(&self, (x, y): (f64, f64)) -> bool {
        self.faces.iter().filter(|(_, towards)| *towards).any(|(corners, _)| {
            let side = |index: usize| {
                let ([x1, y1], [x2, y2]) = (corners[index], corners[(index + 1) % 4]);
                (x2 - x1) * (y - y1) - (y2 - y1) * (x - x1)
            };
            (0..4).all(|index| side(index) > 0.0) || (0..4).all(|index| side(index) < 0.0)
        })
    }
}

fn flat(point: &Direction) -> (f64, f64) {
    let [x, y, _] = seen(point);
    (x, y)
}

/// The head of an arrow whose last stretch goes from one point to the other.
fn head(context: &mut Context<'_>, from: (f64, f64), tip: (f64, f64), color: Color) {
    let (dx, dy) = (from.0 - tip.0, from.1 - tip.1);
    let length = dx.hypot(dy);
    if length < 1e-6 {
        return;
    }
    let scale = 0.3 / length;
    for turn in [0.5_f64, -0.5] {
        let (sin, cos) = turn.sin_cos();
        let (x2, y2) = (tip.0 + (dx * cos - dy * sin) * scale, tip.1 + (dx * sin + dy * cos) * scale);
        context.draw(&Stroke { x1: tip.0, y1: tip.1, x2, y2, color });
    }
}

/// The way to the north, in the lower left corner.
fn compass(context: &mut Context<'_>, name: &'static str, color: Color, (width, height): (f64, f64)) {
    let (x, y) = (-width + 0.3, -height + 0.25);
    let (dx, dy) = flat(&(Vector3::y() * 0.9));
    context.draw(&Stroke { x1: x, y1: y, x2: x + dx, y2: y + dy, color });
    head(context, (x, y), (x + dx, y + dy), color);
    context.print(x + dx + 0.15, y + dy + 0.1, Line::styled(name, style::faint()));
}
