//! A table that names a member no version has would never say anything: the tables of fields in the packs name members of their
//! version.

use std::collections::BTreeSet;

use serde_json::Value;

use super::REGISTRY;
use tck_check::find;
use tck_pack::{Assets, Catalogue, Packs};

fn members(of: &Value, all: &mut BTreeSet<String>) {
    match of {
        Value::Object(object) => {
            if let Some(properties) = object.get("properties").and_then(Value::as_object) {
                all.extend(properties.keys().cloned());
            }
            object.values().for_each(|value| members(value, all));
        }
        Value::Array(items) => items.iter().for_each(|value| members(value, all)),
        _ => {}
    }
}

#[test]
fn the_tables_of_fields_name_members_of_their_version_and_requirements_that_the_check_decides() {
    let packs = Packs::load(&Assets::of_source_tree().unwrap()).unwrap();
    let catalogue = Catalogue::load(&Assets::of_source_tree().unwrap()).unwrap();
    let check = find(REGISTRY, "message/schema").unwrap();
    for pack in packs.all() {
        let mut known = BTreeSet::new();
        for topic in pack.topics() {
            let path = format!("schemas/{}/{}.schema.json", pack.id, topic.name);
            let schema = Assets::of_source_tree().unwrap().get(&path).unwrap().text.clone();
            members(&serde_json::from_str(&schema).unwrap(), &mut known);
        }
        let mut lines = 0;
        for (names, requirement) in pack.fields() {
            lines += 1;
            for name in names {
                assert!(known.contains(name), "VDA 5050 {} has no `{name}`", pack.id);
            }
            if let Some(requirement) = requirement {
                assert!(catalogue.get(requirement).is_some(), "there is no {requirement}");
                assert!(check.decides.contains(&requirement), "{requirement} is not the check's");
            }
        }
        assert!(lines > 40, "VDA 5050 {} has only {lines} lines", pack.id);
    }
}
