//! The tree over baked objects, above their hierarchies: what is far away or dim is taken together across objects. It follows their
//! transforms, and is built anew on the CPU in every frame: 64 objects at most.
//!
//! A binary tree by median cut, in depth-first order with skip pointers; its leaves are the objects. Nodes have spheres and no cones:
//! objects mostly face all ways.

use bevy::math::{Affine3A, Vec3};
use bevy_bounce_shaders::types::{CSSM_TOP_NODES, CssmBake, CssmBakes, CssmTop, NONE};

/// What lengths may be off on the GPU, as a share of them.
const ROUNDING: f32 = 1.0e-5;

/// The same objects, with the tree over them as they stand.
pub fn with_top(bakes: CssmBakes) -> CssmBakes {
    let mut top = Vec::new();
    let mut spheres: Vec<_> = (0..bakes.count).zip(&bakes.objects).map(|(number, bake)| sphere(number, bake)).collect();
    if !spheres.is_empty() {
        add(&mut spheres, &mut top);
    }
    let mut bakes = CssmBakes { top: [CssmTop::default(); CSSM_TOP_NODES], ..bakes };
    for (node, built) in bakes.top.iter_mut().zip(top) {
        *node = built;
    }
    bakes
}

/// Round an object's texels, in the world.
fn sphere(object: u32, bake: &CssmBake) -> CssmTop {
    let world_from_object = world_from_object(bake);
    let scale = world_from_object.matrix3.x_axis.length();
    let radius = 0.5 * bake.bounds_min.distance(bake.bounds_max) + bake.reach;
    CssmTop {
        center: world_from_object.transform_point3(0.5 * (bake.bounds_min + bake.bounds_max)),
        radius: scale * radius * (1.0 + ROUNDING),
        skip: 0,
        object,
    }
}

fn world_from_object(bake: &CssmBake) -> Affine3A {
    let [x, y, z] = [bake.world_from_object_x, bake.world_from_object_y, bake.world_from_object_z];
    Affine3A::from_cols_array(&[x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z, x.w, y.w, z.w])
}

fn add(objects: &mut [CssmTop], nodes: &mut Vec<CssmTop>) {
    let at = nodes.len();
    if let [object] = objects {
        nodes.push(CssmTop { skip: at as u32 + 1, ..*object });
        return;
    }
    let (low, high) = objects.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), object| {
        (low.min(object.center - object.radius), high.max(object.center + object.radius))
    });
    let center = 0.5 * (low + high);
    let radius = objects.iter().map(|object| center.distance(object.center) + object.radius).fold(0.0, f32::max);
    let skip = (at + 2 * objects.len() - 1) as u32;
    nodes.push(CssmTop { center, radius: radius * (1.0 + ROUNDING), skip, object: NONE });
    let axis = (high - low).max_position();
    let half = objects.len().div_ceil(2);
    let key = |object: &CssmTop| object.center[axis];
    objects.select_nth_unstable_by(half - 1, |a, b| key(a).total_cmp(&key(b)).then(a.object.cmp(&b.object)));
    let (first, second) = objects.split_at_mut(half);
    add(first, nodes);
    add(second, nodes);
}

#[cfg(test)]
mod tests {
    use bevy::math::Quat;
    use bevy_bounce_shaders::types::CSSM_OBJECTS;

    use super::super::words::placed;
    use super::*;

    fn bakes(count: usize) -> CssmBakes {
        let mut bakes = CssmBakes { count: count as u32, ..CssmBakes::default() };
        for (number, bake) in bakes.objects.iter_mut().take(count).enumerate() {
            let at = number as f32;
            let place = Affine3A::from_scale_rotation_translation(
                Vec3::splat(0.5 + 0.1 * at),
                Quat::from_rotation_y(at),
                Vec3::new((at * 7.3).sin(), (at * 3.1).cos() * 4.0, (at * 1.7).sin() * 9.0),
            );
            let shape = CssmBake { bounds_min: Vec3::new(-1.0, 0.0, 2.0), bounds_max: Vec3::splat(3.0), ..*bake };
            *bake = placed(CssmBake { reach: 0.1, ..shape }, place);
        }
        bakes
    }

    /// Corners of an object's box, in the world.
    fn corners(bake: &CssmBake) -> impl Iterator<Item = Vec3> {
        let (place, low, high) = (world_from_object(bake), bake.bounds_min, bake.bounds_max);
        (0..8).map(move |corner| {
            let choose = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
            place.transform_point3(Vec3::new(choose(0), choose(1), choose(2)))
        })
    }

    #[test]
    fn every_object_is_in_one_leaf_and_inside_all_spheres_above() {
        for count in [1, 2, 3, 7, CSSM_OBJECTS] {
            let bakes = with_top(bakes(count));
            let nodes = &bakes.top[..2 * count - 1];
            let mut leaves: Vec<u32> = nodes.iter().map(|node| node.object).filter(|object| *object != NONE).collect();
            leaves.sort_unstable();
            assert_eq!(leaves, (0..count as u32).collect::<Vec<_>>());
            assert_eq!(nodes[0].skip as usize, nodes.len());
            for (at, node) in nodes.iter().enumerate() {
                assert_eq!(node.object != NONE, node.skip as usize == at + 1);
                let below =
                    nodes[at..node.skip as usize].iter().filter_map(|leaf| bakes.objects.get(leaf.object as usize));
                for corner in below.flat_map(corners) {
                    assert!(node.center.distance(corner) <= node.radius, "{corner} is outside {node:?}");
                }
                if node.object == NONE {
                    let second = nodes[nodes[at + 1].skip as usize];
                    assert_eq!(second.skip, node.skip);
                }
            }
        }
    }

    #[test]
    fn without_objects_there_are_no_nodes() {
        assert_eq!(with_top(CssmBakes::default()), CssmBakes::default());
    }
}
