//! Scenes in time: what clips move, by hand-made values and against files that hold the pose.

mod common;

use common::asset::{Asset, F32, U8, square};
use common::{SQUARE, shared};
use glam::{Affine3A, Mat4, Quat, Vec3};
use parhelion::scene::{self, LightKind, LoadOptions, Scene, SceneError, View};
use serde_json::{Value, json};
use std::f32::consts::FRAC_PI_2;

fn moving() -> LoadOptions {
    LoadOptions { motion: true, ..LoadOptions::default() }
}

fn load(asset: &Asset) -> Scene {
    asset.load_as(&moving()).unwrap()
}

/// Adds an animation of one channel and says which it is.
fn animate(
    asset: &mut Asset,
    target: Value,
    interpolation: &str,
    times: &[f32],
    shape: &str,
    values: &[f32],
) -> usize {
    let width = match shape {
        "VEC3" => 3,
        "VEC4" => 4,
        _ => 1,
    };
    let input = asset.accessor(bytemuck::cast_slice(times), F32, "SCALAR", times.len());
    let output = asset.accessor(bytemuck::cast_slice(values), F32, shape, values.len() / width);
    let sampler = json!({"input": input, "output": output, "interpolation": interpolation});
    asset.push("animations", json!({"channels": [{"sampler": 0, "target": target}], "samplers": [sampler]}))
}

fn node(node: usize, path: &str) -> Value {
    json!({"node": node, "path": path})
}

fn pointer(pointer: &str) -> Value {
    json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}})
}

/// All that a picture by the first camera depends on.
fn print(scene: &Scene) -> u64 {
    scene.fingerprint(&scene.cameras[0])
}

#[test]
fn nodes_carry_what_is_below_them() {
    let mut asset = square();
    // The parent of square, camera and light turns by 90° in 2 s and rises.
    let turn = Quat::from_rotation_y(FRAC_PI_2).to_array();
    animate(
        &mut asset,
        node(3, "rotation"),
        "LINEAR",
        &[1.0, 3.0],
        "VEC4",
        &[[0.0, 0.0, 0.0, 1.0], turn].concat(),
    );
    let rise = [0.0, 0.0, 0.0, 0.0, 4.0, 0.0];
    animate(&mut asset, node(3, "translation"), "LINEAR", &[1.0, 3.0], "VEC3", &rise);
    let scene = load(&asset);
    assert_eq!((scene.clips().len(), scene.clips_together()), (2, vec![0, 1]));
    assert_eq!(scene.clips()[0].end(), 3.0);
    for (time, share) in
        [(-1.0, 0.0), (0.0, 0.0), (1.0, 0.0), (1.5, 0.25), (2.0, 0.5), (3.0, 1.0), (50.0, 1.0)]
    {
        let pose = scene.pose(&[0, 1], time).unwrap();
        let world = Affine3A::from_rotation_translation(
            Quat::from_rotation_y(share * FRAC_PI_2),
            4.0 * share * Vec3::Y,
        );
        assert!(pose.instances[0].transform.abs_diff_eq(world, 1e-6), "{time}");
        let camera = world * Affine3A::from_translation(3.0 * Vec3::Z);
        assert!(pose.cameras[0].transform.abs_diff_eq(camera, 1e-6), "{time}");
        let light = &pose.lights[0];
        assert!(light.position.abs_diff_eq(4.0 * share * Vec3::Y, 1e-6));
        assert!(light.direction.abs_diff_eq(world.transform_vector3(Vec3::NEG_Z), 1e-6));
        // One of them alone.
        let pose = scene.pose(&[1], time).unwrap();
        assert!(
            pose.instances[0].transform.abs_diff_eq(Affine3A::from_translation(4.0 * share * Vec3::Y), 1e-6)
        );
    }
    // A pose can be posed again.
    assert_eq!(
        print(&scene.pose(&[0], 2.0).unwrap().pose(&[0, 1], 1.5).unwrap()),
        print(&scene.pose(&[0, 1], 1.5).unwrap())
    );
}

