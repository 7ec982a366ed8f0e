//! Generated scenes, each a plugin: a camera, lights and meshes from numbers alone, the same every time.

mod animal;
mod animal_mesh;
mod buddha_box;
mod build;
mod chance;
mod church;
mod cornell;
mod crowd;
mod doors;
mod heads;
mod night_market;
mod object;
mod office;
mod see_through;
mod showroom;
mod solid;
mod town;
mod u_room;
mod village;

pub use animal::AnimalPlugin;
pub use buddha_box::BuddhaBoxPlugin;
pub use build::{Builder, Walls};
pub use church::ChurchPlugin;
pub use cornell::{Block, CornellBox, CornellPlugin, Panel, Surface};
pub use crowd::CrowdPlugin;
pub use doors::DoorsPlugin;
pub use heads::HeadsPlugin;
pub use night_market::NightMarketPlugin;
pub use object::{BakedObject, Piece, report};
pub use office::OfficePlugin;
pub use see_through::SeeThroughPlugin;
pub use showroom::ShowroomPlugin;
pub use solid::Solid;
pub use town::TownPlugin;
pub use u_room::URoomPlugin;
pub use village::VillagePlugin;
