//! Makes the messages of the harness: header, order, instant actions, and what breaks them.
//!
//! Types are for what we send; what is sent wrong on purpose is made right first and then patched.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::{Map, Value, json};

use super::compose_error::ComposeError;
use super::ids::{IdForm, uuid_of_action};
use super::manner::{Manner, Manners};
use super::route::{RouteBuilder, SentOrders};
use tck_base::clock::Stamp;
use tck_base::device::Publication;
use tck_base::pattern::Bindings;
use tck_judge::Ground;
use tck_suite::model::{Patch, Raw, Send, SendAction, later};
use tck_view::{FactsheetView, OfferedAction, OrderView, Topic};

/// A finished message and the actionIds in it, by the names given with `as`.
#[derive(Debug)]
pub struct Composed {
    /// The message.
    pub message: Publication,
    /// Name and actionId.
    pub actions: Vec<(String, String)>,
}

/// Makes messages; counts headerId per topic and actionIds per run.
#[derive(Debug)]
pub struct Composer {
    run: String,
    header_ids: BTreeMap<String, u32>,
    action_count: u64,
    ids: IdForm,
    /// The factsheet of the device the message is for.
    factsheet: Option<Arc<FactsheetView>>,
    orders: SentOrders,
    manners: Manners,
}

impl Composer {
    /// `run` makes ids unique over runs.
    pub fn new(run: impl Into<String>) -> Self {
        Self {
            run: run.into(),
            header_ids: BTreeMap::new(),
            action_count: 0,
            ids: IdForm::default(),
            factsheet: None,
            orders: SentOrders::default(),
            manners: Manners::default(),
        }
    }

    /// Words messages in these manners.
    #[must_use]
    pub fn in_manners(mut self, manners: Manners) -> Self {
        self.manners = manners;
        self
    }

    /// How many bytes a message for the vehicle may have, as far as its factsheet says that.
    fn longest(&self) -> Option<u64> {
        let limits = self.factsheet.as_ref().and_then(|sheet| sheet.string_limits());
        limits
            .and_then(|limits| limits.msg_len.whole())
            .filter(|longest| *longest > 0)
    }

    /// Forgets the orders of the test before.
    pub fn begin_test(&mut self) {
        self.orders = SentOrders::default();
    }

    /// A fresh actionId, as the factsheet of the vehicle wants ids as far as it is known.
    pub fn action_id(&mut self) -> String {
        self.action_count += 1;
        match self.ids {
            IdForm::Readable if self.manners.has(Manner::UuidActionIds) => uuid_of_action(&self.run, self.action_count),
            ids => ids.of_action(&self.run, self.action_count),
        }
    }

    /// Makes the message of a `send` step.
    pub fn compose(
        &mut self,
        send: &Send,
        bindings: &Bindings,
        ground: &Ground,
        now: Stamp,
    ) -> Result<Composed, ComposeError> {
        let topic = ground
            .topics
            .get(&send.topic)
            .cloned()
            .ok_or_else(|| ComposeError::Topic(send.topic.clone()))?;
        let topic = match send.neighbour {
            true => of_neighbour(&topic, &ground.identity.1),
            false => topic,
        };
        let times = times_to_come(send, ground.pack.timestamp_digits(), now);
        let mut timed = Bindings::new();
        let bindings = if times.is_empty() {
            bindings
        } else {
            timed.clone_from(bindings);
            timed.extend(&times);
            &timed
        };
        self.factsheet = ground.factsheet();
        self.ids = IdForm::of(self.factsheet.as_ref().and_then(|sheet| sheet.string_limits()));
        let rule = ground.pack.topic(&send.topic);
        let qos = send.qos.unwrap_or_else(|| rule.map_or(0, |rule| rule.qos));
        let mut actions = Vec::new();
        let payload = if let Some(raw) = &send.raw {
            match raw {
                Raw::Bytes(bytes) => bytes.clone(),
                Raw::Text(term) => match term.bind(bindings)? {
                    Value::String(text) => text.into_bytes(),
                    other => other.to_string().into_bytes(),
                },
            }
        } else {
            let message = self.message(send, bindings, ground, now, &mut actions)?;
            self.manners.text(&message, self.longest())
        };
        Ok(Composed {
            message: Publication {
                topic,
                payload: payload.into(),
                qos,
                retain: send.retain,
            },
            actions,
        })
    }

