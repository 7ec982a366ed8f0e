//! Few words for walls and boxes.

use bevy::ecs::system::SystemParam;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;

/// Spawns simple meshes with simple materials.
#[derive(SystemParam)]
pub struct Builder<'w, 's> {
    /// The world to be.
    pub commands: Commands<'w, 's>,
    /// Meshes.
    pub meshes: ResMut<'w, Assets<Mesh>>,
    /// Materials.
    pub materials: ResMut<'w, Assets<StandardMaterial>>,
}

impl Builder<'_, '_> {
    /// A rough material of this linear albedo.
    pub fn paint(&mut self, albedo: [f32; 3]) -> Handle<StandardMaterial> {
        self.materials.add(StandardMaterial {
            base_color: Color::linear_rgb(albedo[0], albedo[1], albedo[2]),
            perceptual_roughness: 1.0,
            reflectance: 0.2,
            ..default()
        })
    }

    /// A parallelogram from `corner` along `u` and `v`, seen from where `u` x `v` points.
    pub fn panel(&mut self, corner: Vec3, u: Vec3, v: Vec3, paint: &Handle<StandardMaterial>) -> EntityCommands<'_> {
        self.place(panel(corner, u, v), Transform::IDENTITY, paint)
    }

    /// An upright box standing on `base`, turned by `angle` radians about the vertical.
    pub fn block(
        &mut self,
        base: Vec3,
        size: Vec3,
        angle: f32,
        paint: &Handle<StandardMaterial>,
    ) -> EntityCommands<'_> {
        let center = Transform::from_translation(base + Vec3::Y * size.y * 0.5);
        self.place(Cuboid::from_size(size), center.with_rotation(Quat::from_rotation_y(angle)), paint)
    }

    /// Any mesh at any place.
    pub fn place(
        &mut self,
        mesh: impl Into<Mesh>,
        at: Transform,
        paint: &Handle<StandardMaterial>,
    ) -> EntityCommands<'_> {
        let mesh = self.meshes.add(mesh);
        self.commands.spawn((Mesh3d(mesh), MeshMaterial3d(paint.clone()), at))
    }

    /// The inside of a box: floor, ceiling and four walls, each with its paint.
    pub fn room(&mut self, min: Vec3, max: Vec3, paints: &Walls) {
        let (x, y, z) = (Vec3::X * (max.x - min.x), Vec3::Y * (max.y - min.y), Vec3::Z * (max.z - min.z));
        self.panel(min, z, x, &paints.floor);
        self.panel(min + y, x, z, &paints.ceiling);
        self.panel(min, x, y, &paints.back);
        self.panel(max - y, -x, y, &paints.front);
        self.panel(min + z, -z, y, &paints.left);
        self.panel(min + x, z, y, &paints.right);
    }
}

/// Paints of a room, as seen by someone who looks along -z.
#[derive(Clone, Debug)]
pub struct Walls {
    /// Underfoot.
    pub floor: Handle<StandardMaterial>,
    /// Overhead.
    pub ceiling: Handle<StandardMaterial>,
    /// At -z.
    pub back: Handle<StandardMaterial>,
    /// At +z.
    pub front: Handle<StandardMaterial>,
    /// At -x.
    pub left: Handle<StandardMaterial>,
    /// At +x.
    pub right: Handle<StandardMaterial>,
}

fn panel(corner: Vec3, u: Vec3, v: Vec3) -> Mesh {
    let normal = u.cross(v).normalize_or(Vec3::Y);
    let positions: Vec<[f32; 3]> = [corner, corner + u, corner + u + v, corner + v].map(Into::into).into();
    Mesh::new(PrimitiveTopology::TriangleList, default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, vec![normal.to_array(); 4])
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        .with_inserted_indices(Indices::U16(vec![0, 1, 2, 0, 2, 3]))
}
