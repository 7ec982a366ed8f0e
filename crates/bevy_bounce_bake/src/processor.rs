//! Baking as a step of Bevy's asset processor.
//!
//! A *recipe* is a small file beside the scene, `room.cssm.ron`, that names what to bake and how:
//!
//! ```ron
//! (gltf: "room.glb", settings: (atlas: 256, depth: 64, strategy: tiles))
//! ```
//!
//! `gltf` is relative to the recipe, or to the asset folder with a leading `/`; settings that are left out are
//! [`BakeSettings::default`]. With [`BakePlugin`], the recipe is loaded as a [`CssmAsset`] like any asset:
//!
//! ```ignore
//! app.add_plugins((DefaultPlugins.set(AssetPlugin { mode: AssetMode::Processed, ..default() }), BakePlugin));
//! let room: Handle<CssmAsset> = asset_server.load("room.cssm.ron");
//! ```
//!
//! In [`AssetMode::Processed`] the bake happens once and again whenever the recipe, the glTF file, what that refers to, or
//! the version of the baker changes. In [`AssetMode::Unprocessed`] every run bakes on loading.
//!
//! A build pipeline adds the plugin to the headless app that processes its assets and runs that with [`process`], which
//! says what became of each recipe. `examples/process_assets.rs` is such a program.
//!
//! [`AssetMode::Processed`]: bevy_asset::AssetMode::Processed
//! [`AssetMode::Unprocessed`]: bevy_asset::AssetMode::Unprocessed

use std::sync::{Arc, Mutex, PoisonError};

use bevy_app::{App, Plugin};
use bevy_asset::io::{Reader, Writer};
use bevy_asset::processor::{AssetProcessor, LoadTransformAndSave, ProcessorState};
use bevy_asset::saver::{AssetSaver, SavedAsset};
use bevy_asset::transformer::IdentityAssetTransformer;
use bevy_asset::{AssetApp, AssetLoader, AssetPath, AsyncWriteExt, LoadContext};
use bevy_bounce_cssm::{CssmAsset, CssmLoader, CssmPlugin};
use bevy_ecs::resource::Resource;
use bevy_reflect::TypePath;
use serde::{Deserialize, Serialize};

use crate::{BAKER_VERSION, BakeError, BakeSettings, Report, Scene, Source, bake};

/// The full extension of recipes.
pub const RECIPE_EXTENSION: &str = "cssm.ron";

/// What to bake, and how.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// The glTF file: relative to the recipe, or to the asset folder with a leading `/`.
    pub gltf: String,
    /// Sizes and order.
    #[serde(default)]
    pub settings: BakeSettings,
}

/// Registers recipes with the asset server and, where the app has one, with the asset processor.
pub struct BakePlugin;

type BakeProcess = LoadTransformAndSave<RecipeLoader, IdentityAssetTransformer<CssmAsset>, CssmSaver>;

impl Plugin for BakePlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<CssmPlugin>() {
            app.add_plugins(CssmPlugin);
        }
        let outcomes = BakeOutcomes::default();
        app.register_asset_loader(RecipeLoader { outcomes: outcomes.clone() })
            .register_asset_processor(BakeProcess::from(CssmSaver))
            .set_default_asset_processor::<BakeProcess>(RECIPE_EXTENSION)
            .insert_resource(outcomes);
    }
}

/// What became of a recipe that was baked.
#[derive(Clone, Debug)]
pub struct BakeOutcome {
    /// The recipe.
    pub recipe: AssetPath<'static>,
    /// Sizes and time, or one line that says what is wrong and where.
    pub result: Result<Report, String>,
}

/// What became of the recipes that were baked since the last [`take`](Self::take). Recipes that had not changed are not
/// among them.
#[derive(Resource, Clone, Debug, Default)]
pub struct BakeOutcomes(Arc<Mutex<Vec<BakeOutcome>>>);

impl BakeOutcomes {
    /// Takes what there is, by the recipes' paths.
    pub fn take(&self) -> Vec<BakeOutcome> {
        let mut outcomes = std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner));
        outcomes.sort_by_key(|outcome| outcome.recipe.to_string());
        outcomes
    }

    /// In the place of an earlier one of the same recipe. Bevy's processor looks at a recipe by itself and again once its
    /// scene is processed; where both see that the scene has changed, the recipe is baked twice, with the same result.
    fn add(&self, outcome: BakeOutcome) {
        let mut outcomes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        outcomes.retain(|other| other.recipe != outcome.recipe);
        outcomes.push(outcome);
    }
}

