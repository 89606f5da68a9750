//! What a payload says: parsed once, and read once for each table of names.

use std::sync::OnceLock;

use tck_view::{MessageView, Names, Topic};

use super::{Parsed, Payload};

/// A payload, parsed and read.
#[derive(Debug)]
pub(super) struct Read {
    pub parsed: Parsed,
    views: Views,
}

impl Read {
    pub fn of(payload: &Payload) -> Self {
        Self {
            parsed: Parsed::of(payload),
            views: Views::default(),
        }
    }

    pub fn view(&self, topic: Topic, names: &Names) -> Option<&MessageView> {
        let value = self.parsed.value()?;
        let key = (topic, names.id());
        Some(self.views.get(key, &|| MessageView::of_value(topic, value, names)))
    }
}

/// Views of one message. Nearly always there is one; a second one is asked for when versions of the protocol, or topics a
/// message may have been meant for, are tried.
#[derive(Debug, Default)]
struct Views(OnceLock<Box<Kept>>);

#[derive(Debug)]
struct Kept {
    /// Topic, and the id of the names it was read by.
    key: (Topic, u64),
    view: MessageView,
    others: Views,
}

impl Views {
    fn get(&self, key: (Topic, u64), read: &dyn Fn() -> MessageView) -> &MessageView {
        let first = || {
            Box::new(Kept {
                key,
                view: read(),
                others: Self::default(),
            })
        };
        let kept = self.0.get_or_init(first);
        if kept.key == key {
            &kept.view
        } else {
            kept.others.get(key, read)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_read_once_for_each_topic_and_version() {
        let read = Read::of(&Payload::keep(br#"{ "agvPosition": {}, "maps": [] }"#.to_vec().into()));
        let usual = Names::default();
        let other: Names = serde_json::from_str(r#"{ "state": { "maps": false } }"#).unwrap();
        let view = |topic, names| read.view(topic, names).unwrap();
        let first = view(Topic::State, &usual);
        assert!(!first.state().unwrap().maps.is_absent());
        assert!(view(Topic::State, &other).state().unwrap().maps.is_absent());
        assert!(view(Topic::Visualization, &usual).visualization().is_some());
        assert!(std::ptr::eq(first, view(Topic::State, &usual)));
        assert!(std::ptr::eq(view(Topic::State, &other), view(Topic::State, &other)));
    }

    #[test]
    fn what_is_no_json_has_no_view() {
        let read = Read::of(&Payload::keep(b"{".to_vec().into()));
        assert!(read.view(Topic::State, &Names::default()).is_none());
    }
}
