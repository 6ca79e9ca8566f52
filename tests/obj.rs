//! OBJ and MTL files: what they hold, what is mended and noted, and what is refused.

mod common;

use common::{SQUARE, UV, png, strict, write};
use glam::{DQuat, DVec2, DVec3, Vec2, Vec3, Vec4};
use parhelion::scene::{self, AlphaMode, LoadOptions, Material, Scene, SceneError, Wrap};
use proptest::prelude::*;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const OBJ: &str = "\
# a square
mtllib room.mtl
o square
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 0 2
usemtl red paint
f 1/1/1 2/2/1 3/3/1 \\
  4/4/1
";
const MTL: &str = "\
newmtl red paint
Kd 0.5 0.25 0.125
Ns 30
map_Kd -s 2 3 -o 0.5 0.25 -clamp on wood.png
";

/// A folder with a scene, its library and a picture.
fn folder(obj: &[u8], mtl: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "room.mtl", mtl);
    write(folder.path(), "wood.png", &png(1, &[[9, 8, 7, 255]]));
    let path = write(folder.path(), "room.obj", obj);
    (folder, path)
}

fn load(path: &Path) -> Result<Scene, SceneError> {
    scene::load(path, &LoadOptions::default())
}

fn load_obj(obj: &str, mtl: &str) -> Result<Scene, SceneError> {
    load(&folder(obj.as_bytes(), mtl.as_bytes()).1)
}

fn expect(name: &str, loaded: Result<Scene, SceneError>, file: &str, element: &str, words: &[&str]) {
    let error = match loaded {
        Ok(scene) => {
            panic!("{name}: loaded, with {} triangles: {:?}", scene.world_triangles().count(), scene.notes)
        }
        Err(error) => error,
    };
    let found = error.file.file_name().unwrap().to_string_lossy().into_owned();
    assert_eq!(found, file, "{name}: {error}");
    assert_eq!(error.element, element, "{name}: {error}");
    for word in words {
        assert!(error.problem.contains(word), "{name}: `{word}` is not in: {error}");
    }
    assert!(!error.to_string().contains('\n'), "{name}: {error}");
}

