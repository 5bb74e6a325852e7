//! glTF with `KHR_gaussian_splatting`: accessors of every kind, buffers in every place, transforms of nodes, files that lie.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use volraster::glam::{DMat3, DVec3};
use volraster::io::read;
use volraster::scene::{Axes, Gaussians, SplatRule, TrainedMode, harmonics};

use super::super::support::*;
use super::colour;
use crate::folder::Folder;

/// Splats in a file.
const COUNT: usize = 3;

fn number(i: usize) -> f32 {
    ((i * 37 % 101) as f32 - 50.0) / 64.0
}

/// Attributes by name, with numbers of three splats: components of an element, then all numbers.
fn attributes(degree: usize) -> Vec<(String, usize, Vec<f32>)> {
    let own = |name: &str| format!("KHR_gaussian_splatting:{name}");
    let list = |first: usize, width: usize| (0..COUNT * width).map(|i| number(first + i)).collect::<Vec<_>>();
    let mut all = vec![
        ("POSITION".to_owned(), 3, list(0, 3)),
        (own("ROTATION"), 4, vec![0.0, 0.0, 0.0, 1.0, 0.6, 0.0, 0.0, 0.8, 0.5, -0.5, 0.5, -0.5]),
        (own("SCALE"), 3, vec![1.0, 0.5, 0.25, 0.125, 1.0, 0.0, 0.75, 0.625, 0.375]),
        (own("OPACITY"), 1, vec![0.0, 1.0, 0.6]),
    ];
    for l in 0..=degree {
        for n in 0..=2 * l {
            all.push((own(&format!("SH_DEGREE_{l}_COEF_{n}")), 3, list(17 * l + 3 * n, 3)));
        }
    }
    all
}

fn of_width(width: usize) -> &'static str {
    ["", "SCALAR", "VEC2", "VEC3", "VEC4"][width]
}

/// A description and its only buffer: each attribute in a view of its own.
fn document(degree: usize) -> (Value, Vec<u8>) {
    let (mut bytes, mut accessors, mut views) = (Vec::new(), Vec::new(), Vec::new());
    let mut attributes_by_name = serde_json::Map::new();
    for (name, width, numbers) in attributes(degree) {
        attributes_by_name.insert(name, json!(accessors.len()));
        let (own, kind) = (4 * numbers.len(), of_width(width));
        accessors
            .push(json!({"bufferView": views.len(), "componentType": 5126, "count": COUNT, "type": kind}));
        views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": own}));
        bytes.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
    }
    let extension = json!({"kernel": "ellipse", "colorSpace": "srgb_rec709_display"});
    let primitive = json!({
        "mode": 0, "attributes": attributes_by_name, "extensions": {"KHR_gaussian_splatting": extension},
    });
    let document = json!({
        "asset": {"version": "2.0", "copyright": "by me"}, "extensionsUsed": ["KHR_gaussian_splatting"],
        "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}], "meshes": [{"primitives": [primitive]}],
        "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": bytes.len()}],
    });
    (document, bytes)
}