    /// A message with nothing but its header and these members, for the harness's own use.
    pub fn plain(
        &mut self,
        topic: &str,
        members: Value,
        ground: &Ground,
        now: Stamp,
    ) -> Result<Publication, ComposeError> {
        let full = ground
            .topics
            .get(topic)
            .cloned()
            .ok_or_else(|| ComposeError::Topic(topic.to_owned()))?;
        let mut message = self.header(topic, ground, now);
        if let Value::Object(members) = members {
            message.extend(members);
        }
        ground
            .pack
            .names()
            .spell_members(Topic::of_name(topic).object(), &mut message);
        Ok(Publication {
            topic: full,
            payload: self.manners.text(&Value::Object(message), self.longest()).into(),
            qos: ground.pack.topic(topic).map_or(0, |rule| rule.qos),
            retain: false,
        })
    }

    fn message(
        &mut self,
        send: &Send,
        bindings: &Bindings,
        ground: &Ground,
        now: Stamp,
        actions: &mut Vec<(String, String)>,
    ) -> Result<Value, ComposeError> {
        let mut message = self.header(&send.topic, ground, now);
        if send.neighbour {
            message.insert("serialNumber".to_owned(), json!(neighbour(&ground.identity.1)));
        }
        let payload = send.payload.as_ref().map(|term| term.bind(bindings)).transpose()?;
        if !send.actions.is_empty() {
            let kind = ActionKind::Instant {
                broken: send.patch.is_some(),
                blocks: !ground.pack.has("instantActionsNeverBlock"),
            };
            let list = self.actions(&send.actions, kind, bindings, actions)?;
            message.insert("actions".to_owned(), Value::Array(list));
        }
        if let Some(route) = &send.route {
            let said = payload
                .as_ref()
                .and_then(|payload| ground.pack.names().raw(payload, &[OrderView::order_id]))
                .and_then(Value::as_str);
            let own = bindings.get("run.order").and_then(Value::as_str);
            let order = said.or(own).unwrap_or_default().to_owned();
            message.insert("orderId".to_owned(), json!(order));
            message.insert("orderUpdateId".to_owned(), json!(0));
            let mut placed = BTreeMap::new();
            for (at, (place, list)) in route.actions.iter().enumerate() {
                let list = self.actions(list, ActionKind::OfOrder, bindings, actions)?;
                placed.insert(at, (place.clone(), list));
            }
            let builder = RouteBuilder {
                course: bindings.get("course"),
                route,
                actions: placed.into_values().collect(),
            };
            let (count, ids, run) = (&mut self.action_count, self.ids, &self.run);
            let mut fresh = || {
                *count += 1;
                ids.of_action(run, *count)
            };
            let (nodes, edges) = builder.build(&order, &mut self.orders, &mut fresh)?;
            message.insert("nodes".to_owned(), nodes);
            message.insert("edges".to_owned(), edges);
        }
        let mut message = Value::Object(message);
        if let Some(payload) = payload {
            json_patch::merge(&mut message, &payload);
        }
        let (names, object) = (ground.pack.names(), Topic::of_name(&send.topic).object());
        names.spell(object, &mut message);
        match &send.patch {
            None => {}
            Some(Patch::Merge(term)) => {
                let mut patch = term.bind(bindings)?;
                names.spell(object, &mut patch);
                json_patch::merge(&mut message, &patch);
            }
            Some(Patch::Operations(term)) => {
                let Value::Array(operations) = term.bind(bindings)? else {
                    return Err(ComposeError::Patch("it is no list of operations".to_owned()));
                };
                for mut operation in operations {
                    let at = operation
                        .get("path")
                        .and_then(Value::as_str)
                        .unwrap_or_default()
                        .to_owned();
                    // What keeps an order in one piece need not be done where there is no such member.
                    if names.has_lost(object, &at) {
                        continue;
                    }
                    if let Some(value) = operation.get_mut("value") {
                        names.spell_at(object, &at, value);
                    }
                    for place in ["path", "from"] {
                        if let Some(Value::String(path)) = operation.get_mut(place) {
                            *path = names.spelled_path(object, path);
                        }
                    }
                    operate(&mut message, operation)?;
                }
            }
        }
        Ok(message)
    }

