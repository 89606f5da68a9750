//! The factsheet of the vehicle as its master control can know it.
//!
//! A factsheet that was published a moment ago may not have been read yet, so the one before it counts beside it for a
//! while: only what every one of them forbids is wrong.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::Value;
use tck_base::clock::Moment;
use tck_base::pattern::whole;

use crate::members::{ELEMENTS, elements, text};
use crate::observation::Observation;
use crate::setting::Setting;
use crate::topic::Topic;

/// What a factsheet says about an action.
#[derive(Clone, Debug, Default)]
pub struct Offered {
    /// actionScopes.
    pub scopes: Vec<String>,
    /// blockingTypes; `None`: not said.
    pub blocking: Option<Vec<String>>,
    /// Key and whether it may be left out; `None`: not said.
    pub parameters: Option<BTreeMap<String, bool>>,
    /// valueDataType by key, where it is said.
    pub types: BTreeMap<String, String>,
}

/// What a factsheet says.
#[derive(Clone, Debug, Default)]
pub struct Factsheet {
    /// Whether the vehicle is bound to lines, or the factsheet does not say how it finds its way.
    pub line_guided: bool,
    /// Whether it finds itself only at marks on nodes.
    pub on_nodes_only: bool,
    /// optionalParameters; `None`: not said.
    pub supported: Option<Vec<String>>,
    /// Those of them that are REQUIRED.
    pub required: Vec<String>,
    /// By actionType; `None`: not said.
    pub actions: Option<BTreeMap<String, Offered>>,
    /// loadPositions.
    pub load_positions: Vec<String>,
    /// maxStringLens, without those that are 0.
    pub strings: BTreeMap<String, u64>,
    /// idNumericalOnly.
    pub numerical: bool,
    /// maxArrayLens, without those that are 0.
    pub arrays: BTreeMap<String, u64>,
    /// minOrderInterval in seconds.
    pub interval: f64,
}

fn texts(value: Option<&Value>) -> Option<Vec<String>> {
    let list = value?.as_array()?.iter().take(ELEMENTS);
    Some(list.filter_map(|text| Some(text.as_str()?.to_owned())).collect())
}

fn limits(value: Option<&Value>) -> BTreeMap<String, u64> {
    let members = value.and_then(Value::as_object).into_iter().flatten().take(ELEMENTS);
    let all = members.filter_map(|(name, limit)| {
        let limit = whole(limit).filter(|limit| *limit > 0)?;
        Some((name.clone(), limit))
    });
    all.collect()
}

impl Offered {
    fn read(action: &Value) -> Self {
        let listed = action.get("actionParameters").and_then(Value::as_array);
        let parameters = listed.map(|list| {
            let all = list.iter().take(ELEMENTS).map(|parameter| {
                let optional = parameter.get("isOptional").and_then(Value::as_bool).unwrap_or_default();
                (text(parameter, "key").to_owned(), optional)
            });
            all.collect()
        });
        let typed = listed.into_iter().flatten().take(ELEMENTS).filter_map(|parameter| {
            let kind = parameter.get("valueDataType")?.as_str()?;
            Some((text(parameter, "key").to_owned(), kind.chars().take(32).collect()))
        });
        Self {
            types: typed.collect(),
            scopes: texts(action.get("actionScopes")).unwrap_or_default(),
            blocking: texts(action.get("blockingTypes")).filter(|types| !types.is_empty()),
            parameters,
        }
    }
}

impl Factsheet {
    fn read(value: &Value) -> Self {
        let at = |pointer: &str| value.pointer(pointer);
        let navigation = texts(at("/typeSpecification/navigationTypes")).unwrap_or_default();
        let localization = texts(at("/typeSpecification/localizationTypes")).unwrap_or_default();
        let marks = |kind: &String| matches!(kind.as_str(), "RFID" | "DMC" | "SPOT");
        let features = at("/protocolFeatures");
        let listed = features.and_then(|features| features.get("optionalParameters")?.as_array());
        let names = |support: &str| {
            let all = listed.into_iter().flatten().take(ELEMENTS);
            let some = all.filter(move |one| support.is_empty() || text(one, "support") == support);
            some.map(|one| text(one, "parameter").to_owned()).collect::<Vec<_>>()
        };
        let offered = features.filter(|features| features.get("agvActions").is_some_and(Value::is_array));
        let actions = offered.map(|features| {
            let all = elements(features, "agvActions").take(ELEMENTS);
            all.map(|action| (text(action, "actionType").to_owned(), Offered::read(action)))
                .collect::<BTreeMap<_, _>>()
        });
        Self {
            line_guided: navigation.is_empty() || navigation.iter().any(|kind| kind.contains("LINE_GUIDED")),
            on_nodes_only: !localization.is_empty() && localization.iter().all(marks),
            supported: listed.map(|_| names("")),
            required: names("REQUIRED"),
            actions: actions.filter(|actions| !actions.is_empty()),
            load_positions: texts(at("/loadSpecification/loadPositions")).unwrap_or_default(),
            strings: limits(at("/protocolLimits/maxStringLens")),
            numerical: at("/protocolLimits/maxStringLens/idNumericalOnly") == Some(&Value::Bool(true)),
            arrays: limits(at("/protocolLimits/maxArrayLens")),
            interval: at("/protocolLimits/timing/minOrderInterval")
                .and_then(Value::as_f64)
                .unwrap_or_default(),
        }
    }
}

/// The factsheets that count now.
#[derive(Debug, Default)]
pub struct Factsheets {
    now: Option<Arc<Factsheet>>,
    said: Option<u64>,
    since: Option<Moment>,
    /// Those before, until when they count.
    before: Vec<(Arc<Factsheet>, Moment)>,
    /// While nobody knows which one the master control has.
    unknown: bool,
}

impl Factsheets {
    /// All factsheets the master control may go by; none when that is not known.
    #[must_use]
    pub fn valid(&self, record: &Observation<'_>, setting: &Setting<'_>) -> Vec<Arc<Factsheet>> {
        let now = record.at().moment;
        // The very first one takes a while to be read, too.
        let fresh = self.before.is_empty() && self.since.is_some_and(|since| now.since(since) < setting.time.notice);
        if self.unknown || fresh {
            return Vec::new();
        }
        let before = self
            .before
            .iter()
            .filter(|(_, until)| *until > now)
            .map(|(sheet, _)| sheet);
        self.now.iter().chain(before).map(Arc::clone).collect()
    }
}

impl Factsheets {
    /// Learns from the next record.
    pub(crate) fn learn(&mut self, record: &Observation<'_>, setting: &Setting<'_>) {
        let Some(value) = record.said(Topic::Factsheet) else {
            return;
        };
        // It may get lost; the next one tells.
        self.unknown = record.link.disturbed;
        let print = record.content();
        if self.now.is_some() && self.said == print {
            return;
        }
        let now = record.at().moment;
        self.before.retain(|(_, until)| *until > now);
        if self.before.len() == 8 {
            self.before.remove(0);
        }
        let until = now + setting.time.notice;
        let new = Arc::new(Factsheet::read(value));
        self.before.extend(self.now.replace(new).map(|old| (old, until)));
        self.said = print;
        self.since = Some(now);
    }
}
