//! `bounce-bake lightmap`, by itself: closed forms, what the scene keeps, what is refused.

mod pictures;

use std::f32::consts::{FRAC_1_SQRT_2, PI, TAU};

use bevy::prelude::*;
use bevy_bounce_bake::{LightmapSettings, Source, bake_lightmap};
use bevy_bounce_tests::lightmaps::{GlbBuilder, STEM, bake, room, split, texels};
use serde_json::{Value, json};

/// Few texels and rays.
const SMALL: LightmapSettings =
    LightmapSettings { atlas: 64, rays: 128, bounces: None, probes: 4, direct: false, unwrap: false };

fn paint(albedo: f32) -> Value {
    json!({ "pbrMetallicRoughness": { "baseColorFactor": [albedo, albedo, albedo, 1.0], "metallicFactor": 0.0 } })
}

/// Texels that are not black, and their mean.
fn lit(texels: &[Vec3]) -> (Vec<Vec3>, Vec3) {
    let lit: Vec<Vec3> = texels.iter().copied().filter(|texel| *texel != Vec3::ZERO).collect();
    let mean = lit.iter().copied().sum::<Vec3>() / lit.len() as f32;
    (lit, mean)
}

/// Everything shines with 100 cd/m² and reflects half: everything is lit by 100 / (1 - 0.5) cd/m² from all sides.
#[test]
fn a_furnace_is_as_bright_everywhere() {
    let mut file = GlbBuilder::default();
    let mut walls = paint(0.5);
    walls["emissiveFactor"] = json!([1.0, 0.5, 0.0]);
    walls["extensions"] = json!({ "KHR_materials_emissive_strength": { "emissiveStrength": 100.0 } });
    let walls = file.push("materials", walls);
    let (positions, triangles) = room(2.0);
    let mesh = file.mesh(&positions, &triangles, Some(walls));
    file.push("nodes", json!({ "mesh": mesh }));
    let (files, report) = bake(&file.finish(), &SMALL);
    assert_eq!((report.filled, report.probes), (0, [4, 4, 4]));
    for (name, file) in [("lightmap", &files.lightmap), ("volume", files.volume.as_ref().expect("was asked for"))] {
        let (texels, _) = texels(file);
        let lit = lit(&texels).0;
        let fewest = if name == "volume" { texels.len() } else { report.texels };
        assert!(lit.len() >= fewest, "{name}: {} of {fewest} texels have light", lit.len());
        for texel in lit {
            let error = (texel - Vec3::new(200.0, 100.0, 0.0)).abs().max_element();
            assert!(error < 0.5, "{name}: {texel}");
        }
    }
}

/// Within a sphere every place lights every other one alike: of what a lamp in the middle gives, `albedo / (1 -
/// albedo)` comes back by reflections.
#[test]
fn an_integrating_sphere_is_lit_evenly() {
    const ALBEDO: f32 = 0.6;
    const CANDELA: f32 = 900.0;
    const RADIUS: f32 = 3.0;
    let (sides, rings) = (48, 24);
    let place = |ring: u32, side: u32| {
        let (height, around) = (PI * ring as f32 / rings as f32, TAU * side as f32 / sides as f32);
        RADIUS * Vec3::new(height.sin() * around.cos(), height.cos(), height.sin() * around.sin())
    };
    let positions: Vec<Vec3> = (0..=rings).flat_map(|ring| (0..=sides).map(move |side| place(ring, side))).collect();
    let quads = (0..rings).flat_map(|ring| (0..sides).map(move |side| ring * (sides + 1) + side));
    let triangles: Vec<[u32; 3]> =
        quads.flat_map(|a| [[a, a + sides + 1, a + 1], [a + 1, a + sides + 1, a + sides + 2]]).collect();
    let mut file = GlbBuilder::default();
    let wall = file.push("materials", paint(ALBEDO));
    let mesh = file.mesh(&positions, &triangles, Some(wall));
    let normals: Vec<Vec3> = positions.iter().map(|position| -position.normalize()).collect();
    let normals = file.vectors(&normals);
    file.json["meshes"][mesh]["primitives"][0]["attributes"]["NORMAL"] = normals.into();
    file.push("nodes", json!({ "mesh": mesh }));
    file.lamp(json!({ "type": "point", "intensity": CANDELA, "range": 1000.0 }), json!({}));
    let file = file.finish();

    let direct = CANDELA / (RADIUS * RADIUS * PI);
    let bounced = direct * ALBEDO / (1.0 - ALBEDO);
    for (settings, wanted) in [
        (SMALL, bounced),
        (LightmapSettings { bounces: Some(1), ..SMALL }, direct * ALBEDO),
        (LightmapSettings { bounces: Some(2), ..SMALL }, direct * (ALBEDO + ALBEDO * ALBEDO)),
        (LightmapSettings { direct: true, ..SMALL }, direct + bounced),
    ] {
        let (files, report) = bake(&file, &settings);
        let (texels, mean) = lit(&texels(&files.lightmap).0);
        println!("{wanted} cd/m², baked {mean} in {report:?}");
        assert!((mean / wanted - 1.0).abs().max_element() < 0.02, "{mean} instead of {wanted}");
        let far = texels.iter().filter(|texel| (**texel / wanted - 1.0).abs().max_element() > 0.1).count();
        assert!(far * 50 < texels.len(), "{far} of {} texels are off by more than 10 %", texels.len());
    }
}

