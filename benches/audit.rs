//! How fast recorded traffic is judged, part by part: reading lines, parsing JSON, the schema, and all monitors.
#![allow(
    missing_docs,
    clippy::unwrap_used,
    reason = "a benchmark that cannot go on has failed"
)]

use std::hint::black_box;
use std::io::Cursor;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use vda5050_tck::audit::{Audit, Options};
use vda5050_tck::capture::{Item, Lines, Mapping, Message};
use vda5050_tck::journal::Parsed;
use vda5050_tck::simulate::Site;

const MESSAGES: u64 = 4_000;

fn recording() -> String {
    let site = Site {
        seed: 1,
        vehicles: 20,
        messages: MESSAGES,
        faults: 0,
    };
    site.messages().map(|message| message.line() + "\n").collect()
}

fn read(text: &str) -> Vec<Message> {
    let mut lines = Lines::new(Box::new(Cursor::new(text.to_owned())), 0, Mapping::default());
    let mut all = Vec::new();
    while let Some(Item::Message(message)) = lines.read().unwrap() {
        all.push(message);
    }
    all
}

fn audit(criterion: &mut Criterion) {
    let library = vda5050_tck::library(None).unwrap();
    let text = recording();
    let messages = read(&text);
    assert_eq!(messages.len() as u64, MESSAGES);
    let mut group = criterion.benchmark_group("audit");
    group.sample_size(10).throughput(Throughput::Elements(MESSAGES));
    group.bench_function("read", |bencher| bencher.iter(|| read(black_box(&text))));
    group.bench_function("parse", |bencher| {
        bencher.iter(|| {
            for message in &messages {
                black_box(Parsed::of_bytes(&message.payload));
            }
        });
    });
    group.bench_function("schema", |bencher| {
        let schema = library.rules.packs.latest().schema("state").unwrap();
        let states = messages.iter().filter(|message| message.topic.ends_with("/state"));
        let states: Vec<_> = states
            .filter_map(|message| Parsed::of_bytes(&message.payload).value().cloned())
            .collect();
        bencher.iter(|| states.iter().map(|state| schema.findings(state).len()).sum::<usize>());
    });
    for (name, only) in [("single", "message/*"), ("monitors", "*")] {
        group.bench_function(name, |bencher| {
            let options = Options {
                only: vec![only.to_owned()],
                ..Options::default()
            };
            let begin = || (Audit::new(&library.rules, options.clone()).unwrap(), messages.clone());
            bencher.iter_batched(
                begin,
                |(mut audit, messages)| {
                    for message in messages {
                        audit.observe(message);
                    }
                    audit.finish(Vec::new())
                },
                BatchSize::LargeInput,
            );
        });
    }
    group.finish();
}

criterion_group!(benches, audit);
criterion_main!(benches);