/// Runs an app until its asset processor has seen all assets, without a window, and says what became of the recipes.
///
/// The app needs `TaskPoolPlugin`, `AssetPlugin` in processed mode with the processor on, [`BakePlugin`], and the loaders
/// of the other assets in its folder. The output says for each recipe that was baked how it went; one that had not changed
/// is not mentioned. Nothing if the app has no asset processor.
pub fn process(app: &mut App) -> Option<Vec<BakeOutcome>> {
    let processor = app.world().get_resource::<AssetProcessor>()?.clone();
    app.finish();
    app.cleanup();
    app.update();
    while bevy_tasks::block_on(processor.get_state()) != ProcessorState::Finished {
        app.update();
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    app.world().get_resource::<BakeOutcomes>().map(BakeOutcomes::take)
}

/// Bakes what a recipe names.
#[derive(TypePath)]
pub struct RecipeLoader {
    outcomes: BakeOutcomes,
}

/// Why a recipe was not baked.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum RecipeError {
    /// The recipe itself.
    #[error("{recipe}: {problem}; write it as (gltf: \"scene.glb\", settings: (atlas: 128, depth: 64))")]
    Recipe {
        /// The asset.
        recipe: String,
        /// What is wrong with it.
        problem: String,
    },
    /// A file that the recipe or its glTF names.
    #[error("{recipe}: {file}: cannot be read: {problem}; put it there, or name another in the recipe")]
    File {
        /// The asset.
        recipe: String,
        /// The file as an asset path.
        file: String,
        /// What the asset source said.
        problem: String,
    },
    /// The bake.
    #[error("{recipe}: {error}")]
    Bake {
        /// The asset.
        recipe: String,
        /// What is wrong with the scene or the settings.
        error: BakeError,
    },
}

impl AssetLoader for RecipeLoader {
    type Asset = CssmAsset;
    type Settings = ();
    type Error = RecipeError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        _: &(),
        load_context: &mut LoadContext<'_>,
    ) -> Result<CssmAsset, RecipeError> {
        let recipe = load_context.path().clone();
        let result = bake_recipe(reader, load_context).await;
        let outcome = match &result {
            Ok((_, report)) => Ok(report.clone()),
            Err(error) => Err(error.to_string()),
        };
        self.outcomes.add(BakeOutcome { recipe, result: outcome });
        result.map(|(asset, _)| asset)
    }

    fn extensions(&self) -> &[&str] {
        &[RECIPE_EXTENSION]
    }
}

async fn bake_recipe(
    reader: &mut dyn Reader,
    context: &mut LoadContext<'_>,
) -> Result<(CssmAsset, Report), RecipeError> {
    let name = context.path().to_string();
    let wrong = |problem: String| RecipeError::Recipe { recipe: name.clone(), problem };
    let mut bytes = Vec::new();
    reader.read_to_end(&mut bytes).await.map_err(|error| wrong(error.to_string()))?;
    let recipe: Recipe = ron::de::from_bytes(&bytes).map_err(|error| wrong(error.to_string()))?;
    recipe.settings.check().map_err(|error| wrong(error.to_string()))?;
    let path = context.path().resolve_embed_str(&recipe.gltf).map_err(|error| wrong(error.to_string()))?;
    let failed = |error| RecipeError::Bake { recipe: name.clone(), error };
    let mut source = Source::parse(path.to_string(), &read(context, &name, &path).await?).map_err(failed)?;
    for file in source.missing_files() {
        let beside = path.resolve_embed_str(&file).map_err(|error| wrong(error.to_string()))?;
        source.add_file(file, read(context, &name, &beside).await?);
    }
    let scene = Scene::from_gltf(&source).map_err(failed)?;
    let (file, report) = bake(&scene, &recipe.settings, &()).map_err(failed)?;
    Ok((CssmAsset { file }, report))
}

/// The bytes of an asset, which from now on is a dependency of the recipe.
async fn read(context: &mut LoadContext<'_>, recipe: &str, path: &AssetPath<'_>) -> Result<Vec<u8>, RecipeError> {
    context.read_asset_bytes(path.clone()).await.map_err(|error| RecipeError::File {
        recipe: recipe.to_owned(),
        file: path.to_string(),
        problem: error.to_string(),
    })
}

/// Writes baked assets as `.cssm` files have them.
#[derive(TypePath)]
pub struct CssmSaver;

/// Part of what the processor compares to see whether a recipe has to be baked again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CssmSaverSettings {
    /// [`BAKER_VERSION`] of the program that bakes.
    pub baker_version: u32,
}

impl Default for CssmSaverSettings {
    fn default() -> Self {
        Self { baker_version: BAKER_VERSION }
    }
}

impl AssetSaver for CssmSaver {
    type Asset = CssmAsset;
    type Settings = CssmSaverSettings;
    type OutputLoader = CssmLoader;
    type Error = std::io::Error;

    async fn save(
        &self,
        writer: &mut Writer,
        asset: SavedAsset<'_, '_, CssmAsset>,
        _: &CssmSaverSettings,
        _: AssetPath<'_>,
    ) -> Result<(), std::io::Error> {
        writer.write_all(&asset.get().file.to_bytes()).await
    }
}