/// OBJ text, MTL text, and where and how they are defective.
type Defect = (&'static str, String, String, &'static str, &'static str, &'static [&'static str]);

fn obj(from: &str, to: &str) -> (String, String) {
    assert!(OBJ.contains(from), "{from}");
    (OBJ.replacen(from, to, 1), MTL.to_owned())
}

fn mtl(from: &str, to: &str) -> (String, String) {
    assert!(MTL.contains(from), "{from}");
    (OBJ.to_owned(), MTL.replacen(from, to, 1))
}

#[rustfmt::skip]
#[test]
fn what_makes_a_wrong_picture_is_one_error() {
    let case = |name, (o, m): (String, String), file, element, words| -> Defect { (name, o, m, file, element, words) };
    let table = [
        case("empty", (String::new(), String::new()), "room.obj", "file", &["no triangle"]),
        case("not text", ("\0\u{fffd}PK\u{3}".into(), String::new()), "room.obj", "file", &["no triangle"]),
        case("vertex not there", obj("f 1/1/1", "f 5/1/1"), "room.obj", "line 14", &["vertex 5", "there are 4"]),
        case("vertex 0", obj("f 1/1/1", "f 0/1/1"), "room.obj", "line 14", &["vertex 0"]),
        case("vertex before the first", obj("f 1/1/1", "f -5/1/1"), "room.obj", "line 14", &["vertex -5"]),
        case("vertex 2^63", obj("f 1/1/1", "f 9223372036854775808/1/1"), "room.obj", "line 14", &["9223372036854775808"]),
        case("vertex -2^63", obj("f 1/1/1", "f -9223372036854775808/1/1"), "room.obj", "line 14", &["-9223372036854775808"]),
        case("corner that is no number", obj("f 1/1/1", "f 1/x/1"), "room.obj", "line 14", &["`1/x/1`"]),
        case("corner of four", obj("f 1/1/1", "f 1/1/1/1"), "room.obj", "line 14", &["`1/1/1/1`"]),
        case("corner of no vertex", obj("f 1/1/1", "f /1/1"), "room.obj", "line 14", &["`/1/1`"]),
        case("index that overflows", obj("f 1/1/1", "f 99999999999999999999/1/1"), "room.obj", "line 14", &["not a corner"]),
        case("NaN vertex", obj("v 1 1 0", "v 1 NaN 0"), "room.obj", "line 6", &["NaN"]),
        case("infinite vertex", obj("v 1 1 0", "v 1 1e39 0"), "room.obj", "line 6", &["inf"]),
        case("vertex of two", obj("v 1 1 0", "v 1 1"), "room.obj", "line 6", &["this one 2"]),
        case("vertex of words", obj("v 1 1 0", "v one 1 0"), "room.obj", "line 6", &["`one`"]),
        case("NaN colour", mtl("Kd 0.5", "Kd NaN"), "room.mtl", "line 2", &["NaN"]),
        case("colour of two", mtl("Kd 0.5 0.25 0.125", "Kd 0.5 0.25"), "room.mtl", "line 2", &["1 or 3"]),
        case("colour above 1", mtl("Kd 0.5", "Kd 1.5"), "room.mtl", "line 1", &["red paint", "base colour is 1.5"]),
        case("negative emission", mtl("Ns 30", "Ke 0 -1 0"), "room.mtl", "line 1", &["emission is -1"]),
        case("no exponent", mtl("Ns 30", "Ns"), "room.mtl", "line 3", &["missing"]),
        case("rough beyond measure", mtl("Ns 30", "Pr 2"), "room.mtl", "line 1", &["roughness is 2"]),
        case("light glass", mtl("Ns 30", "illum 7\nNi 0.5"), "room.mtl", "line 1", &["index of refraction is 0.5"]),
    ];
    for (name, obj, mtl, file, element, words) in table {
        let (_folder, path) = folder(obj.as_bytes(), mtl.as_bytes());
        expect(name, load(&path), file, element, words);
    }
    let (_folder, path) = folder(OBJ.as_bytes(), MTL.as_bytes());
    let options = LoadOptions { scene: Some("attic".into()), ..LoadOptions::default() };
    expect("scene of an OBJ", scene::load(&path, &options), "room.obj", "scenes", &["attic"]);
}

/// A defect is an error where the load is strict, and else a note of the same words that says what is done about it.
#[rustfmt::skip]
#[test]
fn what_leaves_the_picture_is_mended_and_noted() {
    type Mended = (Defect, &'static str);
    let case = |name, (o, m): (String, String), file, element, words, remedy| -> Mended { ((name, o, m, file, element, words), remedy) };
    let table = [
        case("library not there", obj("room.mtl", "hall.mtl"), "room.obj", "line 2", &["hall.mtl", "not there"], "the one named as the scene is taken"),
        case("library outside", obj("room.mtl", "../room.mtl"), "room.obj", "line 2", &["../room.mtl", "`room.mtl` is"], "of nearly that name"),
        case("library without a name", obj("mtllib room.mtl", "mtllib"), "room.obj", "line 2", &["not a path inside"], "named as the scene"),
        case("library that is a folder", obj("room.mtl", "."), "room.obj", "line 2", &["`.`", "not a file"], "default one"),
        case("unknown material", obj("red paint", "blue"), "room.obj", "line 13", &["`blue`"], "default material"),
        case("nameless material", obj("usemtl red paint", "usemtl"), "room.obj", "line 13", &["without a name"], "default material"),
        case("early material", (OBJ.replace("mtllib room.mtl\n", "") + "mtllib room.mtl\n", MTL.into()), "room.obj", "line 12", &["red paint", "so far"], "later ones are taken"),
        case("no library at all", obj("mtllib room.mtl", "#"), "room.obj", "line 13", &["red paint", "no mtllib"], "default material"),
        case("uv not there", obj("f 1/1/1", "f 1/9/1"), "room.obj", "line 14", &["texture coordinate 9"], "go without"),
        case("normal not there", obj("f 1/1/1", "f 1/1/2"), "room.obj", "line 14", &["normal 2"], "go without"),
        case("normal 2^63", obj("f 1/1/1", "f 1/1/9223372036854775807"), "room.obj", "line 14", &["normal 9223372036854775807"], "go without"),
        case("uv before the first", obj("f 1/1/1", "f 1/-9/1"), "room.obj", "line 14", &["texture coordinate -9"], "go without"),
        case("uv 0", obj("f 1/1/1", "f 1/0/1"), "room.obj", "line 14", &["texture coordinate 0"], "go without"),
        case("late vertex", (OBJ.replace("v 0 1 0\n", "") + "v 0 1 0\n", MTL.into()), "room.obj", "line 13", &["vertex 4", "3 so far"], "come later are taken"),
        case("late uv", (OBJ.replace("vt 0 1\n", "") + "vt 0 1\n", MTL.into()), "room.obj", "line 13", &["texture coordinate 4", "3 so far"], "come later are taken"),
        case("late normal", (OBJ.replace("vn 0 0 2\n", "") + "vn 0 0 2\n", MTL.into()), "room.obj", "line 13", &["normal 1", "0 so far"], "come later are taken"),
        case("normal of two", obj("vn 0 0 2", "vn 0 0"), "room.obj", "line 12", &["a normal has 3"], "triangle's own"),
        case("NaN uv", obj("vt 1 1", "vt 1 NaN"), "room.obj", "line 10", &["NaN"], "without such texture coordinates"),
        case("unused NaN vertex", obj("v 0 1 0\n", "v 0 1 0\nv NaN 0 0\n"), "room.obj", "line 8", &["NaN"], "no face uses"),
        case("decimal comma", obj("v 1 1 0", "v 1,0 1 0"), "room.obj", "line 6", &["`1,0`"], "decimal point"),
        case("words after a vertex", obj("v 1 1 0", "v 1 1 0 here"), "room.obj", "line 6", &["`here`"], "left out"),
        case("words after a face", obj("4/4/1", "4/4/1 (door)"), "room.obj", "line 14", &["`(door)`"], "left out"),
        case("face of two", obj("f 1/1/1", "f 1 2\nf 1/1/1"), "room.obj", "line 14", &["3 corners, this one 2"], "left out"),
        case("crossed face", obj("f 1/1/1", "f 1 3 2 4\nf 1/1/1"), "room.obj", "line 14", &["a polygon"], "overlap"),
        case("nothing named", mtl("Ns 30", "map_Kd wood.png\nnewmtl\nNs 30"), "room.mtl", "line 4", &["newmtl"], "usemtl without one"),
        case("statement before a name", mtl("newmtl", "Ka 1 1 1\nnewmtl"), "room.mtl", "line 1", &["ka", "newmtl"], "left out"),
        case("d and Tr", mtl("Ns 30", "d 1\nTr 1"), "room.mtl", "line 1", &["d and Tr"], "d is the one"),
        case("colour a hair above 1", mtl("Kd 0.5", "Kd 1.0001"), "room.mtl", "line 2", &["1.0001"], "clamped"),
        case("colour a little above 1", mtl("Kd 0.5", "Kd 1.05"), "room.mtl", "line 2", &["1.05"], "clamped"),
        case("negative exponent", mtl("Ns 30", "Ns -3"), "room.mtl", "line 3", &["Ns is negative"], "left out"),
        case("bright material of nothing", mtl("newmtl red", "newmtl x\nKd 5 5 5\nnewmtl red"), "room.mtl", "line 1", &["`x`", "5"], "no surface"),
        case("broken material of nothing", mtl("newmtl red", "newmtl x\nKd\nnewmtl red"), "room.mtl", "line 2", &["a number is missing"], "no surface"),
        case("model of words", mtl("Ns 30", "illum color"), "room.mtl", "line 3", &["`color`"], "left out"),
        case("picture not there", mtl("wood.png", "stone.png"), "room.mtl", "line 4", &["stone.png"], "without such pictures"),
        case("picture outside", mtl("wood.png", "../../etc/passwd"), "room.mtl", "line 4", &["inside the scene's folder"], "without such pictures"),
        case("picture that is none", mtl("wood.png", "room.obj"), "room.mtl", "line 4", &["neither PNG nor JPEG"], "without such pictures"),
        case("picture without a name", mtl(" wood.png", ""), "room.mtl", "line 4", &["missing"], "left out"),
        case("Windows picture", mtl("wood.png", "C:\\Users\\me\\maps\\wood.png"), "room.mtl", "line 4", &["`wood.png` is"], "nearly that name"),
        case("absolute picture", mtl("wood.png", "/home/me/wood.png"), "room.mtl", "line 4", &["`wood.png` is"], "nearly that name"),
        case("picture beside the folder", mtl("wood.png", "../textures/wood.png"), "room.mtl", "line 4", &["`wood.png` is"], "nearly that name"),
        case("picture but for case", mtl("wood.png", "Wood.PNG"), "room.mtl", "line 4", &["`wood.png` is"], "nearly that name"),
        case("library but for case", obj("room.mtl", "Room.MTL"), "room.obj", "line 2", &["`room.mtl` is"], "nearly that name"),
    ];
    for ((name, obj, mtl, file, element, words), remedy) in table {
        let (_folder, path) = folder(obj.as_bytes(), mtl.as_bytes());
        expect(name, scene::load(&path, &strict()), file, element, words);
        let scene = load(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
        let place = if file == "room.obj" { format!("{element}: ") } else { format!("{file}: {element}: ") };
        let is_it = |note: &&String| note.starts_with(&place) && words.iter().all(|word| note.contains(word));
        let note = scene.notes.iter().find(is_it).unwrap_or_else(|| panic!("{name}: {:?}", scene.notes));
        assert!(note.contains(remedy), "{name}: {note}");
        // All of the square is there, and what its material was if that is known.
        assert!(scene.area() >= 0.999, "{name}: {}", scene.area());
        let material = &scene.materials[*scene.meshes[0].materials.last().unwrap() as usize];
        let known = !remedy.starts_with("default");
        assert_eq!(material.name, if known { "red paint" } else { "default" }, "{name}");
        let has_picture = known && !remedy.contains("without such pictures") && name != "picture without a name";
        assert_eq!(material.base_color_texture.is_some(), has_picture, "{name}");
    }
}

#[test]
fn names_and_marks_are_read_as_they_are() {
    let (folder, path) = folder(
        OBJ.replace("v 1 1 0", "\u{feff}v 1 1 0").replace("mtllib", "\u{feff}\u{feff}mtllib").as_bytes(),
        MTL.replace("-s 2 3 -o 0.5 0.25 -clamp on wood.png", "red  wood.png").as_bytes(),
    );
    std::fs::rename(folder.path().join("wood.png"), folder.path().join("red  wood.png")).unwrap();
    let scene = scene::load(&path, &strict()).unwrap();
    assert!((scene.area() - 1.0).abs() < 1e-6 && scene.images.len() == 1);
    // A path of more parts than any folder is deep.
    let deep = format!("{}wood.png", "a/".repeat(300_000));
    write(folder.path(), "room.mtl", MTL.replace("wood.png", &deep).as_bytes());
    assert!(load(&path).unwrap().images.is_empty());
}

#[test]
fn files_load() {
    let scene = load_obj(OBJ, MTL).unwrap();
    let mesh = &scene.meshes[0];
    assert_eq!((mesh.name.as_str(), scene.name.as_str()), ("square", "room"));
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.positions, SQUARE);
    assert_eq!(mesh.normals, [Vec3::Z; 4]);
    assert_eq!(mesh.uv0, UV, "v counts from the top");
    assert_eq!((scene.cameras.len(), scene.lights.len()), (1, 0));
    let material = &scene.materials[mesh.materials[0] as usize];
    assert_eq!(material.name, "red paint");
    assert_eq!(material.base_color, Vec4::new(0.5, 0.25, 0.125, 1.0));
    assert_eq!((material.metallic, material.specular, material.double_sided), (0.0, 0.0, true));
    // α² = 2/(30 + 2), roughness² = α.
    assert!((material.roughness - 0.5).abs() < 1e-6);
    let texture = material.base_color_texture.unwrap();
    assert_eq!(scene.images[0].texels, [[9, 8, 7, 255]]);
    assert_eq!((texture.sampler.wrap_u, texture.sampler.wrap_v), (Wrap::ClampToEdge, Wrap::ClampToEdge));
    // In OBJ's own coordinates u' = 2u + 0.5 and v' = 3v + 0.25, v from the bottom.
    for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.3, 0.8)] {
        let found = texture.transform.to_affine().transform_point2(Vec2::new(u, 1.0 - v));
        assert!(found.abs_diff_eq(Vec2::new(2.0 * u + 0.5, 1.0 - (3.0 * v + 0.25)), 1e-6), "{found}");
    }
}

#[test]
fn indices_count_backwards_and_attributes_may_mix() {
    let obj = "\
v 0 0 0 1 0 0
v 1 0 0 # plain
v 0 1 0
vn 1 0 0
f -3 -2 -1
o second
v 0 0 1 1.0
f 1//1 2//-1 4
l 1 2
p 1
";
    let scene = load_obj(obj, "").unwrap();
    assert_eq!(scene.meshes.len(), 2);
    assert_eq!(scene.meshes[0].name, "room");
    assert!(scene.meshes[0].normals.is_empty());
    assert_eq!(scene.meshes[0].colors, [Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::ONE, Vec4::ONE]);
    assert_eq!(scene.meshes[1].positions, [Vec3::ZERO, Vec3::X, Vec3::Z]);
    assert_eq!(scene.meshes[1].normals, [Vec3::X, Vec3::X, Vec3::ZERO]);
    assert!(
        scene.notes.contains(&"2 statements of points or lines are left out".to_owned()),
        "{:?}",
        scene.notes
    );
}

/// A file's decimals hold more than 32 bits.
#[test]
fn far_files_keep_their_shape() {
    let obj = "mtllib room.mtl\nv 10000000.25 0 -5000000\nv 10000001.5 0 -5000000 1\nv 10000000.25 1 -5000000.125 0.5 0.5 0.5\nf 1 2 3\n";
    let scene = load_obj(obj, "").unwrap();
    let expected = [
        DVec3::new(10_000_000.25, 0.0, -5e6),
        DVec3::new(10_000_001.5, 0.0, -5e6),
        DVec3::new(10_000_000.25, 1.0, -5_000_000.125),
    ];
    let corners: Vec<DVec3> =
        scene.world_triangles().flatten().map(|corner| corner.as_dvec3() + scene.origin).collect();
    assert_eq!(corners, expected);
}

#[test]
fn models_become_materials() {
    let material = |text: &str| {
        let scene = load_obj(OBJ, &format!("newmtl red paint\nKd 0.6\n{text}\n")).unwrap();
        scene.materials[0].clone()
    };
    let plain = material("Tf 0.1 0.2 0.3");
    assert_eq!(
        (plain.base_color, plain.specular, plain.roughness),
        (Vec4::new(0.6, 0.6, 0.6, 1.0), 0.0, 1.0)
    );
    let shiny = material("Ks 0.2 0.4 0.1\nNs 0\nillum 2");
    assert_eq!((shiny.specular, shiny.specular_color, shiny.metallic), (0.4, Vec3::new(0.5, 1.0, 0.25), 0.0));
    let mirror = material("Ks 0.9 0.8 0.7\nillum 3");
    assert_eq!(
        (mirror.metallic, mirror.roughness, mirror.base_color),
        (1.0, 0.0, Vec4::new(0.9, 0.8, 0.7, 1.0))
    );
    let pane = material("illum 4\nNi 1.4");
    assert_eq!((pane.transmission, pane.ior, pane.volume, pane.roughness), (1.0, 1.4, None, 0.0));
    let solid = material("illum 7");
    assert!(solid.volume.is_some_and(|volume| volume.attenuation_distance.is_infinite()) && solid.ior == 1.5);
    assert_eq!(material("Ke 1 2 3").emission, Vec3::new(1.0, 2.0, 3.0));
    for text in ["d 0.25", "Tr 0.75", "d -halo 0.25"] {
        let faint = material(text);
        assert_eq!((faint.base_color.w, faint.alpha_mode), (0.25, AlphaMode::Blend), "{text}");
    }
}

/// An independent reader agrees on files that both understand.
#[test]
fn triangles_are_those_of_tobj() {
    let mut text = String::new();
    for i in 0..60 {
        // Any of a parabola's points are the corners of a convex polygon.
        writeln!(text, "v {i} {} {}\nvn {} 1 0\nvt 0.{i} 0.5", i * i, i + 2 * i * i, i - 30).unwrap();
        if i >= 5 {
            writeln!(text, "f {0}/{0}/{0} {1}/{1}/{1} -3/-3/-3 -2/-2/-2 -1/-1/-1", i - 4, i - 3).unwrap();
            writeln!(text, "f {} {} -1", i - 3, i - 4).unwrap();
        }
    }
    let ours: Vec<[Vec3; 3]> = load_obj(&text, "").unwrap().world_triangles().collect();
    let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| unreachable!()).unwrap();
    let theirs: Vec<[Vec3; 3]> = models
        .iter()
        .flat_map(|model| {
            let position = |&i: &u32| Vec3::from_slice(&model.mesh.positions[3 * i as usize..]);
            model
                .mesh
                .indices
                .chunks_exact(3)
                .map(|t| [position(&t[0]), position(&t[1]), position(&t[2])])
                .collect::<Vec<_>>()
        })
        .collect();
    let distinct = |t: &&[Vec3; 3]| (t[1] - t[0]).as_dvec3().cross((t[2] - t[0]).as_dvec3()) != DVec3::ZERO;
    assert!(ours.len() > 200);
    assert!(ours.iter().eq(theirs.iter().filter(distinct)));
}