/// A square of two joints, nodes 1 and 2, and one morph target, seen by nodes 4's camera; everything moves by steps.
fn everything() -> Asset {
    let mut asset = Asset::empty();
    let positions = asset.positions(&SQUARE);
    let normals = asset.accessor(bytemuck::cast_slice(&[[0.0_f32, 0.6, 0.8]; 4]), F32, "VEC3", 4);
    let joints = asset.accessor(&[0, 1, 0, 0].repeat(4), U8, "VEC4", 4);
    let weights =
        [[1.0_f32, 0.0, 0.0, 0.0], [0.75, 0.25, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]];
    let weights = asset.accessor(bytemuck::cast_slice(&weights), F32, "VEC4", 4);
    let binds = [Mat4::from_translation(Vec3::X), Mat4::from_scale(Vec3::new(1.0, 2.0, 1.0))];
    let binds = asset.accessor(bytemuck::cast_slice(&binds.map(|bind| bind.to_cols_array())), F32, "MAT4", 2);
    let deltas = asset.positions(&[Vec3::ZERO, Vec3::X, Vec3::new(0.5, 0.25, 1.0), Vec3::Z]);
    let indices = asset.accessor(&[0, 1, 2, 0, 2, 3], U8, "SCALAR", 6);
    let attributes = |skinned: bool| match skinned {
        true => json!({"POSITION": positions, "NORMAL": normals, "JOINTS_0": joints, "WEIGHTS_0": weights}),
        false => json!({"POSITION": positions, "NORMAL": normals}),
    };
    let targets = json!([{"POSITION": deltas}]);
    for skinned in [true, false] {
        let mesh = json!({"primitives": [{"attributes": attributes(skinned), "indices": indices, "targets": targets}]});
        asset.push("meshes", mesh);
    }
    asset.push("skins", json!({"joints": [1, 2], "inverseBindMatrices": binds}));
    asset.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}));
    asset.push("nodes", json!({"mesh": 0, "skin": 0, "weights": [0.25]}));
    asset.push("nodes", json!({"translation": [1, 0, 0], "children": [2]}));
    asset.push("nodes", json!({"rotation": [0, 0, 0.6, 0.8], "scale": [1, 2, 1]}));
    asset.push("nodes", json!({"mesh": 1, "weights": [0.5], "translation": [0, 3, 0]}));
    asset.push("nodes", json!({"camera": 0, "translation": [0, 0, 9]}));
    // Another that shows the second mesh, and does not move.
    asset.push("nodes", json!({"mesh": 1, "weights": [0.125], "translation": [3, 0, 0]}));
    asset
}

/// The values of each pose, node by node, and the file that holds it at rest.
const POSES: usize = 3;
fn held(pose: usize) -> (Asset, [Value; 4]) {
    let p = pose as f64;
    let values = [
        json!([1.0 + p, 0.5 * p, 0.0]),
        json!([0.0, if pose == 1 { 0.6 } else { -0.6 }, 0.0, 0.8]),
        json!([1.0, 2.0, if pose == 2 { -0.5 } else { 0.5 }]),
        json!([0.25 * p]),
    ];
    let mut asset = everything();
    asset.json["nodes"][1]["translation"] = values[0].clone();
    asset.json["nodes"][2]["rotation"] = values[1].clone();
    asset.json["nodes"][2]["scale"] = values[2].clone();
    asset.json["nodes"][0]["weights"] = values[3].clone();
    asset.json["nodes"][3]["weights"] = values[3].clone();
    asset.json["nodes"][4]["translation"] = values[0].clone();
    (asset, values)
}

