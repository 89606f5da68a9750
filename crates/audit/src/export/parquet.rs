//! Writes tables as Apache Parquet: one page for each column of a row group, plain values, packed with gzip.
//!
//! Every column may be empty in a row. That is all this program needs of the format, and far less than a library brings.

use std::io::{self, Write};

use flate2::Compression;
use flate2::write::GzEncoder;

/// How many rows are held until they are written, and how many bytes.
const ROWS: usize = 20_000;
const BYTES: usize = 16 << 20;
const MAGIC: &[u8] = b"PAR1";
/// Numbers of the format: plain values, levels in runs, packed with gzip.
const PLAIN: u64 = 0;
const RUNS: u64 = 3;
const GZIP: u64 = 2;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// True or false.
    Bool,
    /// A whole number.
    Int,
    /// A number.
    Float,
    /// Text.
    Text,
    /// Microseconds since 1970, in UTC.
    Time,
}

impl Kind {
    /// How it is stored: BOOLEAN, INT64, DOUBLE or `BYTE_ARRAY`.
    fn stored(self) -> u64 {
        match self {
            Self::Bool => 0,
            Self::Int | Self::Time => 2,
            Self::Float => 5,
            Self::Text => 6,
        }
    }

    /// What it means beyond that.
    fn meaning(self) -> Option<u64> {
        match self {
            Self::Text => Some(0),
            Self::Time => Some(10),
            _ => None,
        }
    }
}

/// One value of a row. What does not fit its column is written as nothing.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Nothing.
    None,
    /// True or false.
    Bool(bool),
    /// A whole number, or a time.
    Int(i64),
    /// A number.
    Float(f64),
    /// Text.
    Text(String),
}

/// The values of a column since the last row group.
#[derive(Default)]
struct Values {
    /// Which rows have one.
    present: Vec<bool>,
    bools: Vec<bool>,
    bytes: Vec<u8>,
}

impl Values {
    fn push(&mut self, kind: Kind, cell: &Cell) {
        let before = self.bytes.len() + self.bools.len();
        match (kind, cell) {
            (Kind::Bool, Cell::Bool(value)) => self.bools.push(*value),
            (Kind::Int | Kind::Time, Cell::Int(value)) => self.bytes.extend(value.to_le_bytes()),
            (Kind::Float, Cell::Float(value)) => self.bytes.extend(value.to_le_bytes()),
            (Kind::Text, Cell::Text(text)) => {
                if let Ok(length) = u32::try_from(text.len()) {
                    self.bytes.extend(length.to_le_bytes());
                    self.bytes.extend(text.as_bytes());
                }
            }
            _ => {}
        }
        self.present.push(self.bytes.len() + self.bools.len() > before);
    }

    /// Levels and values as a page has them.
    fn page(&self) -> Vec<u8> {
        let mut levels = Vec::new();
        for run in self.present.chunk_by(|one, other| one == other) {
            number(run.len() as u64 * 2, &mut levels);
            levels.push(u8::from(run[0]));
        }
        let mut page = u32::try_from(levels.len()).unwrap_or_default().to_le_bytes().to_vec();
        page.extend(levels);
        let byte = |bits: &[bool]| bits.iter().rev().fold(0, |byte, bit| byte << 1 | u8::from(*bit));
        page.extend(self.bools.chunks(8).map(byte));
        page.extend(&self.bytes);
        page
    }
}

/// A column of a row group that was written.
struct Chunk {
    offset: u64,
    whole: u64,
    packed: u64,
}

/// A row group that was written.
struct Group {
    rows: u64,
    chunks: Vec<Chunk>,
}

/// A table.
pub struct Table<W> {
    out: W,
    written: u64,
    columns: Vec<(String, Kind)>,
    values: Vec<Values>,
    held: usize,
    groups: Vec<Group>,
}

