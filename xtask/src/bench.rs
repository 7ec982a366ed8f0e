//! Measures the frame: what each stage costs beside plain Bevy, what the plugins hold on the GPU, and how voxelisation
//! grows with the triangles. Drives the viewer, in release unless told otherwise, one run for each row.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::Result;
use crate::bench_report::{Report, Row};
use crate::bench_samples::Samples;
use crate::glb;
use crate::process::{build_example, graphics, root, shared};
use crate::setup::setup;
use crate::stats::Stats;
use crate::table::milliseconds;

const USAGE: &str = "\
usage: cargo xtask bench [OPTIONS]

  --scene NAME|FILE     `cornell`, `sponza`, another of the shared scenes, or a glTF file; repeatable
  --size WxH            repeatable; 320x180 and 640x360
  --vpls N              virtual lights; repeatable; 256, 1024, 4096 and 16384
  --visibility V        none, voxel, ism or atlas; repeatable; all
  --frames N            frames a run; 30
  --part P              frames, ssbc, samples, memory or growth; repeatable; all
  --quick               one small run of each part, to see that they work
  --dev                 the viewer as the demo and the tests build it: dependencies optimised, our crates a little
  --viewer FILE         a viewer that was built before, where there is no Cargo; leaves out `samples`
  --json FILE           also write what was measured
";

/// The parts of a report.
const PARTS: [&str; 5] = ["frames", "ssbc", "samples", "memory", "growth"];

/// Iterations of bias compensation that are compared.
const ITERATIONS: [u32; 4] = [0, 1, 2, 3];

/// What to measure.
#[derive(Debug, PartialEq)]
struct Options {
    scenes: Vec<String>,
    sizes: Vec<String>,
    vpls: Vec<u32>,
    visibilities: Vec<String>,
    frames: u32,
    parts: Vec<String>,
    growth: Vec<u32>,
    json: Option<PathBuf>,
    dev: bool,
    viewer: Option<PathBuf>,
}

impl Options {
    /// `None` where the usage was asked for.
    fn parse(args: &[String], has_sponza: bool) -> Result<Option<Self>> {
        let [mut scenes, mut sizes, mut vpls, mut visibilities, mut parts] = [const { Vec::<String>::new() }; 5];
        let (mut frames, mut json, mut viewer, mut quick, mut dev) = (None, None, None, false, false);
        let mut args = args.iter();
        while let Some(arg) = args.next() {
            let mut value = || args.next().cloned().ok_or(format!("bench: `{arg}` needs a value"));
            match arg.as_str() {
                "--scene" => scenes.push(value()?),
                "--size" => sizes.push(value()?),
                "--vpls" => vpls.push(value()?),
                "--visibility" => visibilities.push(value()?),
                "--part" => parts.push(value()?),
                "--frames" => frames = Some(value()?),
                "--json" => json = Some(PathBuf::from(value()?)),
                "--viewer" => viewer = Some(std::path::absolute(value()?)?),
                "--quick" => quick = true,
                "--dev" => dev = true,
                "--help" | "-h" => return Ok(None),
                _ => return Err(format!("bench: no option `{arg}`").into()),
            }
        }
        if let Some(unknown) = parts.iter().find(|part| !PARTS.contains(&part.as_str())) {
            return Err(format!("bench: no part `{unknown}`; there are {}", PARTS.join(", ")).into());
        }
        let or = |given: Vec<String>, full: &[&str], small: &[&str]| {
            let default = if quick { small } else { full };
            if given.is_empty() { default.iter().map(|word| word.to_string()).collect() } else { given }
        };
        let number = |text: &String| -> Result<u32> {
            let number = text.parse().ok().filter(|number| *number > 0);
            number.ok_or_else(|| format!("bench: `{text}` is no positive number").into())
        };
        let all_scenes: &[&str] = if has_sponza { &["cornell", "sponza"] } else { &["cornell"] };
        Ok(Some(Self {
            scenes: or(scenes, all_scenes, &["cornell"]),
            sizes: or(sizes, &["320x180", "640x360"], &["320x180"]),
            vpls: or(vpls, &["256", "1024", "4096", "16384"], &["256"]).iter().map(number).collect::<Result<_>>()?,
            visibilities: or(visibilities, &["none", "voxel", "ism", "atlas"], &["none", "atlas"]),
            frames: frames.as_ref().map_or(Ok(if quick { 5 } else { 30 }), number)?,
            parts: or(parts, &PARTS, &PARTS),
            growth: if quick { vec![1_000, 10_000] } else { vec![1_000, 10_000, 100_000, 1_000_000] },
            json,
            dev,
            viewer,
        }))
    }

    fn has(&self, part: &str) -> bool {
        self.parts.iter().any(|name| name == part)
    }
}

