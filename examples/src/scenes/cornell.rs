//! The Cornell box, for Bevy's world and for a glTF file from the same numbers.
//!
//! Four metres a side, open towards +z, a spot light under the ceiling pointing down: the ceiling and the shadows are lit
//! by bounced light alone. Colours after the original's, <https://www.graphics.cornell.edu/online/box/>.

use bevy::camera::Exposure;
use bevy::prelude::*;
use bevy_bounce::GlobalIllumination;

use super::Builder;

/// The box with its two blocks.
pub struct CornellPlugin;

/// Which of the box's three paints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surface {
    /// Floor, ceiling, back, blocks.
    White,
    /// Left wall.
    Red,
    /// Right wall.
    Green,
}

/// A wall: a parallelogram from `corner` along `u` and `v`, facing `u` x `v`. Metres.
#[derive(Clone, Copy, Debug)]
pub struct Panel {
    /// What it is.
    pub name: &'static str,
    /// Where it starts.
    pub corner: Vec3,
    /// First edge.
    pub u: Vec3,
    /// Second edge.
    pub v: Vec3,
    /// Its paint.
    pub surface: Surface,
}

/// A block on the floor. Metres.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// What it is.
    pub name: &'static str,
    /// Middle of its base.
    pub base: Vec3,
    /// Width, height, depth.
    pub size: Vec3,
    /// Rotation about the vertical: sine and cosine of half the angle.
    pub half_turn: [f32; 2],
}

/// All the numbers.
pub struct CornellBox;

impl Surface {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::White, Self::Red, Self::Green];

    /// Linear albedo.
    pub const fn albedo(self) -> [f32; 3] {
        match self {
            Self::White => [0.73, 0.73, 0.73],
            Self::Red => [0.63, 0.06, 0.05],
            Self::Green => [0.14, 0.45, 0.09],
        }
    }
}

const X: Vec3 = Vec3::new(4.0, 0.0, 0.0);
const Y: Vec3 = Vec3::new(0.0, 4.0, 0.0);
const Z: Vec3 = Vec3::new(0.0, 0.0, 4.0);
const MINUS_Z: Vec3 = Vec3::new(0.0, 0.0, -4.0);

const fn panel(name: &'static str, corner: [f32; 3], u: Vec3, v: Vec3, surface: Surface) -> Panel {
    Panel { name, corner: Vec3::from_array(corner), u, v, surface }
}

impl CornellBox {
    /// Floor, ceiling, back, left, right.
    pub const PANELS: [Panel; 5] = [
        panel("floor", [-2.0, 0.0, -2.0], Z, X, Surface::White),
        panel("ceiling", [-2.0, 4.0, -2.0], X, Z, Surface::White),
        panel("back", [-2.0, 0.0, -2.0], X, Y, Surface::White),
        panel("left", [-2.0, 0.0, 2.0], MINUS_Z, Y, Surface::Red),
        panel("right", [2.0, 0.0, -2.0], Z, Y, Surface::Green),
    ];

    /// The tall one and the short one.
    pub const BLOCKS: [Block; 2] = [
        Block {
            name: "tall block",
            base: Vec3::new(-0.7, 0.0, -0.65),
            size: Vec3::new(1.15, 2.4, 1.15),
            half_turn: [0.148, 0.988_987],
        },
        Block {
            name: "short block",
            base: Vec3::new(0.75, 0.0, 0.5),
            size: Vec3::new(1.15, 1.15, 1.15),
            half_turn: [-0.14, 0.990_152],
        },
    ];

    /// Where the lamp hangs.
    pub const LAMP: Vec3 = Vec3::new(0.0, 3.9, 0.0);
    /// Strength of the lamp, candela.
    pub const LAMP_CANDELA: f32 = 6000.0;
    /// Inner and outer angle of the lamp's cone, radians from its axis.
    pub const LAMP_CONE: [f32; 2] = [0.95, 1.1];
    /// Where the camera stands, looking along -z.
    pub const EYE: Vec3 = Vec3::new(0.0, 2.0, 8.4);
    /// Vertical field of view, radians.
    pub const FIELD_OF_VIEW: f32 = 0.65;

    /// Spawns the five walls.
    pub fn spawn_walls(build: &mut Builder) {
        for surface in Surface::ALL {
            let paint = build.paint(surface.albedo());
            for panel in Self::PANELS.iter().filter(|panel| panel.surface == surface) {
                build.panel(panel.corner, panel.u, panel.v, &paint).insert(Name::new(panel.name));
            }
        }
    }

    /// Spawns the lamp and a camera with global illumination.
    pub fn spawn_lamp_and_camera(commands: &mut Commands) {
        commands.spawn((
            SpotLight {
                intensity: Self::LAMP_CANDELA * 4.0 * std::f32::consts::PI,
                range: 100.0,
                inner_angle: Self::LAMP_CONE[0],
                outer_angle: Self::LAMP_CONE[1],
                shadow_maps_enabled: true,
                ..default()
            },
            Transform::from_translation(Self::LAMP).looking_to(Vec3::NEG_Y, Vec3::Z),
        ));
        commands.spawn((
            Camera3d::default(),
            GlobalIllumination::default(),
            Exposure { ev100: 8.0 },
            Projection::Perspective(PerspectiveProjection { fov: Self::FIELD_OF_VIEW, ..default() }),
            Transform::from_translation(Self::EYE),
        ));
    }
}

impl Plugin for CornellPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, spawn);
    }
}

fn spawn(mut build: Builder) {
    CornellBox::spawn_walls(&mut build);
    let white = build.paint(Surface::White.albedo());
    for block in CornellBox::BLOCKS {
        let angle = 2.0 * block.half_turn[0].atan2(block.half_turn[1]);
        build.block(block.base, block.size, angle, &white).insert(Name::new(block.name));
    }
    CornellBox::spawn_lamp_and_camera(&mut build.commands);
}
