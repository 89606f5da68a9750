//! What a mock vehicle asks a master control for because it was told to: access to zones, ways through them, corridors.
//!
//! It shows each request in its states and follows the answers, but does nothing with what it is given.

use serde_json::{Map, Value, json};

use super::told::Told;
use crate::agv::Agv;
use tck_base::clock::Moment;

/// More than this it does not ask for at once.
const MAX_ASKED: usize = 100;

/// A request it shows.
#[derive(Clone, Debug, PartialEq)]
struct Asked {
    /// The list of the state in which it stands.
    list: &'static str,
    id: String,
    status: String,
    /// Its members beside these.
    rest: Map<String, Value>,
    /// When what it was given ends.
    until: Option<Moment>,
}

/// What it asks for.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Asking {
    asked: Vec<Asked>,
    /// It goes by no answer.
    held: bool,
    count: u64,
}

impl Asking {
    /// `ask-for-zone`.
    pub(super) fn for_zone(&mut self, agv: &Agv, told: &Told<'_>) {
        let kind = told.text("requestType").unwrap_or_else(|| "ACCESS".to_owned());
        let mut rest = Map::new();
        rest.insert("requestType".into(), json!(kind));
        rest.insert("zoneId".into(), json!(told.text("zoneId").unwrap_or_default()));
        rest.insert("zoneSetId".into(), json!(told.text("zoneSetId").unwrap_or_default()));
        if kind == "REPLANNING" && told.flag("way") != Some(false) {
            rest.insert("trajectory".into(), way(agv, told.number("over").unwrap_or(2.0)));
        }
        self.ask(agv, "zoneRequests", told.text("requestId"), rest);
    }

    /// `ask-for-corridor`.
    pub(super) fn for_corridor(&mut self, agv: &Agv, told: &Told<'_>) {
        let mut rest = Map::new();
        rest.insert("requestType".into(), json!("CORRIDOR"));
        rest.insert("edgeId".into(), json!(told.text("edgeId").unwrap_or_default()));
        rest.insert("sequenceId".into(), json!(told.whole("sequenceId").unwrap_or_default()));
        self.ask(agv, "edgeRequests", told.text("requestId"), rest);
    }

    fn ask(&mut self, agv: &Agv, list: &'static str, id: Option<String>, rest: Map<String, Value>) {
        if self.asked.len() >= MAX_ASKED {
            return;
        }
        self.count += 1;
        // No id comes again, not even after everything was forgotten (ZREQ-04).
        let own = || format!("asked-{}-{}", agv.now.utc.as_millisecond(), self.count);
        self.asked.push(Asked {
            list,
            id: id.unwrap_or_else(own),
            status: "REQUESTED".to_owned(),
            rest,
            until: None,
        });
    }

    /// `withdraw-requests`: one of them, or all.
    pub(super) fn withdraw(&mut self, id: Option<&str>) {
        self.asked.retain(|asked| id.is_some_and(|id| id != asked.id));
    }

    /// `hold-requests`: no answer changes them any more; they show this status, if one is said.
    pub(super) fn hold(&mut self, status: Option<&str>) {
        self.held = true;
        for asked in &mut self.asked {
            if let Some(status) = status {
                status.clone_into(&mut asked.status);
            }
        }
    }

    /// Takes the answers of a message.
    pub(super) fn answered(&mut self, agv: &mut Agv, payload: &[u8]) {
        let message: Value = serde_json::from_slice(payload).unwrap_or_default();
        let answers = message["responses"].as_array().into_iter().flatten();
        for answer in answers.filter(|_| !self.held) {
            let Some(index) = self.asked.iter().position(|asked| answer["requestId"] == *asked.id) else {
                continue;
            };
            match answer["grantType"].as_str() {
                Some("GRANTED") => {
                    let until = answer["leaseExpiry"].as_str().and_then(|text| text.parse().ok());
                    self.asked[index].until = until.map(|until| moment(agv, until));
                    "GRANTED".clone_into(&mut self.asked[index].status);
                }
                Some("QUEUED") => "QUEUED".clone_into(&mut self.asked[index].status),
                Some("REJECTED" | "REVOKED") => {
                    self.asked.remove(index);
                }
                _ => continue,
            }
            agv.report.requested = true;
        }
    }

    /// When the next of what it was given ends.
    pub(super) fn due(&self) -> Option<Moment> {
        let given = self.asked.iter().filter(|asked| asked.status == "GRANTED");
        given.filter_map(|asked| asked.until).filter(|_| !self.held).min()
    }

    /// What it was given for a time has ended.
    pub(super) fn expire(&mut self, agv: &mut Agv) {
        let now = agv.moment();
        let over = |asked: &&mut Asked| asked.status == "GRANTED" && asked.until.is_some_and(|until| until <= now);
        for asked in self.asked.iter_mut().filter(over).filter(|_| !self.held) {
            "EXPIRED".clone_into(&mut asked.status);
            agv.report.requested = true;
        }
    }

    /// Adds its requests to those of the vehicle.
    pub(super) fn says(&self, state: &mut Map<String, Value>) {
        for asked in &self.asked {
            let mut request = asked.rest.clone();
            request.insert("requestId".into(), json!(asked.id));
            request.insert("requestStatus".into(), json!(asked.status));
            let list = state.entry(asked.list).or_insert_with(|| json!([]));
            if let Value::Array(list) = list {
                list.push(Value::Object(request));
            }
        }
    }
}

/// The moment of a time of day.
fn moment(agv: &Agv, utc: jiff::Timestamp) -> Moment {
    let left = utc.duration_since(agv.now.utc);
    agv.moment() + std::time::Duration::try_from(left).unwrap_or_default()
}

/// A way from where the vehicle stands, straight on by some metres.
fn way(agv: &Agv, metres: f64) -> Value {
    let pose = agv.motion.pose(agv.moment());
    let (sin, cos) = pose.theta.sin_cos();
    let end = json!({ "x": pose.x + metres * cos, "y": pose.y + metres * sin });
    let points = json!([{ "x": pose.x, "y": pose.y }, end]);
    json!({ "degree": 1, "knotVector": [0.0, 0.0, 1.0, 1.0], "controlPoints": points })
}