impl<W: Write> Table<W> {
    /// Begins a table of these columns.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn new(mut out: W, columns: impl IntoIterator<Item = (String, Kind)>) -> io::Result<Self> {
        out.write_all(MAGIC)?;
        let columns: Vec<_> = columns.into_iter().collect();
        Ok(Self {
            out,
            written: MAGIC.len() as u64,
            values: columns.iter().map(|_| Values::default()).collect(),
            columns,
            held: 0,
            groups: Vec::new(),
        })
    }

    /// Adds a row; columns without a cell are empty.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn row(&mut self, cells: &[Cell]) -> io::Result<()> {
        self.held += 1;
        let mut bytes = 0;
        for (at, ((_, kind), values)) in self.columns.iter().zip(&mut self.values).enumerate() {
            values.push(*kind, cells.get(at).unwrap_or(&Cell::None));
            bytes += values.bytes.len();
        }
        if self.held >= ROWS || bytes >= BYTES {
            self.flush()?;
        }
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        let rows = std::mem::take(&mut self.held);
        if rows == 0 {
            return Ok(());
        }
        let mut chunks = Vec::new();
        for values in &mut self.values {
            let page = std::mem::take(values).page();
            let mut packer = GzEncoder::new(Vec::new(), Compression::fast());
            packer.write_all(&page)?;
            let packed = packer.finish()?;
            let mut header = Struct::default();
            header.int(1, 0).int(2, page.len() as u64).int(3, packed.len() as u64);
            let mut of_page = Struct::default();
            of_page.int(1, rows as u64).int(2, PLAIN).int(3, RUNS).int(4, RUNS);
            header.inside(5, of_page);
            let header = header.end();
            self.out.write_all(&header)?;
            self.out.write_all(&packed)?;
            let length = |part: &[u8]| (header.len() + part.len()) as u64;
            chunks.push(Chunk {
                offset: self.written,
                whole: length(&page),
                packed: length(&packed),
            });
            self.written += length(&packed);
        }
        let rows = rows as u64;
        self.groups.push(Group { rows, chunks });
        Ok(())
    }

    /// The end: what the table consists of.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn finish(mut self) -> io::Result<W> {
        self.flush()?;
        let mut root = Struct::default();
        root.text(4, "table").int(5, self.columns.len() as u64);
        let mut schema = vec![root.end()];
        for (name, kind) in &self.columns {
            let mut column = Struct::default();
            column.int(1, kind.stored()).int(3, 1).text(4, name);
            if let Some(meaning) = kind.meaning() {
                column.int(6, meaning);
            }
            schema.push(column.end());
        }
        let groups = self.groups.iter().map(|group| self.group(group)).collect();
        let rows = self.groups.iter().map(|group| group.rows).sum();
        let mut footer = Struct::default();
        footer.int(1, 1).structs(2, schema).long(3, rows).structs(4, groups);
        footer.text(6, concat!("vda5050-tck ", env!("CARGO_PKG_VERSION")));
        let footer = footer.end();
        self.out.write_all(&footer)?;
        let length = u32::try_from(footer.len()).map_err(|_| io::Error::other("too many row groups"))?;
        self.out.write_all(&length.to_le_bytes())?;
        self.out.write_all(MAGIC)?;
        self.out.flush()?;
        Ok(self.out)
    }

    fn group(&self, group: &Group) -> Vec<u8> {
        let mut chunks = Vec::new();
        for ((name, kind), chunk) in self.columns.iter().zip(&group.chunks) {
            let mut about = Struct::default();
            about.int(1, kind.stored()).ints(2, &[PLAIN, RUNS]).texts(3, &[name]);
            about.int(4, GZIP).long(5, group.rows);
            about.long(6, chunk.whole).long(7, chunk.packed).long(9, chunk.offset);
            let mut outer = Struct::default();
            outer.long(2, chunk.offset).inside(3, about);
            chunks.push(outer.end());
        }
        let whole = group.chunks.iter().map(|chunk| chunk.whole).sum();
        let mut about = Struct::default();
        about.structs(1, chunks).long(2, whole).long(3, group.rows);
        about.end()
    }
}

/// A number in groups of seven bits.
fn number(mut value: u64, out: &mut Vec<u8>) {
    while value >= 0x80 {
        out.push(value.to_le_bytes()[0] | 0x80);
        value >>= 7;
    }
    out.push(value.to_le_bytes()[0]);
}

/// A structure in the compact form of Thrift, whose fields come in the order of their numbers.
#[derive(Default)]
struct Struct {
    bytes: Vec<u8>,
    last: u8,
}

impl Struct {
    const LONG: u8 = 6;
    const INT: u8 = 5;
    const TEXT: u8 = 8;
    const LIST: u8 = 9;
    const STRUCT: u8 = 12;

    fn field(&mut self, id: u8, kind: u8) -> &mut Vec<u8> {
        self.bytes.push((id - self.last) << 4 | kind);
        self.last = id;
        &mut self.bytes
    }

    /// A number of 64 bits; none of this file is negative.
    fn long(&mut self, id: u8, value: u64) -> &mut Self {
        number(value << 1, self.field(id, Self::LONG));
        self
    }

    /// A number of 32 bits.
    fn int(&mut self, id: u8, value: u64) -> &mut Self {
        number(value << 1, self.field(id, Self::INT));
        self
    }

    fn text(&mut self, id: u8, text: &str) -> &mut Self {
        let out = self.field(id, Self::TEXT);
        number(text.len() as u64, out);
        out.extend(text.as_bytes());
        self
    }

    fn inside(&mut self, id: u8, other: Self) -> &mut Self {
        let bytes = other.end();
        self.field(id, Self::STRUCT).extend(bytes);
        self
    }

    fn list(&mut self, id: u8, kind: u8, length: usize) -> &mut Vec<u8> {
        let out = self.field(id, Self::LIST);
        match u8::try_from(length) {
            Ok(length @ 0..15) => out.push(length << 4 | kind),
            _ => {
                out.push(0xf0 | kind);
                number(length as u64, out);
            }
        }
        out
    }

    fn ints(&mut self, id: u8, all: &[u64]) -> &mut Self {
        let out = self.list(id, Self::INT, all.len());
        for value in all {
            number(value << 1, out);
        }
        self
    }

    fn texts(&mut self, id: u8, all: &[&str]) -> &mut Self {
        let out = self.list(id, Self::TEXT, all.len());
        for text in all {
            number(text.len() as u64, out);
            out.extend(text.as_bytes());
        }
        self
    }

    fn structs(&mut self, id: u8, all: Vec<Vec<u8>>) -> &mut Self {
        let out = self.list(id, Self::STRUCT, all.len());
        out.extend(all.into_iter().flatten());
        self
    }

    fn end(mut self) -> Vec<u8> {
        self.bytes.push(0);
        self.bytes
    }
}

#[cfg(test)]
#[path = "parquet_tests.rs"]
pub(super) mod tests;
