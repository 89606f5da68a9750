//! Why an order is not taken over, and how the vehicle reports that (sections 6.6.4 and 7.1).
//!
//! Every refusal is a WARNING that names the order (the rulings of ORD-FLOW-01 and ORD-FLOW-04, where the text has no
//! name), and what is wrong with it (BP-02).

use serde_json::Value;

use super::Agv;
use super::errors::{ActiveError, Life};
use super::read::Defect;

/// Rule by which an order is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rule {
    Malformed,
    Unable,
    Memory,
    UnknownMap,
    OtherOrderActive,
    StartOutOfRange,
    Outdated,
    BrokenUpdate,
    /// No reason to refuse an order (ORD-REJ-13).
    Duplicate,
}

/// What a rule is broken by, where versions have an error of its own for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Detail {
    /// An optional field that the vehicle has no use for, or whose value it cannot keep to (OPT-02).
    UnusedField,
    /// The order to be updated was cancelled.
    Cancelled,
    /// The mode takes no orders (MODE-02).
    Mode,
    /// A node cannot be reached (ORD-REJ-22).
    NoRoute,
}

/// An order that is not taken over.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Refusal {
    rule: Rule,
    detail: Option<Detail>,
    reason: String,
    /// What in the message is wrong.
    culprits: Vec<(String, String)>,
}

impl Refusal {
    pub(crate) fn new(rule: Rule, reason: &str) -> Self {
        Self {
            rule,
            detail: None,
            reason: reason.to_owned(),
            culprits: Vec::new(),
        }
    }

    pub(crate) fn naming(mut self, key: &str, value: impl Into<String>) -> Self {
        self.culprits.push((key.to_owned(), value.into()));
        self
    }

    pub(crate) fn because(mut self, detail: Detail) -> Self {
        self.detail = Some(detail);
        self
    }

    pub(crate) fn at_field(rule: Rule, reason: &str, path: &str) -> Self {
        Self::new(rule, reason).naming("field", path)
    }
}

impl From<Defect> for Refusal {
    fn from(defect: Defect) -> Self {
        let reason = format!("{} {}", defect.path, defect.reason);
        Self::at_field(Rule::Malformed, &reason, &defect.path)
    }
}

impl Agv {
    /// Reports a refusal; nothing else changes (ORD-FLOW-12).
    pub(crate) fn refuse(&mut self, message: &Value, refusal: Refusal) {
        self.refuses(message, refusal.rule);
        let names = &self.config.errors;
        let name = match refusal.rule {
            Rule::Malformed => &names.validation,
            Rule::Unable => &names.order,
            Rule::Memory => &names.memory,
            Rule::UnknownMap => &names.unknown_map,
            Rule::OtherOrderActive => &names.other_order_active,
            Rule::StartOutOfRange => &names.start_out_of_range,
            Rule::Outdated => &names.outdated_update,
            Rule::Duplicate => &names.same_update,
            Rule::BrokenUpdate => &names.broken_update,
        };
        let name = match refusal.detail {
            None => name,
            Some(Detail::UnusedField) => &names.unsupported,
            Some(Detail::Cancelled) => &names.after_cancel,
            Some(Detail::Mode) => &names.not_available,
            Some(Detail::NoRoute) => &names.no_route,
        };
        let life = match refusal.rule {
            Rule::Outdated | Rule::BrokenUpdate | Rule::Duplicate => {
                Life::Until(self.moment() + self.config.error_duration)
            }
            _ => Life::UntilNewOrder,
        };
        let mut references = message_references(message);
        let spelled = |(key, value): (String, String)| match key.as_str() {
            "field" => (key, self.spelled_path(&value)),
            _ => (key, value),
        };
        references.extend(refusal.culprits.into_iter().map(spelled));
        let error = ActiveError {
            error_type: name.to_owned(),
            fatal: false,
            references,
            description: refusal.reason,
            life,
        };
        self.raise_refusal(refusal.rule, message, error);
    }
}

/// References that identify the message, as far as it can be read (BP-02).
pub(crate) fn message_references(message: &Value) -> Vec<(String, String)> {
    let mut references = vec![("topic".to_owned(), "order".to_owned())];
    for key in ["headerId", "orderId", "orderUpdateId"] {
        match message.get(key) {
            Some(Value::String(text)) => references.push((key.to_owned(), text.chars().take(256).collect())),
            Some(Value::Number(number)) => references.push((key.to_owned(), number.to_string())),
            _ => {}
        }
    }
    references
}
