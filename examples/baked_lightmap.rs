//! What `bounce-bake lightmap` writes, in plain Bevy: a lightmap on all that stands still, an irradiance volume for a
//! ball that moves. None of this project's plugins runs.
//!
//! `cargo run --example baked_lightmap -- BAKED.glb` shows a file of yours; without one the Cornell box is baked first.
//! A window by default; `--output FILE.png` renders without one, `--help` lists the options.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use bevy::camera::Exposure;
use bevy::gltf::GltfExtras;
use bevy::light::IrradianceVolume;
use bevy::pbr::{DefaultOpaqueRendererMethod, Lightmap};
use bevy::prelude::*;
use bevy::world_serialization::WorldInstanceReady;
use bevy_bounce_bake::lightmap::texture_names;
use bevy_bounce_bake::{LightmapSettings, Source, bake_lightmap, write_atomically};
use bevy_bounce_examples::headless::Pending;
use bevy_bounce_examples::metering::Metered;
use bevy_bounce_examples::{Error, Options, app, error, options};
use clap::Parser;

/// Shows what `bounce-bake lightmap` wrote in plain Bevy.
#[derive(Parser)]
#[command(version)]
struct Cli {
    /// Scene that `bounce-bake lightmap` wrote [default: assets/cornell_box.glb, baked now]
    #[arg(value_name = "BAKED.glb")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    options: Options,
}

/// The baked files.
#[derive(Resource)]
struct Baked {
    scene: Handle<WorldAsset>,
    lightmap: Handle<Image>,
    volume: Handle<Image>,
}

/// Goes up and down.
#[derive(Component)]
struct Ball;

const PENDING: &str = "the baked scene";

fn main() -> ExitCode {
    error::exit("baked_lightmap", || {
        let mut cli: Cli = options::parse("baked_lightmap")?;
        cli.options.plain_bevy = true;
        let run = cli.options.check()?;
        let scene = cli.scene.map_or_else(bake, Ok)?;
        let folder = scene.canonicalize().map_err(|error| Error::file(&scene, error.to_string()))?;
        app::launch(run, folder.parent().map(Path::to_owned), |app| {
            app.insert_resource(DefaultOpaqueRendererMethod::forward()).init_resource::<Pending>();
            app.world_mut().resource_mut::<Pending>().add(PENDING);
            let assets = app.world().resource::<AssetServer>();
            let name = scene.file_name().unwrap_or_default().to_string_lossy();
            let stem = scene.file_stem().unwrap_or_default().to_string_lossy();
            let [lightmap, volume] = texture_names(&stem).map(|name| assets.load(name));
            let scene = assets.load(GltfAssetLabel::Scene(0).from_asset(name.into_owned()));
            app.insert_resource(Baked { scene, lightmap, volume })
                .add_systems(Startup, setup)
                .add_systems(Update, (wait, move_ball))
                .add_observer(look)
                .add_observer(cast_shadows);
        })
    })
}

/// Bakes the Cornell box into the folder for temporary files.
fn bake() -> Result<PathBuf, Error> {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/cornell_box.glb");
    let wrong = |error: bevy_bounce_bake::BakeError| Error::file(&scene, error.to_string());
    let settings = LightmapSettings { atlas: 192, rays: 256, ..default() };
    let (files, _) =
        bake_lightmap(&Source::open(&scene).map_err(wrong)?, "cornell_box", &settings, &()).map_err(wrong)?;
    let folder = std::env::temp_dir().join("bevy_bounce_baked_lightmap");
    std::fs::create_dir_all(&folder).map_err(|error| Error::file(&folder, error.to_string()))?;
    let [lightmap, volume] = texture_names("cornell_box").map(|name| folder.join(name));
    let written = folder.join("cornell_box.glb");
    write_atomically(&lightmap, &files.lightmap).map_err(wrong)?;
    write_atomically(&volume, &files.volume.unwrap_or_default()).map_err(wrong)?;
    write_atomically(&written, &files.scene).map_err(wrong)?;
    Ok(written)
}

fn setup(
    mut commands: Commands,
    baked: Res<Baked>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    commands.spawn(WorldAssetRoot(baked.scene.clone())).observe(hand_out);
    let paint = StandardMaterial { perceptual_roughness: 0.9, ..default() };
    commands.spawn((
        Ball,
        Mesh3d(meshes.add(Sphere::new(0.4))),
        MeshMaterial3d(materials.add(paint)),
        Transform::default(),
    ));
}

/// Gives lightmap and volume to the entities whose extras name them.
fn hand_out(
    ready: On<WorldInstanceReady>,
    children: Query<&Children>,
    extras: Query<&GltfExtras>,
    baked: Res<Baked>,
    mut commands: Commands,
) {
    for entity in children.iter_descendants(ready.entity) {
        let Ok(GltfExtras { value }) = extras.get(entity) else { continue };
        if value.contains(".lightmap.ktx2") {
            commands.entity(entity).insert(Lightmap { image: baked.lightmap.clone(), ..default() });
        } else if value.contains(".volume.ktx2") {
            let voxels = baked.volume.clone();
            commands.entity(entity).insert(IrradianceVolume { voxels, intensity: 1.0, ..default() });
        }
    }
}

/// The lamps cast shadows, as they do in the bake.
fn cast_shadows(
    _: On<WorldInstanceReady>,
    mut points: Query<&mut PointLight>,
    mut spots: Query<&mut SpotLight>,
    mut suns: Query<&mut DirectionalLight>,
) {
    points.iter_mut().for_each(|mut light| light.shadow_maps_enabled = true);
    spots.iter_mut().for_each(|mut light| light.shadow_maps_enabled = true);
    suns.iter_mut().for_each(|mut light| light.shadow_maps_enabled = true);
}

/// Cameras of the file see a room at night and do as the command line asks, which counts for those that are added.
fn look(_: On<WorldInstanceReady>, cameras: Query<Entity, With<Camera3d>>, mut commands: Commands) {
    for camera in cameras {
        let mut camera = commands.entity(camera);
        camera.remove::<Camera3d>().insert((Camera3d::default(), Exposure { ev100: 8.0 }, Metered));
    }
}

fn move_ball(time: Res<Time>, mut balls: Query<&mut Transform, With<Ball>>) {
    for mut ball in &mut balls {
        ball.translation = Vec3::new(0.0, 2.0 + 1.2 * time.elapsed_secs().sin(), 1.0);
    }
}

/// Tells windowless runs when everything is there.
fn wait(baked: Res<Baked>, assets: Res<AssetServer>, lit: Query<(), With<Lightmap>>, mut pending: ResMut<Pending>) {
    // There is no volume where no probes were asked for.
    let has_volume = !assets.load_state(&baked.volume).is_failed();
    if !lit.is_empty() && assets.is_loaded(&baked.lightmap) && (!has_volume || assets.is_loaded(&baked.volume)) {
        pending.done(PENDING);
    }
}