/// Skins, morph targets, mirrored joints, nodes in each other: a pose has the bits of a file that holds it.
#[test]
fn a_pose_is_the_scene_of_a_file_that_holds_it() {
    let mut asset = everything();
    let times = [0.0, 1.0, 2.0];
    let poses: Vec<[Value; 4]> = (0..POSES).map(|pose| held(pose).1).collect();
    let of = |index: usize| -> Vec<f32> {
        let numbers = poses.iter().flat_map(|pose| pose[index].as_array().unwrap());
        numbers.map(|number| number.as_f64().unwrap() as f32).collect()
    };
    let moves = [
        (node(1, "translation"), 0, "VEC3"),
        (node(2, "rotation"), 1, "VEC4"),
        (node(2, "scale"), 2, "VEC3"),
        (node(0, "weights"), 3, "SCALAR"),
        (node(3, "weights"), 3, "SCALAR"),
        (node(4, "translation"), 0, "VEC3"),
    ];
    for (target, index, shape) in &moves {
        animate(&mut asset, target.clone(), "STEP", &times, shape, &of(*index));
    }
    let scene = load(&asset);
    assert_eq!(print(&scene), print(&everything().load().unwrap()), "at rest");
    let clips: Vec<usize> = (0..moves.len()).collect();
    let mut prints = vec![print(&scene)];
    for (pose, &begins) in times.iter().enumerate() {
        let still = held(pose).0.load().unwrap();
        for time in [begins, begins + 0.75] {
            assert_eq!(print(&scene.pose(&clips, f64::from(time)).unwrap()), print(&still), "pose {pose}");
        }
        prints.push(print(&still));
    }
    prints.sort_unstable();
    prints.dedup();
    assert_eq!(prints.len(), POSES + 1, "each is another");
}

/// Far from the origin, where numbers are taken from the scene's middle at rest.
#[test]
fn what_is_far_away_moves_as_exactly() {
    let mut asset = square();
    asset.push("nodes", json!({"children": [3], "translation": [500_000, 0, 0]}));
    asset.json["scenes"][0]["nodes"] = json!([4]);
    animate(
        &mut asset,
        node(0, "translation"),
        "LINEAR",
        &[0.0, 1.0],
        "VEC3",
        &[0.0, 0.0, 0.0, 0.25, 0.0, 0.0],
    );
    let scene = load(&asset);
    assert_eq!(print(&scene), print(&asset.load().unwrap()));
    let x = |scene: &Scene| scene.origin.x + f64::from(scene.instances[0].transform.translation.x);
    let moved = x(&scene.pose(&[0], 0.5).unwrap()) - x(&scene);
    assert!((moved - 0.125).abs() < 1e-6, "{moved}");
}

#[test]
fn pointers_move_lights_cameras_and_materials() {
    let mut asset = square();
    asset.push("extensionsUsed", "KHR_animation_pointer".into());
    asset.push("extensionsUsed", "KHR_node_visibility".into());
    asset.json["materials"][0]["extensions"] =
        json!({"KHR_materials_emissive_strength": {"emissiveStrength": 2}});
    let light = "/extensions/KHR_lights_punctual/lights/0";
    let ways: [(String, &str, Vec<f32>); 9] = [
        (format!("{light}/intensity"), "SCALAR", vec![8.0, 24.0]),
        (format!("{light}/color"), "VEC3", vec![1.0, 0.5, 0.25, 0.0, 1.0, 0.75]),
        (format!("{light}/spot/outerConeAngle"), "SCALAR", vec![0.4, 0.05]),
        ("/cameras/0/perspective/yfov".into(), "SCALAR", vec![0.5, 1.0]),
        (
            "/materials/0/pbrMetallicRoughness/baseColorFactor".into(),
            "VEC4",
            vec![1.0, 1.0, 1.0, 1.0, 0.0, 0.5, 1.0, 1.0],
        ),
        ("/materials/0/pbrMetallicRoughness/roughnessFactor".into(), "SCALAR", vec![1.0, 0.5]),
        ("/materials/0/emissiveFactor".into(), "VEC3", vec![0.0, 0.0, 0.0, 1.0, 0.5, 0.25]),
        ("/nodes/0/translation".into(), "VEC3", vec![0.0, 0.0, 0.0, 0.0, 2.0, 0.0]),
        ("/nodes/1/extensions/KHR_node_visibility/visible".into(), "SCALAR", vec![1.0, 1.0]),
    ];
    for (path, shape, values) in &ways {
        animate(&mut asset, pointer(path), "LINEAR", &[0.0, 1.0], shape, values);
    }
    let scene = load(&asset);
    assert_eq!(scene.clips().len(), ways.len(), "{:?}", scene.notes);
    assert!(!scene.notes.iter().any(|note| note.contains("left out")), "{:?}", scene.notes);
    let pose = scene.pose(&scene.clips_together(), 0.5).unwrap();
    let light = &pose.lights[0];
    assert!(light.intensity.abs_diff_eq(16.0 * Vec3::new(0.5, 0.75, 0.5), 1e-5), "{}", light.intensity);
    // The outer cone passes the inner, which then is a little smaller.
    let LightKind::Spot { inner, outer } = light.kind else { panic!() };
    assert!((outer - 0.225).abs() < 1e-6 && inner == 0.1);
    let LightKind::Spot { inner, outer } = scene.pose(&[2], 1.0).unwrap().lights[0].kind else { panic!() };
    assert!(outer == 0.05 && inner < outer);
    let View::Perspective { yfov } = pose.cameras[0].view else { panic!() };
    assert!((yfov - 0.75).abs() < 1e-6);
    let material = &pose.materials[0];
    assert!(material.base_color.truncate().abs_diff_eq(Vec3::new(0.5, 0.75, 1.0), 1e-6));
    assert_eq!(material.roughness, 0.75);
    assert!(material.emission.abs_diff_eq(2.0 * Vec3::new(0.5, 0.25, 0.125), 1e-6), "{}", material.emission);
    assert!(pose.instances[0].transform.translation.abs_diff_eq(Vec3::Y.into(), 1e-6));
}