/// One run of the viewer to come.
#[derive(Clone, Debug)]
struct Job {
    part: &'static str,
    scene: String,
    file: Option<PathBuf>,
    size: String,
    /// Visibility and virtual lights; `None` is plain Bevy.
    lights: Option<(String, u32)>,
    /// Iterations of bias compensation; `None` leaves the default.
    ssbc: Option<u32>,
}

impl Job {
    fn viewer_args(&self) -> Vec<String> {
        let mut args: Vec<String> = self.file.iter().map(|file| file.display().to_string()).collect();
        args.extend(["--size".into(), self.size.clone()]);
        match &self.lights {
            Some((visibility, vpls)) => {
                args.extend(["--visibility".into(), visibility.clone(), "--vpls".into(), vpls.to_string()]);
            }
            None => args.push("--plain-bevy".into()),
        }
        args.extend(self.ssbc.iter().flat_map(|iterations| ["--ssbc".to_owned(), iterations.to_string()]));
        args
    }

    fn title(&self) -> String {
        let lights = match &self.lights {
            Some((visibility, vpls)) => format!("{vpls} virtual lights, visibility {visibility}"),
            None => "plain Bevy".to_owned(),
        };
        let ssbc = self.ssbc.map_or(String::new(), |iterations| format!(", {iterations} compensations"));
        format!("{} {} {lights}{ssbc}", self.scene, self.size)
    }
}

/// Runs the bench and prints its tables.
pub fn bench(args: &[String]) -> Result<()> {
    let has_sponza = shared().is_some_and(|folder| folder.join("scenes/sponza.glb").is_file());
    let Some(options) = Options::parse(args, has_sponza)? else {
        print!("{USAGE}");
        return Ok(());
    };
    let folder = root().join("target/bench");
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let jobs = jobs(&options, &folder)?;
    let viewer = match &options.viewer {
        Some(viewer) => viewer.clone(),
        None => {
            setup()?;
            build_example("viewer", !options.dev)?
        }
    };
    let mut report = Report::default();
    for (i, job) in jobs.iter().enumerate() {
        let file = folder.join(format!("{i}.json"));
        // What is held does not change from frame to frame.
        let frames = if job.part == "memory" { 1 } else { options.frames };
        let outcome = measure(&viewer, job, frames, &file);
        let told = match &outcome {
            Ok(stats) => format!("{} ms", milliseconds(stats.frame.median)),
            Err(error) => error.to_string(),
        };
        println!("[{}/{}] {}: {told}", i + 1, jobs.len(), job.title());
        report.rows.push(Row {
            part: job.part,
            scene: job.scene.clone(),
            size: job.size.clone(),
            lights: job.lights.clone(),
            ssbc: job.ssbc,
            outcome: outcome.map(|stats| (stats, file)).map_err(|error| error.to_string()),
        });
    }
    if options.has("samples") && options.viewer.is_none() {
        report.samples = Samples::measure(!options.dev)?;
    }
    println!("\n{report}");
    if let Some(file) = &options.json {
        fs::write(file, report.json()?).map_err(|error| format!("{}: {error}", file.display()))?;
    }
    match report.failures() {
        0 => Ok(()),
        n => Err(format!("{n} of {} runs failed", jobs.len()).into()),
    }
}

fn jobs(options: &Options, folder: &Path) -> Result<Vec<Job>> {
    let mut jobs = Vec::new();
    for scene in options.scenes.iter().filter(|_| options.has("frames")) {
        let file = scene_file(scene)?;
        for size in &options.sizes {
            let (scene, file, size) = (scene.clone(), file.clone(), size.clone());
            let job = |lights| Job {
                part: "frames",
                scene: scene.clone(),
                file: file.clone(),
                size: size.clone(),
                lights,
                ssbc: None,
            };
            jobs.push(job(None));
            for visibility in &options.visibilities {
                jobs.extend(options.vpls.iter().map(|vpls| job(Some((visibility.clone(), *vpls)))));
            }
        }
    }
    let one = |part, scene: String, file, size: &str, visibility: &str, vpls| {
        let lights = Some((visibility.to_owned(), vpls));
        Job { part, scene, file, size: size.to_owned(), lights, ssbc: None }
    };
    for visibility in options.visibilities.iter().filter(|_| options.has("ssbc")) {
        let job = one("ssbc", "cornell".to_owned(), None, &options.sizes[0], visibility, 1024);
        jobs.extend(ITERATIONS.map(|iterations| Job { ssbc: Some(iterations), ..job.clone() }));
    }
    if options.has("memory") {
        jobs.push(one("memory", "cornell".to_owned(), None, "1280x720", "voxel", 1024));
    }
    for wanted in options.growth.iter().filter(|_| options.has("growth")) {
        let (bytes, triangles) = glb::torus(*wanted);
        let file = folder.join(format!("torus_{triangles}.glb"));
        fs::write(&file, bytes).map_err(|error| format!("{}: {error}", file.display()))?;
        jobs.push(one("growth", format!("torus {triangles}"), Some(file), "160x90", "none", 16));
    }
    Ok(jobs)
}

