//! Reads tables again, by the description of the format: what was written is what stands there.

use std::io::Read as _;

use flate2::read::GzDecoder;

use super::*;

/// A value in the compact form of Thrift.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Thrift {
    Number(u64),
    Text(String),
    List(Vec<Thrift>),
    Struct(Vec<(u8, Thrift)>),
}

impl Thrift {
    fn get(&self, id: u8) -> &Thrift {
        let Self::Struct(fields) = self else { panic!("{self:?}") };
        let found = fields.iter().find(|(own, _)| *own == id);
        &found.unwrap_or_else(|| panic!("no field {id} in {self:?}")).1
    }

    fn number(&self) -> u64 {
        let Self::Number(number) = self else { panic!("{self:?}") };
        *number
    }

    fn list(&self) -> &[Thrift] {
        let Self::List(list) = self else { panic!("{self:?}") };
        list
    }
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn byte(&mut self) -> u8 {
        let (first, rest) = self.0.split_first().expect("a byte");
        self.0 = rest;
        *first
    }

    fn digits(&mut self) -> u64 {
        let mut value = 0;
        for shift in (0..).step_by(7) {
            let byte = self.byte();
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                break;
            }
        }
        value
    }

    fn value(&mut self, kind: u8) -> Thrift {
        match kind {
            5 | 6 => {
                let digits = self.digits();
                assert_eq!(digits & 1, 0, "negative");
                Thrift::Number(digits >> 1)
            }
            8 => {
                let length = usize::try_from(self.digits()).expect("short");
                let (text, rest) = self.0.split_at(length);
                self.0 = rest;
                Thrift::Text(String::from_utf8(text.to_vec()).expect("text"))
            }
            9 => {
                let head = self.byte();
                let length = match head >> 4 {
                    15 => self.digits(),
                    length => u64::from(length),
                };
                Thrift::List((0..length).map(|_| self.value(head & 15)).collect())
            }
            12 => {
                let mut fields = Vec::new();
                let mut id = 0;
                loop {
                    let head = self.byte();
                    if head == 0 {
                        return Thrift::Struct(fields);
                    }
                    id += head >> 4;
                    fields.push((id, self.value(head & 15)));
                }
            }
            other => panic!("type {other}"),
        }
    }
}

/// Which of `rows` have a value, by the levels of a page; and the values behind them.
fn levels(page: &[u8], rows: usize) -> (Vec<bool>, &[u8]) {
    let length = u32::from_le_bytes(page[..4].try_into().expect("four")) as usize;
    let mut reader = Reader(&page[4..4 + length]);
    let mut present = Vec::new();
    while !reader.0.is_empty() {
        let run = usize::try_from(reader.digits() >> 1).expect("short");
        let value = reader.byte() == 1;
        present.extend(std::iter::repeat_n(value, run));
    }
    assert_eq!(present.len(), rows);
    (present, &page[4 + length..])
}

fn values(kind: Kind, page: &[u8], rows: usize) -> Vec<Cell> {
    let (present, mut rest) = levels(page, rows);
    let mut bit = 0;
    let mut take = |length: usize| {
        let (part, others) = rest.split_at(length);
        rest = others;
        part.to_vec()
    };
    let bits = if kind == Kind::Bool {
        take(present.iter().filter(|present| **present).count().div_ceil(8))
    } else {
        Vec::new()
    };
    let mut read = || match kind {
        Kind::Bool => {
            bit += 1;
            Cell::Bool(bits[(bit - 1) / 8] >> ((bit - 1) % 8) & 1 == 1)
        }
        Kind::Int | Kind::Time => Cell::Int(i64::from_le_bytes(take(8).try_into().expect("eight"))),
        Kind::Float => Cell::Float(f64::from_le_bytes(take(8).try_into().expect("eight"))),
        Kind::Text => {
            let length = u32::from_le_bytes(take(4).try_into().expect("four"));
            Cell::Text(String::from_utf8(take(length as usize)).expect("text"))
        }
    };
    let all = present
        .into_iter()
        .map(|present| if present { read() } else { Cell::None })
        .collect();
    assert!(rest.is_empty());
    all
}

/// The columns of a table.
pub(crate) fn read(file: &[u8], kinds: &[Kind]) -> (Thrift, Vec<Vec<Cell>>) {
    assert!(file.starts_with(MAGIC) && file.ends_with(MAGIC));
    let end = file.len() - 8;
    let length = u32::from_le_bytes(file[end..end + 4].try_into().expect("four")) as usize;
    let footer = Reader(&file[end - length..end]).value(12);
    let mut columns = vec![Vec::new(); kinds.len()];
    for group in footer.get(4).list() {
        let rows = usize::try_from(group.get(3).number()).expect("small");
        for ((chunk, kind), column) in group.get(1).list().iter().zip(kinds).zip(&mut columns) {
            let about = chunk.get(3);
            let at = usize::try_from(about.get(9).number()).expect("small");
            let size = usize::try_from(about.get(7).number()).expect("small");
            let mut reader = Reader(&file[at..at + size]);
            let header = reader.value(12);
            assert_eq!(reader.0.len() as u64, header.get(3).number());
            let mut page = Vec::new();
            GzDecoder::new(reader.0).read_to_end(&mut page).expect("gzip");
            assert_eq!(page.len() as u64, header.get(2).number());
            column.extend(values(*kind, &page, rows));
        }
    }
    (footer, columns)
}

#[test]
fn what_was_written_stands_there_and_what_does_not_fit_is_nothing() {
    let kinds = [Kind::Int, Kind::Bool, Kind::Text, Kind::Float, Kind::Time];
    let columns = kinds.iter().enumerate().map(|(at, kind)| (format!("c{at}"), *kind));
    let mut table = Table::new(Vec::new(), columns).expect("begun");
    let row = |number: i64| {
        let whole = if number % 3 == 0 {
            Cell::None
        } else {
            Cell::Int(number - 5)
        };
        let text = Cell::Text(format!("ü{number}"));
        vec![
            whole,
            Cell::Bool(number % 2 == 0),
            text,
            Cell::Float(0.5),
            Cell::Int(number),
        ]
    };
    let count = i64::try_from(ROWS).expect("small") * 2 + 7;
    for number in 0..count {
        let mut cells = row(number);
        if number % 7 == 0 {
            cells[1] = Cell::Text("no".to_owned());
        }
        table.row(&cells).expect("written");
    }
    let (footer, columns) = read(&table.finish().expect("finished"), &kinds);
    assert_eq!(footer.get(3).number(), count.unsigned_abs());
    assert_eq!(footer.get(4).list().len(), 3);
    assert_eq!(footer.get(2).list()[1].get(4), &Thrift::Text("c0".to_owned()));
    for number in 0..count {
        let at = usize::try_from(number).expect("small");
        let mut wanted = row(number);
        if number % 7 == 0 {
            wanted[1] = Cell::None;
        }
        let found: Vec<Cell> = columns.iter().map(|column| column[at].clone()).collect();
        assert_eq!(found, wanted);
    }
}

#[test]
fn a_table_without_rows_is_a_table() {
    let table = Table::new(Vec::new(), [("c".to_owned(), Kind::Text)]).expect("begun");
    let (footer, columns) = read(&table.finish().expect("finished"), &[Kind::Text]);
    assert_eq!((footer.get(3).number(), columns), (0, vec![Vec::new()]));
}
