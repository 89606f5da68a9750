//! Careful reading of incoming JSON: every field is typed, bounded and named when it is wrong (sections 6.1.2 to
//! 6.1.4).
//!
//! A whole number may be written with a fraction of zero (the ruling of JSON-09); unknown members are left aside.

use serde_json::{Map, Value};

/// Longest id or keyword the vehicle takes, in characters.
pub(crate) const MAX_STRING: usize = 256;

/// A defect of a message, and where it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Defect {
    /// Path of the field, such as `nodes[1].released`.
    pub(crate) path: String,
    /// Description of the defect.
    pub(crate) reason: &'static str,
}

impl Defect {
    /// Of a trajectory that cannot be driven along.
    pub(crate) fn no_curve(path: &str) -> Self {
        Self {
            path: path.to_owned(),
            reason: "is no curve",
        }
    }
}

/// The fields of one JSON object.
#[derive(Clone)]
pub(crate) struct Fields<'a> {
    object: &'a Map<String, Value>,
    path: String,
}

impl<'a> Fields<'a> {
    /// Opens the object at `path`; the root has an empty path.
    pub(crate) fn open(value: &'a Value, path: &str) -> Result<Self, Defect> {
        let Value::Object(object) = value else {
            return Err(Defect {
                path: path.to_owned(),
                reason: "is not an object",
            });
        };
        Ok(Self {
            object,
            path: path.to_owned(),
        })
    }

    /// The path of a member.
    pub(crate) fn at(&self, key: &str) -> String {
        if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        }
    }

    fn wrong(&self, key: &str, reason: &'static str) -> Defect {
        Defect {
            path: self.at(key),
            reason,
        }
    }

    /// Whether the member is there at all.
    pub(crate) fn has(&self, key: &str) -> bool {
        self.object.contains_key(key)
    }

    /// The member as it is.
    pub(crate) fn raw(&self, key: &str) -> Option<&'a Value> {
        self.object.get(key)
    }

    fn required(&self, key: &str) -> Result<&'a Value, Defect> {
        self.object.get(key).ok_or_else(|| self.wrong(key, "is missing"))
    }

    /// A string, possibly empty.
    pub(crate) fn text(&self, key: &str) -> Result<&'a str, Defect> {
        let Value::String(text) = self.required(key)? else {
            return Err(self.wrong(key, "is not a string"));
        };
        if text.chars().nth(MAX_STRING).is_some() {
            return Err(self.wrong(key, "is too long"));
        }
        Ok(text)
    }

    /// A string for people, of any length.
    pub(crate) fn prose(&self, key: &str) -> Result<(), Defect> {
        let text = self.required(key)?.is_string();
        if text {
            Ok(())
        } else {
            Err(self.wrong(key, "is not a string"))
        }
    }

    /// A string that identifies something.
    pub(crate) fn id(&self, key: &str) -> Result<String, Defect> {
        match self.text(key)? {
            "" => Err(self.wrong(key, "is empty")),
            text => Ok(text.to_owned()),
        }
    }

    /// A whole number of 32 bits. `5.0` counts as whole.
    pub(crate) fn uint32(&self, key: &str) -> Result<u32, Defect> {
        let value = self.required(key)?;
        if !value.is_number() {
            return Err(self.wrong(key, "is not a number"));
        }
        whole(value).ok_or_else(|| self.wrong(key, "is not a whole number of 32 bits"))
    }

    /// A Boolean.
    pub(crate) fn boolean(&self, key: &str) -> Result<bool, Defect> {
        self.required(key)?
            .as_bool()
            .ok_or_else(|| self.wrong(key, "is not a Boolean"))
    }

    /// A number.
    pub(crate) fn number(&self, key: &str) -> Result<f64, Defect> {
        self.required(key)?
            .as_f64()
            .filter(|number| number.is_finite())
            .ok_or_else(|| self.wrong(key, "is not a number"))
    }

    /// A number within bounds, both included.
    pub(crate) fn number_in(&self, key: &str, low: f64, high: f64) -> Result<f64, Defect> {
        let number = self.number(key)?;
        if number < low || number > high {
            return Err(self.wrong(key, "is out of range"));
        }
        Ok(number)
    }

    /// An optional member, read by `read` if it is there.
    pub(crate) fn optional<T>(
        &self,
        key: &str,
        read: impl FnOnce(&Self, &str) -> Result<T, Defect>,
    ) -> Result<Option<T>, Defect> {
        if self.has(key) {
            read(self, key).map(Some)
        } else {
            Ok(None)
        }
    }

    /// One of the literals; its index.
    pub(crate) fn literal(&self, key: &str, literals: &[&str]) -> Result<usize, Defect> {
        let text = self.text(key)?;
        literals
            .iter()
            .position(|literal| *literal == text)
            .ok_or_else(|| self.wrong(key, "is not a value of the enumeration"))
    }

    /// The objects of an array.
    pub(crate) fn objects(&self, key: &str) -> Result<Vec<Fields<'a>>, Defect> {
        let Value::Array(elements) = self.required(key)? else {
            return Err(self.wrong(key, "is not an array"));
        };
        let path = self.at(key);
        elements
            .iter()
            .enumerate()
            .map(|(index, element)| Fields::open(element, &format!("{path}[{index}]")))
            .collect()
    }
}

/// A JSON number as a whole number of 32 bits.
fn whole(value: &Value) -> Option<u32> {
    if let Some(number) = value.as_u64() {
        return u32::try_from(number).ok();
    }
    let number = value.as_f64()?;
    if number.fract() != 0.0 || !(0.0..=f64::from(u32::MAX)).contains(&number) {
        return None;
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked to be a whole uint32 above"
    )]
    Some(number as u32)
}
