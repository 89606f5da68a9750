//! MQTT's rules without a network: subscriptions, QoS, retained messages, wills, sessions.

use std::collections::{BTreeMap, VecDeque};

use bytes::Bytes;

use crate::link::filter::covers;
use tck_base::device::Publication;

/// A client of the broker; the harness's own standing subscription is one of them.
pub(super) type Client = u64;

/// Messages kept for an absent client of a persistent session; older ones go first.
const QUEUE_LIMIT: usize = 10_000;

/// A message on its way to one client.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Delivery {
    pub(super) topic: String,
    pub(super) payload: Bytes,
    pub(super) qos: u8,
    pub(super) retain: bool,
}

/// What the broker made of a CONNECT.
pub(super) struct Accepted {
    pub(super) session_present: bool,
    /// The client whose connection was taken over.
    pub(super) displaced: Option<Client>,
    /// What was waiting for the client.
    pub(super) waiting: Vec<Delivery>,
}

#[derive(Default)]
struct Session {
    client_id: String,
    clean: bool,
    will: Option<Publication>,
    kept: Kept,
}

/// The part of a session that outlives a connection.
#[derive(Default)]
struct Kept {
    subscriptions: BTreeMap<String, u8>,
    waiting: VecDeque<Delivery>,
}

/// The broker.
#[derive(Default)]
pub(super) struct Broker {
    retained: BTreeMap<String, Publication>,
    present: BTreeMap<Client, Session>,
    absent: BTreeMap<String, Kept>,
}

impl Broker {
    /// Accepts a client. The will of a connection that is taken over is the caller's to publish, by
    /// [`Broker::leave`] of the displaced client.
    pub(super) fn accept(
        &mut self,
        client: Client,
        client_id: &str,
        clean: bool,
        will: Option<Publication>,
    ) -> Accepted {
        let displaced = (self.present.iter())
            .find(|(_, session)| session.client_id == client_id)
            .map(|(client, _)| *client);
        let mut kept = self.absent.remove(client_id);
        if let Some(session) = displaced.and_then(|displaced| self.present.get_mut(&displaced))
            && !session.clean
        {
            kept = Some(std::mem::take(&mut session.kept));
            session.clean = true;
        }
        let kept = kept.filter(|_| !clean);
        let session_present = kept.is_some();
        let mut kept = kept.unwrap_or_default();
        let waiting = kept.waiting.drain(..).collect();
        let client_id = client_id.to_owned();
        self.present.insert(
            client,
            Session {
                client_id,
                clean,
                will,
                kept,
            },
        );
        Accepted {
            session_present,
            displaced,
            waiting,
        }
    }

    /// Subscribes; returns the stored messages the new subscriptions bring, with RETAIN set.
    pub(super) fn subscribe(&mut self, client: Client, filters: &[(String, u8)]) -> Vec<Delivery> {
        let Some(session) = self.present.get_mut(&client) else {
            return Vec::new();
        };
        let mut stored = Vec::new();
        for (filter, qos) in filters {
            session.kept.subscriptions.insert(filter.clone(), *qos);
            stored.extend(stored_for(&self.retained, filter, *qos));
        }
        stored
    }

    /// What a fresh subscriber with QoS 2 receives.
    pub(super) fn stored(&self, filter: &str) -> Vec<Delivery> {
        stored_for(&self.retained, filter, 2).collect()
    }

    /// Takes a message in; returns who gets it. Live deliveries never have RETAIN set.
    pub(super) fn publish(&mut self, message: Publication) -> Vec<(Client, Delivery)> {
        let mut deliveries = Vec::new();
        for (client, session) in &self.present {
            if let Some(delivery) = live(&session.kept.subscriptions, &message) {
                deliveries.push((*client, delivery));
            }
        }
        for kept in self.absent.values_mut() {
            if let Some(delivery) = live(&kept.subscriptions, &message)
                && delivery.qos > 0
            {
                if kept.waiting.len() == QUEUE_LIMIT {
                    kept.waiting.pop_front();
                }
                kept.waiting.push_back(delivery);
            }
        }
        if message.retain {
            if message.payload.is_empty() {
                self.retained.remove(&message.topic);
            } else {
                self.retained.insert(message.topic.clone(), message);
            }
        }
        deliveries
    }

    /// The last will of a client.
    pub(super) fn will_of(&self, client: Client) -> Option<&Publication> {
        self.present.get(&client)?.will.as_ref()
    }

    /// A client goes. Its will is published unless it said DISCONNECT; returns who gets it.
    pub(super) fn leave(&mut self, client: Client, orderly: bool) -> Vec<(Client, Delivery)> {
        let Some(session) = self.present.remove(&client) else {
            return Vec::new();
        };
        if !session.clean {
            self.absent.insert(session.client_id, session.kept);
        }
        match session.will {
            Some(will) if !orderly => self.publish(will),
            _ => Vec::new(),
        }
    }
}

