//! Surfaces with two sides, with holes, and those that light passes.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use bevy_bounce_bake::rays::Bvh;
use bevy_bounce_bake::{BakeSettings, Scene, Source, bake, verify};
use bevy_bounce_cssm::{CssmFile, Texel};
use glam::Vec3;
use serde_json::{Value, json};

/// Three squares of side 2 above each other at heights 0, 1 and 2: the first looks up, the others down. The one in the
/// middle has a material.
fn sandwich(material: &Value, picture: Option<&image::RgbaImage>) -> Scene {
    let mut bytes: Vec<u8> = Vec::new();
    for (height, front) in [(0.0, 1.0), (1.0, -1.0), (2.0, -1.0)] {
        for [x, z] in [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]] {
            bytes.extend([x, height, z * front].map(f32::to_le_bytes).as_flattened());
        }
    }
    for uv in [[0.0_f32, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]] {
        bytes.extend(uv.map(f32::to_le_bytes).as_flattened());
    }
    bytes.extend([0_u16, 1, 2, 0, 2, 3].map(u16::to_le_bytes).as_flattened());
    let data = |kind: &str, bytes: &[u8]| format!("data:{kind};base64,{}", BASE64_STANDARD.encode(bytes));
    let mut png = std::io::Cursor::new(Vec::new());
    let white = image::RgbaImage::from_pixel(1, 1, image::Rgba([255; 4]));
    picture.unwrap_or(&white).write_to(&mut png, image::ImageFormat::Png).expect("memory takes it");
    let range = |offset: usize, length: usize| json!({ "buffer": 0, "byteOffset": offset, "byteLength": length });
    let accessor = |view: usize, kind: &str, component: u32, count: usize| {
        json!({ "bufferView": view, "type": kind, "componentType": component, "count": count,
                "min": [-1, -1, -1], "max": [1, 2, 1] })
    };
    let square = |view: usize, material: Value| {
        let mut primitive = json!({ "attributes": { "POSITION": view, "TEXCOORD_0": 3 }, "indices": 4 });
        if !material.is_null() {
            primitive["material"] = material;
        }
        json!({ "primitives": [primitive] })
    };
    let file = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0, 1, 2] }],
        "nodes": [{ "mesh": 0 }, { "mesh": 1 }, { "mesh": 2 }],
        "meshes": [square(0, Value::Null), square(1, json!(0)), square(2, Value::Null)],
        "materials": [material],
        "textures": [{ "source": 0 }],
        "images": [{ "uri": data("image/png", png.get_ref()) }],
        "buffers": [{ "byteLength": bytes.len(), "uri": data("application/octet-stream", &bytes) }],
        "bufferViews": [range(0, 48), range(48, 48), range(96, 48), range(144, 32), range(176, 12)],
        "accessors": [
            accessor(0, "VEC3", 5126, 4), accessor(1, "VEC3", 5126, 4), accessor(2, "VEC3", 5126, 4),
            accessor(3, "VEC2", 5126, 4), accessor(4, "SCALAR", 5123, 6)
        ],
    });
    let bytes = serde_json::to_vec(&file).expect("it is JSON");
    Source::parse("sandwich.gltf".into(), &bytes).and_then(|source| Scene::from_gltf(&source)).expect("it is fine")
}

fn baked(scene: &Scene) -> CssmFile {
    bake(scene, &BakeSettings { atlas: 40, depth: 32, ..BakeSettings::default() }, &()).expect("it can be baked").0
}

fn texels(file: &CssmFile, height: f32, up: f32) -> Vec<Texel> {
    let texels = (0..file.meta.texels as usize).filter_map(|index| file.texel(index));
    texels.filter(|texel| (texel.position[1] - height).abs() < 0.1 && texel.normal[1] * up > 0.9).collect()
}

fn area(texels: &[Texel]) -> f32 {
    texels.iter().map(|texel| texel.area).sum()
}

