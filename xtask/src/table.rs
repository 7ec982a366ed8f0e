//! Tables that read well in a terminal and paste into Markdown.

use std::fmt;

/// A table with a header; columns that hold only numbers are aligned to the right.
pub struct Table {
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// An empty table with these columns.
    pub fn new<S: Into<String>>(header: impl IntoIterator<Item = S>) -> Self {
        Self { header: header.into_iter().map(Into::into).collect(), rows: Vec::new() }
    }

    /// Adds a row; cells that are missing stay empty.
    pub fn row<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        let mut row: Vec<String> = cells.into_iter().map(Into::into).collect();
        row.resize(self.header.len(), String::new());
        self.rows.push(row);
    }

    fn is_numeric(&self, column: usize) -> bool {
        let starts_as_number = |cell: &str| cell.trim_start_matches('-').starts_with(|c: char| c.is_ascii_digit());
        let mut cells = self.rows.iter().map(|row| row[column].as_str()).filter(|cell| !matches!(*cell, "" | NONE));
        cells.clone().next().is_some() && cells.all(starts_as_number)
    }
}

/// What a cell without a value shows.
pub const NONE: &str = "-";

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let columns: Vec<(usize, bool)> = (0..self.header.len())
            .map(|column| {
                let cells = self.rows.iter().map(|row| &row[column]).chain([&self.header[column]]);
                let width = cells.map(|cell| cell.chars().count()).max().unwrap_or(0).max(3);
                (width, self.is_numeric(column))
            })
            .collect();
        let line = |f: &mut fmt::Formatter<'_>, row: &[String]| {
            for (cell, &(width, numeric)) in row.iter().zip(&columns) {
                if numeric { write!(f, "| {cell:>width$} ")? } else { write!(f, "| {cell:<width$} ")? }
            }
            writeln!(f, "|")
        };
        line(f, &self.header)?;
        for &(width, numeric) in &columns {
            let dashes = "-".repeat(width + 1);
            if numeric { write!(f, "|{dashes}:")? } else { write!(f, "|{dashes}-")? }
        }
        writeln!(f, "|")?;
        self.rows.iter().try_for_each(|row| line(f, row))
    }
}

/// Milliseconds with three significant digits or so.
pub fn milliseconds(value: f64) -> String {
    if value >= 100.0 {
        format!("{value:.0}")
    } else if value >= 10.0 {
        format!("{value:.1}")
    } else {
        format!("{value:.2}")
    }
}

/// Bytes in the binary unit that reads best.
pub fn bytes(value: u64) -> String {
    const UNITS: [&str; 4] = ["B", "KiB", "MiB", "GiB"];
    let mut scaled = value as f64;
    let mut unit = 0;
    while scaled >= 1024.0 && unit + 1 < UNITS.len() {
        scaled /= 1024.0;
        unit += 1;
    }
    if unit == 0 { format!("{value} B") } else { format!("{scaled:.1} {}", UNITS[unit]) }
}

/// A whole number with thousands set apart.
pub fn grouped(value: u64) -> String {
    let digits = value.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// Minutes and seconds.
pub fn duration(time: std::time::Duration) -> String {
    let seconds = time.as_secs_f64();
    if seconds < 60.0 {
        format!("{seconds:.1} s")
    } else {
        let whole = seconds.round() as u64;
        format!("{} min {:02} s", whole / 60, whole % 60)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn numbers_align_right_and_words_left() {
        let mut table = Table::new(["stage", "ms"]);
        table.row(["scene", "0.25"]);
        table.row(["voxelize", "12.5"]);
        table.row(["direct", NONE]);
        let expected = "\
| stage    |   ms |
|----------|-----:|
| scene    | 0.25 |
| voxelize | 12.5 |
| direct   |    - |
";
        assert_eq!(table.to_string(), expected);
    }

    #[test]
    fn short_rows_are_filled_up() {
        let mut table = Table::new(["a", "b"]);
        table.row(["x"]);
        assert_eq!(table.to_string().lines().last(), Some("| x   |     |"));
    }

    #[test]
    fn values_are_written_to_be_read() {
        assert_eq!(milliseconds(0.1234), "0.12");
        assert_eq!(milliseconds(12.34), "12.3");
        assert_eq!(milliseconds(1234.5), "1234");
        assert_eq!(bytes(17), "17 B");
        assert_eq!(bytes(64 << 20), "64.0 MiB");
        assert_eq!(grouped(7), "7");
        assert_eq!(grouped(262_266), "262,266");
        assert_eq!(grouped(1_000_000), "1,000,000");
        assert_eq!(duration(Duration::from_millis(2_340)), "2.3 s");
        assert_eq!(duration(Duration::from_secs(125)), "2 min 05 s");
    }
}