/// Load as `name.obj` what `corners` and the faces between them are.
fn polygons(corners: &[[f64; 3]], faces: &str) -> Scene {
    let mut text: String = corners.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    text.push_str(faces);
    load_obj(&text, "").unwrap()
}

#[test]
fn concave_polygons_and_walls_with_windows_are_covered_once() {
    // Turned about an oblique axis, and as it is.
    for turn in [DQuat::IDENTITY, DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -3.0).normalize(), 0.9)] {
        let placed = |corners: &[[f64; 2]]| -> Vec<[f64; 3]> {
            corners.iter().map(|&[x, y]| (turn * DVec3::new(x, y, 0.0)).to_array()).collect()
        };
        let facing = (turn * DVec3::Z).as_vec3();
        let check = |scene: &Scene, area: f64| {
            assert!((scene.area() - area).abs() < 1e-5 * area, "{} in place of {area}", scene.area());
            for [a, b, c] in scene.world_triangles() {
                assert!((b - a).cross(c - a).normalize().dot(facing) > 0.99, "it faces as the polygon does");
            }
            assert!(!scene.notes.iter().any(|note| note.contains("polygon")), "{:?}", scene.notes);
        };
        let ell = placed(&[[1.0, 0.0], [0.0, 0.0], [0.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]);
        check(&polygons(&ell, "f 1 2 3 4 5 6"), 3.0);
        let arrow = placed(&[[0.0, 1.0], [-1.0, -1.0], [0.0, -0.5], [1.0, -1.0]]);
        for face in ["f 1 2 3 4", "f 2 3 4 1", "f 3 4 1 2", "f 4 1 2 3"] {
            check(&polygons(&arrow, face), 1.5);
        }
        // A wall of 4 × 3 with a window of 2 × 1 and one of 1 × 0.5, joined by double edges, their corners shared or not.
        let wall = [
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 3.0],
            [0.0, 3.0],
            [1.0, 1.0],
            [1.0, 2.0],
            [3.0, 2.0],
            [3.0, 1.0],
            [3.25, 0.25],
            [3.25, 0.75],
            [3.75, 0.75],
            [3.75, 0.25],
        ];
        let wall = placed(&wall);
        check(&polygons(&wall[..8], "f 1 2 3 4 1 5 6 7 8 5"), 10.0);
        check(&polygons(&wall, "f 1 2 9 10 11 12 9 2 3 4 1 5 6 7 8 5"), 9.75);
        let apart: Vec<_> = [0, 1, 2, 3, 0, 4, 5, 6, 7, 4].map(|i| wall[i]).into();
        check(&polygons(&apart, "f 1 2 3 4 5 6 7 8 9 10"), 10.0);
        // The outside's last edge is given as well.
        check(&polygons(&wall[..8], "f 1 2 3 4 1 5 6 7 8 5 1"), 10.0);
    }
}

