//! Every reader survives every file: mutants of good ones are read, or refused by one error that names the file, without a
//! panic, an abort or memory out of all proportion.
//!
//! `PARHELION_MUTANTS=N` tries N of each good file in place of a few, `PARHELION_CORPUS=FOLDER` begins from that folder's
//! files too. A mutant is a function of its file and its number; the one at hand lies in `mutants/` of the target's folder
//! for temporary files, so that it is there after a crash.

use parhelion::accel::Geometry;
use parhelion::accel::software::SoftwareBvh;
use parhelion::chart::{Reference, grid};
use parhelion::config::RenderConfig;
use parhelion::graph::Typical;
use parhelion::output::{self, Channels, Picture};
use parhelion::scene::{self, Environment, LoadOptions, Scene, SceneError, SceneProfile};
use parhelion::{ErrorClass, renderer};
use std::alloc::{GlobalAlloc, Layout, System};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Most bytes that a mutant may take: a small file's zeros of 2²⁴ elements are legal.
const MOST: usize = 3 << 30;
/// How long a reader may think about a mutant of a small file, far from what it takes.
const LONGEST: Duration = Duration::from_secs(60);
const FEW: u64 = 60;

struct Counting;

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: all is passed on to the system's allocator as it is.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let now = NOW.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        PEAK.fetch_max(now, Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// SplitMix64 (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, count: usize) -> usize {
        (self.next() % count.max(1) as u64) as usize
    }

    fn of<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.below(all.len())]
    }
}

const NUMBERS: &[&str] = &[
    "0",
    "-0",
    "1",
    "-1",
    "2",
    "0.0",
    "1.0",
    "1.0001",
    "-1e-7",
    "255",
    "256",
    "65535",
    "65536",
    "16777216",
    "2147483648",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551616",
    "1e9",
    "1e24",
    "1e38",
    "3.5e38",
    "1e400",
    "-1e38",
    "1e-38",
    "1e-45",
    "NaN",
    "nan",
    "inf",
    "-inf",
    "0x10",
    "1,5",
    "null",
    "true",
    "\"1\"",
    "[]",
    "{}",
    "",
];

const WORDS: &[&str] = &[
    "\u{feff}",
    "\0",
    "\r",
    "\n",
    "\t",
    " ",
    "\\",
    "\"",
    "..",
    "/",
    "../../etc/passwd",
    "/dev/zero",
    "\u{1b}[31m",
    "\u{202e}",
    "%2e%2e%2f",
    "data:,",
    "data:;base64,AAAA",
    "https://example.org/a",
    "KHR_draco_mesh_compression",
    "MASK",
    "BLEND",
    "SCALAR",
    "MAT4",
    "f 1 2 3",
    "usemtl",
    "f",
    "v",
    "#",
    "g",
];

/// Changes a text's numbers and words, or bytes of anything.
fn change(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    let at = random.below(bytes.len() + 1);
    let end = (at + 1 + random.below(64)).min(bytes.len());
    match random.below(10) {
        0 if at < bytes.len() => bytes[at] ^= 1 << random.below(8),
        1 if at < bytes.len() => bytes[at] = random.next() as u8,
        2 if at < bytes.len() => drop(bytes.drain(at..end)),
        3 if at < bytes.len() => {
            let part = bytes[at..end].to_vec();
            bytes.splice(at..at, part);
        }
        4 => bytes.truncate(at),
        5 if !other.is_empty() => {
            let from = random.below(other.len());
            let part = other[from..(from + 1 + random.below(64)).min(other.len())].to_vec();
            bytes.splice(at..at, part);
        }
        6 => drop(bytes.splice(at..at, random.of(WORDS).bytes())),
        // A number, whole.
        _ => {
            let digit = |b: &u8| b.is_ascii_digit();
            let Some(start) = bytes[at..].iter().position(digit).map(|i| at + i) else { return };
            let part = |b: &u8| b.is_ascii_digit() || b".eE+-".contains(b);
            let start = start - bytes[..start].iter().rev().take_while(|b| part(b)).count();
            let length = bytes[start..].iter().take_while(|b| part(b)).count();
            bytes.splice(start..start + length, random.of(NUMBERS).bytes());
        }
    }
}