#[test]
fn both_sides_of_a_double_sided_surface_receive() {
    let single = baked(&sandwich(&json!({}), None));
    assert!(texels(&single, 1.0, 1.0).is_empty() && (area(&texels(&single, 1.0, -1.0)) - 4.0).abs() < 0.01);

    let scene = sandwich(&json!({ "doubleSided": true }), None);
    let file = baked(&scene);
    let (tops, bottoms) = (texels(&file, 1.0, 1.0), texels(&file, 1.0, -1.0));
    assert!((area(&tops) - 4.0).abs() < 0.01 && (area(&bottoms) - 4.0).abs() < 0.01);
    // The top sees the ceiling, the bottom the floor, and neither has a second surface upon it.
    let (ceiling, floor) = ([0.3, 2.0, 0.2], [0.3, 0.0, 0.2]);
    assert!(tops.iter().all(|top| file.visible(top, ceiling) && !file.visible(top, floor)));
    assert!(bottoms.iter().all(|bottom| file.visible(bottom, floor) && !file.visible(bottom, ceiling)));
    assert!(texels(&file, 0.0, 1.0).iter().all(|floor| !file.visible(floor, [0.0, 2.0, 0.0])));
    // Rays through the squares' diagonals meet two triangles of one surface; all others would, were backs surfaces.
    assert!(file.meta.close * 100 < file.meta.rays, "{} of {}", file.meta.close, file.meta.rays);
    // The file has a part for either side, of the same primitive.
    let parts: Vec<_> = file.parts.iter().map(|part| [part.node, part.mesh, part.primitive, part.triangles]).collect();
    assert_eq!(parts, [[0, 0, 0, 2], [1, 1, 0, 2], [1, 1, 0, 2], [2, 2, 0, 2]]);
    assert!(verify(&file, &scene, 20_000).expect("it is of this scene").percent() > 98.0);
    // Corners are in the source's order: a back is wound the other way round in the atlas.
    let turn = |part: usize| {
        let part = file.parts.iter().nth(part).expect("there are four");
        let [a, b, c] = file.parts.triangle(part.first_triangle).expect("it has room").map(glam::Vec2::from);
        (b - a).perp_dot(c - a)
    };
    assert!(turn(1) * turn(2) < 0.0);
}

#[test]
fn light_passes_the_holes_of_a_masked_surface() {
    // Half of the picture is a hole.
    let picture = image::RgbaImage::from_fn(16, 16, |x, _| image::Rgba([255, 0, 0, if x < 8 { 0 } else { 255 }]));
    let texture = json!({ "baseColorTexture": { "index": 0 }, "metallicFactor": 0 });
    let scene = sandwich(&json!({ "alphaMode": "MASK", "pbrMetallicRoughness": texture }), Some(&picture));
    let bvh = Bvh::new(&scene);
    assert!(bvh.visible(Vec3::new(-0.5, 0.1, 0.0), Vec3::new(-0.5, 1.9, 0.0), 0.0));
    assert!(!bvh.visible(Vec3::new(0.5, 0.1, 0.0), Vec3::new(0.5, 1.9, 0.0), 0.0));

    let file = baked(&scene);
    let middle = texels(&file, 1.0, -1.0);
    assert!((area(&middle) - 2.0).abs() < 0.15, "{}", area(&middle));
    assert!(middle.iter().all(|texel| texel.diffuse == [1.0, 0.0, 0.0] && texel.position[0] > -0.06));
    for floor in texels(&file, 0.0, 1.0) {
        let [x, _, z] = floor.position;
        if x.abs() > 0.1 {
            assert_eq!(file.visible(&floor, [x, 2.0, z]), x < 0.0, "{floor:?}");
        }
    }
    assert!(verify(&file, &scene, 20_000).expect("it is of this scene").percent() > 97.0);

    // With a cutoff that no alpha reaches there is nothing.
    let all = sandwich(
        &json!({ "alphaMode": "MASK", "alphaCutoff": 1.01,
                 "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }),
        Some(&picture),
    );
    assert!(texels(&baked(&all), 1.0, -1.0).is_empty());
}

/// Whatever it mirrors, a metal lights others by its base colour.
#[test]
fn metal_has_its_base_color() {
    for metallic in [0.0, 1.0] {
        let color = json!({ "baseColorFactor": [0.5, 0.25, 1.0, 1.0], "metallicFactor": metallic });
        let file = baked(&sandwich(&json!({ "pbrMetallicRoughness": color }), None));
        let middle = texels(&file, 1.0, -1.0);
        assert!(!middle.is_empty() && middle.iter().all(|texel| texel.diffuse == [0.5, 0.25, 1.0]), "{middle:?}");
    }
}

#[test]
fn what_light_passes_is_not_there() {
    for material in [
        json!({ "alphaMode": "BLEND" }),
        json!({ "extensions": { "KHR_materials_transmission": { "transmissionFactor": 0.9 } } }),
    ] {
        let file = baked(&sandwich(&material, None));
        assert_eq!(file.parts.iter().map(|part| part.node).collect::<Vec<_>>(), [0, 2]);
        assert!(texels(&file, 1.0, -1.0).is_empty());
        assert!(texels(&file, 0.0, 1.0).iter().all(|floor| file.visible(floor, [0.0, 2.0, 0.0])));
    }
}