/// The only material, its pictures and the notes of a square with this library; `maps` lie beside it.
fn painted(mtl: &str, maps: &[(&str, Vec<u8>)]) -> (Material, Scene) {
    let (folder, path) = folder(OBJ.as_bytes(), format!("newmtl red paint\n{mtl}\n").as_bytes());
    for (name, bytes) in maps {
        write(folder.path(), name, bytes);
    }
    let scene = load(&path).unwrap();
    let used = scene.meshes[0].materials[0];
    (scene.materials[used as usize].clone(), scene)
}

fn gray(v: u8) -> [u8; 4] {
    [v, v, v, 255]
}

#[test]
fn opacity_is_the_alpha_of_the_base_colour() {
    let maps = [
        ("hole.png", png(2, &[gray(0), gray(255), gray(255), gray(0)])),
        ("mist.png", png(2, &[gray(0), gray(60), gray(120), gray(200)])),
        ("leaf.png", png(2, &[[1, 2, 3, 0], [4, 5, 6, 255], [7, 8, 9, 255], [10, 11, 12, 0]])),
        ("rgb.png", png(1, &[[10, 200, 30, 255]])),
    ];
    let of = |mtl| {
        let (material, scene) = painted(mtl, &maps);
        let image = material.base_color_texture.unwrap().image as usize;
        (material, scene.images[image].texels.clone(), scene)
    };
    let (material, texels, scene) = of("Kd 1 0.5 0.25\nmap_d hole.png");
    assert_eq!(material.alpha_mode, AlphaMode::Mask { cutoff: 0.5 });
    assert_eq!(material.base_color, Vec4::new(1.0, 0.5, 0.25, 1.0), "no map, no change of colour");
    let white = |alpha| [255, 255, 255, alpha];
    assert_eq!(texels, [white(0), white(255), white(255), white(0)]);
    assert_eq!(scene.images.len(), 1);
    let (material, texels, _) = of("map_Kd rgb.png\nmap_d mist.png");
    assert_eq!((material.alpha_mode, material.base_color), (AlphaMode::Blend, Vec4::ONE));
    assert_eq!(texels, [0, 60, 120, 200].map(|alpha| [10, 200, 30, alpha]));
    // One picture for both: its own alpha, once.
    let (material, texels, scene) = of("map_Kd leaf.png\nmap_d leaf.png");
    assert_eq!(material.alpha_mode, AlphaMode::Mask { cutoff: 0.5 });
    assert_eq!(texels, [[1, 2, 3, 0], [4, 5, 6, 255], [7, 8, 9, 255], [10, 11, 12, 0]]);
    assert_eq!(scene.images.len(), 1);
    let (_, texels, _) = of("map_d -imfchan g rgb.png");
    assert_eq!(texels, [white(200)]);
    assert_eq!(of("d 0.5\nmap_d hole.png").0.alpha_mode, AlphaMode::Blend);
    // A colour's alpha without a map_d means nothing, as before.
    let (material, texels, _) = of("map_Kd leaf.png");
    assert_eq!((material.alpha_mode, texels[0]), (AlphaMode::Opaque, [1, 2, 3, 0]));
}