fn binary(document: &Value, bytes: &[u8]) -> Vec<u8> {
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend(((12 + 8 + text.len() + 8 + bytes.len()) as u32).to_le_bytes());
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(text);
    out.extend((bytes.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(bytes);
    out
}

fn with_uri(mut document: Value, uri: &str) -> Vec<u8> {
    document["buffers"][0]["uri"] = json!(uri);
    document.to_string().into_bytes()
}

fn embedded(document: &Value, bytes: &[u8]) -> Vec<u8> {
    with_uri(document.clone(), &format!("data:application/octet-stream;base64,{}", STANDARD.encode(bytes)))
}

/// A file whose description and buffer are changed.
fn changed(change: impl FnOnce(&mut Value, &mut Vec<u8>)) -> Sample {
    let (mut document, mut bytes) = document(1);
    change(&mut document, &mut bytes);
    let length = document["buffers"][0]["byteLength"].as_u64();
    if length.is_some_and(|length| length < 1 << 20) {
        document["buffers"][0]["byteLength"] = json!(bytes.len());
    }
    Sample::one("changed", "a.glb", binary(&document, &bytes))
}

pub fn samples() -> Vec<Sample> {
    let (small, bytes) = document(0);
    let (mut nodes, all) = document(2);
    nodes["nodes"] = json!([
        {"children": [1, 2], "scale": [1, 2, -1]}, {"mesh": 0, "rotation": [0.6, 0, 0, 0.8]}, {"mesh": 0},
    ]);
    vec![
        Sample::one("binary", "a.glb", binary(&small, &bytes)),
        Sample::one("embedded", "a.gltf", embedded(&nodes, &all)),
        Sample::one("beside", "a.gltf", with_uri(small, "a.bin")).with("a.bin", bytes),
        changed(sparse),
        changed(interleave),
    ]
}

/// Positions become zeros, of which the second and third are replaced by what they were.
fn sparse(document: &mut Value, bytes: &mut Vec<u8>) {
    let view = document["bufferViews"].as_array().unwrap().len();
    document["bufferViews"]
        .as_array_mut()
        .unwrap()
        .push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": 4}));
    bytes.extend([1, 0, 2, 0]);
    let sparse = json!({
        "count": 2, "indices": {"bufferView": view, "componentType": 5123},
        "values": {"bufferView": 0, "byteOffset": 12},
    });
    document["accessors"][0] = json!({"componentType": 5126, "count": 3, "type": "VEC3", "sparse": sparse});
}

/// All attributes go into one view, with integers where the extension allows them.
fn interleave(document: &mut Value, bytes: &mut Vec<u8>) {
    let (mut rows, mut offset) = (vec![Vec::new(); COUNT], 0);
    for (place, (name, width, numbers)) in attributes(1).into_iter().enumerate() {
        let accessor = &mut document["accessors"][place];
        accessor["bufferView"] = json!(0);
        accessor["byteOffset"] = json!(offset);
        let short = name.split(':').nth(1).unwrap_or_default();
        let (code, most) = match short {
            "ROTATION" => (5122, 32_767.0),
            "SCALE" => (5121, 255.0),
            "OPACITY" => (5123, 65_535.0),
            _ => (5126, 0.0),
        };
        accessor["componentType"] = json!(code);
        accessor["normalized"] = json!(code != 5126);
        for (row, own) in rows.iter_mut().zip(numbers.chunks(width)) {
            for x in own {
                let whole = (x * most).round();
                match code {
                    5122 => row.extend((whole as i16).to_le_bytes()),
                    5121 => row.push(whole as u8),
                    5123 => row.extend((whole as u16).to_le_bytes()),
                    _ => row.extend(x.to_le_bytes()),
                }
            }
            row.resize(row.len().next_multiple_of(4), 0);
            offset = row.len();
        }
    }
    // Nothing follows the last number.
    *bytes = rows.concat();
    document["bufferViews"] = json!([{"buffer": 0, "byteLength": bytes.len(), "byteStride": offset}]);
}

/// Checks splats without transforms.
#[track_caller]
fn check(splats: &Gaussians, degree: usize, rounding: f32) {
    assert_eq!((splats.len(), splats.degree(), splats.axes()), (COUNT, degree as u32, Axes::Luf));
    assert_eq!((splats.mode(), SplatRule::of(splats.mode())), (TrainedMode::Khronos, SplatRule::Khr));
    let all = attributes(degree);
    assert_eq!(splats.centres().as_flattened(), all[0].2);
    for (found, xyzw) in splats.rotations().iter().zip(all[1].2.chunks(4)) {
        let expected = [xyzw[3], xyzw[0], xyzw[1], xyzw[2]];
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= rounding + 1e-7), "{found:?}");
    }
    for (i, lengths) in all[2].2.chunks(3).enumerate() {
        let expected = DVec3::new(lengths[0].into(), lengths[1].into(), lengths[2].into());
        let distance = splats.scales(i).distance(expected);
        assert!(distance <= f64::from(rounding) * 200.0 + 1e-7, "{i}: {}", splats.scales(i));
    }
    assert_eq!(splats.log_scales()[1][2], f32::NEG_INFINITY);
    assert!(splats.opacities().iter().zip(&all[3].2).all(|(a, b)| (a - b).abs() <= rounding + 1e-7));
    for (function, (_, _, numbers)) in all[4..].iter().enumerate() {
        for (i, rgb) in numbers.chunks(3).enumerate() {
            let place = 3 * (i * harmonics::count(degree as u32) + function);
            assert_eq!(&splats.harmonics()[place..place + 3], rgb, "{function} {i}");
        }
    }
}