/// A floor under the sun, and under a lamp whose cone, range and colour are Bevy's.
#[test]
fn lamps_light_as_bevys_do() {
    let floor = |lamp: Value, node: Value| {
        let mut file = GlbBuilder::default();
        let corners = [Vec3::new(-1.0, 0.0, -1.0), Vec3::new(-1.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 1.0)];
        let mesh = file.mesh(&corners.map(|corner| corner * 0.01), &[[0, 1, 2]], None);
        file.push("nodes", json!({ "mesh": mesh }));
        file.lamp(lamp, node);
        let settings = LightmapSettings { atlas: 8, direct: true, probes: 0, ..SMALL };
        lit(&texels(&bake(&file.finish(), &settings).0.lightmap).0).1
    };
    let down = json!([-FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2]);
    let at = |height: f32| json!({ "translation": [0.0, height, 0.0], "rotation": down });
    // 60 degrees from the zenith.
    let aslant = json!({ "rotation": [-(15.0f32.to_radians().sin()), 0.0, 0.0, 15.0f32.to_radians().cos()] });
    let sun = floor(json!({ "type": "directional", "intensity": 1000.0 }), aslant);
    let spot = |inner: f32, outer: f32| json!({ "innerConeAngle": inner, "outerConeAngle": outer });
    let near = floor(json!({ "type": "spot", "intensity": 90.0, "range": 1000.0, "spot": spot(0.2, 0.4) }), at(3.0));
    // Half way through its range a lamp has lost 1 - (1 - 1/16)^2.
    let fading = floor(json!({ "type": "point", "intensity": 90.0, "range": 6.0 }), at(3.0));
    // Without a range, 20 units; colours are taken for sRGB.
    let colored = floor(json!({ "type": "point", "intensity": 90.0, "color": [0.5, 1.0, 0.0] }), at(10.0));
    for (name, found, wanted) in [
        ("sun", sun, Vec3::splat(500.0)),
        ("spot", near, Vec3::splat(10.0)),
        ("range", fading, Vec3::splat(10.0 * (15.0f32 / 16.0).powi(2))),
        ("colour", colored, Vec3::new(0.214_04, 1.0, 0.0) * 0.9 * (15.0f32 / 16.0).powi(2)),
    ] {
        let error = (found - wanted / PI).abs().max_element() / wanted.max_element() * PI;
        assert!(error < 0.005, "{name}: {found} instead of {}", wanted / PI);
    }
    let beside = json!({ "translation": [3.0, 3.0, 0.0], "rotation": down });
    let dark = floor(json!({ "type": "spot", "intensity": 90.0, "spot": spot(0.2, 0.4) }), beside);
    assert!(dark.is_nan(), "light outside of the cone: {dark}");
}

#[test]
fn threads_do_not_matter() {
    let bytes = cornell_box();
    let files = [1, 2, 5].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| bake(&bytes, &SMALL).0)
    });
    assert!(files[0] == files[1] && files[0] == files[2]);
}

