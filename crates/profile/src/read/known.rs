//! `[known]`: failures that are known, with a reason and an end.

use super::{Entry, Reader};
use crate::KnownFailure;

impl Reader<'_> {
    pub(super) fn known(&mut self, (name, value): Entry<'_, '_>) {
        let id = name.get_ref().as_ref();
        let what = format!("the known failure `{id}`");
        let Some(members) = self.members(&what, value, &["reason", "until"], &["reason", "until"]) else {
            return;
        };
        let reason = members
            .get("reason")
            .and_then(|reason| self.text("the reason of a known failure", reason));
        let until = members.get("until").and_then(|until| {
            let text = self.text("the end of a known failure", until)?;
            let day = text
                .parse::<jiff::civil::Date>()
                .ok()
                .filter(|day| day.to_string() == text);
            if day.is_none() {
                let hint = "expected a day such as \"2030-12-31\": the last one on which it is known".to_owned();
                let title = format!("`{text}` is not a day");
                self.complain("bad-value", until.span(), &title, "not a day", Some(hint));
            }
            day
        });
        if let (Some(reason), Some(until)) = (reason, until) {
            let known = KnownFailure {
                id: id.to_owned(),
                reason,
                until: until.to_string(),
                span: self.span(name.span()),
            };
            self.layer.known.push((known, self.origin.clone()));
        }
    }
}