    /// The actions of an order, or of a message with instant actions.
    fn actions(
        &mut self,
        list: &[SendAction],
        kind: ActionKind,
        bindings: &Bindings,
        named: &mut Vec<(String, String)>,
    ) -> Result<Vec<Value>, ComposeError> {
        // What is broken on purpose has to be there first.
        let whole = !matches!(kind, ActionKind::Instant { broken: false, .. })
            || !self.manners.has(Manner::EmptyParametersLeftOut);
        let mut all = Vec::new();
        for action in list {
            let known = action
                .name
                .as_ref()
                .and_then(|name| bindings.get(&format!("{name}.id"))?.as_str().map(str::to_owned));
            let fresh = known.is_none();
            let id = known.unwrap_or_else(|| self.action_id());
            let mut parameters = Vec::new();
            if let Some(term) = &action.with_all
                && let Value::Object(members) = term.bind(bindings)?
            {
                parameters.extend(
                    members
                        .into_iter()
                        .map(|(key, value)| json!({ "key": key, "value": value })),
                );
            }
            for (key, term) in &action.with {
                parameters.push(json!({ "key": key, "value": term.bind(bindings)? }));
            }
            let action_type = action.action.bind(bindings)?;
            let blocking = action.blocking.as_ref().map(|term| term.bind(bindings)).transpose()?;
            let blocking = match blocking {
                Some(said) if kind == ActionKind::OfOrder => said,
                _ if matches!(kind, ActionKind::Instant { blocks: false, .. }) => json!("NONE"),
                // How an instant action blocks is nothing a test is about.
                said => {
                    let usual = match kind {
                        ActionKind::OfOrder => "HARD",
                        ActionKind::Instant { .. } => self.manners.blocking(),
                    };
                    let usual = said.unwrap_or_else(|| json!(usual));
                    usual_blocking(&action_type, usual, self.factsheet.as_deref())
                }
            };
            let mut made = json!({ "actionType": action_type, "actionId": id, "blockingType": blocking });
            if whole || !parameters.is_empty() {
                made["actionParameters"] = Value::Array(parameters);
            }
            all.push(made);
            if let (Some(name), true) = (&action.name, fresh) {
                named.push((name.clone(), id));
            }
        }
        Ok(all)
    }

    fn header(&mut self, topic: &str, ground: &Ground, now: Stamp) -> Map<String, Value> {
        let id = self.header_ids.entry(topic.to_owned()).or_default();
        let header = json!({
            "headerId": *id,
            "timestamp": timestamp(now, ground.pack.timestamp_digits()),
            "version": ground.pack.version.to_string(),
            "manufacturer": ground.identity.0,
            "serialNumber": ground.identity.1,
        });
        *id = id.wrapping_add(1);
        match header {
            Value::Object(members) => members,
            _ => Map::new(),
        }
    }
}

/// The serial number of a vehicle that does not exist, beside the one under test.
fn neighbour(serial_number: &str) -> String {
    format!("{serial_number}-neighbour")
}

/// The topic of the vehicle that does not exist in the place of that of the one under test.
fn of_neighbour(topic: &str, serial_number: &str) -> String {
    let mut levels: Vec<String> = topic.split('/').map(str::to_owned).collect();
    if let Some(level) = levels.iter_mut().rev().find(|level| *level == serial_number) {
        *level = neighbour(serial_number);
    }
    levels.join("/")
}

