//! The factsheet of the vehicle as its master control can know it.
//!
//! A factsheet that was published a moment ago may not have been read yet, so the one before it counts beside it for a
//! while: only what every one of them forbids is wrong.

use std::collections::BTreeMap;
use std::sync::Arc;

use tck_base::clock::Moment;
use tck_view::{
    ArrayLimits, FactsheetView, List, Member, Number, OfferedAction, OfferedParameter, OptionalParameter, Print,
    StringLimits, Text,
};

use crate::observation::Observation;
use crate::ordered::ELEMENTS;
use crate::setting::Setting;

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
    /// All of it as it was read.
    pub view: Arc<FactsheetView>,
    /// minOrderInterval in seconds.
    pub interval: f64,
}

fn texts(list: &Member<List<Member<Text>>>) -> Vec<String> {
    list.iter()
        .take(ELEMENTS)
        .filter_map(|text| Some(text.text()?.to_owned()))
        .collect()
}

/// A limit of a length; 0 is none.
fn limit(member: &Member<Number>) -> Option<u64> {
    member.whole().filter(|limit| *limit > 0)
}

impl Offered {
    fn read(action: &OfferedAction) -> Self {
        let listed = || action.action_parameters.iter().take(ELEMENTS);
        let key = |parameter: &OfferedParameter| parameter.key.or_empty().to_owned();
        let parameters = action.action_parameters.is_there().then(|| {
            let all = listed().map(|parameter| (key(parameter), parameter.is_optional.is(true)));
            all.collect()
        });
        let typed = listed().filter_map(|parameter| {
            let kind = parameter.value_data_type.text()?;
            Some((key(parameter), kind.chars().take(32).collect()))
        });
        Self {
            types: typed.collect(),
            scopes: texts(&action.action_scopes),
            blocking: Some(texts(&action.blocking_types)).filter(|types| !types.is_empty()),
            parameters,
        }
    }
}

impl Factsheet {
    fn read(view: &Arc<FactsheetView>) -> Self {
        let kind = view.type_specification.there();
        let navigation = kind.map(|kind| texts(&kind.navigation_types)).unwrap_or_default();
        let localization = kind.map(|kind| texts(&kind.localization_types)).unwrap_or_default();
        let marks = |kind: &String| matches!(kind.as_str(), "RFID" | "DMC" | "SPOT");
        let features = view.protocol_features.there();
        let names = |wanted: fn(&OptionalParameter) -> bool| {
            let some = view.optional_parameters().take(ELEMENTS).filter(move |one| wanted(one));
            some.map(|one| one.parameter.or_empty().to_owned()).collect::<Vec<_>>()
        };
        let lists = features.is_some_and(|features| features.optional_parameters.is_there());
        let actions = view.offered_actions().take(ELEMENTS);
        let actions: BTreeMap<_, _> = actions
            .map(|action| (action.action_type.or_empty().to_owned(), Offered::read(action)))
            .collect();
        let loads = view.load_specification.there();
        let interval = view.timing().and_then(|timing| timing.min_order_interval.float());
        Self {
            line_guided: navigation.is_empty() || navigation.iter().any(|kind| kind.contains("LINE_GUIDED")),
            on_nodes_only: !localization.is_empty() && localization.iter().all(marks),
            supported: lists.then(|| names(|_| true)),
            required: names(|one| one.support.is("REQUIRED")),
            actions: Some(actions).filter(|actions| !actions.is_empty()),
            load_positions: loads.map(|loads| texts(&loads.load_positions)).unwrap_or_default(),
            interval: interval.unwrap_or_default(),
            view: Arc::clone(view),
        }
    }

    /// How long a text, or a whole message, may be, where that is limited.
    #[must_use]
    pub fn string_limit(&self, of: fn(&StringLimits) -> &Member<Number>) -> Option<u64> {
        limit(of(self.view.string_limits()?))
    }

    /// How long a list may be, where that is limited.
    #[must_use]
    pub fn array_limit(&self, of: fn(&ArrayLimits) -> &Member<Number>) -> Option<u64> {
        limit(of(self.view.array_limits()?))
    }

    /// Whether ids are to be made of digits only.
    #[must_use]
    pub fn wants_digits(&self) -> bool {
        let strings = self.view.string_limits();
        strings.is_some_and(|strings| strings.id_numerical_only.is(true))
    }

    /// Whether it limits the length of anything, or wants digits.
    #[must_use]
    pub fn is_limited(&self) -> bool {
        let strings = self.view.string_limits().into_iter().flat_map(StringLimits::all);
        let arrays = self.view.array_limits().into_iter().flat_map(ArrayLimits::all);
        self.wants_digits() || strings.chain(arrays).any(|member| limit(member).is_some())
    }
}

/// The factsheets that count now.
#[derive(Debug, Default)]
pub struct Factsheets {
    now: Option<Arc<Factsheet>>,
    said: Option<Print>,
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
        let Some(view) = record.said_factsheet() else {
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
        let new = Arc::new(Factsheet::read(view));
        self.before.extend(self.now.replace(new).map(|old| (old, until)));
        self.said = print;
        self.since = Some(now);
    }
}