#[test]
fn buffers_are_found_in_the_file_beside_it_and_in_its_text() {
    for degree in 0..=3 {
        let (document, bytes) = document(degree);
        let loaded = Sample::one("binary", "a.bin", binary(&document, &bytes)).loaded();
        assert_eq!(loaded.report.format, "glTF, binary");
        assert_eq!(loaded.report.gaussians.as_ref().unwrap().texts, ["copyright: by me"]);
        assert!(loaded.report.notes.is_empty() && loaded.report.warnings.is_empty(), "{:?}", loaded.report);
        check(&gaussians(loaded), degree, 0.0);
        let loaded = Sample::one("embedded", "a.gltf", embedded(&document, &bytes)).loaded();
        assert_eq!(loaded.report.format, "glTF");
        check(&gaussians(loaded), degree, 0.0);
        let text = with_uri(document.clone(), "data/a%20b.bin");
        let sample = Sample::one("beside", "a.gltf", text.clone()).with("data/a b.bin", bytes.clone());
        check(&gaussians(sample.loaded()), degree, 0.0);
        let folder = Folder::new();
        folder.write("data/a b.bin", &bytes);
        check(&gaussians(read(folder.write("a.gltf", text), &OPTIONS).unwrap()), degree, 0.0);
        let path = folder.write("a.glb", binary(&document, &bytes));
        check(&gaussians(read(path, &OPTIONS).unwrap()), degree, 0.0);
    }
}

#[test]
fn accessors_may_be_interleaved_normalised_and_sparse() {
    check(&gaussians(changed(interleave).loaded()), 1, 2e-5);
    let splats = gaussians(changed(sparse).loaded());
    assert_eq!(splats.centres()[0], [0.0; 3]);
    assert_eq!(splats.centres()[1..].as_flattened(), &attributes(1)[0].2[3..]);
    // Replaced over numbers of a view.
    let both = changed(|document, bytes| {
        sparse(document, bytes);
        document["accessors"][0]["bufferView"] = json!(0);
        document["accessors"][0]["sparse"]["values"]["byteOffset"] = json!(0);
    });
    let (centres, numbers) = (gaussians(both.loaded()), attributes(1)[0].2.clone());
    assert_eq!(centres.centres().as_flattened(), [&numbers[..3], &numbers[..6]].concat());
    // Positions as integers, as KHR_mesh_quantization allows.
    let small = changed(|document, bytes| {
        document["extensionsRequired"] = json!(["KHR_gaussian_splatting", "KHR_mesh_quantization"]);
        let view = document["bufferViews"].as_array().unwrap().len();
        let own = json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": 11, "byteStride": 4});
        document["bufferViews"].as_array_mut().unwrap().push(own);
        bytes.extend([1, 2, 3, 0, 0xff, 0x80, 0x7f, 0, 0, 0, 0]);
        document["accessors"][0] =
            json!({"bufferView": view, "componentType": 5120, "count": 3, "type": "VEC3"});
    });
    let splats = gaussians(small.loaded());
    assert_eq!(splats.centres(), [[1.0, 2.0, 3.0], [-1.0, -128.0, 127.0], [0.0; 3]]);
}