#[test]
fn heights_and_normals_are_normal_maps() {
    // Heights that grow by 51/255 a texel to the right.
    let ramp: Vec<_> = (0..4).flat_map(|_| (0..4).map(|x| gray(51 * x))).collect();
    let normals = [[128, 128, 255, 255], [160, 100, 245, 255]];
    let maps = [("ramp.png", png(4, &ramp)), ("normals.png", png(2, &normals))];
    let of = |mtl| {
        let (material, scene) = painted(mtl, &maps);
        let map = material.normal_map.unwrap();
        (map.scale, scene.images[map.texture.image as usize].clone(), scene)
    };
    for (mtl, scale) in
        [("bump ramp.png", 1.0), ("map_Bump -bm 0.5 ramp.png", 0.5), ("map_bump ramp.png -bm 3", 3.0)]
    {
        let (found, image, scene) = of(mtl);
        assert_eq!(found, scale, "{mtl}");
        assert_eq!(scene.images.len(), 1, "heights themselves are of no use");
        let texel = |i: usize| {
            let (high, low) = (image.texels[i], image.texels[16 + i]);
            let decode = |c: usize| f64::from(u16::from_be_bytes([high[c], low[c]])) / 32767.5 - 1.0;
            DVec3::new(decode(0), decode(1), decode(2))
        };
        // Inside the slope is 0.2; over the edge, where the picture begins again, (0.2 − 0.6)/2.
        for (x, slope) in [(0, -0.2), (1, 0.2), (2, 0.2), (3, -0.2)] {
            let expected = DVec3::new(-slope, 0.0, 1.0).normalize();
            assert!((texel(4 + x) - expected).length() < 1e-4, "{mtl} {x}: {}", texel(4 + x));
        }
    }
    let (_, clamped, _) = of("bump -clamp on ramp.png");
    let slope = |i: usize| {
        let decode = |c: usize| {
            f64::from(u16::from_be_bytes([clamped.texels[i][c], clamped.texels[16 + i][c]])) / 32767.5 - 1.0
        };
        -decode(0) / decode(2)
    };
    assert!((slope(0) - 0.1).abs() < 1e-4 && (slope(3) - 0.1).abs() < 1e-4, "{} {}", slope(0), slope(3));
    for mtl in ["norm normals.png", "map_Norm normals.png", "norm -bm 2 normals.png"] {
        let (scale, image, scene) = of(mtl);
        assert_eq!(
            (scale, &image.texels[..]),
            (if mtl.contains("-bm") { 2.0 } else { 1.0 }, &normals[..]),
            "{mtl}"
        );
        assert!(!scene.notes.iter().any(|note| note.contains("normals.png")), "{:?}", scene.notes);
    }
    let (_, image, scene) = of("bump normals.png");
    assert_eq!(image.texels, normals);
    assert!(scene.notes.iter().any(|note| note.contains("shows normals, not heights")), "{:?}", scene.notes);
    assert!(!scene.meshes[0].tangents.is_empty(), "normal maps need tangents");
}

