//! The tables of a bench.

use std::fmt;
use std::fs;
use std::path::PathBuf;

use serde_json::{Value, json};

use crate::Result;
use crate::bench_samples::Samples;
use crate::stats::{Stage, Stats, Times, stage_rank};
use crate::table::{NONE, Table, bytes, grouped, milliseconds};

/// What was measured.
#[derive(Default)]
pub struct Report {
    /// Runs in order.
    pub rows: Vec<Row>,
    /// What bias compensation looks at.
    pub samples: Vec<Samples>,
}

/// One run.
pub struct Row {
    /// `frames`, `ssbc`, `memory` or `growth`.
    pub part: &'static str,
    /// Its scene.
    pub scene: String,
    /// `WxH` in pixels.
    pub size: String,
    /// Visibility and virtual lights; `None` is plain Bevy.
    pub lights: Option<(String, u32)>,
    /// Iterations of bias compensation, where they are what is compared.
    pub ssbc: Option<u32>,
    /// Statistics and the file they were read from, or what went wrong.
    pub outcome: std::result::Result<(Stats, PathBuf), String>,
}

impl Row {
    fn stats(&self) -> Option<&Stats> {
        self.outcome.as_ref().ok().map(|(stats, _)| stats)
    }

    /// Scene, size, visibility and virtual lights.
    fn key(&self) -> Vec<String> {
        let (visibility, vpls) = match &self.lights {
            Some((visibility, vpls)) => (visibility.clone(), vpls.to_string()),
            None => ("plain Bevy".to_owned(), NONE.to_owned()),
        };
        vec![self.scene.clone(), self.size.clone(), visibility, vpls]
    }
}

const KEY: [&str; 4] = ["scene", "size", "visibility", "virtual lights"];

impl Report {
    /// How many runs failed.
    pub fn failures(&self) -> usize {
        self.rows.iter().filter(|row| row.outcome.is_err()).count()
    }

    /// Every run as JSON, the viewer's own statistics inside.
    pub fn json(&self) -> Result<String> {
        let runs = self.rows.iter().map(|row| {
            let (visibility, vpls) = row.lights.as_ref().map_or((None, None), |(v, n)| (Some(v), Some(n)));
            let stats: Value = match &row.outcome {
                Ok((_, file)) => serde_json::from_str(&fs::read_to_string(file)?)?,
                Err(error) => json!({"error": error}),
            };
            Ok(json!({
                "part": row.part, "scene": row.scene, "size": row.size, "plain_bevy": row.lights.is_none(),
                "visibility": visibility, "vpls": vpls, "ssbc": row.ssbc, "stats": stats
            }))
        });
        Ok(serde_json::to_string_pretty(&runs.collect::<Result<Vec<Value>>>()?)?)
    }

    fn part<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Row> + Clone {
        self.rows.iter().filter(move |row| row.part == name)
    }

    /// Wall time of whole frames, and how many times plain Bevy's.
    fn frames(&self) -> Table {
        let mut table = Table::new(KEY.into_iter().chain(["median ms", "p95 ms", "of plain Bevy"]));
        for row in self.part("frames") {
            let mut cells = row.key();
            if let Some(stats) = row.stats() {
                let plain = self
                    .part("frames")
                    .find(|other| other.lights.is_none() && other.scene == row.scene && other.size == row.size);
                let ratio = plain.and_then(Row::stats).map(|plain| stats.frame.median / plain.frame.median);
                cells.push(milliseconds(stats.frame.median));
                cells.push(stats.frame.p95.map_or(NONE.to_owned(), milliseconds));
                cells.push(ratio.map_or(NONE.to_owned(), |ratio| format!("{ratio:.2}")));
            } else {
                cells.extend([NONE; 3].map(str::to_owned));
            }
            table.row(cells);
        }
        table
    }