#[test]
fn nodes_place_and_turn_their_splats() {
    let plain = gaussians(changed(|_, _| ()).loaded());
    let turn = DMat3::from_quat(volraster::glam::DQuat::from_xyzw(0.6, 0.0, 0.0, 0.8));
    // A node above with a mirror and a shear, by columns.
    let above = DMat3::from_cols(DVec3::new(1.0, 0.25, 0.0), DVec3::NEG_Y * 2.0, DVec3::new(0.0, 0.5, 1.0));
    let sample = changed(|document, _| {
        document["nodes"] = json!([
            {"children": [2, 1], "matrix": [1, 0.25, 0, 0, 0, -2, 0, 0, 0, 0.5, 1, 0, 5, 6, 7, 1]},
            {"mesh": 0, "translation": [1, 2, 3], "rotation": [1.2, 0, 0, 1.6], "scale": [2, 2, 2]},
            {"children": [3]},
            {"mesh": 0, "name": "as it is"},
            {"mesh": 0, "name": "in no scene"},
        ]);
        document["meshes"]
            .as_array_mut()
            .unwrap()
            .push(json!({"primitives": [{"attributes": {"POSITION": 0}}]}));
        document["nodes"][2]["mesh"] = json!(1);
    });
    let loaded = sample.loaded();
    let notes = loaded.report.notes.join("; ");
    assert!(notes.contains("2 primitives of splats are merged"), "{notes}");
    assert!(notes.contains("1 primitives without splats left out"), "{notes}");
    let splats = gaussians(loaded);
    assert_eq!(splats.len(), 2 * COUNT);
    let origin = DVec3::new(5.0, 6.0, 7.0);
    let first = (above, origin);
    let second = (above * (turn * 2.0), above * DVec3::new(1.0, 2.0, 3.0) + origin);
    for (node, (matrix, offset)) in [first, second].into_iter().enumerate() {
        // The orthogonal matrix: the limit of means of a matrix and the inverse of its transpose.
        let mut polar = matrix;
        for _ in 0..60 {
            polar = (polar + polar.transpose().inverse()) * 0.5;
        }
        for i in 0..COUNT {
            let found = node * COUNT + i;
            assert!(splats.centre(found).distance(matrix * plain.centre(i) + offset) < 1e-5);
            let difference = splats.covariance(found) - matrix * plain.covariance(i) * matrix.transpose();
            assert!(difference.to_cols_array().iter().all(|d| d.abs() < 1e-5), "{node} {i}: {difference}");
            for direction in super::directions() {
                let own = colour(&plain, i, &harmonics::basis(1, direction));
                let seen = colour(&splats, found, &harmonics::basis(1, polar * direction));
                assert!(seen.distance(own) < 1e-5, "{node} {i}: {seen} {own}");
            }
        }
    }
}

#[test]
fn the_default_scene_is_shown() {
    let shown = |change: &dyn Fn(&mut Value)| {
        let sample = changed(|document, _| {
            document["nodes"] = json!([
                {"mesh": 0, "translation": [10, 0, 0]}, {"mesh": 0}, {"children": [1], "translation": [20, 0, 0]},
            ]);
            document["scenes"] = json!([{"nodes": [0]}, {"nodes": [2]}]);
            change(document);
        });
        let loaded = sample.loaded();
        let notes = loaded.report.notes.join("; ");
        let x = f64::from(number(0));
        (
            gaussians(loaded)
                .centres()
                .iter()
                .step_by(COUNT)
                .map(|c| f64::from(c[0]) - x)
                .collect::<Vec<_>>(),
            notes,
        )
    };
    let near = |found: &[f64], expected: &[f64]| {
        assert_eq!(found.len(), expected.len());
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?} {expected:?}");
    };
    let (found, notes) = shown(&|document| document["scene"] = json!(1));
    near(&found, &[20.0]);
    assert!(notes.contains("1 other scenes left out"), "{notes}");
    near(&shown(&|document| drop(document.as_object_mut().unwrap().remove("scene"))).0, &[10.0]);
    let roots = |document: &mut Value| {
        let object = document.as_object_mut().unwrap();
        object.remove("scene");
        object.remove("scenes");
    };
    near(&shown(&roots).0, &[10.0, 20.0]);
}

