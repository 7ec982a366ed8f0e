//! Recipes in the asset processor, headless.

use std::path::Path;

use bevy_app::{App, TaskPoolPlugin};
use bevy_asset::processor::{AssetProcessor, FileTransactionLogFactory};
use bevy_asset::{AssetMode, AssetPlugin, AssetServer, Assets, Handle};
use bevy_bounce_bake::processor::{BakeOutcome, BakePlugin, process};
use bevy_bounce_bake::{Scene, Source, bake};
use bevy_bounce_cssm::CssmAsset;

use crate::scenes::{cornell_box, small};

const RECIPE: &str = "(gltf: \"room.glb\", settings: (atlas: 24, depth: 8))";

fn app(folder: &Path, mode: AssetMode) -> App {
    let mut app = App::new();
    let plugin = AssetPlugin {
        file_path: folder.join("assets").display().to_string(),
        processed_file_path: folder.join("imported/Default").display().to_string(),
        mode,
        use_asset_processor_override: Some(true),
        watch_for_changes_override: Some(false),
        ..AssetPlugin::default()
    };
    app.add_plugins((TaskPoolPlugin::default(), plugin, BakePlugin));
    if let Some(processor) = app.world().get_resource::<AssetProcessor>() {
        let log = FileTransactionLogFactory { file_path: folder.join("imported/log") };
        processor.data().set_log_factory(Box::new(log)).expect("it has not started");
    }
    app
}

/// One run of a build pipeline.
fn run(folder: &Path) -> Vec<BakeOutcome> {
    process(&mut app(folder, AssetMode::Processed)).expect("it has a processor")
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let assets = folder.path().join("assets/rooms");
    std::fs::create_dir_all(&assets).expect("writable");
    std::fs::copy(cornell_box(), assets.join("room.glb")).expect("the repository has it");
    std::fs::write(assets.join("room.cssm.ron"), RECIPE).expect("writable");
    folder
}

fn assert_baked(outcomes: &[BakeOutcome]) {
    let baked =
        matches!(outcomes, [BakeOutcome { recipe, result: Ok(_) }] if recipe.to_string() == "rooms/room.cssm.ron");
    assert!(baked, "{outcomes:?}");
}

#[test]
fn what_has_changed_is_baked_again() {
    let folder = folder();
    let assets = folder.path().join("assets/rooms");
    let output = folder.path().join("imported/Default/rooms/room.cssm.ron");
    assert_baked(&run(folder.path()));

    // The same bytes as by the library, and by the command, which calls it.
    let scene = Source::open(&cornell_box()).and_then(|source| Scene::from_gltf(&source)).expect("it is fine");
    let bytes = bake(&scene, &small(), &()).expect("it can be baked").0.to_bytes();
    assert!(std::fs::read(&output).expect("it was written") == bytes);
    assert!(run(folder.path()).is_empty());

    std::fs::write(assets.join("room.cssm.ron"), RECIPE.replace("24", "32")).expect("writable");
    assert_baked(&run(folder.path()));
    assert!(std::fs::read(&output).expect("it was written") != bytes);
    assert!(run(folder.path()).is_empty());

    let glb = std::fs::read(assets.join("room.glb")).expect("it is there");
    let mut changed = glb.clone();
    let last = changed.len() - 6;
    changed[last] ^= 1;
    std::fs::write(assets.join("room.glb"), &changed).expect("writable");
    assert_baked(&run(folder.path()));

    std::fs::write(assets.join("room.glb"), &glb[..glb.len() / 2]).expect("writable");
    let outcomes = run(folder.path());
    let [BakeOutcome { result: Err(problem), .. }] = &outcomes[..] else { panic!("{outcomes:?}") };
    assert!(problem.contains("rooms/room.cssm.ron") && problem.contains("rooms/room.glb"), "{problem}");
    assert!(problem.contains("truncated"), "{problem}");

    std::fs::write(assets.join("room.glb"), &glb).expect("writable");
    assert_baked(&run(folder.path()));
    assert!(run(folder.path()).is_empty());
}

#[test]
fn recipes_that_make_no_sense_are_named() {
    let folder = folder();
    let recipe = folder.path().join("assets/rooms/room.cssm.ron");
    for (text, wanted) in [
        ("(gltf: ", "write it as"),
        ("(gltf: \"room.glb\", settings: (atlas: 24, deep: 8))", "deep"),
        ("(gltf: \"room.glb\", settings: (depth: 9))", "multiple of 8"),
        ("(gltf: \"hall.glb\")", "rooms/hall.glb"),
    ] {
        std::fs::write(&recipe, text).expect("writable");
        let outcomes = run(folder.path());
        let [BakeOutcome { result: Err(problem), .. }] = &outcomes[..] else { panic!("{text}: {outcomes:?}") };
        assert!(problem.contains("rooms/room.cssm.ron") && problem.contains(wanted), "{problem}");
    }
}

#[test]
fn recipes_load_as_baked_assets() {
    let folder = folder();
    run(folder.path());
    for mode in [AssetMode::Processed, AssetMode::Unprocessed] {
        let mut app = app(folder.path(), mode);
        let handle: Handle<CssmAsset> = app.world().resource::<AssetServer>().load("rooms/room.cssm.ron");
        for _ in 0..20_000 {
            app.update();
            if app.world().resource::<Assets<CssmAsset>>().contains(&handle) {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        let assets = app.world().resource::<Assets<CssmAsset>>();
        assert_eq!(assets.get(&handle).map(|asset| asset.file.meta.depth), Some(8));
    }
}
