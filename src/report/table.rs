use serde_json::{Map, Value};

/// A value of a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Words.
    Text(String),
    /// A whole number.
    Count(u64),
    /// A measured or derived number.
    Number(f64),
    /// Yes or no.
    Flag(bool),
    /// Nothing to say here.
    Absent,
}

impl Cell {
    /// The number in it, if there is one.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Count(n) => Some(*n as f64),
            Self::Number(x) => Some(*x),
            Self::Text(_) | Self::Flag(_) | Self::Absent => None,
        }
    }

    fn json(&self) -> Value {
        match self {
            Self::Text(text) => text.as_str().into(),
            Self::Count(n) => (*n).into(),
            // JSON has no infinities; a number that is none becomes null.
            Self::Number(x) => (*x).into(),
            Self::Flag(is) => (*is).into(),
            Self::Absent => Value::Null,
        }
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<u64> for Cell {
    fn from(n: u64) -> Self {
        Self::Count(n)
    }
}

impl From<usize> for Cell {
    fn from(n: usize) -> Self {
        Self::Count(n as u64)
    }
}

impl From<f64> for Cell {
    fn from(x: f64) -> Self {
        Self::Number(x)
    }
}

impl From<bool> for Cell {
    fn from(is: bool) -> Self {
        Self::Flag(is)
    }
}

impl<T: Into<Self>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Absent, Into::into)
    }
}

/// What a column is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Part of what tells rows apart.
    Id,
    /// Counted or computed: the same in every run; less is better.
    Less,
    /// As [`Role::Less`]; more is better.
    More,
    /// Measured by the clock; less is better.
    Sooner,
    /// Measured by the clock; more is better.
    Faster,
    /// Neither better nor worse, and not compared.
    Note,
}

/// A column of a table.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// Its name in JSON.
    pub key: &'static str,
    /// Its head in Markdown, with the unit.
    pub head: &'static str,
    /// What it is for.
    pub role: Role,
    /// Decimals in Markdown.
    pub digits: usize,
}

impl Column {
    /// A column with its name, head, role and decimals.
    pub const fn new(key: &'static str, head: &'static str, role: Role, digits: usize) -> Self {
        Self { key, head, role, digits }
    }
}

/// Rows of one form.
#[derive(Clone, Debug)]
pub struct Table {
    /// Its name in JSON: the field `table` of each row.
    pub name: &'static str,
    /// Its heading in Markdown.
    pub title: String,
    /// What a reader must know, a paragraph each.
    pub notes: Vec<String>,
    /// The columns; those with [`Role::Id`] tell rows apart.
    pub columns: &'static [Column],
    /// A cell a column.
    pub rows: Vec<Vec<Cell>>,
    /// True for rows too many to read: Markdown says where they are.
    pub json_only: bool,
}

impl Table {
    /// A table without rows.
    pub fn new(name: &'static str, title: impl Into<String>, columns: &'static [Column]) -> Self {
        Self { name, title: title.into(), notes: Vec::new(), columns, rows: Vec::new(), json_only: false }
    }

    /// Adds a paragraph above the rows.
    #[must_use]
    pub fn with_note(mut self, note: impl Into<String>) -> Self {
        self.notes.push(note.into());
        self
    }

    /// Leaves the rows to JSON.
    #[must_use]
    pub fn in_json_only(mut self) -> Self {
        self.json_only = true;
        self
    }

    /// Adds a row.
    ///
    /// # Panics
    /// When it has not a cell a column.
    pub fn push(&mut self, row: Vec<Cell>) {
        assert_eq!(row.len(), self.columns.len(), "table `{}`", self.name);
        self.rows.push(row);
    }

    /// The cells of one column.
    ///
    /// # Panics
    /// When there is no such column.
    pub fn column(&self, key: &str) -> impl Iterator<Item = &Cell> {
        let found = self.columns.iter().position(|c| c.key == key);
        let place = found.unwrap_or_else(|| panic!("table `{}` has no column `{key}`", self.name));
        self.rows.iter().map(move |row| &row[place])
    }

    /// The rows as JSON objects.
    pub fn json(&self) -> impl Iterator<Item = Value> + '_ {
        self.rows.iter().map(|row| {
            let mut object = Map::from_iter([("table".to_owned(), self.name.into())]);
            object.extend(self.columns.iter().zip(row).map(|(c, cell)| (c.key.to_owned(), cell.json())));
            Value::Object(object)
        })
    }
}
