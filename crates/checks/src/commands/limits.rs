//! The limits a vehicle states in its factsheet: how long, how many, how often.

use super::fields::ids;
use super::{Command, ELEMENTS, Found};
use crate::finding::quote;
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::{Event, LinkFault};
use tck_pack::HookInfo;
use tck_view::{ActionView, ArrayLimits, Field, Json, Member, Number, ProtocolLimits, Timing};
use tck_world::{Fact, Factsheet, Listen, Observation, Topic};

/// `commands/limits`.
pub(crate) const SIZES: Check = Check {
    name: "commands/limits",
    decides: &["FACT-12"],
    doc: "Orders and instant actions keep the lengths of arrays, ids, enumerations and whole messages that the factsheet \
          of the vehicle states, and its wish for ids of digits only. 0 and a missing limit are none.",
    arguments: &[],
    listens: &[
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[Fact::Factsheets],
    needs: &[ProtocolLimits::max_string_lens, ProtocolLimits::max_array_lens],
    start: |_| Box::new(Sizes),
};

/// `commands/order-interval`.
pub(crate) const ORDER_INTERVAL: Check = Check {
    name: "commands/order-interval",
    decides: &["FACT-13"],
    doc: "Between two order messages lies at least minOrderInterval of the factsheet, with a margin of a tenth and \
          50 ms. Judged only while the link is not disturbed; the first order behind a link that was cut counts from the \
          last one before.",
    arguments: &[],
    listens: &[Listen::Fault, Listen::Hook, Listen::Delivered(Topic::Order)],
    reads: &[Fact::Factsheets],
    needs: &[Timing::min_order_interval],
    start: |_| Box::new(Interval::default()),
};

struct Sizes;

impl Running for Sizes {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(command) = Command::read(record) else {
            return false;
        };
        let sheets = context.world.factsheets().valid(record, context);
        if sheets.is_empty() || !sheets.iter().all(|sheet| sheet.is_limited()) {
            return false;
        }
        let length = record.payload().map_or(0, tck_journal::Payload::len);
        let all: Vec<Vec<String>> = sheets.iter().map(|sheet| excesses(sheet, command, length)).collect();
        // Wrong is what no factsheet that counts allows.
        if all.iter().all(|excesses| !excesses.is_empty()) {
            let mut found = Found::new(record, findings);
            for text in all.into_iter().next().unwrap_or_default() {
                found.broken("FACT-12", text);
            }
        }
        true
    }
}

/// A list of a message: its name in a factsheet, its limit there, and how many elements it has.
type Counted = (Field, fn(&ArrayLimits) -> &Member<Number>, usize);

/// The lists of a message.
fn lists(command: Command<'_>) -> Vec<Counted> {
    let mut all: Vec<Counted> = Vec::new();
    match command {
        Command::Instant(message) => {
            let count = message.actions.total();
            all.push((ArrayLimits::instant_actions, |limits| &limits.instant_actions, count));
        }
        Command::Order(order) => {
            all.push((
                ArrayLimits::order_nodes,
                |limits| &limits.order_nodes,
                order.nodes.total(),
            ));
            all.push((
                ArrayLimits::order_edges,
                |limits| &limits.order_edges,
                order.edges.total(),
            ));
            for node in order.nodes.iter().take(ELEMENTS) {
                let count = node.actions.total();
                all.push((ArrayLimits::node_actions, |limits| &limits.node_actions, count));
            }
            for edge in order.edges.iter().take(ELEMENTS) {
                let count = edge.actions.total();
                all.push((ArrayLimits::edge_actions, |limits| &limits.edge_actions, count));
                if let Some(curve) = edge.trajectory.there() {
                    let (knots, points) = (curve.knot_vector.total(), curve.control_points.total());
                    all.push((ArrayLimits::knot_vector, |limits| &limits.knot_vector, knots));
                    all.push((ArrayLimits::control_points, |limits| &limits.control_points, points));
                }
            }
        }
    }
    let parameters = |action: &ActionView| -> Counted {
        let count = action.action_parameters.total();
        (
            ArrayLimits::action_parameters,
            |limits| &limits.action_parameters,
            count,
        )
    };
    all.extend(command.actions().into_iter().map(|(_, action)| parameters(action)));
    all
}

fn excesses(sheet: &Factsheet, command: Command<'_>, length: u64) -> Vec<String> {
    let string = |of| sheet.string_limit(of).unwrap_or(u64::MAX);
    let most = string(|limits| &limits.id_len);
    let words = string(|limits| &limits.enum_len);
    let loads = string(|limits| &limits.load_id_len);
    let mut all = Vec::new();
    if let Some(limit) = sheet
        .string_limit(|limits| &limits.msg_len)
        .filter(|limit| length > *limit)
    {
        all.push(format!("the message has {length} bytes, msgLen is {limit}"));
    }
    for (name, limit, count) in lists(command) {
        if let Some(limit) = sheet.array_limit(limit).filter(|limit| count as u64 > *limit) {
            all.push(format!(
                "{} has {count} elements, the limit is {limit}",
                name.usual_name()
            ));
        }
    }
    for (name, id) in ids(command) {
        if id.length() > most {
            all.push(format!("{name} {} is longer than idLen {most}", quote(id)));
        }
        if sheet.wants_digits() && !id.bytes().all(|byte| byte.is_ascii_digit()) {
            all.push(format!("{name} {} is not made of digits only", quote(id)));
        }
    }
    for (_, action) in command.actions() {
        if let Some(blocking) = action.blocking_type.there().filter(|word| word.length() > words) {
            all.push(format!("blockingType {} is longer than enumLen", quote(blocking)));
        }
        let load = match action.argument("loadId") {
            Member::There(Json::Text(load)) => Some(load),
            _ => None,
        };
        if let Some(load) = load.filter(|load| load.length() > loads) {
            all.push(format!("loadId {} is longer than loadIdLen", quote(load)));
        }
    }
    all
}

#[derive(Default)]
struct Interval {
    last: Option<Moment>,
    /// The link was cut since the last order.
    cut: bool,
}

impl Running for Interval {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        match record.event() {
            Event::Fault {
                fault: LinkFault::Cut { .. },
            } => self.cut = true,
            Event::Fault {
                fault: LinkFault::Restore,
            } if self.cut => {}
            // What is held back or lost comes at other times than it was sent.
            Event::Fault { .. } => self.last = None,
            Event::Hook { hook, .. } if context.hook(hook).is_some_and(HookInfo::restarts) => self.last = None,
            _ => {}
        }
        let order = Command::read(record).and_then(Command::order);
        if order.is_none() || record.link.disturbed {
            return false;
        }
        let now = record.at().moment;
        let before = self.last.replace(now);
        if std::mem::take(&mut self.cut) {
            // What was sent while the link was down may come all at once. It is never earlier than it was sent.
            self.last = None;
        }
        let Some(before) = before else {
            return false;
        };
        let sheets = context.world.factsheets().valid(record, context);
        let Some(interval) = sheets.iter().map(|sheet| sheet.interval).reduce(f64::min) else {
            return false;
        };
        if interval <= 0.0 {
            return false;
        }
        let gap = now.since(before).as_secs_f64();
        if gap < interval * 0.9 - 0.05 {
            let text = format!("two orders come {gap:.2} s apart, minOrderInterval is {interval} s");
            Found::new(record, findings).broken("FACT-13", text);
        }
        true
    }
}