fn cornell_box() -> Vec<u8> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/cornell_box.glb");
    std::fs::read(path).expect("the repository has it")
}

/// The ceiling of the Cornell box is the darkest for what looks down from it, and its left wall is red.
#[test]
fn probes_know_where_light_comes_from() {
    let (files, report) = bake(&cornell_box(), &LightmapSettings { probes: 6, ..SMALL });
    let (texels, size) = texels(files.volume.as_ref().expect("was asked for"));
    let [x, y, z] = report.probes;
    assert_eq!(size, UVec3::new(x, 2 * y, 3 * z));
    let facing = |axis: u32, negative: u32, at: UVec3| {
        let at = at + UVec3::new(0, negative * y, axis * z);
        texels[((at.z * size.y + at.y) * size.x + at.x) as usize]
    };
    let middle = UVec3::new(x / 2, y / 2, z / 2);
    let redness = |color: Vec3| color.x / color.y;
    let (left, right) = (facing(0, 1, middle), facing(0, 0, middle));
    assert!(redness(left) > 1.5 * redness(right), "left {left}, right {right}");
    let (up, down) = (facing(1, 0, middle), facing(1, 1, middle));
    assert!(down.y > up.y, "the lit floor is below: up {up}, down {down}");
}

/// A scene with something of everything.
fn collection() -> Vec<u8> {
    let mut file = GlbBuilder::default();
    let plain = file.push("materials", paint(0.5));
    let mut leaf = paint(0.7);
    leaf["doubleSided"] = true.into();
    leaf["name"] = "leaf".into();
    let leaf = file.push("materials", leaf);
    let mut glass = paint(0.9);
    glass["alphaMode"] = "BLEND".into();
    let glass = file.push("materials", glass);
    let (positions, triangles) = room(0.5);
    let cube = file.mesh(&positions, &triangles, Some(plain));
    let colors: Vec<[u8; 4]> = (0..positions.len() as u8).map(|vertex| [vertex, 2 * vertex, 3, 255]).collect();
    let colors = file.accessor(&colors, 5121, "VEC4", 1);
    file.json["accessors"][colors]["normalized"] = true.into();
    let primitive = &mut file.json["meshes"][cube]["primitives"][0];
    primitive["attributes"]["COLOR_0"] = colors.into();
    primitive["extras"] = json!({ "mine": 7 });
    let quad = &[Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y];
    let leaf_mesh = file.mesh(quad, &[[0, 1, 2], [0, 2, 3]], Some(leaf));
    let normals = file.vectors(&[Vec3::Z; 4]);
    file.json["meshes"][leaf_mesh]["primitives"][0]["attributes"]["NORMAL"] = normals.into();
    let pane = file.mesh(quad, &[[0, 1, 2], [0, 2, 3]], Some(glass));
    file.push("nodes", json!({ "mesh": cube, "name": "one" }));
    file.push("nodes", json!({ "mesh": cube, "name": "other", "translation": [3.0, 0.0, 0.0] }));
    file.push("nodes", json!({ "mesh": leaf_mesh, "name": "leaf", "translation": [0.0, 3.0, 0.0] }));
    file.push("nodes", json!({ "mesh": pane, "name": "pane", "extras": "glass" }));
    file.push("nodes", json!({ "mesh": cube, "name": "mover", "translation": [0.0, 0.0, 4.0] }));
    let times: Vec<[u8; 4]> = [0.0f32, 1.0].map(f32::to_le_bytes).to_vec();
    let times = file.accessor(&times, 5126, "SCALAR", 1);
    file.json["accessors"][times]["min"] = json!([0.0]);
    file.json["accessors"][times]["max"] = json!([1.0]);
    let places = file.vectors(&[Vec3::ZERO, Vec3::X]);
    file.push(
        "animations",
        json!({
            "channels": [{ "sampler": 0, "target": { "node": 4, "path": "translation" } }],
            "samplers": [{ "input": times, "output": places }],
        }),
    );
    file.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }));
    file.push("nodes", json!({ "camera": 0, "name": "eye", "translation": [0.0, 0.0, 9.0] }));
    file.lamp(
        json!({ "type": "point", "intensity": 100.0 }),
        json!({ "name": "lamp", "translation": [1.5, 1.0, 1.0] }),
    );
    file.json["extensions"]["MINE_something"] = json!({ "deep": [1, { "er": 0.25 }] });
    file.json.insert("extensionsUsed".into(), json!(["KHR_lights_punctual", "MINE_something"]));
    file.finish()
}