#[test]
fn hidden_nodes_appear() {
    let mut asset = square();
    asset.push("extensionsUsed", "KHR_node_visibility".into());
    let positions = asset.positions(&SQUARE.map(|p| p + Vec3::Z));
    let hidden = asset.show(json!({"attributes": {"POSITION": positions}, "indices": 1}));
    asset.json["nodes"][hidden]["extensions"] = json!({"KHR_node_visibility": {"visible": false}});
    asset.push("nodes", json!({"extensions": {"KHR_lights_punctual": {"light": 0}, "KHR_node_visibility": {"visible": true}}}));
    asset.json["scenes"][0]["nodes"] = json!([3, hidden, hidden + 1]);
    let visible = |node: usize| pointer(&format!("/nodes/{node}/extensions/KHR_node_visibility/visible"));
    animate(&mut asset, visible(hidden), "STEP", &[0.0, 1.0], "SCALAR", &[0.0, 1.0]);
    animate(&mut asset, visible(hidden + 1), "STEP", &[0.0, 1.0], "SCALAR", &[1.0, 0.0]);
    let scene = load(&asset);
    assert_eq!(scene.instances.len(), 1);
    let [before, after] = [0.5, 1.5].map(|time| scene.pose(&[0, 1], time).unwrap());
    assert_eq!((before.instances.len(), after.instances.len()), (1, 2));
    assert!(before.lights[1].intensity != Vec3::ZERO && after.lights[1].intensity == Vec3::ZERO);
    assert_eq!(print(&before), print(&scene));
}

/// What was done to a scene after it was loaded is done to its poses, too; without being asked a load keeps no motion.
#[test]
fn poses_keep_what_was_added_and_cost_nothing_unasked() {
    let mut asset = square();
    animate(&mut asset, node(0, "translation"), "STEP", &[0.0, 1.0], "VEC3", &[0.0, 0.0, 0.0, 5.0, 0.0, 0.0]);
    let still = asset.load().unwrap();
    assert!(still.motion.is_none() && still.clips().is_empty());
    assert!(still.notes.iter().any(|note| note == "1 animations are left out"));
    assert_eq!(print(&still.pose(&[], 7.0).unwrap()), print(&still));

    let mut scene = load(&asset);
    assert!(!scene.notes.iter().any(|note| note.contains("animations")));
    let camera = scene.cameras[0].clone();
    scene.add_headlight(&camera);
    scene.environment = Some(scene::Environment::constant(Vec3::ONE).into());
    let pose = scene.pose(&[0], 1.0).unwrap();
    assert_eq!((pose.lights.len(), &pose.lights[1]), (2, &scene.lights[1]));
    assert!(pose.environment.is_some() && pose.notes.is_empty());

    // One that has no camera is framed over all of the motion, the same at any time.
    asset.json["nodes"][1].as_object_mut().unwrap().remove("camera");
    let scene = load(&asset);
    let pose = scene.pose(&[0], 1.0).unwrap();
    assert_eq!((scene.cameras.len(), &scene.cameras), (1, &pose.cameras));
    let fitted = asset.load().unwrap();
    let eye = |scene: &Scene| scene.cameras[0].transform.translation.z;
    assert!(eye(&scene) > eye(&fitted) + 2.0, "{} {}", eye(&scene), eye(&fitted));
}