/// Chunks of a .glb, changed one by one, lengths put right.
fn change_glb(bytes: &[u8], other: &[u8], random: &mut Random) -> Option<Vec<u8>> {
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize);
    let json = bytes.get(20..20 + word(12)?)?;
    let rest = bytes.get(20 + json.len()..)?;
    let (mut json, mut rest) = (json.to_vec(), rest.to_vec());
    for _ in 0..1 + random.below(3) {
        match random.below(4) {
            0 if rest.len() > 8 => {
                let mut data = rest.split_off(8);
                let length = data.len();
                change(&mut data, other, random);
                data.resize(length, 0);
                rest.extend(data);
            }
            _ => change(&mut json, other, random),
        }
    }
    if random.below(4) > 0 {
        json.resize(json.len().next_multiple_of(4), b' ');
    }
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend((20 + json.len() as u32 + rest.len() as u32).to_le_bytes());
    glb.extend((json.len() as u32).to_le_bytes());
    glb.extend(b"JSON");
    glb.extend(json);
    glb.extend(rest);
    Some(glb)
}

fn mutant(good: &Good, other: &[u8], number: u64) -> Vec<u8> {
    let mut random = Random(number);
    let whole = good.file.extension().is_none_or(|e| e != "glb") || random.below(5) == 0;
    if !whole && let Some(glb) = change_glb(&good.bytes, other, &mut random) {
        return glb;
    }
    let mut bytes = good.bytes.clone();
    for _ in 0..1 + random.below(4) {
        change(&mut bytes, other, &mut random);
    }
    bytes
}

/// A good file, and the one that is read when it is changed.
struct Good {
    file: PathBuf,
    bytes: Vec<u8>,
    main: PathBuf,
}

/// What comes of reading a file: nothing wrong, or an error's class and words.
type Outcome = Result<(), (ErrorClass, String)>;

fn use_scene(scene: Scene) -> Outcome {
    scene.validate().expect("what an importer makes is valid");
    let triangles: usize =
        scene.instances.iter().map(|instance| scene.meshes[instance.mesh as usize].triangles.len()).sum();
    let _ = SceneProfile::of(&scene, 0.1);
    if triangles < 1 << 14 {
        let near = scene.near_origin();
        near.validate().expect("a shifted scene is as valid");
        let geometry = Geometry::of(&near).unwrap();
        SoftwareBvh::build(&geometry, true, u64::MAX).unwrap();
        renderer::plan(&near, &RenderConfig::default(), &[], &Typical).unwrap();
        let _ = scene.fingerprint(&scene.cameras[0]);
    }
    Ok(())
}

/// Whatever moves the scene, its poses are scenes or refused by the file's name.
fn play(file: &Path) {
    let named = |error: SceneError| assert_eq!((error.class(), &*error.file), (ErrorClass::Input, file));
    let Ok(scene) = scene::load(file, &LoadOptions { motion: true, ..LoadOptions::default() }).map_err(named)
    else {
        return;
    };
    for clip in 0..scene.clips().len() {
        for time in [-1.0, 0.3, scene.clips()[clip].end(), 1e300] {
            let _ = scene.pose(&[clip], time).map(|pose| pose.validate().unwrap()).map_err(named);
        }
    }
}

