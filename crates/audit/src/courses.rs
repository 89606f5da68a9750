//! The orders of a vehicle of which something was found, as pictures: what it was told, where it drove, and where it was then.
//!
//! What is found is known when an order is long under way, or over. So the order in hand and the one before it are followed, and what
//! was found decides which of them are kept. All of it is bounded.

use std::ops::RangeInclusive;

use super::result::SideResult;
use tck_report::clean::{line, short};
use tck_report::course::{Bounds, CoursePicture, Driven, Finding};
use tck_view::MessageView;

/// How many orders of one vehicle are kept as pictures.
const ORDERS: usize = 3;
/// How long the sentence of a finding may be beside its picture, in characters.
const SENTENCE: usize = 200;

/// The orders of a vehicle that are followed.
#[derive(Default)]
pub(super) struct Courses {
    now: Option<Followed>,
    before: Option<Followed>,
    kept: Vec<Followed>,
}

/// An order that is followed, from one message to another.
struct Followed {
    order: String,
    messages: RangeInclusive<u64>,
    driven: Driven,
    /// Whether a state has named it: one that was refused is never named.
    named: bool,
}

impl Courses {
    /// Takes in a message of this number; `found` tells whether something was found at one of these messages.
    pub fn note(&mut self, number: u64, message: &MessageView, found: impl Fn(&RangeInclusive<u64>) -> bool) {
        let order = match message {
            MessageView::Order(order) => order.order_id.text(),
            MessageView::State(state) => state.order_id.text(),
            MessageView::Visualization(_) => None,
            _ => return,
        };
        let order = order.filter(|id| !id.is_empty());
        if let (Some(id), Some(before)) = (order, &mut self.before)
            && before.order == id
            && self.now.as_ref().is_none_or(|now| now.order != id)
        {
            // Of two orders of which only one was ever named, the vehicle has the other one in hand, or goes on with it.
            if before.named && self.now.as_ref().is_none_or(|now| now.named) {
                before.driven.note(number, message);
                return;
            }
            std::mem::swap(&mut self.now, &mut self.before);
        }
        if let Some(id) = order.filter(|id| self.now.as_ref().is_none_or(|now| now.order != **id)) {
            let begun = Followed {
                order: id.to_owned(),
                messages: number..=number,
                driven: Driven::new(Bounds::FLEET),
                named: false,
            };
            let before = self.now.replace(begun);
            let older = std::mem::replace(&mut self.before, before);
            let is_worth = |older: &Followed| self.kept.len() < ORDERS && found(&older.messages);
            if let Some(older) = older.filter(is_worth) {
                self.kept.push(older);
            }
        }
        if let Some(now) = &mut self.now {
            now.messages = *now.messages.start()..=number;
            now.named |= matches!(message, MessageView::State(_)) && order == Some(now.order.as_str());
            now.driven.note(number, message);
        }
    }