/// Corners of all triangles of a node, in the node's space, sorted; and whether its primitives are marked.
fn triangles(file: &gltf::Gltf, node: &str) -> (Vec<[[u32; 3]; 3]>, Vec<String>) {
    let node = file.nodes().find(|found| found.name() == Some(node)).expect("it is there");
    let (mut corners, mut marks) = (Vec::new(), Vec::new());
    for primitive in node.mesh().expect("has a mesh").primitives() {
        let reader = primitive.reader(|_| file.blob.as_deref());
        let positions: Vec<[f32; 3]> = reader.read_positions().expect("has positions").collect();
        let indices: Vec<u32> = reader.read_indices().expect("has indices").into_u32().collect();
        let bits = |index: &u32| positions[*index as usize].map(f32::to_bits);
        corners.extend(indices.as_chunks::<3>().0.iter().map(|triangle| {
            let mut corners = [0, 1, 2].map(|corner| bits(&triangle[corner]));
            corners.sort_unstable();
            corners
        }));
        marks.push(primitive.extras().as_ref().map_or(String::new(), |extras| extras.get().to_owned()));
    }
    corners.sort_unstable();
    (corners, marks)
}

/// A node that mirrors turns triangles over by itself, and one that shrinks to nothing has nothing to light.
#[test]
fn mirrored_triangles_keep_their_winding_and_empty_ones_their_mesh() {
    let mut file = GlbBuilder::default();
    let wall = file.push("materials", paint(0.5));
    let (positions, triangles) = room(2.0);
    let mesh = file.mesh(&positions, &triangles, Some(wall));
    for (name, scale) in [("even", [1.0, 1.0, 1.0]), ("mirrored", [-1.0, 1.0, 1.0]), ("nothing", [0.0; 3])] {
        file.push(
            "nodes",
            json!({ "mesh": mesh, "name": name, "scale": scale, "translation": [9.0 * scale[0], 0, 0] }),
        );
    }
    file.lamp(json!({ "type": "point", "intensity": 100.0 }), json!({ "translation": [9, 0, 0] }));
    let (files, _) = bake(&file.finish(), &SMALL);
    let written = gltf::Gltf::from_slice(&files.scene).expect("is a glTF");
    for (name, has_light) in [("even", true), ("mirrored", true), ("nothing", false)] {
        let node = written.nodes().find(|node| node.name() == Some(name)).expect("it is there");
        let primitive = node.mesh().expect("has a mesh").primitives().next().expect("has a primitive");
        let reader = primitive.reader(|_| written.blob.as_deref());
        let corners: Vec<Vec3> = reader.read_positions().expect("has positions").map(Vec3::from).collect();
        let indices: Vec<u32> = reader.read_indices().expect("has indices").into_u32().collect();
        assert_eq!(indices.len(), 3 * triangles.len(), "{name}");
        for [a, b, c] in indices.as_chunks().0.iter().map(|corner| corner.map(|index| corners[index as usize])) {
            assert!((b - a).cross(c - a).dot(a + b + c) < 0.0, "{name}: the room's walls look inwards");
        }
        assert_eq!(primitive.extras().is_some(), has_light, "{name}");
    }
}