    /// Each stage of each run that has any.
    fn stages(&self) -> Table {
        let rows = self.part("frames").filter(|row| row.stats().is_some_and(|stats| !stats.stages.is_empty()));
        let mut names: Vec<&String> =
            rows.clone().filter_map(Row::stats).flat_map(|stats| stats.stages.iter().map(|(name, _)| name)).collect();
        names.sort_by_key(|name| (stage_rank(name), *name));
        names.dedup();
        let mut table = Table::new(KEY.into_iter().chain(names.iter().map(|name| name.as_str())));
        for row in rows {
            let cell =
                |name: &&String| row.stats().and_then(|stats| stats.stage(name)).map_or(NONE.to_owned(), stage_cell);
            table.row(row.key().into_iter().chain(names.iter().map(cell)));
        }
        table
    }

    /// Bias compensation by iterations, and what one of them costs beside the shading by virtual lights, alone and with
    /// their shadow maps.
    fn ssbc(&self) -> Table {
        let own =
            ["iterations", "maps ms", "interleaved ms", "ssbc ms", "ms an iteration", "% of interleaved", "% of both"];
        let mut table = Table::new(KEY.into_iter().chain(own));
        for row in self.part("ssbc") {
            let time = |name| Some(row.stats()?.stage(name)?.gpu?.median);
            let (maps, shading, ssbc) = (time("shadow_atlas"), time("interleaved"), time("ssbc"));
            let both = shading.map(|shading| shading + maps.unwrap_or(0.0));
            let each = ssbc.zip(row.ssbc.filter(|iterations| *iterations > 0)).map(|(ms, n)| ms / f64::from(n));
            let share = |of: Option<f64>| {
                each.zip(of).map_or(NONE.to_owned(), |(each, of)| format!("{:.0}", 100.0 * each / of))
            };
            let ms = |value: Option<f64>| value.map_or(NONE.to_owned(), milliseconds);
            let iterations = row.ssbc.map_or(NONE.to_owned(), |iterations| iterations.to_string());
            let cells = [iterations, ms(maps), ms(shading), ms(ssbc), ms(each), share(shading), share(both)];
            table.row(row.key().into_iter().chain(cells));
        }
        table
    }

    fn memory(&self) -> String {
        self.part("memory")
            .filter_map(|row| Some((row, row.stats()?)))
            .map(|(row, stats)| {
                let mut table = Table::new(["allocation", "bytes", "size"]);
                for (name, count) in &stats.gpu_items {
                    table.row([name.clone(), grouped(*count), bytes(*count)]);
                }
                table.row(["total".to_owned(), grouped(stats.gpu_bytes), bytes(stats.gpu_bytes)]);
                format!("Held on the GPU by the plugins, {} at {}\n\n{table}", row.scene, row.size)
            })
            .collect()
    }

    /// Voxelisation by triangles; `growth` compares with the row above: 1 is linear, less is better.
    fn growth(&self) -> Table {
        let mut table = Table::new(["triangles", "voxelize ms", "p95 ms", "us a triangle", "growth"]);
        let mut before: Option<(f64, f64)> = None;
        for stats in self.part("growth").filter_map(Row::stats) {
            let Some(times) = stats.stage("voxelize").and_then(|stage| stage.gpu) else {
                table.row([grouped(stats.triangles)]);
                continue;
            };
            let now = (stats.triangles as f64, times.median);
            let growth = before.map(|(triangles, time)| (now.1 / time) / (now.0 / triangles));
            table.row([
                grouped(stats.triangles),
                milliseconds(times.median),
                times.p95.map_or(NONE.to_owned(), milliseconds),
                format!("{:.3}", 1.0e3 * times.median / now.0),
                growth.map_or(NONE.to_owned(), |growth| format!("{growth:.2}")),
            ]);
            before = Some(now);
        }
        table
    }
}