/// Each leaves the rest as it is, with one note; strictly read it is an error that names the channel.
#[test]
fn broken_animations_are_noted_or_refused() {
    let check = |asset: &Asset, words: &str| {
        let scene = load(asset);
        let told = scene.notes.iter().filter(|note| note.contains("animations[1].channels["));
        let told: Vec<_> = told.collect();
        assert!(told.len() == 1 && told[0].contains(words), "{words}: {:?}", scene.notes);
        assert_eq!(scene.pose(&[0], 0.0).unwrap().instances[0].transform.translation.x, 1.0, "{words}");
        let strict = LoadOptions { strict: true, ..moving() };
        let error: SceneError = asset.load_as(&strict).unwrap_err();
        assert!(error.element.starts_with("animations[1].channels["), "{words}: {error}");
        assert!(error.problem.contains(words), "{words}: {error}");
        // Where nothing is to move it is nobody's business.
        asset.load_as(&LoadOptions { motion: false, ..strict }).unwrap();
    };
    let other = || {
        let mut asset = square();
        animate(&mut asset, node(0, "translation"), "STEP", &[0.0], "VEC3", &[1.0, 0.0, 0.0]);
        asset
    };
    let (ones, two) = ([1.0; 3], [0.0, 1.0]);
    let scale = || node(0, "scale");
    type Keys<'a> = (Value, &'a str, &'a [f32], &'a str, &'a [f32], &'a str);
    let keys: [Keys<'_>; 13] = [
        (scale(), "LINEAR", &[1.0, 0.0], "VEC3", &[1.0; 6], "not in order"),
        (scale(), "LINEAR", &[0.0, f32::NAN], "VEC3", &[1.0; 6], "not finite"),
        (scale(), "LINEAR", &[0.0], "VEC3", &[1.0, f32::INFINITY, 1.0], "not finite"),
        (scale(), "LINEAR", &two, "VEC3", &ones, "3 values for 2 keys"),
        (scale(), "CUBICSPLINE", &two, "VEC3", &[1.0; 6], "of 1 numbers, expected 3"),
        (node(0, "rotation"), "LINEAR", &[0.0], "VEC3", &ones, "of 3 numbers, expected 4"),
        (scale(), "LINEAR", &[0.0], "SCALAR", &ones, "Scalar"),
        (node(99, "scale"), "LINEAR", &[0.0], "VEC3", &ones, "node 99 is not there"),
        (node(0, "shear"), "LINEAR", &[0.0], "VEC3", &ones, "its path is shear"),
        (scale(), "SMOOTH", &[0.0], "VEC3", &ones, "SMOOTH"),
        (pointer("/materials/0/doubleSided"), "STEP", &[0.0], "SCALAR", &[1.0], "none of what can be moved"),
        (json!({"path": "pointer"}), "STEP", &[0.0], "SCALAR", &[1.0], "no pointer"),
        (node(0, "weights"), "STEP", &[0.0], "SCALAR", &[1.0], "0 morph targets"),
    ];
    for (target, interpolation, times, shape, values, words) in keys {
        let mut asset = other();
        animate(&mut asset, target, interpolation, times, shape, values);
        check(&asset, words);
    }
    let broken = |break_it: &dyn Fn(&mut Value), words: &str| {
        let mut asset = other();
        animate(&mut asset, scale(), "STEP", &[0.0], "VEC3", &ones);
        break_it(&mut asset.json);
        check(&asset, words);
    };
    let identity = Mat4::IDENTITY.to_cols_array();
    broken(
        &|json| {
            json["nodes"][1]["matrix"] = json!(identity);
            json["nodes"][1].as_object_mut().unwrap().remove("translation");
            json["animations"][1]["channels"][0]["target"]["node"] = json!(1);
        },
        "has a matrix",
    );
    broken(&|json| json["animations"][1]["channels"][0]["sampler"] = json!(7), "samplers[7] is not there");
    broken(
        &|json| json["animations"][1]["samplers"][0]["output"] = json!(1234),
        "accessor of its output is not there",
    );
    broken(
        &|json| {
            let channels = &mut json["animations"][1]["channels"];
            let channel = channels[0].clone();
            channels.as_array_mut().unwrap().push(channel);
        },
        "an earlier one moves the same",
    );
    // A channel without a node moves nothing, as the standard has it.
    let mut asset = square();
    animate(&mut asset, json!({"path": "scale"}), "STEP", &[0.0], "VEC3", &[1.0; 3]);
    assert!(asset.load_as(&LoadOptions { strict: true, ..moving() }).unwrap().clips().is_empty());
}