    /// The pictures of the orders during which something was found, the first order first.
    pub fn finish(self, sides: &[SideResult]) -> Vec<CoursePicture> {
        let all = self.kept.into_iter().chain(self.before).chain(self.now);
        let pictures = all.filter_map(|followed| {
            let found = sides.iter().flat_map(|side| &side.findings);
            let mut found: Vec<_> = found.filter(|one| followed.messages.contains(&one.message)).collect();
            if found.is_empty() {
                return None;
            }
            // A stable order: of two equal verdicts the first stays the first.
            found.sort_by_key(|one| std::cmp::Reverse(one.verdict));
            let findings = found.into_iter().map(|one| {
                let text = format!("{} {}: {}", one.requirement, one.verdict.word(), one.text);
                Finding {
                    number: one.message,
                    what: short(&line(&text), SENTENCE).into_owned(),
                }
            });
            followed.driven.picture(&findings.collect::<Vec<_>>())
        });
        pictures.take(ORDERS).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use std::collections::BTreeSet;
    use tck_base::verdict::Verdict;
    use tck_pack::Role;
    use tck_view::{Names, Topic};

    use super::super::result::FindingResult;

    fn state(order: &str, x: u32) -> MessageView {
        let state = json!({ "orderId": order, "driving": true,
            "agvPosition": { "x": x, "y": 0, "theta": 0, "mapId": "hall", "positionInitialized": true } });
        MessageView::of_value(Topic::State, &state, &Names::default())
    }

    fn side(messages: &[u64]) -> SideResult {
        let findings = messages.iter().map(|message| FindingResult {
            monitor: "m".to_owned(),
            requirement: "STATE-12".to_owned(),
            verdict: Verdict::Fail,
            count: 1,
            message: *message,
            recording: None,
            line: None,
            first: String::new(),
            last: String::new(),
            text: "odd".to_owned(),
            shown: None,
            interpretation: None,
        });
        SideResult::new(Role::Agv, 1, 1, findings.collect(), BTreeSet::new(), Vec::new())
    }

    /// A vehicle of many orders, ten states each, with something found at each of these messages.
    fn pictures(orders: u64, found: &[u64]) -> Vec<CoursePicture> {
        let mut courses = Courses::default();
        for order in 0..orders {
            for step in 0..10_u32 {
                let message = state(&format!("order {order}"), step);
                let number = order * 10 + u64::from(step);
                // What was found is told a little later.
                courses.note(number, &message, |span| {
                    found.iter().any(|at| span.contains(at) && at + 2 < number)
                });
            }
        }
        courses.finish(&[side(found)])
    }

    #[test]
    fn orders_of_which_something_was_found_are_drawn_and_no_others() {
        let drawn = pictures(6, &[9, 42]);
        let places: Vec<_> = drawn.iter().map(|picture| picture.found[0].place).collect();
        assert_eq!(places, [Some((9.0, 0.0)), Some((2.0, 0.0))]);
        assert_eq!(drawn[0].trail.len(), 10);
        assert_eq!(pictures(6, &[]), []);
    }

    #[test]
    fn a_vehicle_of_many_orders_keeps_a_few() {
        let found: Vec<u64> = (0..10_000).collect();
        assert_eq!(pictures(1_000, &found).len(), ORDERS);
    }

    #[test]
    fn an_order_that_is_refused_ends_no_picture() {
        let mut courses = Courses::default();
        let found = |span: &RangeInclusive<u64>| span.contains(&8);
        let order = |id: &str| {
            let order = json!({ "orderId": id, "orderUpdateId": 0, "nodes": [], "edges": [] });
            MessageView::of_value(Topic::Order, &order, &Names::default())
        };
        courses.note(1, &order("a"), found);
        courses.note(2, &state("a", 0), found);
        for (number, refused) in [(3, "b"), (5, "c"), (7, "d")] {
            courses.note(number, &order(refused), found);
            courses.note(number + 1, &state("a", u32::try_from(number).expect("small")), found);
        }
        courses.note(9, &state("a", 9), found);
        let drawn = courses.finish(&[side(&[8])]);
        assert_eq!(drawn.len(), 1);
        assert_eq!(
            (drawn[0].order.as_str(), drawn[0].found[0].place),
            ("a", Some((7.0, 0.0)))
        );
        assert_eq!(drawn[0].trail.first(), Some(&(0.0, 0.0)));
    }

    #[test]
    fn a_state_that_comes_late_belongs_to_the_order_before() {
        let mut courses = Courses::default();
        let none = |_: &RangeInclusive<u64>| false;
        courses.note(1, &state("a", 0), none);
        courses.note(2, &state("b", 1), none);
        courses.note(3, &state("a", 7), none);
        courses.note(4, &state("b", 2), none);
        let drawn = courses.finish(&[side(&[4])]);
        assert_eq!(drawn.len(), 1);
        assert_eq!(drawn[0].trail, [(1.0, 0.0), (2.0, 0.0)]);
    }
}