#[test]
fn physical_statements_are_metallic_and_rough() {
    let maps = [
        ("rough.png", png(2, &[gray(0), gray(51), gray(102), gray(255)])),
        ("metal.png", png(1, &[[10, 200, 30, 255]])),
    ];
    let of = |mtl: &str| painted(mtl, &maps);
    let (material, _) =
        of("Kd 0.5 0.25 0.125\nKs 1 0 0\nNs 30\nPr 0.25\nPm 0.75\nPc 0.5\nPcr 0.125\nPs 0.5\nKe 1 2 3");
    assert_eq!((material.roughness, material.metallic), (0.25, 0.75));
    assert_eq!((material.specular, material.specular_color), (1.0, Vec3::ONE), "Ks is another model's");
    assert_eq!(material.emission, Vec3::new(1.0, 2.0, 3.0));
    let coat = material.clearcoat.unwrap();
    assert_eq!((coat.factor, coat.roughness), (0.5, 0.125));
    let (material, _) = of("Kd 0.5\nNs 30\nPm 1");
    assert!((material.roughness - 0.5).abs() < 1e-6, "without Pr it is that of Ns");
    assert_eq!(material.metallic, 1.0);
    let (material, scene) = of("map_Pr rough.png\nmap_Pm -imfchan g metal.png");
    assert_eq!((material.roughness, material.metallic), (1.0, 1.0));
    let image = material.metallic_roughness_texture.unwrap().image as usize;
    assert_eq!(scene.images[image].texels, [0, 51, 102, 255].map(|rough| [255, rough, 200, 255]));
    let (material, scene) = of("Pr 0.5\nmap_Pr rough.png");
    assert_eq!((material.roughness, material.metallic), (0.5, 0.0), "maps are multiplied");
    assert_eq!(scene.images[0].texels, [0, 51, 102, 255].map(|rough| [255, rough, 255, 255]));
    // One that is not there is as if it had not been named.
    let (material, _) = of(
        "Ns 30\nmap_Pr gone.png\nmap_Pm gone.png\nmap_Ke gone.png\nmap_Ks gone.png\nmap_d gone.png\nnorm gone.png",
    );
    let (plain, _) = of("Ns 30");
    assert_eq!(format!("{material:?}"), format!("{plain:?}"));
    let (material, _) = of("map_Ks metal.png\nmap_Ke metal.png");
    assert_eq!((material.specular, material.emission), (1.0, Vec3::ONE));
    assert!(material.specular_color_texture.is_some() && material.emission_texture.is_some());
}

