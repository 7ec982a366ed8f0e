//! Shows a glTF scene lit by bounced light, in a window or as a picture; renders, measures and compares.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use bevy_bounce_examples::gltf::{GltfScenePlugin, SceneFile};
use bevy_bounce_examples::{Error, Options, app, baked, error, options};
use clap::Parser;

/// Shows a glTF scene lit by bounced light.
#[derive(Parser)]
#[command(version)]
struct Cli {
    /// Scene to show [default: assets/cornell_box.glb]
    #[arg(value_name = "SCENE.glb|.gltf")]
    scene: Option<PathBuf>,
    /// glTF camera by name [default: main, else the first]
    #[arg(long, value_name = "NAME")]
    camera: Option<String>,
    /// As the references: diffuse, two-sided but for what shines, without normal, occlusion or emissive maps, vertex colours, clearcoat or
    /// blended surfaces
    #[arg(long)]
    matte: bool,
    /// Turns textures upside down, which is how the path-traced references show them
    #[arg(long, hide = true)]
    flip_textures: bool,
    /// Baked visibility for the scene, for --technique cssm and --visibility cssm [default: baked now, atlas 128, depth 64]
    #[arg(long, value_name = "FILE.cssm")]
    bake: Option<PathBuf>,
    /// Print the names of the scene's cameras, one a line
    #[arg(long)]
    list_cameras: bool,
    #[command(flatten)]
    options: Options,
}

fn main() -> ExitCode {
    error::exit("viewer", || view(&options::parse("viewer")?))
}

fn view(cli: &Cli) -> Result<(), Error> {
    let run = cli.options.check()?;
    let by_bake = cli.options.uses_bakes();
    if cli.bake.is_some() && !by_bake {
        return Err(Error::Usage("--bake: baked visibility is for --technique cssm and --visibility cssm".into()));
    }
    let file = SceneFile::open(&cli.scene.clone().unwrap_or_else(default_scene))?;
    if cli.list_cameras {
        file.cameras.iter().for_each(|camera| println!("{}", camera.name));
        return Ok(());
    }
    let camera = file.camera(cli.camera.as_deref())?.cloned();
    let bake = by_bake.then(|| baked::load(cli.bake.as_deref(), &file.path)).transpose()?;
    let folder = file.folder();
    app::launch(run, Some(folder), |app| {
        app.add_plugins(GltfScenePlugin { file, camera, matte: cli.matte, flip_textures: cli.flip_textures, bake });
    })
}

/// The project's own scene, from its root or from where cargo runs an example.
fn default_scene() -> PathBuf {
    let name = Path::new("assets/cornell_box.glb");
    let package = std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_else(|| env!("CARGO_MANIFEST_DIR").into());
    let beside = Path::new(&package).join("..").join(name);
    if name.exists() || !beside.exists() { name.to_owned() } else { beside }
}
