//! Two heads that turn in the Cornell box, over a floor with letters: the scene of Ritschel et al. 2008, out of numbers.
//!
//! The room and the heads are baked each by itself; both heads are of one bake.

use bevy::prelude::*;
use bevy_bounce_bake::BakeSettings;
use bevy_bounce_cssm::CssmAsset;

use super::solid::atlas_place;
use super::{BakedObject, Builder, CornellBox, Piece, Solid, report};
use crate::Error;
use crate::headless::Failed;

/// The room, two heads, the lamp and the camera of the Cornell box.
pub struct HeadsPlugin;

/// Turns about the vertical, radians a second.
#[derive(Component)]
struct Turning(f32);

impl Plugin for HeadsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Failed>().add_systems(Startup, spawn).add_systems(Update, turn);
    }
}

/// Cells of the floor a side; a letter is five high and wide.
const CELLS: u32 = 66;
/// Quadrilaterals a side of each of a head's six charts.
const HEAD_QUADS: u32 = 40;
const ROOM_BAKE: BakeSettings =
    BakeSettings { atlas: 96, depth: 32, strategy: bevy_bounce_bake::Strategy::Tiles, unwrap: false };
const HEAD_BAKE: BakeSettings = BakeSettings { atlas: 72, ..ROOM_BAKE };

/// Rows of a letter from the top, bits from the left.
fn letter(letter: u8) -> [u8; 5] {
    match letter {
        b'B' => [0b11110, 0b10001, 0b11110, 0b10001, 0b11110],
        b'C' => [0b01111, 0b10000, 0b10000, 0b10000, 0b01111],
        b'E' => [0b11111, 0b10000, 0b11110, 0b10000, 0b11111],
        b'N' => [0b10001, 0b11001, 0b10101, 0b10011, 0b10001],
        b'O' => [0b01110, 0b10001, 0b10001, 0b10001, 0b01110],
        b'U' => [0b10001, 0b10001, 0b10001, 0b10001, 0b01110],
        b'V' => [0b10001, 0b10001, 0b01010, 0b01010, 0b00100],
        b'Y' => [0b10001, 0b01010, 0b00100, 0b00100, 0b00100],
        _ => [0; 5],
    }
}

/// What is written on the floor at a cell, counted from the back left.
fn ink(column: u32, row: u32) -> Vec3 {
    const TEXT: &[u8] = b"BEVYBOUNCE ";
    const INKS: [Vec3; 2] = [Vec3::new(0.05, 0.08, 0.45), Vec3::new(0.55, 0.06, 0.04)];
    let (line, within) = (row / 6, row % 6);
    let (place, across) = (column / 6, column % 6);
    let rows = letter(TEXT[((place + 4 * line) as usize) % TEXT.len()]);
    let is_ink = within < 5 && across < 5 && rows[within as usize] >> (4 - across) & 1 == 1;
    if is_ink { INKS[line as usize % 2] } else { Vec3::splat(0.78) }
}

fn floor() -> Solid {
    let mut floor = Solid::default();
    let panel = CornellBox::PANELS[0];
    // `u` runs to the front, `v` to the right.
    let at = |column: u32, row: u32| {
        let [across, along] = [column, row].map(|step| step as f32 / CELLS as f32);
        (panel.corner + panel.u * along + panel.v * across, atlas_place(0, Vec2::new(across, along)))
    };
    for row in 0..CELLS {
        for column in 0..CELLS {
            let corners = [at(column, row), at(column, row + 1), at(column + 1, row + 1), at(column + 1, row)];
            floor.quad(corners.map(|(position, _)| position), ink(column, row));
            floor.atlas.extend(corners.map(|(_, atlas)| atlas));
        }
    }
    floor
}

fn room() -> Vec<Piece> {
    let mut pieces = vec![Piece { name: "floor", solid: floor(), albedo: [1.0; 3] }];
    for (panel, chart) in CornellBox::PANELS[1..].iter().zip(1..) {
        let mut solid = Solid::default();
        let [a, c] = [panel.corner, panel.corner + panel.u + panel.v];
        solid.quad([a, a + panel.u, c, a + panel.v], Vec3::ONE);
        solid.atlas.extend([Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y].map(|at| atlas_place(chart, at)));
        pieces.push(Piece { name: panel.name, solid, albedo: panel.surface.albedo() });
    }
    pieces
}

