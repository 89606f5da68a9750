//! A case of a table of which a run takes some.

use tck_pack::Way;

/// One of many cases, of which a run takes some.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Drawn {
    /// Where it comes from.
    pub kind: Kind,
    /// How many cases of the table a run takes.
    pub draw: usize,
}

/// Where a case comes from. A run spreads what it takes evenly over the kinds of a table.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A schema: the topic it is of, and how a member is broken.
    Schema(String, Way),
    /// A matrix: the row of its first axis.
    Column(String),
}

impl Drawn {
    /// What its table is made from, for people.
    #[must_use]
    pub fn origin(&self) -> String {
        match &self.kind {
            Kind::Schema(topic, _) => format!("[member-way] from the schema of {topic}"),
            Kind::Column(_) => "of a matrix".to_owned(),
        }
    }
}
