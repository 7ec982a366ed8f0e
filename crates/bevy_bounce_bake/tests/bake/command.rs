//! The `bounce-bake` command.

use std::path::Path;
use std::process::{Command, Output};

use crate::scenes::cornell_box;

fn run(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bounce-bake")).args(args).current_dir(folder).output().expect("it runs")
}

/// Exit status and what was said on stderr.
fn fails(folder: &Path, args: &[&str]) -> (i32, String) {
    let output = run(folder, args);
    (output.status.code().unwrap_or(-1), String::from_utf8_lossy(&output.stderr).into_owned())
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::copy(cornell_box(), folder.path().join("room.glb")).expect("the repository has it");
    folder
}

const BAKE: [&str; 8] = ["bake", "room.glb", "-o", "room.cssm", "--atlas", "32", "--depth", "16"];

#[test]
fn bake_info_and_verify() {
    let folder = folder();
    let output = run(folder.path(), &[&BAKE[..], &["--report", "report.json"]].concat());
    assert!(output.status.success(), "{output:?}");
    let report = std::fs::read(folder.path().join("report.json")).expect("it was written");
    let report: serde_json::Value = serde_json::from_slice(&report).expect("it is JSON");
    let mut fields: Vec<&str> = report.as_object().expect("an object").keys().map(String::as_str).collect();
    fields.sort_unstable();
    let wanted = [
        "atlas",
        "compressed_bytes",
        "depth",
        "depth_maps",
        "ratio",
        "runs",
        "seconds",
        "strategy",
        "uncompressed_bytes",
    ];
    assert_eq!(fields, wanted);
    assert_eq!((&report["atlas"], &report["depth"]), (&32.into(), &16.into()));
    let info = run(folder.path(), &["info", "room.cssm"]);
    assert!(info.status.success() && String::from_utf8_lossy(&info.stdout).contains("6 x 16 x 16"), "{info:?}");
    let verify = ["verify", "room.cssm", "room.glb", "--rays", "20000", "--min-agreement"];
    let passed = run(folder.path(), &[&verify[..], &["80"]].concat());
    let said = String::from_utf8_lossy(&passed.stdout).into_owned();
    let last = said.lines().last().unwrap_or_default();
    assert!(passed.status.success() && last.starts_with("agreement ") && last.ends_with(" %"), "{said}");
    let (status, said) = fails(folder.path(), &[&verify[..], &["100"]].concat());
    assert!(status == 1 && said.contains("room.cssm"), "{status} {said}");
}

#[test]
fn threads_do_not_matter() {
    let folder = folder();
    let bytes = ["1", "2", "5"].map(|threads| {
        let output = run(folder.path(), &[&BAKE[..], &["--quiet", "--threads", threads]].concat());
        assert!(output.status.success() && output.stdout.is_empty() && output.stderr.is_empty(), "{output:?}");
        std::fs::read(folder.path().join("room.cssm")).expect("it was written")
    });
    assert!(bytes[0] == bytes[1] && bytes[0] == bytes[2]);
}

#[test]
fn lightmap_writes_three_files_and_a_report() {
    let folder = folder();
    let bake = ["lightmap", "room.glb", "-o", "lit.glb", "--atlas", "32", "--rays", "16", "--probes", "2"];
    let output = run(folder.path(), &[&bake[..], &["--report", "report.json"]].concat());
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && said.contains("lit.glb: ") && said.contains("bounces"), "{output:?}");
    let read = |name: &str| std::fs::read(folder.path().join(name)).expect("it was written");
    let report: serde_json::Value = serde_json::from_slice(&read("report.json")).expect("it is JSON");
    assert_eq!((&report["lights"], &report["rays"], &report["cut_off"]), (&1.into(), &16.into(), &0.into()));
    let files = ["lit.glb", "lit.lightmap.ktx2", "lit.volume.ktx2"].map(read);
    let output = run(folder.path(), &[&bake[..], &["--quiet", "--threads", "3"]].concat());
    assert!(output.status.success() && output.stdout.is_empty() && output.stderr.is_empty(), "{output:?}");
    assert!(files == ["lit.glb", "lit.lightmap.ktx2", "lit.volume.ktx2"].map(read));
}

#[test]
fn bad_input_gets_a_line_and_a_status() {
    let folder = folder();
    let at = folder.path();
    std::fs::write(at.join("broken.glb"), b"glTF\x02\0\0\0\xff\0\0\0").expect("writable");
    std::fs::write(at.join("broken.cssm"), b"CSSM, surely").expect("writable");
    let cases: [(&[&str], &str); 14] = [
        (&["bake", "absent.glb", "-o", "x.cssm"], "absent.glb"),
        (&["bake", "broken.glb", "-o", "x.cssm"], "truncated"),
        (&["bake", "room.glb", "-o", "x.cssm", "--depth", "12"], "multiple of 8"),
        (&["bake", "room.glb", "-o", "x.cssm", "--atlas", "0"], "atlas 0"),
        (&["bake", "room.glb", "-o", "x.cssm", "--strategy", "hop"], "spiral"),
        (&["bake", "room.glb"], "--output"),
        (&["info", "broken.cssm"], "magic number"),
        (&["info", "absent.cssm"], "absent.cssm"),
        (&["lightmap", "absent.glb", "-o", "x.glb"], "absent.glb"),
        (&["lightmap", "room.glb", "-o", "."], "is a folder"),
        (&["lightmap", "room.glb", "-o", "x.gltf"], "name it .glb"),
        (&["lightmap", "room.glb", "-o", "./room.glb"], "is the scene itself"),
        (&["lightmap", "room.glb", "-o", "x.glb", "--rays", "1"], "rays 1"),
        (&["frobnicate"], "frobnicate"),
    ];
    for (args, wanted) in cases {
        let (status, said) = fails(at, args);
        assert!(status == 2 && said.contains(wanted), "{args:?}: {status} {said}");
    }
    assert!(!at.join("x.cssm").exists() && !at.join("x.glb").exists());
    let (status, said) =
        fails(at, &["bake", "room.glb", "-o", "no/such/folder/x.cssm", "--atlas", "8", "--depth", "8"]);
    assert!(status == 1 && said.contains("folder that exists"), "{status} {said}");
}

#[test]
fn a_killed_run_leaves_the_old_file() {
    let folder = folder();
    let old = b"the old file".to_vec();
    std::fs::write(folder.path().join("room.cssm"), &old).expect("writable");
    let slow = ["bake", "room.glb", "-o", "room.cssm", "--atlas", "512", "--depth", "128", "--quiet"];
    let mut child =
        Command::new(env!("CARGO_BIN_EXE_bounce-bake")).args(slow).current_dir(folder.path()).spawn().expect("it runs");
    std::thread::sleep(std::time::Duration::from_millis(300));
    assert!(child.try_wait().expect("it can be asked").is_none(), "it was done before it could be killed");
    child.kill().and_then(|()| child.wait()).expect("it can be killed");
    assert_eq!(std::fs::read(folder.path().join("room.cssm")).expect("it is there"), old);
}