#[test]
fn the_scene_keeps_everything() {
    let bytes = collection();
    let (files, _) = bake(&bytes, &SMALL);
    let (before, _) = split(&bytes);
    let (after, _) = split(&files.scene);
    for kept in ["asset", "animations", "cameras", "extensions", "extensionsUsed", "scene"] {
        assert_eq!(before[kept], after[kept], "{kept}");
    }
    // What was there keeps its number; what is new comes behind.
    for (array, new) in [("materials", 1), ("nodes", 1), ("meshes", 2)] {
        let [before, after] = [&before, &after].map(|json| json[array].as_array().expect("is an array"));
        assert_eq!(after.len(), before.len() + new, "{array}");
    }
    assert_eq!(before["materials"][1], after["materials"][1]);
    assert_eq!(after["materials"][3]["doubleSided"], json!(false));
    assert_eq!(before["nodes"][3], after["nodes"][3], "the pane");

    let [old, new] = [&bytes, &files.scene].map(|bytes| gltf::Gltf::from_slice(bytes).expect("is valid glTF"));
    for (node, lit) in [("one", true), ("other", true), ("pane", false), ("mover", false)] {
        let ((before, _), (after, marks)) = (triangles(&old, node), triangles(&new, node));
        assert_eq!(before, after, "{node}");
        assert_eq!(marks[0].contains("room.lightmap.ktx2"), lit, "{node}: {marks:?}");
        assert_eq!(marks[0].contains("mine"), node != "pane", "{node}: {marks:?}");
    }
    // Each triangle of the leaf twice: front and back.
    let ((before, _), (after, _)) = (triangles(&old, "leaf"), triangles(&new, "leaf"));
    assert_eq!([before.clone(), before].concat().len(), after.len());
    assert!(after.chunks(2).all(|pair| pair[0] == pair[1]));
    attributes_follow(&new);
}

/// Vertex colours stay with their vertices, normals look to the front of their triangles, and no two surfaces share a
/// texel.
fn attributes_follow(file: &gltf::Gltf) {
    let mut places: Vec<[f32; 2]> = Vec::new();
    let (positions, _) = room(0.5);
    for name in ["one", "other", "leaf"] {
        let node = file.nodes().find(|node| node.name() == Some(name)).expect("it is there");
        let primitive = node.mesh().and_then(|mesh| mesh.primitives().next()).expect("has a primitive");
        let reader = primitive.reader(|_| file.blob.as_deref());
        let at: Vec<Vec3> = reader.read_positions().expect("has positions").map(Vec3::from).collect();
        let uv: Vec<[f32; 2]> = reader.read_tex_coords(1).expect("has a second set").into_f32().collect();
        assert!(uv.iter().flatten().all(|value| (0.0..=1.0).contains(value)));
        let indices: Vec<u32> = reader.read_indices().expect("has indices").into_u32().collect();
        for triangle in indices.as_chunks::<3>().0 {
            let [a, b, c] = triangle.map(|index| at[index as usize]);
            if let Some(normals) = reader.read_normals() {
                let normal = normals.map(Vec3::from).nth(triangle[0] as usize).expect("one a vertex");
                assert!((b - a).cross(c - a).dot(normal) > 0.0, "a normal looks to the back");
            }
            let middle = [0, 1].map(|axis| triangle.iter().map(|index| uv[*index as usize][axis]).sum::<f32>() / 3.0);
            places.push(middle);
        }
        if let Some(colors) = reader.read_colors(0) {
            for (color, at) in colors.into_rgba_u8().zip(&at) {
                assert_eq!(positions[usize::from(color[0])], *at, "a colour went to another vertex");
                assert_eq!([color[1], color[2], color[3]], [2 * color[0], 3, 255]);
            }
        }
    }
    let apart = |a: &[f32; 2], b: &[f32; 2]| (a[0] - b[0]).abs().max((a[1] - b[1]).abs()) > 1.0e-3;
    for (number, place) in places.iter().enumerate() {
        assert!(places[..number].iter().all(|other| apart(place, other)), "two triangles share {place:?}");
    }
}