fn primitive(document: &mut Value) -> &mut Value {
    &mut document["meshes"][0]["primitives"][0]
}

fn refused(change: impl FnOnce(&mut Value), parts: &[&str]) {
    changed(|document, _| change(document)).refused(parts);
}

fn extension(key: &str, value: Value) -> Sample {
    changed(|document, _| primitive(document)["extensions"]["KHR_gaussian_splatting"][key] = value)
}

#[test]
fn what_cannot_be_drawn_is_refused_or_noted() {
    extension("colorSpace", json!("lin_rec709_display")).refused(&[
        "primitives[0]",
        "colorSpace \"lin_rec709_display\"",
        "must be srgb_rec709_display",
    ]);
    extension("kernel", json!("cube")).refused(&["kernel \"cube\": must be ellipse"]);
    let name = "KHR_gaussian_splatting_compression_spz_2";
    let packed = json!({name: {"bufferView": 0}});
    extension("extensions", packed.clone()).refused(&[name, "is not supported", "SPZ"]);
    refused(|document| primitive(document)["extensions"] = packed, &[name, "is not supported"]);
    refused(|document| document["extensionsRequired"] = json!([name]), &["extensionsRequired", name]);
    refused(|document| document["extensionsRequired"] = json!(["EXT_x"]), &["EXT_x is not supported"]);
    let noted = |sample: Sample, text: &str| {
        let notes = sample.loaded().report.notes;
        assert!(notes.iter().any(|note| note.contains(text)), "{text}: {notes:?}");
    };
    noted(extension("projection", json!("fisheye")), "projection \"fisheye\" is drawn as perspective");
    noted(extension("sortingMethod", json!("z")), "sortingMethod \"z\" is drawn as cameraDistance");
    noted(extension("extensions", json!({"EXT_y": {}})), "extension EXT_y of splats left out");
    noted(extension("colorSpace", json!(null)), "colorSpace is missing");
    noted(changed(|document, _| document["animations"] = json!([{}])), "1 animations left out");
    noted(changed(|document, _| document["nodes"][0]["skin"] = json!(0)), "skins of 1 nodes left out");
    let instancing = json!({"EXT_mesh_gpu_instancing": {}});
    refused(
        |document| document["nodes"][0]["extensions"] = instancing,
        &["node 0", "EXT_mesh_gpu_instancing"],
    );
    let view = json!({"EXT_meshopt_compression": {}});
    refused(|document| document["bufferViews"][0]["extensions"] = view, &["bufferViews[0]", "not supported"]);
    // Other meshes alone.
    refused(
        |document| drop(primitive(document).as_object_mut().unwrap().remove("extensions")),
        &["content", "no node shows splats", "KHR_gaussian_splatting"],
    );
    refused(|document| document["nodes"] = json!([{}]), &["no node shows splats"]);
    // Drafts of the extension had logarithms.
    let loaded = changed(|document, bytes| {
        let offset = document["bufferViews"][2]["byteOffset"].as_u64().unwrap() as usize;
        let logs: Vec<u8> = [-1.0_f32, 0.5, 0.0].repeat(3).iter().flat_map(|x| x.to_le_bytes()).collect();
        bytes[offset..offset + logs.len()].copy_from_slice(&logs);
    })
    .loaded();
    assert!(loaded.report.warnings[0].contains("taken as logarithms"), "{:?}", loaded.report.warnings);
    assert_eq!(gaussians(loaded).log_scales(), [[-1.0, 0.5, 0.0]; 3]);
}