fn read(file: &Path) -> Outcome {
    let options = LoadOptions::default();
    match file.extension().and_then(|e| e.to_str()) {
        Some("gltf" | "glb" | "obj") => match scene::load(file, &options) {
            Ok(scene) => {
                play(file);
                use_scene(scene)
            }
            Err(error) => Err((error.class(), error.to_string())),
        },
        Some("hdr") => Environment::load(file, &options).map(drop).map_err(|e| (e.class(), e.to_string())),
        Some("exr") => {
            let sky = Environment::load(file, &options).map(drop).map_err(|e| (e.class(), e.to_string()));
            let named = |error: String| assert!(error.contains(&*file.to_string_lossy()), "{error}");
            let _ = output::read_exr(file).map_err(|error| named(error.to_string()));
            let _ = Reference::read(file, [2, 1]).map_err(|error| named(error.to_string()));
            sky
        }
        Some("toml") => {
            let settings = grid::settings(&file.display().to_string(), &RenderConfig::default());
            let _ = settings.map_err(|error| assert!(error.to_string().contains(&*file.to_string_lossy())));
            let config = RenderConfig::from_toml(file).and_then(|config| config.validate());
            // What a value may not be is told by its key.
            config.map_err(|e| (e.class(), format!("{}: {e}", file.display())))
        }
        other => unreachable!("{other:?}"),
    }
}

/// Tries `count` mutants of each file, and says how many were read and refused.
fn try_mutants(goods: &[Good], count: u64) {
    static ONE: Mutex<()> = Mutex::new(());
    // Memory is counted for all threads together.
    let _alone = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    let (mut fine, mut refused) = (0_u64, 0_u64);
    for number in 0..count {
        for (i, good) in goods.iter().enumerate() {
            let other = &goods[(number as usize + i) % goods.len()].bytes;
            let bytes = mutant(good, other, number.wrapping_mul(0x1_0001).wrapping_add(i as u64));
            std::fs::write(&good.file, &bytes).unwrap();
            let name = good.main.display();
            let begun = Instant::now();
            PEAK.store(NOW.load(Ordering::Relaxed), Ordering::Relaxed);
            let before = NOW.load(Ordering::Relaxed);
            match read(&good.main) {
                Ok(()) => fine += 1,
                Err((class, error)) => {
                    refused += 1;
                    let folder = good.main.parent().unwrap().to_string_lossy();
                    assert!(error.contains(&*folder), "mutant {number} of {name}: no file in `{error}`");
                    assert!(matches!(class, ErrorClass::Input | ErrorClass::Memory), "{name}: {error}");
                    assert!(error.len() < 2000, "mutant {number} of {name}: {} bytes of error", error.len());
                }
            }
            let peak = PEAK.load(Ordering::Relaxed) - before;
            assert!(peak < MOST, "mutant {number} of {name}: {peak} bytes");
            assert!(begun.elapsed() < LONGEST, "mutant {number} of {name}: {:?}", begun.elapsed());
            std::fs::write(&good.file, &good.bytes).unwrap();
        }
        if (number + 1).is_power_of_two() {
            println!("{fine} mutants read, {refused} refused so far");
        }
    }
    println!("{fine} mutants read, {refused} refused");
}

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mutants").join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn count() -> u64 {
    std::env::var("PARHELION_MUTANTS").map_or(FEW, |count| count.parse().unwrap())
}

/// Files of these kinds below the folder that `PARHELION_CORPUS` names, with what lies beside them, each in a folder of its
/// own below `into`; none that is large.
fn corpus(kinds: &[&str], into: &Path) -> Vec<Good> {
    let Some(corpus) = std::env::var_os("PARHELION_CORPUS") else { return Vec::new() };
    let (mut goods, mut folders) = (Vec::new(), vec![PathBuf::from(corpus)]);
    while let Some(from) = folders.pop() {
        let here: Vec<PathBuf> =
            std::fs::read_dir(&from).unwrap().map(|entry| entry.unwrap().path()).collect();
        folders.extend(here.iter().filter(|path| path.is_dir()).cloned());
        let small =
            |path: &&PathBuf| path.metadata().is_ok_and(|data| data.is_file() && data.len() < 1 << 20);
        let of = |path: &Path| {
            kinds.contains(&&*path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase())
        };
        let small: Vec<_> = here.iter().filter(small).collect();
        for path in small.iter().filter(|path| of(path)) {
            let to = into.join(format!("{}", goods.len()));
            std::fs::create_dir_all(&to).unwrap();
            for beside in &small {
                std::fs::copy(beside, to.join(beside.file_name().unwrap())).unwrap();
            }
            let extension = path.extension().unwrap().to_string_lossy().to_ascii_lowercase();
            let file = to.join(path.file_stem().unwrap()).with_extension(extension);
            let bytes = std::fs::read(path).unwrap();
            goods.push(Good { main: file.clone(), file, bytes });
        }
    }
    goods
}

