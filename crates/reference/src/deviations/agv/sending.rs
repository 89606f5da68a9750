//! Deviations of how messages are sent: topics, QoS and RETAIN, texts that are no JSON, and when states come
//! (sections 6.2, 6.3 and 6.10).

use crate::agv::Mode;

use super::prelude::*;

records! {
    fault "other-major-version" ["TOPIC-03", "TOPIC-02"] "Publishes its visualization below another major version." because "It breaks a recommendation only."
        => sending(|_, out| if out.name == "visualization" { out.topic = out.topic.replacen("/v", "/v1", 1) });
    fault "states-topic" ["TOPIC-01"] "Publishes its states on a topic called states."
        => sending(|_, out| if out.name == "state" { out.topic.push('s') });
    fault "misspelled-topic" ["TOPIC-01", "TOPIC-11"] "Publishes its factsheet on a topic spelled with an underscore."
        => sending(|_, out| if let Some(above) = out.topic.strip_suffix("factsheet") { out.topic = format!("{above}fact_sheet") });
    fault "visualization-spelled-british" ["TOPIC-01"] "It publishes its visualization on the topic visualisation."
        => sending(|_, out| if let Some(above) = out.topic.strip_suffix("visualization") { out.topic = format!("{above}visualisation") });
    fault "state-qos-1" ["MQTT-07"] "Publishes the state with QoS 1." because "A higher QoS delivers the state as well; the ruling of MQTT-06 and MQTT-07 is a warning."
        => sending(|_, out| if out.name == "state" { out.qos = 1 });
    fault "warned-state-qos-one" ["MQTT-07"] "States that hold an error are published with QoS 1."
        because "The ruling of MQTT-07 makes a higher quality of service a warning: a state with QoS 1 harms nobody."
        => sending(|agv, out| if out.name == "state" && !agv.errors.is_empty() { out.qos = 1 });
    fault "visualization-qos-one" ["MQTT-07"] "It publishes the visualization with QoS 1."
        because "The ruling of MQTT-07 makes a higher quality of service a warning: a visualization with QoS 1 harms nobody."
        => sending(|_, out| if out.name == "visualization" { out.qos = 1 });
    fault "factsheet-qos-2" ["MQTT-07"] "Publishes the factsheet with QoS 2." because "A higher QoS delivers the factsheet as well; the ruling of MQTT-06 and MQTT-07 is a warning."
        => sending(|_, out| if out.name == "factsheet" { out.qos = 2 });
    fault "factsheet-not-retained" ["FACT-01"] "Publishes the factsheet without the retain flag."
        => sending(|_, out| if out.name == "factsheet" { out.retain = false });
    fault "factsheet-answer-not-retained" ["FACT-01"] "It answers a factsheetRequest with a factsheet without the retain flag."
        => sending(|agv, out| if out.name == "factsheet" && agv.connection.factsheet_asked { out.retain = false });
    fault "no-factsheet" ["TOPIC-11", "ACT-40"] "Never publishes a factsheet."
        => unsaid(|_, name, _| name == "factsheet");
    fault "visualization-missing" ["VIS-02", "TOPIC-12"] "States a visualization interval and publishes none." because "It breaks a recommendation only."
        => unsaid(|_, name, _| name == "visualization");
    fault "visualization-only-moving" ["VIS-02"] "It publishes its visualization only while it moves, though the factsheet states an interval."
        because "The topic is optional, and VIS-02, the rate on it, is a recommendation."
        => unsaid(|agv, name, _| name == "visualization" && !agv.motion.is_moving());

    fault "nul-after-json" ["MQTT-02", "JSON-10", "STATE-02"] "Sends the terminating zero byte of its string with every periodic state."
        => plain().writes(|_, _, out, text| if out.periodic { text.push(0) });
    fault "latin-1-text" ["JSON-03", "STATE-02"] "Encodes the text of its periodic states in Latin-1."
        => sending(|_, out| if out.periodic {
            out.message.set("information", json!([{ "infoType": "place", "infoDescription": "Lagerpl@tz", "infoLevel": "INFO" }]));
        }).writes(|_, _, out, text| if out.periodic { replace(text, b"Lagerpl@tz", b"Lagerpl\xe4tz") });
    fault "refusal-text-latin-1" ["JSON-03", "MQTT-02"] "Encodes the description of the error of every order it refuses in Latin-1."
        => refusal(|_, _, _, error| {
            "Auftrag abgel@hnt".clone_into(&mut error.description);
            true
        }).writes(|_, _, _, text| replace(text, b"abgel@hnt", b"abgel\xe4hnt"));
    fault "nan-velocity" ["JSON-08", "MQTT-02", "STATE-02"] "Writes NaN as turning speed into its periodic states."
        => sending(|_, out| if out.periodic { out.message.set("velocity", json!({ "vx": 0.0, "vy": 0.0, "omega": "@" })) })
            .writes(|_, _, out, text| if out.periodic { replace(text, b"\"@\"", b"NaN") });
    fault "nan-as-text" ["JSON-08", "STATE-MSG-05"] "Writes the word NaN as turning speed into its periodic states."
        => sending(|_, out| if out.periodic { out.message.set("velocity", json!({ "vx": 0.0, "vy": 0.0, "omega": "NaN" })) });
    fault "duplicate-key" ["JSON-10"] "Repeats the key driving in its periodic states, with another value." because "JSON leaves open what a repeated key means; the check of JSON-10 remarks on it."
        => plain().writes(|_, agv, out, text| if out.periodic {
            let other: &[u8] = if agv.motion.is_moving() { b"{\"driving\":false," } else { b"{\"driving\":true," };
            replace(text, b"{", other);
        });
    fault "reach-unlimited" ["JSON-08", "MQTT-02", "STATE-MSG-15"] "While it charges it reports its reach as the overflowing number 1e999."
        => plain().writes(|_, agv, _, text| if agv.charging { replace(text, b"\"reach\":8000", b"\"reach\":1e999") });

    fault "state-silence" ["STATE-02"] "Sends states only every 45 seconds when nothing happens."
        => silent(|_| true);
    fault "silent-when-idle" ["STATE-02"] "Without an order it sends no state for 45 seconds."
        => silent(|agv| !agv.is_busy());
    fault "silent-while-held" ["STATE-02"] "Sends states only every 45 seconds while it waits for a release."
        => silent(|agv| agv.waits_at_decision_point());
    fault "silent-while-paused" ["STATE-02"] "Sends states only every 45 seconds while it is paused."
        => silent(|agv| agv.holds.pause);
    fault "silent-by-hand" ["STATE-02"] "Sends states only every 45 seconds in MANUAL."
        => silent(|agv| agv.mode == Mode::Manual);
    fault "silent-in-emergency" ["STATE-02"] "While the emergency stop is pressed no state comes for 45 s unless something changes."
        => silent(|agv| agv.holds.emergency);
    fault "silent-while-acting" ["STATE-02"] "Sends states only every 45 seconds while an action runs."
        => silent(|agv| agv.actions.iter().any(|action| action.of_order() && action.status.is_active()));
    fault "silent-after-reconnect" ["STATE-02"] "Sends no states for 35 seconds after it reconnected."
        => when(Event::Reporting, |agv| if agv.connection.sessions > 1 { agv.report.silent_until = Some(agv.moment() + Duration::from_secs(35)) });
    fault "state-interval-exceeded" ["STATE-02"] "Sends states less often than its factsheet says." because "The interval of the factsheet is no limit of the text; below 30 s a warning is all."
        => plain().lasts(|_, _, what, usual| match what {
            Span::BetweenStates => usual * 2 + Duration::from_secs(2),
            _ => usual,
        });
    fault "visualization-slow" ["VIS-02"] "Publishes the visualization at a third of the stated rate." because "It breaks a recommendation only."
        => plain().lasts(|_, _, what, usual| if matches!(what, Span::BetweenVisualizations) { usual * 3 } else { usual });
}