#[test]
fn descriptions_that_lie_are_refused() {
    let accessor = |i: usize, key: &'static str, value: Value, parts: &[&str]| {
        refused(|document| document["accessors"][i][key] = value, parts);
    };
    for (count, rule) in [(4, "4 elements need 48 bytes: the view has 36"), (u64::MAX, "elements need")] {
        let change = |document: &mut Value| {
            let all = document["accessors"].as_array_mut().unwrap();
            all.iter_mut().for_each(|own| own["count"] = json!(count));
        };
        refused(change, &["accessors[0]", rule]);
        // Before memory is taken for them.
        let sample = changed(|document, bytes| {
            sparse(document, bytes);
            change(document);
        });
        sample.refused(&["accessors["]);
    }
    accessor(1, "count", json!(2), &["primitives[0]", "attributes: have 3 and 2 elements"]);
    accessor(1, "type", json!("VEC3"), &["ROTATION: type \"VEC3\": must be VEC4"]);
    accessor(1, "byteOffset", json!(4), &["accessors[1]", "need 52 bytes"]);
    accessor(1, "byteOffset", json!(u64::MAX), &["accessors[1]", "elements need"]);
    accessor(1, "componentType", json!(5121), &["ROTATION: componentType 5121, not normalised"]);
    accessor(4, "componentType", json!(5122), &["SH_DEGREE_0_COEF_0", "not allowed"]);
    accessor(4, "normalized", json!(true), &["SH_DEGREE_0_COEF_0", "not allowed"]);
    accessor(0, "componentType", json!(5130), &["POSITION: componentType 5130"]);
    accessor(0, "bufferView", json!(99), &["bufferViews[99]", "there is no such view"]);
    accessor(0, "bufferView", json!(null), &["accessors[0]", "neither bufferView nor sparse"]);
    let view = |key: &'static str, value: Value, parts: &[&str]| {
        refused(|document| document["bufferViews"][0][key] = value, parts);
    };
    view("byteLength", json!(1 << 20), &["bufferViews[0]", "the buffer has"]);
    view("byteOffset", json!(u64::MAX), &["bufferViews[0]", "the buffer has"]);
    view("byteStride", json!(8), &["byteStride 8: must be 12 to 252"]);
    view("buffer", json!(1), &["buffers[1]", "there is no such buffer"]);
    refused(|document| document["buffers"][0]["byteLength"] = json!(1 << 30), &["buffers[0]", "there are"]);
    let attribute = |name: &'static str, parts: &[&str]| {
        refused(
            |document| drop(primitive(document)["attributes"].as_object_mut().unwrap().remove(name)),
            parts,
        );
    };
    attribute("POSITION", &["POSITION: is missing"]);
    attribute("KHR_gaussian_splatting:SH_DEGREE_1_COEF_1", &["SH_DEGREE_1_COEF_1: is missing"]);
    attribute("KHR_gaussian_splatting:SH_DEGREE_0_COEF_0", &["SH_DEGREE_0_COEF_0: is missing"]);
    attribute("KHR_gaussian_splatting:OPACITY", &["OPACITY: is missing"]);
    refused(|document| primitive(document)["attributes"]["POSITION"] = json!(99), &["no accessors[99]"]);
    refused(|document| primitive(document)["mode"] = json!(4), &["mode: splats must be points"]);
    refused(|document| primitive(document)["indices"] = json!(0), &["indices and targets"]);
    refused(|document| document["asset"]["version"] = json!("1.0"), &["asset.version", "must be 2.0"]);
    refused(|document| document["scene"] = json!(5), &["scene", "no such scene"]);
    let nodes = |nodes: Value, parts: &[&str]| refused(|document| document["nodes"] = nodes, parts);
    nodes(json!([{"mesh": 7}]), &["node 0", "no such mesh"]);
    nodes(json!([{"children": [0]}]), &["node 0", "one parent"]);
    nodes(json!([{"children": [1, 1]}, {}]), &["node 1", "one parent"]);
    nodes(json!([{"children": [9]}]), &["node 9", "no such node"]);
    nodes(json!([{"mesh": 0, "rotation": [0, 0, 0, 0]}]), &["node 0", "rotation"]);
    nodes(json!([{"mesh": 0, "matrix": vec![1; 16]}]), &["node 0", "last row"]);
    nodes(json!([{"mesh": 0, "matrix": vec![1; 16], "scale": [1, 1, 1]}]), &["node 0", "has a matrix, and"]);
    let huge = json!({"children": [1], "scale": [1e300, 1, 1]});
    nodes(json!([huge, {"mesh": 0, "scale": [1e300, 1, 1]}]), &["node 1", "overflows"]);
    let many: Vec<Value> = (0..70_000).map(|_| json!({"mesh": 0})).collect();
    refused(
        |document| {
            document["scenes"] = json!([{"nodes": (0..70_000).collect::<Vec<_>>()}]);
            document["nodes"] = json!(many);
        },
        &["more than 65536 primitives"],
    );
    let replaced = |key: &'static str, value: Value, parts: &[&str]| {
        let sample = changed(|document, bytes| {
            sparse(document, bytes);
            document["accessors"][0]["sparse"][key] = value;
        });
        sample.refused(parts);
    };
    replaced("count", json!(4), &["sparse", "4 elements of 3"]);
    replaced("count", json!(3), &["accessors[0]", "3 elements need 6 bytes"]);
    replaced("indices", json!({"bufferView": 0, "componentType": 5126}), &["componentType of indices"]);
    replaced("indices", json!({"bufferView": 0, "componentType": 5123}), &["index", "must be below 3"]);
    replaced("values", json!({"bufferView": 0, "byteOffset": 16}), &["accessors[0]", "need 40 bytes"]);
}