/// The GPU's time with its 95th percentile; the CPU's where the GPU's is unknown.
fn stage_cell(stage: Stage) -> String {
    let text = |times: Times| match times.p95 {
        Some(p95) => format!("{} ({})", milliseconds(times.median), milliseconds(p95)),
        None => milliseconds(times.median),
    };
    match (stage.gpu, stage.cpu) {
        (Some(gpu), _) => text(gpu),
        (None, Some(cpu)) => format!("{} CPU", text(cpu)),
        (None, None) => NONE.to_owned(),
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(stats) = self.rows.iter().find_map(Row::stats) {
            writeln!(f, "Adapter: {}", stats.adapter)?;
        }
        if self.part("frames").next().is_some() {
            writeln!(f, "\nWhole frames, submitted and finished\n\n{}", self.frames())?;
            writeln!(f, "Stages, GPU ms: median (95th percentile)\n\n{}", self.stages())?;
        }
        if self.part("ssbc").next().is_some() {
            writeln!(f, "Bias compensation\n\n{}", self.ssbc())?;
        }
        if !self.samples.is_empty() {
            writeln!(f, "Samples a pixel of bias compensation\n\n{}", Samples::table(&self.samples))?;
        }
        write!(f, "{}", self.memory())?;
        if self.part("growth").next().is_some() {
            writeln!(f, "\nVoxelisation of one shape cut into more and more triangles\n\n{}", self.growth())?;
        }
        for row in &self.rows {
            if let Err(error) = &row.outcome {
                writeln!(f, "failed: {}: {error}", row.key().join(" "))?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stats(median: f64, triangles: u64, voxelize: Option<f64>) -> Stats {
        let stage = |median| Stage { gpu: Some(Times { median, p95: Some(2.0 * median) }), cpu: None };
        Stats {
            adapter: "llvmpipe".into(),
            size: (320, 180),
            triangles,
            vpls: 256,
            gpu_bytes: 1024,
            gpu_items: vec![("grid".into(), 1000)],
            frame: Times { median, p95: Some(median) },
            stages: voxelize.map(|median| ("voxelize".to_owned(), stage(median))).into_iter().collect(),
        }
    }

    fn row(part: &'static str, lights: Option<u32>, outcome: std::result::Result<Stats, &str>) -> Row {
        Row {
            part,
            scene: "cornell".into(),
            size: "320x180".into(),
            lights: lights.map(|vpls| ("voxel".to_owned(), vpls)),
            ssbc: None,
            outcome: outcome.map(|stats| (stats, PathBuf::new())).map_err(str::to_owned),
        }
    }

    #[test]
    fn frames_are_compared_with_plain_bevy() {
        let rows = vec![
            row("frames", None, Ok(stats(10.0, 34, None))),
            row("frames", Some(256), Ok(stats(25.0, 34, Some(3.0)))),
        ];
        let report = Report { rows, ..Default::default() };
        let text = report.to_string();
        assert!(text.contains(" 2.50 |"), "{text}");
        assert!(text.contains("3.00 (6.00)"), "{text}");
        assert!(report.stages().to_string().lines().count() == 3, "plain Bevy has no stages of ours:\n{text}");
        assert_eq!(report.failures(), 0);
    }

    #[test]
    fn a_failed_run_is_reported_and_counted() {
        let report = Report { rows: vec![row("frames", Some(256), Err("viewer failed"))], ..Default::default() };
        assert_eq!(report.failures(), 1);
        assert!(report.to_string().contains("failed: cornell 320x180 voxel 256: viewer failed"));
    }

    #[test]
    fn growth_of_one_is_linear() {
        let rows = [(1_000, 1.0), (10_000, 10.0), (100_000, 50.0)];
        let rows = rows.map(|(triangles, ms)| row("growth", Some(16), Ok(stats(1.0, triangles, Some(ms)))));
        let text = Report { rows: rows.into(), ..Default::default() }.growth().to_string();
        let last = |line: usize| text.lines().nth(line).and_then(|line| line.split('|').nth(5)).map(str::trim);
        assert_eq!((last(2), last(3), last(4)), (Some("-"), Some("1.00"), Some("0.50")), "{text}");
    }

    #[test]
    fn memory_is_itemised_with_its_total() {
        let text =
            Report { rows: vec![row("memory", Some(1024), Ok(stats(1.0, 34, None)))], ..Default::default() }.memory();
        assert!(text.contains("| grid ") && text.contains("1.0 KiB"), "{text}");
    }
}
