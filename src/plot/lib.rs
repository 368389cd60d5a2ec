//! Plots as SVG: panels with axes, dots, lines and bars of intervals.
//!
//! This crate does not know the meaning of what it draws, and it writes no file.

use std::fmt::Write as _;

/// More dots than this show nothing new and make the file slow to open.
const MOST_DOTS: usize = 6000;
/// Width and height of a panel in a file of its own.
const SIZE: (f64, f64) = (640.0, 480.0);
const LEFT: f64 = 80.0;
const RIGHT: f64 = 20.0;
/// Title and names of the series stand above the axes.
const TOP: f64 = 50.0;
const BOTTOM: f64 = 50.0;

/// How a series is drawn.
pub enum Mark {
    /// A dot at each point.
    Dots,
    /// A line from point to point.
    Line,
    /// A thin broken line: a model, a limit.
    Dashed,
    /// Dots with an upright bar from low to high.
    Bars(Vec<(f64, f64)>),
}

/// Points that belong together.
pub struct Series {
    /// Shown above the axes, unless it is empty.
    pub name: String,
    /// How it is drawn.
    pub mark: Mark,
    /// Its points, x and y.
    pub points: Vec<(f64, f64)>,
    /// The colour by number, so that related series have the same. `None`: the colour of its place in the list.
    pub hue: Option<usize>,
}

impl Series {
    /// Points that belong together, and how they are drawn.
    pub fn new(name: impl Into<String>, mark: Mark, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self { name: name.into(), mark, points: points.into_iter().collect(), hue: None }
    }

    /// Points as dots.
    pub fn dots(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self::new(name, Mark::Dots, points)
    }

    /// Points as a line.
    pub fn line(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self::new(name, Mark::Line, points)
    }

    /// Points as a thin broken line.
    pub fn dashed(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self::new(name, Mark::Dashed, points)
    }

    /// Sets the colour by number: series with equal numbers have the same colour.
    #[must_use]
    pub fn hue(self, hue: usize) -> Self {
        Self { hue: Some(hue), ..self }
    }
}

/// One pair of axes.
pub struct Panel {
    title: String,
    x: String,
    y: String,
    series: Vec<Series>,
    /// Logarithmic axes, both.
    log: bool,
    /// One scale for both axes, so that a circle looks like one.
    square: bool,
    /// The range that is shown, x and y. The title counts the points outside. `None`: all points.
    view: [Option<(f64, f64)>; 2],
    /// Names along the x axis in place of the numbers 0, 1, 2 ...
    names: Vec<String>,
    size: (f64, f64),
}

impl Panel {
    /// Linear axes with their title and the names of x and y.
    pub fn new(title: impl Into<String>, x: impl Into<String>, y: impl Into<String>, series: Vec<Series>) -> Self {
        let (title, x, y) = (title.into(), x.into(), y.into());
        Self { title, x, y, series, log: false, square: false, view: [None; 2], names: Vec::new(), size: SIZE }
    }

    /// Each text replaced by what a rule makes of it, so that a caller can make names from outside safe to show.
    #[must_use]
    pub fn with_texts(mut self, rule: impl Fn(&str) -> String) -> Self {
        let own = [&mut self.title, &mut self.x, &mut self.y].into_iter().chain(&mut self.names);
        for text in own.chain(self.series.iter_mut().map(|series| &mut series.name)) {
            *text = rule(text);
        }
        self
    }

    /// Logarithmic axes, both.
    #[must_use]
    pub fn log(self) -> Self {
        Self { log: true, ..self }
    }

    /// One scale for both axes.
    #[must_use]
    pub fn square(self) -> Self {
        Self { square: true, ..self }
    }

    /// Names along the x axis, for x values of 0, 1, 2 ...
    #[must_use]
    pub fn names(self, names: impl IntoIterator<Item = String>) -> Self {
        let names: Vec<String> = names.into_iter().collect();
        let view = [Some((-0.6, names.len() as f64 - 0.4)), self.view[1]];
        Self { names, view, ..self }
    }

    /// Another size, in pixels.
    #[must_use]
    pub fn sized(self, width: f64, height: f64) -> Self {
        Self { size: (width, height), ..self }
    }

    /// Shows this part only, so that spikes do not hide the rest.
    #[must_use]
    pub fn within(self, x: Option<(f64, f64)>, y: Option<(f64, f64)>) -> Self {
        Self { view: [x, y], ..self }
    }
}

/// Colours that differ in print and for most eyes.
const COLOURS: [&str; 6] = ["#1b5e9b", "#d1495b", "#2e8b57", "#b8860b", "#6a4c93", "#555555"];

