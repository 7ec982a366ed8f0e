//! Lightmaps and an irradiance volume for plain Bevy.
//!
//! From a glTF file comes another one with everything that was in it, a second UV set and its own place in the atlas
//! for each surface, and beside it two textures that Bevy 0.19 reads as they are:
//!
//! | file | in Bevy | holds |
//! |---|---|---|
//! | `NAME.glb` | a scene | `extras` of primitives name the lightmap, those of a node the volume, which the node places |
//! | `NAME.lightmap.ktx2` | `Lightmap::image`, all of it | irradiance over pi, cd/m²: `StandardMaterial::lightmap_exposure` stays 1 |
//! | `NAME.volume.ktx2` | `IrradianceVolume::voxels` | the same for six facings a voxel: `intensity` is 1 |
//!
//! Bevy's loader knows nothing of lightmaps. An observer of a few lines hands them out; `examples/baked_lightmap.rs` is
//! one:
//!
//! ```ignore
//! fn hand_out(
//!     ready: On<WorldInstanceReady>,
//!     children: Query<&Children>,
//!     extras: Query<&GltfExtras>,
//!     assets: Res<AssetServer>,
//!     mut commands: Commands,
//! ) {
//!     for entity in children.iter_descendants(ready.entity) {
//!         let Ok(GltfExtras { value }) = extras.get(entity) else { continue };
//!         if value.contains("room.lightmap.ktx2") {
//!             let image = assets.load("room.lightmap.ktx2");
//!             commands.entity(entity).insert(Lightmap { image, ..default() });
//!         } else if value.contains("room.volume.ktx2") {
//!             let voxels = assets.load("room.volume.ktx2");
//!             commands.entity(entity).insert(IrradianceVolume { voxels, intensity: 1.0, ..default() });
//!         }
//!     }
//! }
//! ```
//!
//! # What is in the light
//!
//! All that bounces, and all that emissive surfaces send; not what lamps light by themselves, which Bevy adds live,
//! unless [`LightmapSettings::direct`] says so. Emission counts as cd/m², as glTF has it; plain Bevy shows it without
//! exposure unless `StandardMaterial::emissive_exposure_weight` is 1. The sky is black.
//!
//! Lamps (`KHR_lights_punctual`) are as Bevy 0.19 loads and shades them: their colours are taken for sRGB, they reach 20
//! units where they name no range, and fade out towards its end and the edge of their cone. They cast shadows: switch
//! these on in Bevy, whose loader leaves them off, and ambient light off. Lamps that move count where they stand in the
//! file.
//!
//! # What is lit
//!
//! All opaque and masked surfaces that stand still. What moves by a skin, morph targets or an animation, and what light
//! passes, is neither in the lightmap nor in the way of light: the volume lights it. A double-sided primitive gets its
//! backs as triangles of their own and a material that culls, for its sides are lit differently. A mesh that stands in
//! several places is copied for each. Those without a first UV set get one, for Bevy 0.19 has no shader for a second
//! alone. With a second UV set for all ([`UvSource`]) nothing of this is needed, and the geometry stays as it was.
//!
//! # How
//!
//! Radiosity between the texels of the atlas, then one last gathering with more rays. A texel is the mean of up to four
//! places; those that no light reaches, or that see backs of surfaces for the most part, lie within solids and are left
//! out, and texels that have only such take the light of their neighbours, as those round each chart do. Differences
//! between texels that are no more than the noise of their rays are evened out.
//!
//! Bevy's deferred renderer does not tell lightmapped surfaces from others when it applies irradiance volumes: there
//! they get both. Its forward renderer takes the lightmap alone.
//!
//! # Measured
//!
//! What the lightmap adds to Bevy's picture, as energy against path-traced references of as many bounces; `low` is the
//! error that is left when noise is averaged away. `cargo test --workspace --test baked lightmap -- --nocapture
//! --include-ignored` prints it:
//!
//! | scene | atlas | rays | energy | low |
//! |---|---|---|---|---|
//! | Cornell box, 34 triangles | 128 | 128 | 0.987 | 0.043 |
//! | a corner with spheres, 2,338 triangles | 256 | 128 | 0.988 | 0.024 |
//! | a room lit from round the corner, 36 triangles | 256 | 128 | 0.992 | 0.033 |
//! | a cathedral, 75,276 triangles, all of them double-sided | 1024 | 64 | 0.992 | 0.056 |
//!
//! Surfaces that are lit by a volume of 8 voxels a side instead are 1.045 times as bright as by the lightmap.
//!
//! `bounce-bake lightmap assets/cornell_box.glb -o OUT.glb --atlas N`, debug build, two cores of which other programs used
//! the better part: what the bake takes by itself is in the processor's seconds, over both cores.
//!
//! | atlas | texels | rays | seconds | processor | peak memory |
//! |---|---|---|---|---|---|
//! | 256 | 44,207 | 512 | 15.9 | 7.7 | 34 MB |
//! | 512 | 180,012 | 512 | 71.8 | 35.8 | 109 MB |
//!
//! The cathedral's 503,636 texels in 22,874 charts took 251 s in that test; where charts are so many, a good part of
//! this is spent on finding places for them.

