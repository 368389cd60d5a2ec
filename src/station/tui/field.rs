//! A line of text that is typed, scanned or pasted. It stays short and printable, whatever the input.

/// What was typed into a line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct InputField {
    text: String,
    /// Characters beyond the limit.
    dropped: usize,
    /// A control character came: this is not text for a person.
    control: bool,
}

/// Characters that a field keeps; more are counted.
pub(crate) const MAX_CHARACTERS: usize = 200;

impl InputField {
    pub(crate) fn new(text: &str) -> Self {
        let mut field = Self::default();
        text.chars().for_each(|character| field.push(character));
        field
    }

    pub(crate) fn push(&mut self, character: char) {
        if character.is_control() {
            self.control = true;
        } else if self.text.chars().count() < MAX_CHARACTERS {
            self.text.push(character);
        } else {
            self.dropped += 1;
        }
    }

    /// Marks the field after a control character that is not a key.
    pub(crate) fn spoil(&mut self) {
        self.control = true;
    }

    pub(crate) fn pop(&mut self) {
        if self.dropped > 0 {
            self.dropped -= 1;
        } else {
            self.text.pop();
        }
    }

    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.text.is_empty() && !self.control
    }

    /// The number of characters that came, kept or not.
    pub(crate) fn characters(&self) -> usize {
        self.text.chars().count() + self.dropped
    }

    pub(crate) fn has_control(&self) -> bool {
        self.control
    }
}
