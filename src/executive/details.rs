//! What an analysis finds beside its measurements, as records hold it.

use std::ops::Deref;
use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

/// JSON whose form depends on the item: equations, covariances, residuals, curves.
///
/// A spectrum has thousands of numbers. The event, the folds of every observer and the items that work with it later
/// share one copy: a clone costs no memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Details(Arc<Value>);

impl Details {
    /// The value, to change it. Other holders keep what they have.
    pub fn to_mut(&mut self) -> &mut Value {
        Arc::make_mut(&mut self.0)
    }
}

impl From<Value> for Details {
    fn from(value: Value) -> Self {
        Self(Arc::new(value))
    }
}

impl Deref for Details {
    type Target = Value;

    fn deref(&self) -> &Value {
        &self.0
    }
}

impl Serialize for Details {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Details {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Value::deserialize(deserializer).map(Self::from)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_record_holds_the_plain_value() {
        let value = json!({ "dof": 1.0 / 3.0, "label": [null, "x"] });
        let text = serde_json::to_string(&Details::from(value.clone())).unwrap();
        assert_eq!(text, value.to_string());
        assert_eq!(*serde_json::from_str::<Details>(&text).unwrap(), value);
    }

    #[test]
    fn holders_share_one_copy_until_one_of_them_changes_it() {
        let first = Details::from(json!({ "a": 1 }));
        let mut second = first.clone();
        assert!(std::ptr::eq(&*first, &*second));
        second.to_mut()["a"] = json!(2);
        assert_eq!((&first["a"], &second["a"]), (&json!(1), &json!(2)));
    }
}