mod export;
mod fill;
mod places;
mod radiosity;
mod sampling;
mod smooth;
mod surface;
mod texture;
mod volume;

use std::time::Instant;

use glam::{UVec3, Vec3};

use crate::atlas::{Atlas, UvSource};
use crate::bake::LIFT;
use crate::scene::{Scene, Source, emissions, lights};
use crate::{BakeError, Progress};
use export::Marks;
use fill::fill;
use places::Places;
use radiosity::Radiosity;
use smooth::smooth;
use surface::Surface;
use volume::Volume;

/// Rings of cells round each chart that take the light of their neighbours: as many as bicubic filtering reads.
const RINGS: u32 = 2;
/// The brightest texel that the textures hold, cd/m².
pub const BRIGHTEST: f32 = texture::LARGEST;

/// What can be chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LightmapSettings {
    /// Side of the atlas in texels, 8 to 4096. Time grows with its square.
    pub atlas: u32,
    /// Rays of a texel for the light that the map holds, 16 to 65536. Noise falls with their square root.
    pub rays: u32,
    /// Most reflections, at least 1; as many as matter where none is given.
    pub bounces: Option<u32>,
    /// Voxels of the irradiance volume along the scene's longest side, up to 128; 0 for none.
    pub probes: u32,
    /// Whether the map holds what lamps light by themselves, too.
    pub direct: bool,
    /// Whether the second UV set is passed over.
    pub unwrap: bool,
}

impl Default for LightmapSettings {
    fn default() -> Self {
        Self { atlas: 512, rays: 512, bounces: None, probes: 16, direct: false, unwrap: false }
    }
}

impl LightmapSettings {
    /// Whether all values are in range.
    pub fn check(&self) -> Result<(), BakeError> {
        let wrong = |problem: String| Err(BakeError::Setting(problem));
        if !(8..=4096).contains(&self.atlas) {
            return wrong(format!("atlas {}: 8 to 4096 texels are possible", self.atlas));
        }
        if !(16..=65_536).contains(&self.rays) {
            return wrong(format!("rays {}: 16 to 65536 are possible", self.rays));
        }
        if self.bounces == Some(0) {
            return wrong("bounces 0: at least 1 is needed, or the map would be black".into());
        }
        if self.probes > 128 {
            return wrong(format!("probes {}: up to 128 along the longest side are possible", self.probes));
        }
        Ok(())
    }
}

/// The files that belong together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LightmapFiles {
    /// The scene, binary glTF.
    pub scene: Vec<u8>,
    /// The lightmap, KTX 2.
    pub lightmap: Vec<u8>,
    /// The irradiance volume, KTX 2.
    pub volume: Option<Vec<u8>>,
}

/// What a lightmap came to.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct LightmapReport {
    /// Width and height of the atlas in texels.
    pub atlas: [u32; 2],
    /// Texels that show some surface.
    pub texels: usize,
    /// Those of them without light of their own: none reaches them, or they lie within solids. Near others they take theirs.
    pub filled: usize,
    /// Pieces that the surface was cut into.
    pub charts: u32,
    /// Lamps that were found.
    pub lights: usize,
    /// Reflections.
    pub bounces: u32,
    /// Rays of a texel.
    pub rays: u32,
    /// Voxels of the irradiance volume.
    pub probes: [u32; 3],
    /// Texels brighter than [`BRIGHTEST`].
    pub cut_off: usize,
    /// Of the whole bake but for reading the file and putting the new ones together.
    pub seconds: f64,
}