#[test]
fn containers_and_uris_that_lie_are_refused() {
    let (document, bytes) = document(0);
    let whole = binary(&document, &bytes);
    let change = |at: usize, value: u8, parts: &[&str]| {
        let mut bytes = whole.clone();
        bytes[at] = value;
        Sample::one("changed", "a.glb", bytes).refused(parts);
    };
    change(4, 1, &["version 1: must be 2"]);
    change(11, 1, &["bytes are announced"]);
    change(15, 1, &["chunk at byte 12", "longer than what follows"]);
    change(16, b'X', &["chunk at byte 12", "must be the JSON chunk"]);
    let chunk = whole.len() - bytes.len() - 8;
    change(chunk + 4, b'X', &["buffers[0]", "no binary chunk"]);
    Sample::one("cut", "a.glb", &whole[..whole.len() - 1]).refused(&["bytes are announced"]);
    Sample::one("short", "a.glb", &whole[..10]).refused(&["header", "ends early"]);
    let mut alone = b"glTF\x02\0\0\0\x0c\0\0\0".to_vec();
    Sample::one("empty", "a.glb", alone.clone()).refused(&["there is no JSON chunk"]);
    alone[8] = 16;
    alone.extend([0; 4]);
    Sample::one("part of a chunk", "a.glb", alone).refused(&["chunk at byte 12", "ends early"]);
    Sample::one("packed", "a.glb", gzip(&whole)).refused(&["gzip"]);
    for uri in ["../a.bin", "/etc/passwd", "file:///etc/passwd", "http://a/b", "a/../b", "%2e%2e/a", "a\\b"] {
        Sample::one("uri", "a.gltf", with_uri(document.clone(), uri))
            .with("a.bin", bytes.clone())
            .refused(&["buffers[0]", "beside"]);
    }
    Sample::one("missing", "a.gltf", with_uri(document.clone(), "none.bin")).refused(&["none.bin"]);
    Sample::one("no data", "a.gltf", with_uri(document.clone(), "data:,abc"))
        .refused(&["data must be base64"]);
    Sample::one("no base64", "a.gltf", with_uri(document.clone(), "data:;base64,a*b"))
        .refused(&["no base64"]);
    Sample::one("short", "a.gltf", with_uri(document.clone(), "data:;base64,AAAA")).refused(&["there are 3"]);
    Sample::one("no uri", "a.gltf", document.to_string()).refused(&["has no uri"]);
    Sample::one("no JSON", "a.gltf", "{").refused(&["line 1"]);
}