/// `None` is the viewer's own default, the Cornell box.
fn scene_file(name: &str) -> Result<Option<PathBuf>> {
    if name == "cornell" {
        return Ok(None);
    }
    let given = PathBuf::from(name);
    if given.is_file() {
        return Ok(Some(std::path::absolute(given)?));
    }
    let file = shared().map(|folder| folder.join("scenes").join(format!("{name}.glb")));
    let found = file.filter(|file| file.is_file());
    found
        .map(Some)
        .ok_or_else(|| format!("bench: no scene `{name}`: neither a file nor among the shared scenes").into())
}

fn measure(viewer: &Path, job: &Job, frames: u32, stats: &Path) -> Result<Stats> {
    let _ = fs::remove_file(stats);
    let mut command = Command::new(viewer);
    command.args(job.viewer_args()).args(["--frames", &frames.to_string()]);
    command.arg("--output").arg(stats.with_extension("png")).arg("--stats").arg(stats);
    command.current_dir(root()).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    graphics(&mut command);
    let output = command.output().map_err(|error| format!("cannot start the viewer: {error}"))?;
    if output.status.success() {
        return Stats::read(stats);
    }
    let text = String::from_utf8_lossy(&output.stderr);
    let last = text.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("no message");
    Err(format!("viewer failed ({}): {last}", output.status).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(args: &[&str], has_sponza: bool) -> Result<Option<Options>> {
        Options::parse(&args.iter().map(|arg| arg.to_string()).collect::<Vec<_>>(), has_sponza)
    }

    #[test]
    fn defaults_cover_scenes_sizes_and_lights() -> Result<()> {
        let options = parse(&[], true)?.ok_or("usage")?;
        assert_eq!(options.scenes, ["cornell", "sponza"]);
        assert_eq!(options.sizes, ["320x180", "640x360"]);
        assert_eq!(options.vpls, [256, 1024, 4096, 16384]);
        assert_eq!(options.visibilities, ["none", "voxel", "ism", "atlas"]);
        assert!(!options.dev && parse(&["--dev"], true)?.is_some_and(|options| options.dev));
        assert_eq!(options.growth.last(), Some(&1_000_000));
        assert_eq!(options.viewer, None);
        assert_eq!(parse(&[], false)?.map(|options| options.scenes), Some(vec!["cornell".to_owned()]));
        Ok(())
    }

    #[test]
    fn given_values_replace_the_defaults() -> Result<()> {
        let args =
            ["--quick", "--scene", "a.glb", "--size", "1920x1080", "--vpls", "64", "--frames", "9", "--part", "frames"];
        let options = parse(&[&args[..], &["--viewer", "/bin/viewer"]].concat(), true)?.ok_or("usage")?;
        assert_eq!(options.viewer, Some("/bin/viewer".into()));
        assert_eq!(options.scenes, ["a.glb"]);
        assert_eq!(options.sizes, ["1920x1080"]);
        assert_eq!((options.vpls, options.frames), (vec![64], 9));
        assert_eq!(options.parts, ["frames"]);
        Ok(())
    }

    #[test]
    fn wrong_options_are_named() {
        for (args, named) in [
            (&["--fast"] as &[&str], "--fast"),
            (&["--size"], "--size"),
            (&["--vpls", "many"], "many"),
            (&["--frames", "0"], "0"),
            (&["--part", "cost"], "cost"),
        ] {
            assert!(parse(args, true).is_err_and(|error| error.to_string().contains(named)), "{args:?}");
        }
        assert!(parse(&["--help"], true).is_ok_and(|options| options.is_none()));
    }

    #[test]
    fn each_size_starts_with_plain_bevy() -> Result<()> {
        let options = parse(&["--part", "frames", "--vpls", "256"], false)?.ok_or("usage")?;
        let jobs = jobs(&options, Path::new(""))?;
        let titles: Vec<String> = jobs.iter().map(Job::title).collect();
        assert_eq!(titles[0], "cornell 320x180 plain Bevy");
        assert_eq!(titles[1], "cornell 320x180 256 virtual lights, visibility none");
        assert_eq!(titles[5], "cornell 640x360 plain Bevy");
        assert_eq!(titles.len(), 10);
        assert_eq!(jobs[0].viewer_args(), ["--size", "320x180", "--plain-bevy"]);
        assert_eq!(jobs[1].viewer_args(), ["--size", "320x180", "--visibility", "none", "--vpls", "256"]);
        Ok(())
    }
}