/// The surface of a head in a direction from its middle; it looks along +z. Metres.
fn head_surface(direction: Vec3) -> Vec3 {
    let d = direction.normalize();
    let bump = |x: f32, y: f32, z: f32, width: f32| {
        (-d.distance_squared(Vec3::new(x, y, z).normalize()) / (width * width)).exp()
    };
    let hair = (0.5 * (d.y + 0.1 - d.z)).clamp(0.0, 1.0) * (34.0 * d.x + 9.0 * (5.0 * d.y).sin()).sin();
    let pores = (41.0 * d.x).sin() * (37.0 * d.y).sin() * (43.0 * d.z).sin();
    let eyes = bump(0.36, 0.14, 0.9, 0.2) + bump(-0.36, 0.14, 0.9, 0.2);
    let nose = bump(0.0, -0.05, 1.0, 0.17);
    let brow = bump(0.3, 0.34, 0.9, 0.2) + bump(-0.3, 0.34, 0.9, 0.2);
    let lips = bump(0.0, -0.38, 0.95, 0.12) * (60.0 * (d.y + 0.37)).sin().abs();
    let ears = bump(1.0, 0.0, -0.1, 0.2) + bump(-1.0, 0.0, -0.1, 0.2);
    let chin = bump(0.0, -0.75, 0.75, 0.3);
    let relief = 0.07 * hair + 0.012 * pores - 0.12 * eyes + 0.26 * nose + 0.06 * brow + 0.06 * lips + 0.2 * ears;
    d * (1.0 + relief + 0.08 * chin) * Vec3::new(0.5, 0.68, 0.6)
}

/// A cube whose sides are blown up, each a chart.
fn head() -> Solid {
    let mut solid = Solid::default();
    let rows = HEAD_QUADS + 1;
    for face in 0..6_u32 {
        let axis = (face / 2) as usize;
        let sign = if face.is_multiple_of(2) { 1.0 } else { -1.0 };
        let direction = |at: Vec2| {
            // Even angles.
            let across = ((2.0 * at - 1.0) * std::f32::consts::FRAC_PI_4).map(f32::tan);
            let mut direction = Vec3::ZERO;
            direction[axis] = sign;
            direction[(axis + 1) % 3] = across.x * sign;
            direction[(axis + 2) % 3] = across.y;
            direction
        };
        let first = solid.positions.len() as u32;
        for i in 0..rows * rows {
            let at = Vec2::new((i % rows) as f32, (i / rows) as f32) / HEAD_QUADS as f32;
            let step = |along: Vec2| head_surface(direction(at + along)) - head_surface(direction(at - along));
            let [across, up] = [Vec2::X, Vec2::Y].map(|axis| step(axis * 0.25 / HEAD_QUADS as f32));
            solid.positions.push(head_surface(direction(at)));
            solid.normals.push(across.cross(up).normalize_or(Vec3::Y));
            solid.colors.push(Vec3::ONE);
            solid.atlas.push(atlas_place(face, at));
        }
        for i in 0..HEAD_QUADS * HEAD_QUADS {
            let corner = first + i / HEAD_QUADS * rows + i % HEAD_QUADS;
            solid.indices.extend([0, 1, rows + 1, 0, rows + 1, rows].map(|offset| corner + offset));
        }
    }
    solid
}

fn spawn(mut build: Builder, bakes: Option<ResMut<Assets<CssmAsset>>>, mut failed: ResMut<Failed>) {
    report(try_spawn(&mut build, bakes), &mut failed);
}

fn try_spawn(build: &mut Builder, bakes: Option<ResMut<Assets<CssmAsset>>>) -> Result<(), Error> {
    let mut bakes = bakes.map(ResMut::into_inner);
    let room = BakedObject::new("room", &room(), &ROOM_BAKE, build, bakes.as_deref_mut())?;
    let plaster = Piece { name: "plaster", solid: head(), albedo: [0.74, 0.7, 0.64] };
    let head = BakedObject::new("head", &[plaster], &HEAD_BAKE, build, bakes)?;
    room.spawn(&mut build.commands, Transform::IDENTITY);
    for (name, x, angle, speed) in [("left head", -0.85, 0.5, 0.6), ("right head", 0.85, -0.6, -0.45)] {
        let at = Transform::from_xyz(x, 1.15, -0.1).with_rotation(Quat::from_rotation_y(angle));
        let head = head.spawn(&mut build.commands, at);
        build.commands.entity(head).insert((Name::new(name), Turning(speed)));
    }
    CornellBox::spawn_lamp_and_camera(&mut build.commands);
    Ok(())
}

fn turn(time: Res<Time>, mut heads: Query<(&mut Transform, &Turning)>) {
    for (mut transform, Turning(speed)) in &mut heads {
        transform.rotate_y(speed * time.delta_secs());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_head_is_seen_from_outside() {
        let head = head();
        let triangles = head.indices.as_chunks::<3>().0;
        let outwards = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|index| head.positions[index as usize]);
            let normal = head.normals[triangle[0] as usize];
            (b - a).cross(c - a).dot(normal) > 0.0 && normal.dot(a) > 0.0
        };
        // Ears and hair fold back here and there.
        let count = triangles.iter().filter(|triangle| outwards(triangle)).count();
        assert!(count * 100 > 98 * triangles.len(), "{count} of {}", triangles.len());
    }
}