#[test]
fn vertex_colours_are_srgb_and_all_there_is() {
    let linear = |v: f32| if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
    let corners = |white: f32| -> String {
        let color = |(i, [r, g, b]): (usize, [f32; 3])| {
            format!("v {} {} 0 {} {} {}\n", i % 2, i / 2, r * white, g * white, b * white)
        };
        [[0.0, 0.02, 0.2], [0.4, 0.6, 0.8], [1.0; 3]].into_iter().enumerate().map(color).collect()
    };
    for white in [1.0, 255.0] {
        for (paint, expected) in
            [("", 1.0), ("mtllib room.mtl\nusemtl dull\n", 1.0), ("mtllib room.mtl\nusemtl own\n", 0.5)]
        {
            let text = format!("{}{paint}f 1 2 3\n", corners(white));
            let scene = load_obj(&text, "newmtl dull\nNs 10\nnewmtl own\nKd 0.5 0.5 0.5\n").unwrap();
            let mesh = &scene.meshes[0];
            let found = [mesh.colors[0].z, mesh.colors[1].x, mesh.colors[0].y, mesh.colors[2].x];
            let is = [linear(0.2), linear(0.4), linear(0.02), 1.0];
            for (found, is) in found.into_iter().zip(is) {
                assert!((found - is).abs() < 1e-5, "{found} instead of {is}");
            }
            let material = &scene.materials[mesh.materials[0] as usize];
            assert_eq!(material.base_color, Vec3::splat(expected).extend(1.0), "`{paint}`");
            let told = scene.notes.iter().any(|note| note.contains("255 is taken for white"));
            assert_eq!(told, white == 255.0, "{:?}", scene.notes);
        }
    }
    // Faces without colours beside those with them keep the stand-in.
    let scene =
        load_obj(&format!("{}v 5 0 0\nv 6 0 0\nv 5 1 0\nf 1 2 3\nf 4 5 6\n", corners(1.0)), "").unwrap();
    let colors: Vec<_> =
        scene.meshes[0].materials.iter().map(|&i| scene.materials[i as usize].base_color.x).collect();
    assert_eq!(colors, [1.0, 0.8]);
}

/// Marks, old line ends and numbers in other programs' ways change nothing.
#[test]
fn text_of_any_system_is_the_same() {
    let plain = load_obj(OBJ, MTL).unwrap();
    let crlf = |text: &str| text.replace('\n', "\r\n");
    let cr = |text: &str| text.replace('\n', "\r");
    let mark = |text: &str| format!("\u{feff}{text}");
    let upper = |text: &str| {
        text.replace("newmtl", "NewMtl").replace("Kd", "KD").replace("\nv", "\nV").replace("usemtl", "USEMTL")
    };
    for change in [crlf as fn(&str) -> String, cr, mark, upper] {
        let scene = load_obj(&change(OBJ), &change(MTL)).unwrap();
        assert_eq!(format!("{scene:?}"), format!("{plain:?}"));
    }
    let wide = |text: &str| -> Vec<u8> { mark(text).encode_utf16().flat_map(u16::to_le_bytes).collect() };
    let (_folder, path) = folder(&wide(OBJ), MTL.as_bytes());
    expect("UTF-16", load(&path), "room.obj", "file", &["UTF-16"]);
    let (_folder, path) = folder(OBJ.as_bytes(), &wide(MTL));
    expect("UTF-16", scene::load(&path, &strict()), "room.obj", "line 2", &["`room.mtl` is UTF-16"]);
    assert_eq!(load(&path).unwrap().materials[0].name, "default");
}

