//! Messages and findings as tables, for people who go on in their notebooks: a Parquet file for each topic name, and one of
//! findings.

mod columns;
mod parquet;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::Address;
use super::result::{AuditResult, FindingResult};
use columns::{AROUND, FINDING, HEADER, Member, PAYLOAD};
use parquet::{Cell, Kind, Table};
use tck_capture::Message;
use tck_journal::Parsed;
use tck_pack::Packs;
use tck_view::{Header, Names};

/// Messages and findings as tables, for people who go on in their notebooks: a Parquet file for each topic name, and
/// one of findings.
pub struct Export<'p> {
    packs: &'p Packs,
    folder: PathBuf,
    tables: BTreeMap<String, Table<BufWriter<File>>>,
}

impl<'p> Export<'p> {
    /// Tables in this folder; each message is read as one of the version it names.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn begin(folder: &Path, packs: &'p Packs) -> io::Result<Self> {
        std::fs::create_dir_all(folder)?;
        Ok(Self {
            packs,
            folder: folder.to_owned(),
            tables: BTreeMap::new(),
        })
    }

    fn table(&self, name: &str, columns: Vec<(String, Kind)>) -> io::Result<Table<BufWriter<File>>> {
        let file = File::create(self.folder.join(format!("{name}.parquet")))?;
        Table::new(BufWriter::new(file), columns)
    }

    /// Adds the message of that number.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn message(&mut self, number: u64, message: &Message, of: &Address) -> io::Result<()> {
        let members = columns::of(&of.name);
        if !self.tables.contains_key(&of.name) {
            let around = AROUND.iter().map(|(name, kind)| ((*name).to_owned(), *kind));
            let inside = HEADER.iter().chain(members);
            let inside = inside.map(|member| (member.name.to_owned(), member.kind));
            let payload = std::iter::once((PAYLOAD.0.to_owned(), PAYLOAD.1));
            let table = self.table(&of.name, around.chain(inside).chain(payload).collect())?;
            self.tables.insert(of.name.clone(), table);
        }
        let parsed = Parsed::of_bytes(&message.payload);
        let mut row = vec![
            whole(number),
            message.at.map_or(Cell::None, |at| Cell::Int(at.as_microsecond())),
            whole(message.place.file),
            whole(message.place.line),
            text(&message.topic),
            text(&of.manufacturer),
            text(&of.serial_number),
            message.qos.map_or(Cell::None, whole),
            message.retain.map_or(Cell::None, Cell::Bool),
        ];
        let inside = HEADER.iter().chain(members);
        let names = self.names(parsed.value());
        row.extend(inside.map(|member| cell(parsed.value(), member, names)));
        row.push(std::str::from_utf8(&message.payload).map_or(Cell::None, text));
        match self.tables.get_mut(&of.name) {
            Some(table) => table.row(&row),
            None => Ok(()),
        }
    }

    /// What members of a message are called.
    fn names(&self, message: Option<&Value>) -> &Names {
        let latest = self.packs.latest();
        let said = message.and_then(|message| latest.names().raw(message, &[Header::version])?.as_str());
        said.and_then(|version| self.packs.get(version))
            .unwrap_or(latest)
            .names()
    }

    /// Adds what was found, and ends all tables.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn finish(mut self, result: &AuditResult) -> io::Result<()> {
        let columns = FINDING.iter().map(|(name, kind)| ((*name).to_owned(), *kind));
        let mut findings = self.table("findings", columns.collect())?;
        for vehicle in &result.vehicles {
            for side in &vehicle.sides {
                for finding in side.findings.iter().chain(&side.information) {
                    let mut row = vec![
                        text(&vehicle.manufacturer),
                        text(&vehicle.serial_number),
                        vehicle.protocol.as_deref().map_or(Cell::None, text),
                        text(&side.role),
                    ];
                    row.extend(about(finding));
                    findings.row(&row)?;
                }
            }
        }
        findings.finish()?;
        for (_, table) in std::mem::take(&mut self.tables) {
            table.finish()?;
        }
        Ok(())
    }
}