/// With a second UV set that can be used, the geometry stays as it was.
#[test]
fn a_second_set_is_kept() {
    let with_set = |uv: [[f32; 2]; 4], set_of_texture: u32| {
        let mut file = GlbBuilder::default();
        let mut material = paint(0.5);
        let pixel = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mP8z8BQDwAEhQGAhKmMIQAAAABJRU5ErkJggg==";
        file.push("images", json!({ "uri": pixel }));
        file.push("textures", json!({ "source": 0 }));
        material["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0, "texCoord": set_of_texture });
        let material = file.push("materials", material);
        let quad = [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Z, Vec3::Z];
        let mesh = file.mesh(&quad, &[[0, 2, 1], [0, 3, 2]], Some(material));
        let words: Vec<[u8; 4]> = uv.as_flattened().iter().map(|value| value.to_le_bytes()).collect();
        let set = file.accessor(&words, 5126, "VEC2", 2);
        let attributes = &mut file.json["meshes"][mesh]["primitives"][0]["attributes"];
        attributes["TEXCOORD_0"] = set.into();
        attributes["TEXCOORD_1"] = set.into();
        file.push("nodes", json!({ "mesh": mesh }));
        file.lamp(json!({ "type": "point", "intensity": 100.0 }), json!({ "translation": [0.5, 1.0, 0.5] }));
        file.finish()
    };
    let square = [[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9]];
    let bytes = with_set(square, 1);
    let (files, _) = bake(&bytes, &SMALL);
    let (mut after, _) = split(&files.scene);
    let (before, _) = split(&bytes);
    after["meshes"][0]["primitives"][0].as_object_mut().expect("is an object").remove("extras");
    assert_eq!((&before["meshes"], &before["accessors"]), (&after["meshes"], &after["accessors"]));

    let refused = |bytes: &[u8], settings: &LightmapSettings| {
        let source = Source::parse("quad.glb".into(), bytes).expect("it can be read");
        bake_lightmap(&source, STEM, settings, &()).expect_err("it is refused").to_string()
    };
    let said = refused(&bytes, &LightmapSettings { unwrap: true, ..SMALL });
    assert!(said.contains("quad.glb: mesh 0, primitive 0") && said.contains("reads TEXCOORD_1"), "{said}");
    let said = refused(&with_set([[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.8, 0.1]], 0), &SMALL);
    assert!(said.contains("overlap") && said.contains("--unwrap"), "{said}");
    for (settings, wanted) in [
        (LightmapSettings { atlas: 5000, ..SMALL }, "atlas 5000"),
        (LightmapSettings { rays: 1, ..SMALL }, "rays 1"),
        (LightmapSettings { bounces: Some(0), ..SMALL }, "bounces 0"),
        (LightmapSettings { probes: 1000, ..SMALL }, "probes 1000"),
    ] {
        let said = refused(&bytes, &settings);
        assert!(said.contains(wanted), "{said}");
    }
}

/// Where everything moves there is nothing to light, and a lamp of no number is named.
#[test]
fn what_cannot_be_lit_is_refused() {
    let said = |change: &dyn Fn(&mut Value)| {
        let bytes = collection();
        let (mut json, rest) = split(&bytes);
        change(&mut json);
        let bytes = bevy_bounce_tests::lightmaps::join(&json, rest);
        let source = Source::parse("all.glb".into(), &bytes).expect("it can be read");
        bake_lightmap(&source, STEM, &SMALL, &()).expect_err("it is refused").to_string()
    };
    let moving = said(&|json| json["scenes"][0]["nodes"] = json!([4]));
    assert!(moving.contains("all.glb") && moving.contains("no triangle"), "{moving}");
    let endless = said(&|json| json["nodes"][6]["translation"] = json!([1.0e39, 0.0, 0.0]));
    assert!(endless.contains("node 6") && endless.contains("not finite"), "{endless}");
}

#[test]
fn damaged_files_do_no_harm() {
    let settings = LightmapSettings { atlas: 24, rays: 16, probes: 1, ..SMALL };
    for bytes in [cornell_box(), collection()] {
        let mut rng = fastrand::Rng::with_seed(4);
        let mut baked = 0;
        for _ in 0..150 {
            let mut damaged = bytes.clone();
            for _ in 0..rng.usize(1..4) {
                let at = rng.usize(0..damaged.len());
                damaged[at] = rng.u8(..);
            }
            // Whatever comes of it, it is no panic.
            let source = Source::parse("room.glb".into(), &damaged);
            let files = source.and_then(|source| bake_lightmap(&source, STEM, &settings, &()));
            baked += usize::from(files.is_ok_and(|(files, _)| gltf::Gltf::from_slice(&files.scene).is_ok()));
        }
        assert!(baked > 0, "nothing was as good as before");
    }
}
