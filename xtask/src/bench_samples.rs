//! Samples that bias compensation takes: pixels and texels that one receiver looks at, of the descent and of the flat sum.

use std::process::Stdio;

use crate::Result;
use crate::process::{cargo, line};
use crate::table::Table;

/// The test that compares both, which prints what they took.
const TEST: &str = "ssbc::the_shipped_integration_equals_its_twin_and_the_flat_sum";

/// What both took on average where the geometry term has that bound.
#[derive(Debug, PartialEq)]
pub struct Samples {
    /// Of the geometry term, 1/m^2.
    bound: f64,
    hierarchical: f64,
    flat: f64,
}

impl Samples {
    /// Runs the test.
    pub fn measure(release: bool) -> Result<Vec<Self>> {
        let mut command = cargo(["test", "--workspace", "--locked", "--test", "suite"]);
        if release {
            command.arg("--release");
        }
        command.args(["--", TEST, "--exact", "--nocapture"]).stderr(Stdio::inherit());
        println!("$ {}", line(&command));
        let output = command.output().map_err(|error| format!("cannot start cargo: {error}"))?;
        let text = String::from_utf8_lossy(&output.stdout);
        let found: Vec<Self> = text.lines().filter_map(Self::parse).collect();
        if !output.status.success() || found.is_empty() {
            return Err(format!("`{}` told no samples ({})", line(&command), output.status).into());
        }
        Ok(found)
    }

    /// From `bound B: ...; samples a pixel H, F`.
    fn parse(line: &str) -> Option<Self> {
        let (bound, rest) = line.split_once("bound ")?.1.split_once(':')?;
        let (hierarchical, flat) = rest.split_once("samples a pixel ")?.1.split_once(", ")?;
        let number = |text: &str| text.trim().parse().ok();
        Some(Self { bound: number(bound)?, hierarchical: number(hierarchical)?, flat: number(flat)? })
    }

    /// All of them, in a room of 320x180 pixels.
    pub fn table(samples: &[Self]) -> Table {
        let mut table = Table::new(["bound 1/m^2", "hierarchical", "flat", "times fewer"]);
        for Self { bound, hierarchical, flat } in samples {
            let cells = [*bound, *hierarchical, *flat, flat / hierarchical];
            table.row(cells.map(|value| format!("{value:.1}")));
        }
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_read_from_what_the_test_prints() {
        let line = "test a ... bound 64: hierarchical over flat 1.0010, rms 0.0300; samples a pixel 8.4, 66.2";
        assert_eq!(Samples::parse(line), Some(Samples { bound: 64.0, hierarchical: 8.4, flat: 66.2 }));
        assert_eq!(Samples::parse("bound 64: shader over twin 1.0000, rms 0.0100"), None);
    }

    #[test]
    fn the_table_says_how_many_times_fewer() {
        let text = Samples::table(&[Samples { bound: 64.0, hierarchical: 8.0, flat: 60.0 }]).to_string();
        assert!(text.contains(" 7.5 |"), "{text}");
    }
}
