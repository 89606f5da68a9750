//! The factsheet of the device, as a run knows it.

use std::ops::Deref;
use std::sync::Arc;

use serde_json::Value;
use tck_view::{FactsheetView, MessageView, Names, Object, Topic};

/// A factsheet. Its limits are kept as they were published, too: tests name any of them.
#[derive(Clone, Debug, Default)]
pub struct Sheet {
    view: Arc<FactsheetView>,
    limits: Option<Value>,
    names: Names,
}

impl Sheet {
    /// Reads a factsheet message.
    #[must_use]
    pub fn read(message: &Value, names: &Names) -> Self {
        let view = MessageView::of_value(Topic::Factsheet, message, names);
        Self {
            view: view.factsheet().map(Arc::clone).unwrap_or_default(),
            limits: names.raw(message, &[FactsheetView::protocol_limits]).cloned(),
            names: names.clone(),
        }
    }

    /// Whether a limit is set, such as `maxArrayLens.order.nodes`: a group, and a member whose name has dots in it. `None`
    /// when there are no limits at all.
    #[must_use]
    pub fn has_limit(&self, path: &str) -> Option<bool> {
        let (group, member) = path.split_once('.').unwrap_or((path, ""));
        let own = self.names.spelled_names(Object::ProtocolLimits, &[group, member]);
        let mut own = own.unwrap_or_default().into_iter();
        let limits = self.limits.as_ref()?;
        let value = own
            .clone()
            .next()
            .and(own.try_fold(limits, |here, name| here.get(name)));
        Some(value.and_then(Value::as_f64).is_some_and(|limit| limit > 0.0))
    }

    /// Whether it heeds zones of a type, or of any; a list that is missing is empty (the ruling of ZONE-01). `None` when it does
    /// not say what kind of vehicle it is.
    #[must_use]
    pub fn heeds_zones(&self, name: Option<&str>) -> Option<bool> {
        let kind = self.type_specification.there()?;
        let mut listed = kind.supported_zones.texts();
        Some(match name {
            Some(name) => listed.any(|zone_type| zone_type == name),
            None => listed.next().is_some(),
        })
    }

    /// Whether it lists an action; `None` when it has no such list.
    #[must_use]
    pub fn has_action(&self, name: &str, scope: Option<&str>) -> Option<bool> {
        let all = self.protocol_features.there()?.actions.there()?;
        let spelling = self.names.spelling(Object::OfferedAction, "actionType");
        let name = spelling.map_or(name, |spelling| spelling.word(name));
        Some(all.iter().any(|action| {
            let is_scope = |scope: &str| action.action_scopes.texts().any(|other| other == scope);
            action.action_type.is(name) && scope.is_none_or(is_scope)
        }))
    }

    /// The actions that it lists for nodes.
    #[must_use]
    pub fn node_actions(&self) -> Vec<&str> {
        let all = self
            .protocol_features
            .there()
            .and_then(|features| features.actions.there());
        let all = all.into_iter().flat_map(|actions| actions.iter());
        let of_nodes = all.filter(|action| action.action_scopes.texts().any(|scope| scope == "NODE"));
        of_nodes.filter_map(|action| action.action_type.text()).collect()
    }

    /// Whether it lists an optional parameter; `None` when it has no such list.
    #[must_use]
    pub fn has_optional(&self, path: &str) -> Option<bool> {
        let all = self.protocol_features.there()?.optional_parameters.there()?;
        let path = self.spelled(path);
        Some(all.iter().any(|one| one.parameter.is(&path)))
    }

    /// Whether the vehicle cannot do without the optional parameter, or without a part of it.
    #[must_use]
    pub fn requires(&self, path: &str) -> bool {
        let path = self.spelled(path);
        self.optional_parameters().any(|one| {
            let rest = one.parameter.or_empty().strip_prefix(path.as_str());
            let is_part = rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
            is_part && one.support.is("REQUIRED")
        })
    }

    /// An optional parameter, which begins with its topic, as the version of the vehicle writes it.
    fn spelled(&self, path: &str) -> String {
        let (topic, below) = path.split_once('.').unwrap_or((path, ""));
        format!(
            "{topic}.{}",
            self.names.spelled_path(Topic::of_name(topic).object(), below)
        )
    }

    /// The series it is of.
    #[must_use]
    pub fn series(&self) -> Option<&str> {
        self.type_specification.there()?.series_name.text()
    }
}

impl Deref for Sheet {
    type Target = FactsheetView;

    fn deref(&self) -> &FactsheetView {
        &self.view
    }
}