fn good(folder: &Path, name: &str, bytes: &[u8], main: &str) -> Good {
    let file = folder.join(name);
    std::fs::write(&file, bytes).unwrap();
    Good { file, bytes: bytes.to_vec(), main: folder.join(main) }
}

/// A glTF asset with a little of everything, numbers without meaning.
const ASSET: &str = r#"{"asset": {"version": "2.0"}, "scene": 0,
"extensionsUsed": ["KHR_lights_punctual", "KHR_materials_clearcoat", "KHR_texture_transform", "EXT_mesh_gpu_instancing"],
"extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 3, "color": [1, 0.5, 0.25]},
 {"type": "spot", "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.5}}]}},
"scenes": [{"nodes": [0, 1, 4]}, {"name": "other", "nodes": [1]}],
"nodes": [{"mesh": 0, "skin": 0, "weights": [0.5]}, {"children": [2, 3], "rotation": [0, 0, 0, 1], "scale": [2, 1, 1]},
 {"camera": 0, "translation": [0, 1, 3], "extensions": {"KHR_lights_punctual": {"light": 0}}},
 {"mesh": 1, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.5, 0, 0, 1],
  "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0, "SCALE": 2}}}},
 {"camera": 1, "extensions": {"KHR_lights_punctual": {"light": 1}}}],
"cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}},
 {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0, "zfar": 10}}],
"skins": [{"joints": [1, 2], "inverseBindMatrices": 7}],
"meshes": [{"weights": [0], "primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 3, "COLOR_0": 4,
  "JOINTS_0": 5, "WEIGHTS_0": 4}, "indices": 6, "material": 0, "targets": [{"POSITION": 8}]}]},
 {"primitives": [{"attributes": {"POSITION": 0, "TANGENT": 4, "NORMAL": 2}, "mode": 5, "material": 1}]}],
"materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.5], "metallicFactor": 0.2, "baseColorTexture":
  {"index": 0, "extensions": {"KHR_texture_transform": {"offset": [0.1, 0.2], "scale": [2, 2]}}}},
  "normalTexture": {"index": 0, "scale": 0.5}, "alphaMode": "MASK", "emissiveFactor": [0.5, 0, 0]},
 {"extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 0.5}}, "doubleSided": true}],
"textures": [{"source": 0, "sampler": 0}], "samplers": [{"wrapS": 33071, "magFilter": 9728}],
"images": [{"uri": "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGNoaPgPAAODAgAApfuJAAAAAElFTkSuQmCC"}],
"animations": [{"channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}], "samplers": [{"input": 9, "output": 0}]}],
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
 {"bufferView": 0, "byteOffset": 36, "componentType": 5126, "count": 3, "type": "VEC3"},
 {"bufferView": 0, "byteOffset": 36, "componentType": 5126, "count": 3, "type": "VEC3"},
 {"bufferView": 0, "byteOffset": 72, "componentType": 5126, "count": 3, "type": "VEC2"},
 {"bufferView": 0, "byteOffset": 32, "componentType": 5126, "count": 3, "type": "VEC4"},
 {"componentType": 5121, "count": 3, "type": "VEC4"},
 {"bufferView": 1, "componentType": 5121, "count": 3, "type": "SCALAR"},
 {"count": 2, "componentType": 5126, "type": "MAT4"},
 {"count": 3, "componentType": 5126, "type": "VEC3", "sparse": {"count": 1, "indices": {"bufferView": 1, "componentType": 5121},
  "values": {"bufferView": 0}}},
 {"count": 3, "componentType": 5126, "type": "SCALAR"}],
"bufferViews": [{"buffer": 0, "byteLength": 96}, {"buffer": 1, "byteLength": 3}],
"buffers": [{"byteLength": 96, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/"},
 {"byteLength": 3, "uri": "data:;base64,AAEC"}]}"#;

#[test]
fn mutants_of_gltf() {
    let folder = folder("gltf");
    let mut goods = vec![
        good(&folder, "asset.gltf", ASSET.as_bytes(), "asset.gltf"),
        good(&folder, "cornell.glb", include_bytes!("../scenes/cornell.glb"), "cornell.glb"),
    ];
    scene::load(&goods[0].main, &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    goods.extend(corpus(&["gltf", "glb"], &folder.join("corpus")));
    try_mutants(&goods, count());
}

#[test]
fn mutants_of_obj() {
    let folder = folder("obj");
    let obj = "mtllib a.mtl\no square\nv 0 0 0 1 0.5 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.4 0.5 0\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 2\n\
        usemtl red paint\nf 1/1/1 2/2/1 3/3/1 \\\n 4//1 5\ng x\ns 1\nusemtl glass\nf -1 -2 -3\nl 1 2\np 1\n";
    let mtl = "newmtl red paint\nKd 0.5 0.25 0.125\nKs 0.5\nNs 30\nd 0.5\nmap_Kd -s 2 3 -o 0.5 0.25 -clamp on a.png\n\
        map_d a.png\nbump -bm 0.5 a.png\nPr 0.5\nPm 0.5\nmap_Pr a.png\nKe 1 2 3\nnewmtl glass\nillum 7\nNi 1.5\nTr 0.5\n";
    let mut png = std::io::Cursor::new(Vec::new());
    let image = image::RgbaImage::from_fn(4, 4, |x, y| image::Rgba([64 * x as u8, 64 * y as u8, 9, 200]));
    image.write_to(&mut png, image::ImageFormat::Png).unwrap();
    let mut goods = vec![
        good(&folder, "a.obj", obj.as_bytes(), "a.obj"),
        good(&folder, "a.mtl", mtl.as_bytes(), "a.obj"),
        good(&folder, "a.png", png.get_ref(), "a.obj"),
    ];
    scene::load(&goods[0].main, &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    goods.extend(corpus(&["obj"], &folder.join("corpus")));
    try_mutants(&goods, count());
}

#[test]
fn mutants_of_pictures_and_settings() {
    let folder = folder("rest");
    let mut hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n-Y 2 +X 8\n".to_vec();
    hdr.extend([2, 2, 0, 8]);
    hdr.extend([136, 1, 136, 2, 136, 3, 8, 1, 2, 3, 4, 5, 6, 7, 8]);
    hdr.extend([128, 64, 0, 129].repeat(8));
    let names = |names: &[&str]| names.iter().map(ToString::to_string).collect();
    let channels = vec![Channels { names: names(&["R", "G", "B"]), data: &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0] }];
    let exr = folder.join("sky.exr");
    let picture = Picture { size: [2, 1], window: [0, 0, 2, 1], channels, attributes: Vec::new() };
    output::write_exr(&exr, &picture).unwrap();
    let exr = std::fs::read(exr).unwrap();
    let config = "method = 'igi'\nsize = [64, 48]\nvpl_shoot.vpls = 90\nindirect.box_split = 0.5\n[tone_map]\nexposure = 1.5\n";
    let sweeps = "[[sweep]]\nmethod = ['igi', 'path']\npath_trace.spp = [1, 4]\nvpl_shoot.bounces = 2\n";
    let mut goods = vec![
        good(&folder, "sky.hdr", &hdr, "sky.hdr"),
        good(&folder, "sky.exr", &exr, "sky.exr"),
        good(&folder, "config.toml", config.as_bytes(), "config.toml"),
        good(&folder, "grid.toml", sweeps.as_bytes(), "grid.toml"),
    ];
    goods.extend(corpus(&["hdr", "exr"], &folder.join("corpus")));
    try_mutants(&goods, count());
}