fn stored_for(retained: &BTreeMap<String, Publication>, filter: &str, qos: u8) -> impl Iterator<Item = Delivery> {
    retained
        .values()
        .filter(|message| covers(filter, &message.topic))
        .map(move |message| Delivery {
            topic: message.topic.clone(),
            payload: message.payload.clone(),
            qos: message.qos.min(qos),
            retain: true,
        })
}

fn live(subscriptions: &BTreeMap<String, u8>, message: &Publication) -> Option<Delivery> {
    let granted = subscriptions
        .iter()
        .filter(|(filter, _)| covers(filter, &message.topic))
        .map(|(_, qos)| *qos)
        .max()?;
    Some(Delivery {
        topic: message.topic.clone(),
        payload: message.payload.clone(),
        qos: message.qos.min(granted),
        retain: false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(topic: &str, text: &str, qos: u8, retain: bool) -> Publication {
        Publication {
            topic: topic.to_owned(),
            payload: Bytes::copy_from_slice(text.as_bytes()),
            qos,
            retain,
        }
    }

    fn subscriber(broker: &mut Broker, client: Client, filter: &str, qos: u8) {
        broker.accept(client, &client.to_string(), true, None);
        broker.subscribe(client, &[(filter.to_owned(), qos)]);
    }

    #[test]
    fn a_delivery_has_the_smaller_of_both_qos() {
        for (published, subscribed, delivered) in [(0, 2, 0), (1, 2, 1), (2, 2, 2), (2, 0, 0), (1, 0, 0), (2, 1, 1)] {
            let mut broker = Broker::default();
            subscriber(&mut broker, 1, "t", subscribed);
            assert_eq!(broker.publish(message("t", "x", published, false))[0].1.qos, delivered);
        }
    }

    #[test]
    fn a_live_delivery_of_a_retained_message_has_no_retain_flag() {
        let mut broker = Broker::default();
        subscriber(&mut broker, 1, "t", 2);
        assert!(!broker.publish(message("t", "x", 1, true))[0].1.retain);
    }

    #[test]
    fn a_fresh_subscriber_gets_the_last_retained_message_with_the_flag() {
        let mut broker = Broker::default();
        broker.publish(message("t", "old", 1, true));
        broker.publish(message("t", "new", 1, true));
        broker.publish(message("t", "not retained", 1, false));
        let stored = broker.stored("t");
        assert_eq!(stored.len(), 1);
        assert_eq!(
            (&stored[0].payload[..], stored[0].retain, stored[0].qos),
            (&b"new"[..], true, 1)
        );
    }

    #[test]
    fn an_empty_retained_message_clears_the_store_and_is_still_delivered() {
        let mut broker = Broker::default();
        broker.publish(message("t", "x", 1, true));
        subscriber(&mut broker, 1, "t", 2);
        assert_eq!(broker.publish(message("t", "", 1, true)).len(), 1);
        assert!(broker.stored("t").is_empty());
    }

    #[test]
    fn the_will_comes_after_a_loss_and_not_after_disconnect() {
        for (orderly, wills) in [(false, 1), (true, 0)] {
            let mut broker = Broker::default();
            subscriber(&mut broker, 1, "will", 2);
            broker.accept(2, "device", true, Some(message("will", "gone", 1, true)));
            assert_eq!(broker.leave(2, orderly).len(), wills);
            assert_eq!(broker.stored("will").len(), wills);
        }
    }

    #[test]
    fn a_persistent_session_keeps_subscriptions_and_messages_above_qos_0() {
        let mut broker = Broker::default();
        broker.accept(1, "device", false, None);
        broker.subscribe(1, &[("t".to_owned(), 1)]);
        broker.leave(1, true);
        broker.publish(message("t", "lost", 0, false));
        broker.publish(message("t", "kept", 1, false));
        let accepted = broker.accept(2, "device", false, None);
        assert!(accepted.session_present);
        assert_eq!(accepted.waiting.len(), 1);
        assert_eq!(broker.publish(message("t", "live", 1, false)).len(), 1);
    }

    #[test]
    fn a_clean_session_forgets_what_was_kept() {
        let mut broker = Broker::default();
        broker.accept(1, "device", false, None);
        broker.subscribe(1, &[("t".to_owned(), 1)]);
        broker.leave(1, true);
        assert!(!broker.accept(2, "device", true, None).session_present);
        assert!(broker.publish(message("t", "x", 1, false)).is_empty());
    }

    #[test]
    fn a_second_connection_with_the_same_client_id_displaces_the_first() {
        let mut broker = Broker::default();
        subscriber(&mut broker, 9, "will", 2);
        broker.accept(1, "device", true, Some(message("will", "gone", 1, false)));
        assert_eq!(broker.accept(2, "device", true, None).displaced, Some(1));
        assert_eq!(broker.leave(1, false).len(), 1);
    }
}
