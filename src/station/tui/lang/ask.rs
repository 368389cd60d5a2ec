//! Requests to the operator in a language that is not the station's own. In English the screen shows the text of the log.

use gnc_analysis::motion::GYRO_RANGE_DPS;
use gnc_bench::fixture::{Ask, QuestionAsked, SwitchReading, TakenOver, about_axis, numbered, turn_rates};
use gnc_executive::plan::{QuestionKind, QuestionWords};
use gnc_rig::Orientation;

use super::{Texts, fill};

/// The sentences of a language. Those with places to fill in name the values in the order of the English text.
#[derive(Debug)]
pub(super) struct AskTexts {
    pub switch_all_off: &'static str,
    pub switch_one_on: &'static str,
    pub switch_still_on: &'static str,
    pub switch_still_off: &'static str,
    pub heading: &'static str,
    pub lay: &'static str,
    pub turn: &'static str,
    pub spin: &'static str,
    pub about: &'static str,
    pub stop: &'static str,
    pub taken_over: &'static str,
    pub left: &'static str,
    pub enter_done: &'static str,
    pub enter_lies: &'static str,
    pub enter_turned: &'static str,
    pub enter_at_rate: &'static str,
    pub enter_still: &'static str,
    /// The plan's own words in this language, if it has them.
    pub own_words: fn(&QuestionWords) -> Option<&str>,
    pub number: &'static str,
    pub number_in: &'static str,
    pub text: &'static str,
    pub limit: &'static str,
    pub picture: &'static str,
    pub look_over: &'static str,
    pub enter_typed: &'static str,
    pub enter_right: &'static str,
    /// What stands between two sentences.
    pub between: &'static str,
}

impl AskTexts {
    /// A request in words.
    pub(super) fn words(&self, texts: &Texts, ask: &Ask) -> String {
        format!("{}{}{}", self.action(texts, ask), self.between, self.when_done(ask))
    }

    fn action(&self, texts: &Texts, ask: &Ask) -> String {
        match ask {
            Ask::Switches(None) => self.switch_all_off.to_owned(),
            Ask::Switches(Some(number)) => fill(self.switch_one_on, &[&number.to_string()]),
            Ask::SwitchesAgain { on, still } => {
                let still = still.iter().map(|reading| format!("{}{}", self.reading(reading), self.between));
                format!("{}{}", still.collect::<String>(), self.action(texts, &Ask::Switches(*on)))
            }
            Ask::Heading { deg } => fill(self.heading, &[&format!("{deg:.0}")]),
            Ask::Lay(orientation) => fill(self.lay, &[&texts.orientation(orientation)]),
            Ask::Turn { orientation, angle_deg, span_s, ramp_s } => {
                let (peak_dps, ramp_dps2) = turn_rates(*angle_deg, *span_s, *ramp_s);
                let parts = [
                    format!("{angle_deg:+.0}"),
                    self.about(*orientation),
                    ramp_s.to_string(),
                    format!("{peak_dps:.0}"),
                    format!("{ramp_dps2:.0}"),
                    ramp_s.to_string(),
                    span_s.to_string(),
                    format!("{GYRO_RANGE_DPS:.0}"),
                ];
                fill(self.turn, &parts.each_ref().map(String::as_str))
            }
            Ask::Spin { orientation, rate_dps } => {
                fill(self.spin, &[&format!("{rate_dps:+.0}"), &self.about(*orientation)])
            }
            Ask::StopTable => self.stop.to_owned(),
            Ask::Words(words) => gnc_text::printable(words).into_owned(),
            Ask::Question(asked) => self.question(asked),
            Ask::LookOver(answers) => {
                let each = answers.iter().map(|(name, answer)| format!("{name}: {}.", gnc_text::printable(answer)));
                [vec![self.look_over.to_owned()], each.collect()].concat().join(self.between)
            }
            Ask::Resumed { over, next } => {
                let names = |captures: &[String]| {
                    let each: Vec<_> = captures.iter().map(|name| texts.capture(name).into_owned()).collect();
                    gnc_text::printable(&TakenOver::names(&each)).into_owned()
                };
                let taken = fill(self.taken_over, &[&names(&over.taken)]);
                let left = fill(self.left, &[&names(&over.left)]);
                [taken, left, self.action(texts, next)].join(self.between)
            }
        }
    }

    fn question(&self, asked: &QuestionAsked) -> String {
        let question = &asked.question;
        let shown = |text: &str| gnc_text::printable(text).into_owned();
        let mut parts = vec![shown((self.own_words)(&question.words).unwrap_or(&question.words.en))];
        match &question.kind {
            QuestionKind::Number { unit } if unit.symbol().is_empty() => parts.push(self.number.to_owned()),
            QuestionKind::Number { unit } => parts.push(fill(self.number_in, &[unit.symbol()])),
            QuestionKind::Text { .. } => parts.push(self.text.to_owned()),
            QuestionKind::Choice { of } => parts.push(format!("{}.", shown(&numbered(of)))),
            QuestionKind::Done => {}
        }
        if let Some(limit) = asked.limit.as_ref().filter(|_| question.kind != QuestionKind::Done) {
            parts.push(fill(self.limit, &[limit]));
        }
        if let Some(path) = &question.picture {
            parts.push(fill(self.picture, &[&shown(path)]));
        }
        parts.join(self.between)
    }

    fn reading(&self, reading: &SwitchReading) -> String {
        let text = if reading.on { self.switch_still_on } else { self.switch_still_off };
        fill(text, &[&reading.switch.to_string(), &format!("{:.3}", reading.volt)])
    }

    fn about(&self, orientation: Option<Orientation>) -> String {
        about_axis(orientation).map_or_else(String::new, |axis| fill(self.about, &[axis]))
    }

    fn when_done(&self, ask: &Ask) -> &'static str {
        match ask {
            Ask::Switches(_) | Ask::SwitchesAgain { .. } | Ask::Heading { .. } | Ask::Words(_) => self.enter_done,
            Ask::Question(asked) if asked.question.kind == QuestionKind::Done => self.enter_done,
            Ask::Question(_) => self.enter_typed,
            Ask::LookOver(_) => self.enter_right,
            Ask::Lay(_) => self.enter_lies,
            Ask::Turn { .. } => self.enter_turned,
            Ask::Spin { .. } => self.enter_at_rate,
            Ask::StopTable => self.enter_still,
            Ask::Resumed { next, .. } => self.when_done(next),
        }
    }
}