/// What is scaled to nothing is not there, and may be all there is; cameras and lights stay what can be drawn with.
#[test]
fn poses_with_nothing_to_see_are_empty() {
    let mut asset = square();
    let steps = |last: [f32; 3]| [[1.0, 1.0, 1.0], [1.0, 1.0, 0.0], last].concat();
    animate(&mut asset, node(1, "scale"), "STEP", &[0.0, 1.0, 2.0], "VEC3", &steps([0.0; 3]));
    animate(&mut asset, node(0, "scale"), "STEP", &[0.0, 1.0, 2.0], "VEC3", &steps([0.0; 3]));
    animate(&mut asset, node(2, "scale"), "STEP", &[0.0, 1.0, 2.0], "VEC3", &steps([0.0; 3]));
    let scene = load(&asset);
    assert_eq!(scene.pose(&[0, 1, 2], 1.0).unwrap().instances.len(), 1, "flat");
    let pose = scene.pose(&[0, 1, 2], 2.0).unwrap();
    assert_eq!((pose.instances.len(), &pose.cameras), (0, &scene.cameras));
    assert_eq!((pose.lights.len(), pose.lights[0].intensity), (1, Vec3::ZERO));
    pose.validate().unwrap();
    // At rest, too; nothing at any time is refused.
    let mut asset = square();
    asset.json["nodes"][0]["scale"] = json!([0, 0, 0]);
    animate(&mut asset, node(0, "scale"), "STEP", &[0.0, 1.0], "VEC3", &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
    let scene = load(&asset);
    assert_eq!((scene.instances.len(), scene.pose(&[0], 1.0).unwrap().instances.len()), (0, 1));
    asset.json["meshes"][0]["primitives"] = json!([{"attributes": {"POSITION": 0}, "mode": 0}]);
    let error = asset.load_as(&moving()).unwrap_err();
    assert!(error.problem.contains("no triangle"), "{error}");
}

/// Integers are what extensions may store, and what lies out of range is brought into it.
#[test]
fn values_are_read_as_they_are_stored() {
    let mut asset = square();
    asset.push("extensionsUsed", "KHR_node_visibility".into());
    let times = asset.accessor(bytemuck::cast_slice(&[0.0_f32, 1.0]), F32, "SCALAR", 2);
    let visible = asset.accessor(&[1, 0], U8, "SCALAR", 2);
    let sampler = json!({"input": times, "output": visible, "interpolation": "STEP"});
    let target = pointer("/nodes/0/extensions/KHR_node_visibility/visible");
    let channel = json!({"sampler": 0, "target": target});
    asset.push("animations", json!({"channels": [channel], "samplers": [sampler]}));
    animate(&mut asset, pointer("/cameras/0/perspective/yfov"), "LINEAR", &[0.0, 1.0], "SCALAR", &[0.0, 9.0]);
    animate(&mut asset, pointer("/cameras/0/perspective/znear"), "STEP", &[0.0], "SCALAR", &[1.0]);
    let transform =
        "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform/offset";
    animate(&mut asset, pointer(transform), "STEP", &[0.0], "VEC2", &[1.0, 1.0]);
    let long = [0.0, 0.0, 0.0, 2.0, 0.0, 2.0, 0.0, 2.0];
    animate(&mut asset, node(0, "rotation"), "LINEAR", &[0.0, 3.0], "VEC4", &long);
    let scene = asset.load_as(&moving()).unwrap();
    assert_eq!(scene.clips().iter().map(|clip| clip.index).collect::<Vec<_>>(), [0, 1, 4]);
    let told = |words: &str| scene.notes.iter().filter(|note| note.contains(words)).count();
    assert_eq!((told("stays at rest"), told("normalised")), (1, 1), "{:?}", scene.notes);
    let shown = |time| scene.pose(&[0], time).unwrap().instances.len();
    assert_eq!((shown(0.5), shown(1.0)), (1, 0));
    for time in [0.0, 1.0] {
        scene.pose(&[1], time).unwrap().validate().unwrap();
    }
    let turned = scene.pose(&[2], 1.0).unwrap().instances[0].transform;
    assert!(turned.abs_diff_eq(Affine3A::from_rotation_y(FRAC_PI_2 / 3.0), 1e-6));
    // An accessor that can't be typed is the channel's defect alone.
    for (key, value) in [("componentType", json!(1234)), ("type", json!("FOO")), ("count", json!(-3))] {
        let mut broken = square();
        animate(&mut broken, node(0, "translation"), "STEP", &[0.0], "VEC3", &[1.0, 0.0, 0.0]);
        animate(&mut broken, node(0, "scale"), "STEP", &[0.0], "VEC3", &[1.0; 3]);
        let last = broken.json["accessors"].as_array().unwrap().len() - 1;
        broken.json["accessors"][last][key] = value;
        let scene = load(&broken);
        assert_eq!(scene.clips().len(), 1);
        let told = scene.notes.iter().filter(|note| note.starts_with("animations[1].channels[0]")).count();
        assert_eq!(
            (told, scene.notes.len()),
            (1, 1 + square().load().unwrap().notes.len()),
            "{:?}",
            scene.notes
        );
    }
}

/// Against values worked out from the files by hand.
#[test]
fn published_samples_move_as_they_should() {
    let Some(samples) = shared("gltf-samples") else { return };
    let scene =
        scene::load(&samples.join("InterpolationTest/glTF-Binary/InterpolationTest.glb"), &moving()).unwrap();
    // Three ways to change a scale, a rotation and a translation, each its own clip of its own cube.
    assert_eq!((scene.clips().len(), scene.clips_together().len()), (9, 9));
    let moved = |clip: usize, time: f64| {
        let pose = scene.pose(&[clip], time).unwrap();
        let differ = scene.instances.iter().zip(&pose.instances).filter(|(a, b)| a.transform != b.transform);
        differ.map(|(_, instance)| instance.transform).collect::<Vec<_>>()
    };
    for clip in 0..9 {
        let end = scene.clips()[clip].end();
        assert!((0..20).any(|i| moved(clip, end * f64::from(i) / 20.0).len() == 1), "clip {clip}");
        assert!((0..20).all(|i| moved(clip, end * f64::from(i) / 20.0).len() <= 1), "clip {clip}");
    }
    let morph = scene::load(&samples.join("SimpleMorph/glTF/SimpleMorph.gltf"), &moving()).unwrap();
    // Weights (0, 0), (0, 1), (1, 1), (1, 0), (0, 0) at 0 … 4 s; targets move the tip by (−1, 1) and (1, 1).
    let tip = |time: f64| morph.pose(&[0], time).unwrap().meshes[0].positions[2];
    let base = tip(0.0);
    for (time, by) in [
        (0.5, Vec3::new(0.5, 0.5, 0.0)),
        (1.0, Vec3::new(1.0, 1.0, 0.0)),
        (1.5, Vec3::new(0.5, 1.5, 0.0)),
        (2.0, 2.0 * Vec3::Y),
        (3.0, Vec3::new(-1.0, 1.0, 0.0)),
        (4.0, Vec3::ZERO),
    ] {
        assert!(tip(time).abs_diff_eq(base + by, 1e-5), "{time}: {}", tip(time) - base);
    }
}