fn about(finding: &FindingResult) -> [Cell; 11] {
    let time = |text: &str| {
        let time = text.parse::<jiff::Timestamp>();
        time.map_or(Cell::None, |time| Cell::Int(time.as_microsecond()))
    };
    [
        text(finding.verdict.word()),
        text(&finding.requirement),
        text(&finding.monitor),
        whole(finding.count),
        whole(finding.message),
        finding.recording.map_or(Cell::None, whole),
        finding.line.map_or(Cell::None, whole),
        time(&finding.first),
        time(&finding.last),
        text(&finding.text),
        finding.interpretation.as_deref().map_or(Cell::None, text),
    ]
}

/// A member as its column has it; nothing where the message has another type there.
fn cell(message: Option<&Value>, member: &Member, names: &Names) -> Cell {
    let value = message.and_then(|message| names.raw(message, member.path));
    match (value, member.kind) {
        (Some(Value::Array(list)), Kind::Int) => whole(list.len()),
        (Some(value), Kind::Int) => value.as_i64().map_or(Cell::None, Cell::Int),
        (Some(value), Kind::Float) => value.as_f64().map_or(Cell::None, Cell::Float),
        (Some(value), Kind::Bool) => value.as_bool().map_or(Cell::None, Cell::Bool),
        (Some(value), Kind::Text) => value.as_str().map_or(Cell::None, text),
        _ => Cell::None,
    }
}

fn text(text: &str) -> Cell {
    Cell::Text(text.to_owned())
}

fn whole(number: impl TryInto<i64>) -> Cell {
    number.try_into().map_or(Cell::None, Cell::Int)
}

#[cfg(test)]
mod tests {
    use super::super::{Audit, Options, tests::traffic};
    use super::*;
    use tck_pack::Role;

    #[test]
    fn every_topic_is_a_table_and_so_are_the_findings() {
        let library = tck_testing::library();
        let pack = library.rules.packs.latest();
        let messages = traffic(library, pack, Role::Agv, "order-acceptance/", &["horizon-not-reported"]);
        let folder = tempfile::tempdir().expect("folder");
        let mut export = Export::begin(folder.path(), &library.rules.packs).expect("begun");
        let mut audit = Audit::new(&library.rules, Options::default()).expect("options");
        let mut states = 0;
        for message in messages {
            let address = audit.address(&message.topic).expect("a vehicle");
            states += usize::from(address.name == "state");
            let number = audit.messages() + 1;
            export.message(number, &message, &address).expect("written");
            audit.observe(message);
        }
        let result = audit.finish(Vec::new());
        export.finish(&result).expect("finished");
        let table = |name: &str, kinds: &[Kind]| {
            let file = std::fs::read(folder.path().join(format!("{name}.parquet"))).expect("a table");
            parquet::tests::read(&file, kinds).1
        };
        let inside = HEADER.iter().chain(columns::of("state")).map(|member| member.kind);
        let kinds: Vec<Kind> = AROUND
            .iter()
            .map(|(_, kind)| *kind)
            .chain(inside)
            .chain([PAYLOAD.1])
            .collect();
        let state = table("state", &kinds);
        assert_eq!((state.len(), state[0].len()), (kinds.len(), states));
        for column in &state {
            let payload = &state[kinds.len() - 1];
            assert!(column.len() == states && payload.iter().all(|cell| matches!(cell, Cell::Text(_))));
        }
        let members = HEADER.iter().chain(columns::of("state"));
        let driving = members.take_while(|member| member.name != "driving").count() + AROUND.len();
        for is_driving in [true, false] {
            assert!(
                state[driving].contains(&Cell::Bool(is_driving)),
                "driving is never {is_driving}"
            );
        }
        let findings = table("findings", &FINDING.map(|(_, kind)| kind));
        assert!(findings[5].contains(&text("STATE-12")), "{:?}", findings[5]);
    }

    #[test]
    fn every_column_is_documented() {
        let text = include_str!("../../../../docs/audit.md");
        let topics = [
            "state",
            "visualization",
            "order",
            "instantActions",
            "connection",
            "factsheet",
        ];
        let inside = topics.iter().flat_map(|topic| columns::of(topic)).chain(HEADER);
        let around = AROUND.iter().chain(&FINDING).chain([&PAYLOAD]);
        let all = around.map(|(name, _)| *name).chain(inside.map(|member| member.name));
        let missing: Vec<&str> = all.filter(|name| !text.contains(&format!("`{name}`"))).collect();
        assert!(missing.is_empty(), "docs/audit.md lacks {missing:?}");
    }
}
