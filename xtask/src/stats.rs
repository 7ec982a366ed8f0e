//! What `viewer --stats` writes.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::Result;

/// One run of the viewer.
#[derive(Clone, Debug, PartialEq)]
pub struct Stats {
    /// The GPU, or the software that stands in for it.
    pub adapter: String,
    /// Width and height in pixels.
    pub size: (u64, u64),
    /// Triangles in the scene.
    pub triangles: u64,
    /// Virtual point lights; 0 without any.
    pub vpls: u64,
    /// Bytes that the plugins hold on the GPU.
    pub gpu_bytes: u64,
    /// The same by allocation, largest first; empty where the viewer does not itemise them.
    pub gpu_items: Vec<(String, u64)>,
    /// Milliseconds of a whole frame, submitted and finished.
    pub frame: Times,
    /// Milliseconds of each stage, in the order of the frame.
    pub stages: Vec<(String, Stage)>,
}

/// Milliseconds over the measured frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Times {
    /// Half of the frames took longer.
    pub median: f64,
    /// One frame in twenty took longer.
    pub p95: Option<f64>,
}

/// Times of one stage; `None` where the device has no timestamps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stage {
    /// On the GPU.
    pub gpu: Option<Times>,
    /// Recording its commands.
    pub cpu: Option<Times>,
}

/// The order of the frame; what is not in it follows by name.
const FRAME_ORDER: [&str; 9] =
    ["scene", "voxelize", "vpl_trace", "shadow_atlas", "gbuffer", "direct", "interleaved", "ssbc", "compose"];

impl Stats {
    /// Reads the file that `viewer --stats` wrote.
    pub fn read(file: &Path) -> Result<Self> {
        let text = fs::read_to_string(file).map_err(|error| format!("{}: {error}", file.display()))?;
        Self::parse(&text).map_err(|error| format!("{}: {error}", file.display()).into())
    }

    fn parse(text: &str) -> Result<Self> {
        let json: Value = serde_json::from_str(text)?;
        let number = |name: &str| json.get(name).and_then(Value::as_u64).unwrap_or(0);
        let size = json.get("size").and_then(Value::as_array).ok_or("no member `size`")?;
        let edge = |i: usize| size.get(i).and_then(Value::as_u64).ok_or("`size` is not [width, height]");
        let stages = json.get("stages").and_then(Value::as_object).into_iter().flatten();
        let mut stages: Vec<(String, Stage)> = stages
            .map(|(name, times)| {
                let times_of = |median, p95| Times::of_stage(times, median, p95);
                let gpu = times_of("gpu_ms", "gpu_ms_p95");
                (name.clone(), Stage { gpu, cpu: times_of("cpu_ms", "cpu_ms_p95") })
            })
            .collect();
        stages.sort_by_key(|(name, _)| (stage_rank(name), name.clone()));
        let gpu_items = json.get("gpu_bytes_by").and_then(Value::as_object).into_iter().flatten();
        let mut gpu_items: Vec<(String, u64)> =
            gpu_items.filter_map(|(name, bytes)| Some((name.clone(), bytes.as_u64()?))).collect();
        gpu_items.sort_by_key(|(_, bytes)| std::cmp::Reverse(*bytes));
        Ok(Self {
            adapter: json.get("adapter").and_then(Value::as_str).ok_or("no member `adapter`")?.to_owned(),
            size: (edge(0)?, edge(1)?),
            triangles: number("triangles"),
            vpls: number("vpls"),
            gpu_bytes: number("gpu_bytes"),
            gpu_items,
            frame: json.get("frame_ms").and_then(Times::of_frame).ok_or("no member `frame_ms`")?,
            stages,
        })
    }

    /// The times of one stage.
    pub fn stage(&self, name: &str) -> Option<Stage> {
        self.stages.iter().find(|(stage, _)| stage == name).map(|(_, times)| *times)
    }
}

/// Where a stage stands in the frame; `stage/part` stands with its stage.
pub fn stage_rank(name: &str) -> usize {
    let stage = name.split('/').next().unwrap_or(name);
    FRAME_ORDER.iter().position(|known| *known == stage).unwrap_or(FRAME_ORDER.len())
}

impl Times {
    fn of_frame(json: &Value) -> Option<Self> {
        Self::of_stage(json, "median", "p95")
    }

    fn of_stage(json: &Value, median: &str, p95: &str) -> Option<Self> {
        let member = |name: &str| json.get(name).and_then(Value::as_f64);
        Some(Self { median: member(median)?, p95: member(p95) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FULL: &str = r#"{
        "adapter": "llvmpipe", "size": [640, 360], "triangles": 34, "vpls": 1024, "gpu_bytes": 300,
        "gpu_bytes_by": {"grid": 100, "surface": 200},
        "frame_ms": {"median": 40.5, "p95": 44.0},
        "stages": {
            "compose": {"gpu_ms": 1.5, "gpu_ms_p95": 2.0, "cpu_ms": 0.1},
            "voxelize": {"gpu_ms": 3.0, "cpu_ms": 0.2},
            "bloom": {"gpu_ms": null, "cpu_ms": 0.3}
        }
    }"#;

    #[test]
    fn every_member_is_read() -> Result<()> {
        let stats = Stats::parse(FULL)?;
        assert_eq!(stats.adapter, "llvmpipe");
        assert_eq!(stats.size, (640, 360));
        assert_eq!((stats.triangles, stats.vpls, stats.gpu_bytes), (34, 1024, 300));
        assert_eq!(stats.frame, Times { median: 40.5, p95: Some(44.0) });
        assert_eq!(stats.gpu_items, [("surface".to_owned(), 200), ("grid".to_owned(), 100)]);
        Ok(())
    }

    #[test]
    fn stages_stand_in_the_order_of_the_frame() -> Result<()> {
        let stats = Stats::parse(FULL)?;
        let names: Vec<&str> = stats.stages.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["voxelize", "compose", "bloom"]);
        assert_eq!(stats.stage("compose").and_then(|s| s.gpu), Some(Times { median: 1.5, p95: Some(2.0) }));
        assert_eq!(stats.stage("voxelize").and_then(|s| s.gpu), Some(Times { median: 3.0, p95: None }));
        assert_eq!(stats.stage("bloom").and_then(|s| s.gpu), None);
        assert_eq!(stats.stage("absent"), None);
        Ok(())
    }

    #[test]
    fn a_missing_member_is_named() {
        let message = |text: &str| Stats::parse(text).map_err(|error| error.to_string()).err().unwrap_or_default();
        assert!(message(r#"{"size": [1, 1], "frame_ms": {"median": 1}}"#).contains("adapter"));
        assert!(message(r#"{"adapter": "a", "frame_ms": 1}"#).contains("size"));
        assert!(message(r#"{"adapter": "a", "size": [1], "frame_ms": 1}"#).contains("size"));
        assert!(message(r#"{"adapter": "a", "size": [1, 1]}"#).contains("frame_ms"));
        assert!(!message("{").is_empty());
    }
}