/// The panels, up to three beside each other.
#[must_use]
pub fn svg(panels: &[Panel]) -> String {
    let mut text = String::new();
    let beside = match panels.len() {
        4 => 2,
        n => n.clamp(1, 3),
    };
    let (of_one, down_one) = panels.first().map_or(SIZE, |panel| panel.size);
    let (width, height) = (of_one * beside as f64, down_one * panels.len().div_ceil(beside) as f64);
    let _ = writeln!(
        text,
        r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="12">"#
    );
    let _ = writeln!(text, r#"<rect width="{width}" height="{height}" fill="white"/>"#);
    for (i, panel) in panels.iter().enumerate() {
        let (right, down) = (of_one * (i % beside) as f64, down_one * (i / beside) as f64);
        let _ = writeln!(text, r#"<g transform="translate({right} {down})">"#);
        draw(&mut text, panel);
        text.push_str("</g>\n");
    }
    text.push_str("</svg>\n");
    text
}

/// One axis: from data to the page.
struct Scale {
    low: f64,
    high: f64,
    log: bool,
    from: f64,
    to: f64,
}

impl Scale {
    fn of(values: impl Iterator<Item = f64>, view: Option<(f64, f64)>, log: bool, (from, to): (f64, f64)) -> Self {
        if let Some((low, high)) = view.filter(|(low, high)| low < high) {
            return Self { low, high, log: false, from, to };
        }
        let map = |v: f64| if log { v.log10() } else { v };
        let (low, high) = values
            .map(map)
            .filter(|v| v.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let (low, high) = if low > high { (0.0, 1.0) } else { (low, high) };
        let pad = if high > low { 0.05 * (high - low) } else { 0.5 * low.abs().max(1.0) };
        Self { low: low - pad, high: high + pad, log, from, to }
    }

    fn shows(&self, v: f64) -> bool {
        let v = if self.log { v.log10() } else { v };
        (self.low..=self.high).contains(&v)
    }

    fn at(&self, v: f64) -> f64 {
        let v = if self.log { v.log10() } else { v };
        self.from + (v - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    /// Places of the ticks and their labels.
    fn ticks(&self) -> Vec<(f64, String)> {
        if self.log && self.high - self.low > 0.7 {
            let step = ((self.high - self.low) / 6.0).ceil().max(1.0);
            let first = (self.low / step).ceil() as i32;
            return (first..)
                .map(|k| f64::from(k) * step)
                .take_while(|d| *d <= self.high)
                .map(|d| (10_f64.powf(d), format!("1e{d}")))
                .collect();
        }
        let unmap = |v: f64| if self.log { 10_f64.powf(v) } else { v };
        let (low, high) = (unmap(self.low), unmap(self.high));
        let raw = (high - low) / 5.0;
        let decade = 10_f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * decade).find(|s| *s >= raw).unwrap_or(raw);
        let first = (low / step).ceil();
        (0..12)
            .map(|k| (first + f64::from(k)) * step)
            .take_while(|v| *v <= high)
            .map(|v| {
                let v = if v.abs() < step * 1e-9 { 0.0 } else { v };
                let plain = v == 0.0 || (1e-3..1e5).contains(&v.abs());
                let digits = usize::try_from(-(step.log10().floor() as i32)).unwrap_or(0).min(9);
                (v, if plain { format!("{v:.digits$}") } else { format!("{v:.2e}") })
            })
            .collect()
    }
}

fn draw(text: &mut String, panel: &Panel) {
    let bars = |s: &Series| match &s.mark {
        Mark::Bars(bars) => bars.iter().flat_map(|(l, h)| [*l, *h]).collect(),
        _ => Vec::new(),
    };
    let all = || panel.series.iter().flat_map(|s| s.points.iter().copied());
    let (width, height) = panel.size;
    let (left, right, top, bottom) = (LEFT, width - RIGHT, TOP, height - BOTTOM);
    let heights = all().map(|p| p.1).chain(panel.series.iter().flat_map(bars));
    let mut x = Scale::of(all().map(|p| p.0), panel.view[0], panel.log, (left, right));
    let mut y = Scale::of(heights, panel.view[1], panel.log, (bottom, top));
    if panel.square {
        let unit = ((x.high - x.low) / (right - left)).max((y.high - y.low) / (bottom - top));
        for (scale, length) in [(&mut x, right - left), (&mut y, bottom - top)] {
            let middle = f64::midpoint(scale.low, scale.high);
            (scale.low, scale.high) = (middle - unit * length / 2.0, middle + unit * length / 2.0);
        }
    }
    let outside = all().filter(|(a, b)| !(x.shows(*a) && y.shows(*b))).count();
    let note = if outside > 0 { format!(", {outside} points outside") } else { String::new() };
    let title = format!("{}{note}", panel.title);
    let _ = writeln!(text, r#"<text x="12" y="20" font-size="14">{}</text>"#, escaped(&title));
    legend(text, &panel.series, left);
    let names = panel.names.iter().enumerate().map(|(i, name)| (i as f64, escaped(name)));
    for (v, label) in if panel.names.is_empty() { x.ticks() } else { names.collect() } {
        let at = x.at(v);
        let _ = writeln!(text, r##"<path d="M{at:.1} {top} V{bottom}" stroke="#ddd"/>"##);
        let _ = writeln!(text, r#"<text x="{at:.1}" y="{:.1}" text-anchor="middle">{label}</text>"#, bottom + 16.0);
    }
    for (v, label) in y.ticks() {
        let at = y.at(v);
        let _ = writeln!(text, r##"<path d="M{left} {at:.1} H{right}" stroke="#ddd"/>"##);
        let _ = writeln!(text, r#"<text x="{:.1}" y="{:.1}" text-anchor="end">{label}</text>"#, left - 6.0, at + 4.0);
    }
    let _ = writeln!(
        text,
        r#"<rect x="{left}" y="{top}" width="{}" height="{}" fill="none" stroke="black"/>"#,
        right - left,
        bottom - top
    );
    let middle = f64::midpoint(left, right);
    let _ =
        writeln!(text, r#"<text x="{middle}" y="{}" text-anchor="middle">{}</text>"#, height - 12.0, escaped(&panel.x));
    let _ = writeln!(
        text,
        r#"<text transform="translate(16 {}) rotate(-90)" text-anchor="middle">{}</text>"#,
        f64::midpoint(top, bottom),
        escaped(&panel.y)
    );
    for (i, series) in panel.series.iter().enumerate() {
        marks(text, series, colour(i, series), &x, &y);
    }
}

fn colour(place: usize, series: &Series) -> &'static str {
    COLOURS[series.hue.unwrap_or(place) % COLOURS.len()]
}

/// Names of the series, above the axes.
fn legend(text: &mut String, series: &[Series], from: f64) {
    let mut at = from;
    for (i, series) in series.iter().enumerate().filter(|(_, series)| !series.name.is_empty()) {
        let _ = writeln!(
            text,
            r#"<rect x="{at}" y="32" width="10" height="10" fill="{}"/><text x="{}" y="41">{}</text>"#,
            colour(i, series),
            at + 14.0,
            escaped(&series.name)
        );
        at += 7.0 * series.name.chars().count() as f64 + 28.0;
    }
}

fn marks(text: &mut String, series: &Series, colour: &str, x: &Scale, y: &Scale) {
    let stride = series.points.len().div_ceil(MOST_DOTS).max(1);
    let placed: Vec<(f64, f64)> = series
        .points
        .iter()
        .step_by(stride)
        .filter(|(a, b)| x.shows(*a) && y.shows(*b))
        .map(|(a, b)| (x.at(*a), y.at(*b)))
        .collect();
    match &series.mark {
        Mark::Line | Mark::Dashed => {
            let path: Vec<String> = placed.iter().map(|(a, b)| format!("{a:.1},{b:.1}")).collect();
            let style = match series.mark {
                Mark::Dashed => r#"stroke-width="1" stroke-dasharray="5 3""#,
                _ => r#"stroke-width="1.3""#,
            };
            let path = path.join(" ");
            let _ = writeln!(text, r#"<polyline fill="none" stroke="{colour}" {style} points="{path}"/>"#);
        }
        Mark::Dots => {
            let path: String = placed.iter().map(|(a, b)| format!("M{a:.1} {b:.1}h0")).collect();
            let width = if placed.len() > 200 { 2 } else { 5 };
            let _ =
                writeln!(text, r#"<path d="{path}" stroke="{colour}" stroke-width="{width}" stroke-linecap="round"/>"#);
        }
        Mark::Bars(bars) => {
            for ((a, b), (low, high)) in series.points.iter().zip(bars) {
                let (a, b, low, high) = (x.at(*a), y.at(*b), y.at(*low), y.at(*high));
                if [a, b, low, high].iter().all(|v| v.is_finite()) {
                    let _ = writeln!(
                        text,
                        r#"<path d="M{a:.1} {low:.1}V{high:.1}" stroke="{colour}"/><circle cx="{a:.1}" cy="{b:.1}" r="2.5" fill="{colour}"/>"#
                    );
                }
            }
        }
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}
