use super::*;

fn speaker(lang: Lang) -> Speaker {
    let words = |en: &str, zh: Option<&str>| QuestionWords { en: en.to_owned(), zh: zh.map(str::to_owned), ru: None };
    let questions = [("tp4", words("Voltage at TP4?", Some("TP4 的电压？")))];
    let questions = questions.map(|(name, words)| (name.to_owned(), words)).into();
    Speaker { events_to_stdout: false, wording: Wording::new(lang), questions: Arc::new(questions) }
}

const ASKED: &str =
    "Voltage at TP4? A number in V. Limit: 3.2 .. 3.4 V. Press Enter when it is typed. (n: not possible; <: back)";

#[test]
fn a_question_is_asked_in_the_plans_own_words() {
    assert_eq!(speaker(Lang::En).question("tp4", ASKED), ASKED);
    assert_eq!(
        speaker(Lang::Zh).question("tp4", ASKED),
        "TP4 的电压？单位为 V 的数。限值：3.2 .. 3.4 V。输入后按 Enter。(n：无法完成；<：返回)"
    );
    // The plan has no Russian words.
    assert_eq!(
        speaker(Lang::Ru).question("tp4", ASKED),
        "Voltage at TP4? Число в V. Допуск: 3.2 .. 3.4 V. Введите ответ и нажмите Enter. (n: невозможно; <: назад)"
    );
}

#[test]
fn a_request_in_words_of_the_plan_keeps_them() {
    assert_eq!(
        speaker(Lang::Ru).request("Close the lid Press Enter when it is done."),
        "Close the lid Нажмите Enter, когда это сделано."
    );
    assert_eq!(
        speaker(Lang::Zh).request("Stop the table. Press Enter when it stands still."),
        "请停止转台。停稳后按 Enter。"
    );
}
