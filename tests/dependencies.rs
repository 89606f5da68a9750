//! The dependencies of the program keep to `deny.toml`: their licences, where they come from, and that none is there
//! twice without a reason. What is known against them (advisories) is looked up by `cargo deny` where it can be had.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on has failed")]

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use serde_json::Value;

/// Where all of them come from.
const REGISTRY: &str = "registry+https://github.com/rust-lang/crates.io-index";

struct Package {
    name: String,
    version: String,
    licence: Option<String>,
    source: Option<String>,
}

fn packages() -> Vec<Package> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--all-features"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let all: Value = serde_json::from_slice(&output.stdout).unwrap();
    let text = |value: &Value| value.as_str().map(str::to_owned);
    let read = |package: &Value| Package {
        name: text(&package["name"]).unwrap(),
        version: text(&package["version"]).unwrap(),
        licence: text(&package["license"]),
        source: text(&package["source"]),
    };
    all["packages"].as_array().unwrap().iter().map(read).collect()
}

fn policy() -> toml::Table {
    include_str!("../deny.toml").parse().unwrap()
}

fn names(list: &toml::Value, member: Option<&str>) -> BTreeSet<String> {
    let items = list.as_array().unwrap().iter();
    items
        .map(|item| member.map_or(item, |member| &item[member]).as_str().unwrap().to_owned())
        .collect()
}

/// Whether a licence expression is satisfied by what is allowed. `/` is how older packages write OR.
fn is_allowed(expression: &str, allowed: &BTreeSet<String>) -> bool {
    let plain = expression.replace('/', " OR ").replace(['(', ')'], " ");
    let alternatives = |part: &str| part.split(" OR ").any(|one| allowed.contains(one.trim()));
    if expression.contains('(') {
        // (A OR B) AND C
        return plain.split(" AND ").all(alternatives);
    }
    plain
        .split(" OR ")
        .any(|part| part.split(" AND ").all(|one| allowed.contains(one.trim())))
}

#[test]
fn every_licence_is_allowed_and_every_source_known() {
    let policy = policy();
    let allowed = names(&policy["licenses"]["allow"], None);
    let packages = packages();
    assert!(packages.len() > 100, "only {} packages", packages.len());
    for package in &packages {
        let of = format!("{} {}", package.name, package.version);
        let licence = package
            .licence
            .as_deref()
            .unwrap_or_else(|| panic!("{of} has no licence"));
        assert!(is_allowed(licence, &allowed), "{of}: {licence}");
        let is_own = package.name == env!("CARGO_PKG_NAME") || package.name.starts_with("tck-");
        assert!(
            (is_own && package.source.is_none()) || package.source.as_deref() == Some(REGISTRY),
            "{of} comes from elsewhere"
        );
    }
}

#[test]
fn none_is_there_twice_without_a_reason_and_every_reason_is_needed() {
    let skipped = names(&policy()["bans"]["skip"], Some("crate"));
    let mut versions: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for package in packages() {
        versions.entry(package.name).or_default().push(package.version);
    }
    versions.retain(|_, versions| versions.len() > 1);
    let is_version =
        |wanted: &str, version: &str| version.strip_prefix(wanted).is_some_and(|rest| rest.starts_with('.'));
    for (name, versions) in &versions {
        let open = versions.iter().filter(|version| {
            !skipped.iter().any(
                |skip| matches!(skip.split_once('@'), Some((of, wanted)) if of == name && is_version(wanted, version)),
            )
        });
        assert!(open.count() <= 1, "{name} is there as {}", versions.join(" and "));
    }
    for skip in &skipped {
        let (name, wanted) = skip.split_once('@').unwrap();
        let needed = versions
            .get(name)
            .is_some_and(|all| all.iter().any(|version| is_version(wanted, version)));
        assert!(needed, "{skip} is not there twice any more");
    }
}

/// The names of the packages that the library is compiled with, with these of its features only.
fn compiled_with(features: &str) -> BTreeSet<String> {
    let output = Command::new(env!("CARGO"))
        .args([
            "tree", "--locked", "--edges", "normal", "--prefix", "none", "--format", "{p}",
        ])
        .args([
            "--package",
            env!("CARGO_PKG_NAME"),
            "--no-default-features",
            "--features",
            features,
        ])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let names = String::from_utf8(output.stdout).unwrap();
    names
        .lines()
        .filter_map(|line| line.split(' ').next())
        .map(str::to_owned)
        .collect()
}

#[test]
fn a_feature_brings_what_it_needs_and_nothing_else_has_it() {
    let bare = compiled_with("");
    for (feature, brings) in [
        (
            "cli",
            &[
                "clap",
                "crossterm",
                "indicatif",
                "ratatui",
                "tck-explore",
                "tck-qualify",
            ][..],
        ),
        ("broker", &["mqtt5"]),
        ("tls", &["ring", "rustls", "tokio-rustls", "rustls-native-certs"]),
        (
            "captures",
            &["tck-audit", "tck-capture", "tck-watch", "etherparse", "pcap-parser"],
        ),
    ] {
        let with = compiled_with(feature);
        for package in brings {
            assert!(with.contains(*package), "{feature} lacks {package}");
            assert!(!bare.contains(*package), "without {feature} there is {package}");
        }
    }
}

#[test]
fn a_licence_expression_is_read_as_it_is_meant() {
    let allowed = BTreeSet::from(["MIT".to_owned(), "ISC".to_owned()]);
    for good in [
        "MIT",
        "GPL-3.0 OR MIT",
        "MIT/Apache-2.0",
        "MIT AND ISC",
        "(MIT OR GPL-3.0) AND ISC",
    ] {
        assert!(is_allowed(good, &allowed), "{good}");
    }
    for bad in [
        "GPL-3.0",
        "MIT AND GPL-3.0",
        "GPL-3.0/Apache-2.0",
        "(MIT OR ISC) AND GPL-3.0",
    ] {
        assert!(!is_allowed(bad, &allowed), "{bad}");
    }
}