/// Names of the textures that go with a scene of that name.
pub fn texture_names(stem: &str) -> [String; 2] {
    [format!("{stem}.lightmap.ktx2"), format!("{stem}.volume.ktx2")]
}

/// Bakes the default scene of a file, on all threads of the current `rayon` pool. The result does not depend on how
/// many those are. `stem` is the name of the new scene, without extension: the scene refers to its textures by
/// [`texture_names`].
pub fn bake_lightmap(
    source: &Source,
    stem: &str,
    settings: &LightmapSettings,
    progress: &dyn Progress,
) -> Result<(LightmapFiles, LightmapReport), BakeError> {
    settings.check()?;
    let started = Instant::now();
    let scene = Scene::from_gltf(source)?.still(source)?;
    let (lights, emissions) = (lights(source)?, emissions(source)?);
    let uv = if settings.unwrap { UvSource::Unwrap } else { UvSource::Auto };
    let atlas = Atlas::build(&scene, settings.atlas, uv, progress)?;
    let cells = cells(&atlas);
    let places = Places::new(&scene, &emissions, &atlas, &cells);
    let surface = Surface::new(&scene, &atlas, &cells);
    let (min, max) = scene.bounds();
    let lift = LIFT * min.distance(max);
    let radiosity = Radiosity { surface: &surface, places: &places, atlas: &atlas, lights: &lights, lift };
    let solution = radiosity.solve(settings.bounces, progress);
    let gathered = radiosity.gather(&solution.radiance, settings.rays, progress);
    let mut light = smooth(&atlas, &cells, &gathered);
    let filled = light.iter().filter(|light| light.is_none()).count();
    if settings.direct {
        for ((light, gathered), direct) in light.iter_mut().zip(&gathered).zip(&solution.direct) {
            // Where nothing bounces, lamps may light nevertheless.
            let alone = Some(*direct).filter(|direct| *direct != Vec3::ZERO);
            *light = light.zip(gathered.as_ref()).map(|(light, gathered)| light + gathered.direct).or(alone);
        }
    }
    let texels = spread(&atlas, &cells, &light);
    let volume = (settings.probes > 0).then(|| Volume::new([min, max], settings.probes));
    let voxels = volume.map(|volume| volume.light(&surface, &solution.radiance, progress));

    let brightest = |texel: &&Vec3| texel.max_element() > BRIGHTEST;
    let report = LightmapReport {
        atlas: atlas.size.to_array(),
        texels: atlas.texels.len(),
        filled,
        charts: atlas.charts,
        lights: lights.len(),
        bounces: solution.bounces,
        rays: settings.rays,
        probes: volume.map_or([0; 3], |volume| volume.resolution.to_array()),
        cut_off: texels.iter().filter(brightest).count(),
        seconds: started.elapsed().as_secs_f64(),
    };
    let marks = Marks::new(texture_names(stem), volume);
    let files = LightmapFiles {
        scene: export::scene(source, &scene, &atlas, &marks)?,
        lightmap: texture::write(&texels, atlas.size.extend(1))?,
        volume: match (volume, voxels) {
            (Some(volume), Some(voxels)) => Some(texture::write(&voxels, volume.texels())?),
            _ => None,
        },
    };
    Ok((files, report))
}

/// The texel of each cell.
fn cells(atlas: &Atlas) -> Vec<Option<u32>> {
    let mut cells = vec![None; (atlas.size.x * atlas.size.y) as usize];
    for (number, texel) in (0..).zip(&atlas.texels) {
        let [x, y] = texel.texel.cell;
        cells[(y * atlas.size.x + x) as usize] = Some(number);
    }
    cells
}

/// The texture: light of the texels, and what lies round them.
fn spread(atlas: &Atlas, cells: &[Option<u32>], light: &[Option<Vec3>]) -> Vec<Vec3> {
    let mut texture: Vec<Option<Vec3>> = cells.iter().map(|cell| light[(*cell)? as usize]).collect();
    fill(&mut texture, UVec3::new(atlas.size.x, atlas.size.y, 1), RINGS);
    texture.into_iter().map(Option::unwrap_or_default).collect()
}