/// Where actions stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ActionKind {
    /// In an order.
    OfOrder,
    /// In a message with instant actions.
    Instant {
        /// Whether the message is broken on purpose afterwards.
        broken: bool,
        /// Whether they may block at all.
        blocks: bool,
    },
}

/// One operation of JSON Patch, or `as-text`: the value that stands there is put in quotes.
fn operate(message: &mut Value, operation: Value) -> Result<(), ComposeError> {
    if operation.get("op").and_then(Value::as_str) == Some("as-text") {
        let path = operation.get("path").and_then(Value::as_str).unwrap_or_default();
        let place = message
            .pointer_mut(path)
            .ok_or_else(|| ComposeError::Patch(format!("there is nothing at {path}")))?;
        let text = match place.take() {
            Value::String(text) => text,
            other => other.to_string(),
        };
        *place = Value::String(text);
        return Ok(());
    }
    let operations = serde_json::from_value(Value::Array(vec![operation]));
    let operations: json_patch::Patch = operations.map_err(|error| ComposeError::Patch(error.to_string()))?;
    json_patch::patch(message, &operations).map_err(|error| ComposeError::Patch(error.to_string()))
}

/// ISO 8601 in UTC with so many fraction digits (HDR-03).
fn timestamp(now: Stamp, digits: usize) -> String {
    format!("{:.digits$}", now.utc)
}

/// The times that a message names by how long they are ahead: `now`, and below it what stands behind the dot.
fn times_to_come(send: &Send, digits: usize, now: Stamp) -> Map<String, Value> {
    let mut times = Map::new();
    let patch = send.patch.as_ref().map(|patch| match patch {
        Patch::Merge(term) | Patch::Operations(term) => term,
    });
    for term in send.payload.iter().chain(patch) {
        for name in term.variables() {
            if let (Some(ahead), Some((_, rest))) = (later(name), name.split_once('.')) {
                let then = now.at(now.moment + ahead);
                times.insert(rest.to_owned(), json!(timestamp(then, digits)));
            }
        }
    }
    if times.is_empty() {
        return times;
    }
    Map::from_iter([("now".to_owned(), Value::Object(times))])
}

/// How an action blocks where a test does not care: the usual way, or the first type its factsheet lists when the usual
/// one is not among them (FACT-15).
fn usual_blocking(action_type: &Value, usual: Value, factsheet: Option<&FactsheetView>) -> Value {
    let is_it =
        |action: &&OfferedAction| action.action_type.is_there() && action.action_type.text() == action_type.as_str();
    let own = factsheet.and_then(|sheet| sheet.offered_actions().find(is_it));
    let Some(types) = own.map(|action| &action.blocking_types) else {
        return usual;
    };
    if types.texts().any(|listed| Some(listed) == usual.as_str()) {
        return usual;
    }
    types.texts().next().map_or(usual, Value::from)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_base::clock::Moment;

    #[test]
    fn a_value_is_put_in_quotes_where_it_stands() {
        let mut message = json!({ "list": [{ "a": 5, "b": true }] });
        for path in ["/list/0/a", "/list/0/b"] {
            operate(&mut message, json!({ "op": "as-text", "path": path })).expect("there");
        }
        operate(&mut message, json!({ "op": "add", "path": "/list/0/c", "value": null })).expect("there");
        assert_eq!(message, json!({ "list": [{ "a": "5", "b": "true", "c": null }] }));
        let nowhere = operate(&mut message, json!({ "op": "as-text", "path": "/list/1" }));
        assert!(nowhere.is_err());
    }

    #[test]
    fn the_timestamp_has_the_fraction_digits_of_its_version_and_a_z() {
        let utc = "2026-11-21T09:16:24.129Z".parse().expect("timestamp");
        let stamp = Stamp {
            moment: Moment::START,
            utc,
        };
        assert_eq!(timestamp(stamp, 2), "2026-11-21T09:16:24.12Z");
        assert_eq!(timestamp(stamp, 3), "2026-11-21T09:16:24.129Z");
    }
}
