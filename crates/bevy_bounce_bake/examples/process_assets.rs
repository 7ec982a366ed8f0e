//! A build step: bakes the recipes of an asset folder, without a window, and says how it went by its exit status.
//!
//! `cargo run --example process_assets -- ASSETS PROCESSED`: 0 if all recipes are baked or up to date, 1 if one failed, 2
//! if the command line makes no sense. A game's own step also adds the plugins that load the rest of its assets.

use std::path::PathBuf;
use std::process::ExitCode;

use bevy_app::{App, TaskPoolPlugin};
use bevy_asset::processor::{AssetProcessor, FileTransactionLogFactory};
use bevy_asset::{AssetMode, AssetPlugin};
use bevy_bounce_bake::processor::{BakePlugin, process};

fn main() -> ExitCode {
    let folders: Vec<PathBuf> =
        std::env::args_os().skip(1).map(|folder| std::path::absolute(folder).unwrap_or_default()).collect();
    let [assets, processed] = &folders[..] else {
        eprintln!("process_assets: give two folders: process_assets ASSETS PROCESSED");
        return ExitCode::from(2);
    };
    if !assets.is_dir() {
        eprintln!("process_assets: {}: is no folder; give the folder with the assets", assets.display());
        return ExitCode::from(2);
    }
    let mut app = App::new();
    app.add_plugins((
        TaskPoolPlugin::default(),
        AssetPlugin {
            file_path: assets.display().to_string(),
            processed_file_path: processed.join("Default").display().to_string(),
            mode: AssetMode::Processed,
            use_asset_processor_override: Some(true),
            watch_for_changes_override: Some(false),
            ..Default::default()
        },
        BakePlugin,
    ));
    if let Some(processor) = app.world().get_resource::<AssetProcessor>() {
        let log = FileTransactionLogFactory { file_path: processed.join("log") };
        if let Err(error) = processor.data().set_log_factory(Box::new(log)) {
            eprintln!("process_assets: {error}");
            return ExitCode::from(1);
        }
    }
    let mut failed = false;
    for outcome in process(&mut app).unwrap_or_default() {
        match outcome.result {
            Ok(report) => println!("{}: baked, {:.1} : 1, {:.1} s", outcome.recipe, report.ratio, report.seconds),
            Err(problem) => {
                eprintln!("process_assets: {problem}");
                failed = true;
            }
        }
    }
    ExitCode::from(u8::from(failed))
}