/// A picture is found from its library's folder too, and nothing outside is.
#[test]
fn files_are_found_in_the_scenes_folder_alone() {
    let outer = tempfile::tempdir().unwrap();
    let texels = |v| png(1, &[gray(v)]);
    write(outer.path(), "secret.png", &texels(1));
    write(outer.path(), "model/Maps/Oak.png", &texels(2));
    write(outer.path(), "model/lib/room.mtl", b"newmtl red paint\nmap_Kd near.png\n");
    write(outer.path(), "model/lib/near.png", &texels(3));
    let with = |mtl: &str| {
        write(outer.path(), "model/room.mtl", format!("newmtl red paint\nmap_Kd {mtl}\n").as_bytes());
        load(&write(outer.path(), "model/room.obj", OBJ.as_bytes())).unwrap()
    };
    for name in [
        "maps/oak.PNG",
        "..\\textures\\Maps\\Oak.png",
        "C:\\models\\maps\\oak.png",
        "/home/me/maps/OAK.png",
        "\"Maps/Oak.png\"",
    ] {
        let scene = with(name);
        assert_eq!(scene.images.len(), 1, "{name}: {:?}", scene.notes);
        assert_eq!(scene.images[0].texels, [gray(2)], "{name}");
    }
    let absolute = outer.path().join("secret.png").display().to_string();
    for name in [
        "../secret.png",
        &absolute,
        "https://example.org/secret.png",
        "data:image/png;base64,AAAA",
        "\0",
        "//",
    ] {
        let scene = with(name);
        assert!(scene.images.is_empty(), "{name}");
        assert!(
            scene.notes.iter().any(|note| note.contains("without such pictures")),
            "{name}: {:?}",
            scene.notes
        );
    }
    let text = OBJ.replace("room.mtl", "lib/room.mtl");
    let scene = scene::load(&write(outer.path(), "model/room.obj", text.as_bytes()), &strict()).unwrap();
    assert_eq!(scene.images[0].texels, [gray(3)], "beside its library");
}

#[cfg(unix)]
#[test]
fn hostile_files_end() {
    let (folder, _) = folder(OBJ.as_bytes(), MTL.as_bytes());
    let reload = |text: &str| load(&write(folder.path(), "room.obj", text.as_bytes()));
    let mut line = String::from("# ");
    line.extend(std::iter::repeat_n('x', 10_000_000));
    for text in [format!("{line}\n{OBJ}"), format!("{OBJ}usemtl {line}\n"), format!("{}\n{OBJ}", &line[2..])]
    {
        let scene = reload(&text).unwrap();
        assert!(scene.notes.iter().all(|note| note.len() < 1000));
    }
    expect(
        "long word",
        reload(&format!("{OBJ}f 1 2 {line}x\n").replace("# x", "x")),
        "room.obj",
        "line 16",
        &["not a corner"],
    );
    // Libraries that are the scene, a pipe, a folder.
    let pipe = folder.path().join("pipe.mtl");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    std::fs::create_dir(folder.path().join("folder.mtl")).unwrap();
    for library in ["room.obj", "pipe.mtl", "folder.mtl", "/dev/zero", "\0"] {
        let scene = reload(&OBJ.replace("room.mtl", library)).unwrap();
        assert!(!scene.notes.is_empty(), "{library}");
    }
    for picture in ["pipe.mtl", "folder.mtl", "room.obj", "/dev/zero"] {
        write(
            folder.path(),
            "room.mtl",
            format!("newmtl red paint\nmap_d {picture}\nmap_Kd {picture}\nbump {picture}\n").as_bytes(),
        );
        let scene = load(&write(folder.path(), "room.obj", OBJ.as_bytes())).unwrap();
        assert_eq!(scene.images.len(), 0, "{picture}");
    }
    // A million corners: convex, and not.
    for depth in [1.0, 0.5] {
        let count = 1_000_000;
        let (mut text, mut face) = (String::new(), String::from("f"));
        for i in 0..count {
            let at = DVec2::from_angle(TAU * f64::from(i) / f64::from(count))
                * if i % 2 == 0 { 1.0 } else { depth };
            writeln!(text, "v {} {} 0", at.x, at.y).unwrap();
            write!(face, " {}", i + 1).unwrap();
        }
        let loaded = reload(&(text + &face));
        if depth < 1.0 {
            expect("a star", loaded, "room.obj", "line 1000001", &["1000000 corners", "not convex"]);
        } else {
            assert!((loaded.unwrap().area() - 0.5 * TAU).abs() < 1e-5);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever stands where a number stood, a file loads as a valid scene or fails with an error.
    #[test]
    fn corrupt_numbers_never_panic(at in any::<prop::sample::Index>(), number in prop_oneof!["-?[0-9]{1,3}", "[0-9]{10,20}", "-?[0-9]e[0-9]{2}", "nan", "/"]) {
        let change = |text: &str| {
            let digits: Vec<usize> = text.match_indices(|c: char| c.is_ascii_digit()).map(|(i, _)| i).collect();
            let i = digits[at.index(digits.len())];
            format!("{}{number}{}", &text[..i], &text[i + 1..])
        };
        for scene in [load_obj(&change(OBJ), MTL), load_obj(OBJ, &change(MTL))].into_iter().flatten() {
            scene.validate().unwrap();
        }
    }
}
