//! Deviations of what is said to requests of vehicles (sections 6.4.3, 6.6.10 and 6.9).

use super::prelude::*;

records! {
    fault "requests-unanswered" ["REQ-03"] "It answers no request."
        => deciding(|_, _, _, _| None);
    fault "zone-requests-unanswered" ["REQ-03"] "It answers requests for corridors only."
        => deciding(|_, _, claim, usual| usual.filter(|_| !is_zone(claim)));
    fault "corridor-requests-unanswered" ["REQ-03", "CORR-21"] "It answers requests for zones only."
        => deciding(|_, _, claim, usual| usual.filter(|_| is_zone(claim)));
    fault "later-requests-unanswered" ["REQ-03", "CORR-21"] "Of several requests of a vehicle it answers the first one."
        => deciding(|site, vehicle, claim, usual| {
            let name = vehicle.name();
            let others = site.claims.all.iter().filter(|other| other.whose == name && other.id != claim.id);
            usual.filter(|_| others.into_iter().all(|other| other.said.is_none()))
        });
    fault "later-vehicle-never-answered" ["REQ-03"] "It says nothing to a vehicle that asks for a zone which another one has, then and later."
        => fleet::<BTreeSet<String>>().decides(|unheard, site, vehicle, claim, usual| {
            let key = format!("{} {}", vehicle.name(), claim.id);
            let held = site.claims.all.iter().any(|other| other.whose != claim.whose && is_zone(other) && other.holds());
            if is_zone(claim) && claim.said.is_none() && held && usual == Some(Grant::Queued) { unheard.insert(key.clone()); }
            usual.filter(|_| !unheard.contains(&key))
        });
    fault "requests-of-the-first-vehicle-only" ["REQ-03"] "It answers requests of the first vehicle of its fleet only."
        => deciding(|site, vehicle, _, usual| {
            let first = site.config.vehicles.first().map(|first| &first.serial_number);
            usual.filter(|_| first == Some(&vehicle.config.serial_number))
        });
    fault "asked-again-unanswered" ["REQ-03"] "It answers the first request of a vehicle for a zone, and no later one for the same zone."
        => keep::<BTreeMap<String, String>>().decides(|known, _, _, claim, usual| {
            let Wish::Zone { zone_id, .. } = &claim.wish else { return usual };
            let first = known.entry(zone_id.clone()).or_insert_with(|| claim.id.clone());
            usual.filter(|_| *first == claim.id)
        });
    fault "requests-unanswered-after-return" ["REQ-03"] "It answers no request of a vehicle that has come ONLINE again."
        => keep::<bool>().happens(|back, _, _, event| if let Event::Online(Presence::Away) = event { *back = true; })
            .decides(|back, _, _, _, usual| usual.filter(|_| !*back));
    fault "requests-unanswered-after-a-cut" ["REQ-03"] "It answers no request any more once its own connection was lost."
        => keep::<bool>().happens(|cut, _, _, event| if let Event::Connected(true) = event { *cut = true; })
            .decides(|cut, _, _, _, usual| usual.filter(|_| !*cut));
    fault "responses-to-the-first-vehicle" ["REQ-03"] "It publishes responses to any vehicle on the topic of the first vehicle of its fleet."
        => sending(|site, _, out| if out.name == "responses" {
            let first = site.config.vehicles.first().and_then(|first| first.topics.get("responses"));
            first.into_iter().for_each(|topic| out.topic.clone_from(topic));
        });
    fault "answers-to-whoever-has-the-zone" ["REQ-18", "REQ-03"]
        "What it says to a vehicle that asks for a zone which another one has it publishes on the topic of that other vehicle."
        => sending(|site, vehicle, out| if out.name == "responses" {
            let (name, all) = (vehicle.name(), &site.claims.all);
            let answers = out.message.get("responses").and_then(Value::as_array);
            let answered = |claim: &&Claim| claim.whose == name && answers.into_iter().flatten().any(|answer| answer["requestId"] == claim.id);
            let has = |claim: &Claim| all.iter().find(|other| other.whose != name && other.holds() && site.same_zone(claim, other));
            let holder = all.iter().filter(answered).find_map(has);
            let known = holder.and_then(|holder| site.config.vehicles.iter().find(|one| holder.whose.ends_with(&format!("/{}", one.serial_number))));
            let topic = known.and_then(|one| one.topics.get("responses")).cloned();
            topic.into_iter().for_each(|topic| out.topic = topic);
        });
    fault "requests-from-before-the-start-unanswered" ["REQ-03"]
        "It answers only what vehicles begin to ask for while it runs, and nothing that the first state after its start asks for already."
        => keep::<Start>().happens(|start, site, vehicle, event| match event {
            Event::Connected(_) => {
                // A link that broke is none.
                start.fresh |= start.losses == site.connection.losses;
                start.losses = site.connection.losses;
            }
            Event::State(_) if std::mem::take(&mut start.fresh) => {
                let asked = vehicle.state.iter().flat_map(|state| state.requests()).filter(|one| one.request_status == "REQUESTED");
                start.old = asked.map(|one| one.request_id.clone()).collect();
            }
            _ => {}
        }).decides(|start, _, _, claim, usual| usual.filter(|_| claim.said.is_some() || !start.old.contains(&claim.id)));
    fault "answers-under-the-first-id" ["REQ-03", "REQ-04"] "It answers every request of a vehicle under the requestId of the first one."
        => keep::<Option<String>>().sends(|first, _, _, outgoing| {
            outgoing.message.each("responses", |answer| {
                let id = first.get_or_insert_with(|| answer.text("requestId").to_owned()).clone();
                answer.set("requestId", id);
            });
            true
        });
    fault "queued-for-ever" ["REQ-03"] "A request that it has queued it never grants."
        because "To be queued is an answer, and no time is given for the next one."
        => deciding(|_, _, claim, usual| usual.map(|grant| if claim.said == Some(Grant::Queued) { Grant::Queued } else { grant }));
    fault "zone-never-free-again" ["REQ-03", "ZREQ-18"] "A zone that was granted once stays occupied, also when the vehicle has given it back."
        because "Who waits for it has been answered, and no time is given for the next answer."
        => fleet::<BTreeMap<String, String>>().decides(|taken, _, vehicle, claim, usual| {
            let Wish::Zone { zone_id, .. } = &claim.wish else { return usual };
            let name = vehicle.name();
            if usual == Some(Grant::Granted) && claim.said != Some(Grant::Granted) {
                let whose = taken.entry(zone_id.clone()).or_insert_with(|| name.clone());
                if *whose != name { return Some(Grant::Queued); }
            }
            usual
        });
    fault "response-type-for-grant-type" ["REQ-04"] "It calls the grantType of a response responseType."
        => response(|answer| answer.rename("grantType", "responseType"));
    fault "grant-type-in-other-words" ["REQ-04"] "It answers with ACCEPTED where it grants something."
        => response(|answer| if answer.says("grantType", "GRANTED") { answer.set("grantType", "ACCEPTED") });
    fault "response-without-a-list" ["REQ-04"] "A message with one response has it in the place of the list."
        => responses(|m| m.change("responses", |list| if let Some(first) = list.get(0).cloned() { *list = first }));
    fault "response-without-id" ["REQ-04"] "Responses do not say which request they answer."
        => response(|answer| answer.unset("requestId"));
    fault "two-answers-to-one-request" ["REQ-04"] "The message that grants something also says that the request is queued."
        => responses(|m| {
            let granted = m.list("responses").iter().find(|answer| answer["grantType"] == "GRANTED").map(|answer| answer["requestId"].clone());
            if let Some(id) = granted { m.add("responses", json!({ "requestId": id, "grantType": "QUEUED" })) }
        });
    fault "lease-of-what-is-not-granted" ["REQ-05"] "It says until when a request is valid that is queued or rejected."
        => response(|answer| if answer.says("grantType", "QUEUED") || answer.says("grantType", "REJECTED") { answer.set("leaseExpiry", "2099-01-01T00:00:00.000Z") });
    fault "lease-in-seconds" ["REQ-05"] "leaseExpiry is a number of seconds."
        => response(|answer| answer.change("leaseExpiry", |end| *end = json!(20)));
    fault "lease-in-local-time" ["REQ-05"] "leaseExpiry is in local time, two hours ahead, and says so."
        => response(|answer| answer.change("leaseExpiry", |end| *end = json!(end.as_str().unwrap_or_default().replace('Z', "+02:00"))));
    fault "lease-without-zone" ["REQ-05", "HDR-03"] "leaseExpiry is in local time, two hours ahead, without Z and without offset."
        => response(|answer| answer.change("leaseExpiry", |end| {
            let utc = end.as_str().and_then(|text| text.parse::<jiff::Timestamp>().ok());
            let local = utc.and_then(|utc| utc.checked_add(jiff::SignedDuration::from_hours(2)).ok());
            if let Some(local) = local { *end = json!(format!("{local:.0}").replace('Z', "")); }
        }));
    fault "lease-already-over" ["REQ-05"] "The lease of a grant has ended an hour before it comes."
        because "A time that has passed is a warning by the catalogue."
        => holding(()).sends(|(), site, _, outgoing| {
            let over = site.now.utc.checked_sub(jiff::SignedDuration::from_hours(1)).unwrap_or(site.now.utc);
            outgoing.message.each("responses", |answer| answer.change("leaseExpiry", |end| *end = json!(format!("{over:.3}"))));
            true
        });
    fault "lease-prolonged-under-another-id" ["REQ-11"] "It prolongs a lease by a response with a requestId of its own." because "To prolong a lease is a permission, so that what is said about it is remarked on."
        => fleet::<BTreeSet<String>>().sends(|granted, _, _, outgoing| {
            outgoing.message.each("responses", |answer| {
                let id = answer.text("requestId").to_owned();
                if answer.says("grantType", "GRANTED") && !granted.insert(id.clone()) {
                    answer.set("requestId", format!("{id}-again"));
                }
            });
            true
        });
    fault "responses-nobody-asked-for" ["REQ-18"] "It grants a vehicle the way with each new order, before the vehicle asks for anything."
        because "That a response comes unasked is a warning by the catalogue."
        => begun(|site, vehicle| site.publish(vehicle, "responses", &json!({ "responses": [{ "requestId": "way-1", "grantType": "GRANTED" }] })));
    fault "corridors-of-the-horizon-granted" ["CORR-22"] "It grants corridors of edges that are not released."
        => deciding(|_, _, claim, usual| match usual {
            Some(Grant::Queued) if !is_zone(claim) => Some(Grant::Granted),
            usual => usual,
        });
    fault "revoked-zone-given-away" ["ZREQ-17"] "It gives a zone to the next vehicle as soon as it has revoked it from the one before."
        => allowing(|_, what, usual| match what {
            Permission::Occupied(claim) => usual && claim.said != Some(Grant::Revoked),
            _ => usual,
        });
    fault "zone-given-twice" ["ZREQ-18"] "It gives a zone to two vehicles at a time."
        because "That a zone is used by one vehicle at a time is not demanded; the catalogue makes it a warning."
        => forbidding(|_, _, what| matches!(what, Permission::Occupied(_)));
    fault "zone-free-a-minute-after-its-grant" ["ZREQ-18"]
        "It gives a zone to the next vehicle a minute after it was granted, also while the first one still shows the grant."
        because "That a zone is used by one vehicle at a time is not demanded; the catalogue makes it a warning."
        => fleet::<BTreeMap<String, Moment>>().decides(|given, _, _, claim, usual| {
            if claim.said == Some(Grant::Granted) { given.entry(key(claim)).or_insert(claim.said_at); } else { given.remove(&key(claim)); }
            usual
        }).allows(|given, site, _, what, usual| match what {
            Permission::Occupied(claim) => usual && given.get(&key(claim)).is_none_or(|at| *at + Duration::from_secs(60) > site.now.moment),
            _ => usual,
        });
    fault "base-extended-outside-the-corridor" ["CORR-23"] "It extends the base of a vehicle that stands outside its corridor."
        because "The catalogue records what a fleet control does then, and makes this a warning."
        => letting(|_, _, what| matches!(what, Permission::Extend(_)));
    tolerance "grants-for-good" ["REQ-05", "REQ-11"] "Its grants have no end."
        => plain().lasts(|(), _, _, what, usual| if matches!(what, Span::Lease) { Duration::ZERO } else { usual });
    tolerance "grants-never-prolonged" ["REQ-11"] "It prolongs no grant."
        => forbidding(|_, _, what| matches!(what, Permission::Prolong));
    tolerance "rejects-then-grants" ["REQ-04", "REQ-03"] "It rejects the first request of a vehicle for a zone, and answers the next ones as usual."
        => keep::<BTreeMap<String, String>>().decides(|first, _, _, claim, usual| {
            let Wish::Zone { set_id, zone_id, .. } = &claim.wish else { return usual };
            let zone = format!("{set_id} {zone_id}");
            if claim.said.is_none() { first.entry(zone.clone()).or_insert_with(|| claim.id.clone()); }
            if first.get(&zone) == Some(&claim.id) { Some(Grant::Rejected) } else { usual }
        });
    tolerance "same-grant-up-to-three-times" ["REQ-03", "REQ-04", "MQTT-06"] "It sends a grant up to three times, unchanged, until the state shows it."
        => keep::<BTreeMap<String, (Value, u32)>>().sends(|given, site, vehicle, outgoing| {
            let name = vehicle.name();
            let Some(answers) = outgoing.message.get_mut("responses").and_then(Value::as_array_mut) else { return true };
            answers.retain_mut(|answer| {
                let id = answer["requestId"].as_str().unwrap_or_default().to_owned();
                let shown = site.claims.all.iter().any(|claim| claim.whose == name && claim.id == id && claim.shown == "GRANTED");
                if shown || answer["grantType"] != "GRANTED" { return true; }
                let (same, times) = given.entry(id).or_insert_with(|| (answer.clone(), 0));
                *times += 1;
                answer.clone_from(same);
                *times <= 3
            });
            let says = !answers.is_empty();
            if !says && let Some(next) = vehicle.header_ids.get_mut("responses") { *next = next.wrapping_sub(1); }
            says
        });
    tolerance "queued-before-granted" ["REQ-03", "REQ-04"] "Every request waits in a queue first, if only for a moment."
        => deciding(|_, vehicle, claim, usual| match (claim.said, usual) {
            (None, Some(Grant::Granted)) => {
                vehicle.at(Moment::START);
                Some(Grant::Queued)
            }
            _ => usual,
        });
    tolerance "granted-a-minute-and-a-half-later" ["REQ-03", "REQ-04"] "Every request is queued at once and granted 90 s later."
        => deciding(|site, vehicle, claim, usual| match (claim.said, usual) {
            (None, Some(Grant::Granted)) => {
                vehicle.at(site.now.moment + Duration::from_secs(90));
                Some(Grant::Queued)
            }
            (Some(Grant::Queued), Some(Grant::Granted)) => {
                let due = claim.said_at + Duration::from_secs(90);
                if due > site.now.moment { vehicle.at(due); }
                Some(if due > site.now.moment { Grant::Queued } else { Grant::Granted })
            }
            _ => usual,
        });
    tolerance "lease-of-15-s-prolonged-every-5-s" ["REQ-11", "REQ-05"] "It grants for 15 s and prolongs that every 5 s."
        => plain().lasts(|(), _, _, what, usual| if matches!(what, Span::Lease) { Duration::from_secs(10) } else { usual })
            .sends(|(), site, _, outgoing| {
                let until = site.now.utc.checked_add(Duration::from_secs(15)).unwrap_or(site.now.utc);
                outgoing.message.each("responses", |answer| answer.change("leaseExpiry", |end| *end = json!(format!("{until:.3}"))));
                true
            });
    tolerance "corridors-of-the-horizon-refused" ["CORR-22"] "It rejects requests for corridors of edges that are not released."
        => deciding(|_, _, claim, usual| match usual {
            Some(Grant::Queued) if !is_zone(claim) => Some(Grant::Rejected),
            usual => usual,
        });
}

type Deciding = fn(&Site, &mut Vehicle, &Claim, Option<Grant>) -> Option<Grant>;

/// Answers requests otherwise.
fn deciding(change: Deciding) -> Box<Hooks<Deciding>> {
    holding(change).decides(|change, site, vehicle, claim, usual| change(site, vehicle, claim, usual))
}

/// Whether a request is about a zone.
fn is_zone(claim: &Claim) -> bool {
    matches!(claim.wish, Wish::Zone { .. })
}

/// What is remembered of requests when it starts.
#[derive(Clone, Default)]
struct Start {
    /// How often the link broke so far.
    losses: u32,
    /// No state has come since it started.
    fresh: bool,
    /// What was asked for before.
    old: BTreeSet<String>,
}

/// Names a request among those of all vehicles.
fn key(claim: &Claim) -> String {
    format!("{} {}", claim.whose, claim.id)
}
