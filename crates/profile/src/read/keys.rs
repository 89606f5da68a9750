//! `[keys]`: what test management calls a requirement, test or monitor.

use super::{Entry, Reader};
use crate::IssueKey;

impl Reader<'_> {
    pub(super) fn issue_key(&mut self, (name, value): Entry<'_, '_>) {
        let id = name.get_ref().as_ref();
        let Some(text) = self.text(&format!("the key of `{id}`"), value) else {
            return;
        };
        if IssueKey::read(&text).is_none() {
            let hint = "an issue of Jira (Xray) is like \"PROJ-12\", a test case of TestRail like \"C1234\"".to_owned();
            let title = format!("`{text}` is no key of test management");
            self.complain("bad-value", value.span(), &title, "of neither form", Some(hint));
            return;
        }
        self.layer.issue_keys.insert(id.to_owned(), (text, self.origin.clone()));
    }
}
