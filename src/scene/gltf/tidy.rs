//! JSON before it is typed: cut to what is read of it, in the types that are expected.

use crate::scene::mend::Mended;
use crate::scene::{SceneError, file};
use ::gltf::json::accessor::Accessor;
use ::gltf::json::validation::Checked;
use serde::Deserialize;
use serde_json::{Map, Number, Value, json};
use std::borrow::Cow;
use std::collections::HashSet;
use std::path::Path;

/// What is done about defects that leave the picture as it is.
pub(super) const UNNEEDED: &str = "nothing shown needs it";

/// What is read of a value.
enum Shape {
    /// All of it.
    Plain,
    /// A string; anything else is as good as none.
    Name,
    /// An integer, which JSON may write `1.0`.
    Integer,
    /// One of these integers; any other means the default.
    Among(&'static [u64]),
    List(&'static Shape),
    /// Members of any name.
    Map(&'static Shape),
    /// These members.
    Object(&'static [(&'static str, Shape)]),
}

use Shape::{Among, Integer, List, Map as Members, Name, Object, Plain};

const INDEX: Shape = Object(&[("source", Integer)]);

const TEXTURE: Shape = Object(&[
    ("index", Integer),
    ("texCoord", Integer),
    ("scale", Plain),
    (
        "extensions",
        Object(&[(
            "KHR_texture_transform",
            Object(&[("offset", Plain), ("rotation", Plain), ("scale", Plain), ("texCoord", Integer)]),
        )]),
    ),
]);

const MATERIAL: Shape = Object(&[
    ("name", Name),
    ("alphaCutoff", Plain),
    ("alphaMode", Plain),
    ("doubleSided", Plain),
    ("emissiveFactor", Plain),
    ("emissiveTexture", TEXTURE),
    ("normalTexture", TEXTURE),
    (
        "pbrMetallicRoughness",
        Object(&[
            ("baseColorFactor", Plain),
            ("baseColorTexture", TEXTURE),
            ("metallicFactor", Plain),
            ("roughnessFactor", Plain),
            ("metallicRoughnessTexture", TEXTURE),
        ]),
    ),
    (
        "extensions",
        Object(&[
            (
                "KHR_materials_clearcoat",
                Object(&[
                    ("clearcoatFactor", Plain),
                    ("clearcoatTexture", TEXTURE),
                    ("clearcoatRoughnessFactor", Plain),
                    ("clearcoatRoughnessTexture", TEXTURE),
                    ("clearcoatNormalTexture", TEXTURE),
                ]),
            ),
            ("KHR_materials_emissive_strength", Object(&[("emissiveStrength", Plain)])),
            ("KHR_materials_ior", Object(&[("ior", Plain)])),
            (
                "KHR_materials_specular",
                Object(&[
                    ("specularFactor", Plain),
                    ("specularTexture", TEXTURE),
                    ("specularColorFactor", Plain),
                    ("specularColorTexture", TEXTURE),
                ]),
            ),
            (
                "KHR_materials_transmission",
                Object(&[("transmissionFactor", Plain), ("transmissionTexture", TEXTURE)]),
            ),
            ("KHR_materials_unlit", Object(&[])),
            (
                "KHR_materials_volume",
                Object(&[
                    ("thicknessFactor", Plain),
                    ("attenuationDistance", Plain),
                    ("attenuationColor", Plain),
                ]),
            ),
        ]),
    ),
]);

const PRIMITIVE: Shape = Object(&[
    ("attributes", Members(&Integer)),
    ("indices", Integer),
    ("material", Integer),
    ("mode", Integer),
    ("targets", List(&Object(&[("POSITION", Integer), ("NORMAL", Integer), ("TANGENT", Integer)]))),
    ("extensions", Object(&[("KHR_draco_mesh_compression", Plain)])),
]);

const NODE: Shape = Object(&[
    ("name", Name),
    ("camera", Integer),
    ("children", List(&Integer)),
    ("mesh", Integer),
    ("skin", Integer),
    ("matrix", Plain),
    ("translation", Plain),
    ("rotation", Plain),
    ("scale", Plain),
    ("weights", Plain),
    (
        "extensions",
        Object(&[
            ("KHR_lights_punctual", Object(&[("light", Integer)])),
            ("KHR_node_visibility", Object(&[("visible", Plain)])),
            ("EXT_mesh_gpu_instancing", Object(&[("attributes", Members(&Integer))])),
        ]),
    ),
]);

const ACCESSOR: Shape = Object(&[
    ("bufferView", Integer),
    ("byteOffset", Integer),
    ("componentType", Integer),
    ("count", Integer),
    ("normalized", Plain),
    ("type", Plain),
    (
        "sparse",
        Object(&[
            ("count", Integer),
            (
                "indices",
                Object(&[("bufferView", Integer), ("byteOffset", Integer), ("componentType", Integer)]),
            ),
            ("values", Object(&[("bufferView", Integer), ("byteOffset", Integer)])),
        ]),
    ),
]);

const LIGHT: Shape = Object(&[
    ("name", Name),
    ("type", Plain),
    ("color", Plain),
    ("intensity", Plain),
    ("range", Plain),
    ("spot", Object(&[("innerConeAngle", Plain), ("outerConeAngle", Plain)])),
]);

/// The whole file, in the order in which defects are looked for.
const ROOT: Shape = Object(&[
    ("asset", Object(&[("version", Plain), ("minVersion", Plain)])),
    ("extensionsUsed", Plain),
    ("extensionsRequired", Plain),
    ("scene", Integer),
    ("scenes", List(&Object(&[("name", Name), ("nodes", List(&Integer))]))),
    ("nodes", List(&NODE)),
    ("meshes", List(&Object(&[("name", Name), ("primitives", List(&PRIMITIVE)), ("weights", Plain)]))),
    ("materials", List(&MATERIAL)),
    (
        "textures",
        List(&Object(&[
            ("sampler", Integer),
            ("source", Integer),
            (
                "extensions",
                Object(&[
                    ("EXT_texture_avif", INDEX),
                    ("EXT_texture_webp", INDEX),
                    ("KHR_texture_basisu", INDEX),
                    ("MSFT_texture_dds", INDEX),
                ]),
            ),
        ])),
    ),
    ("images", List(&Object(&[("name", Name), ("uri", Plain), ("bufferView", Integer)]))),
    (
        "samplers",
        List(&Object(&[
            ("magFilter", Among(&[9728, 9729])),
            ("minFilter", Among(&[9728, 9729, 9984, 9985, 9986, 9987])),
            ("wrapS", Among(&[33071, 33648, 10497])),
            ("wrapT", Among(&[33071, 33648, 10497])),
        ])),
    ),
    ("skins", List(&Object(&[("joints", List(&Integer)), ("inverseBindMatrices", Integer)]))),
    (
        "cameras",
        List(&Object(&[
            ("name", Name),
            ("type", Plain),
            ("perspective", Object(&[("yfov", Plain)])),
            ("orthographic", Object(&[("ymag", Plain)])),
        ])),
    ),
    ("accessors", List(&ACCESSOR)),
    (
        "bufferViews",
        List(&Object(&[
            ("buffer", Integer),
            ("byteLength", Integer),
            ("byteOffset", Integer),
            ("byteStride", Integer),
            ("extensions", Object(&[("EXT_meshopt_compression", Plain), ("KHR_meshopt_compression", Plain)])),
        ])),
    ),
    ("buffers", List(&Object(&[("byteLength", Integer), ("uri", Plain)]))),
    ("extensions", Object(&[("KHR_lights_punctual", Object(&[("lights", List(&LIGHT))]))])),
]);

/// Where a value is.
enum Place<'a> {
    Root,
    Member(&'a Place<'a>, &'a str),
    Item(&'a Place<'a>, usize),
}

impl std::fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Root => Ok(()),
            Self::Member(Self::Root, name) => write!(f, "{name}"),
            Self::Member(parent, name) => write!(f, "{parent}.{name}"),
            Self::Item(parent, index) => write!(f, "{parent}[{index}]"),
        }
    }
}

struct Tidy<'a> {
    file: &'a Path,
    mended: &'a Mended,
}

impl Tidy<'_> {
    fn mend(&self, place: &Place<'_>, problem: String, remedy: &'static str) -> Result<(), SceneError> {
        self.mended.mend(self.file, SceneError::new(self.file, place.to_string(), problem), remedy)
    }

    /// Cuts `value` to `shape`; what has other types than expected stays as it is.
    fn cut(&self, value: &mut Value, shape: &Shape, place: &Place<'_>) -> Result<(), SceneError> {
        match (shape, &mut *value) {
            (Integer | Among(_), Value::Number(number)) => *number = integral(number),
            (List(shape), Value::Array(items)) => {
                for (i, item) in items.iter_mut().enumerate() {
                    self.cut(item, shape, &Place::Item(place, i))?;
                }
            }
            (Members(shape), Value::Object(members)) => {
                for (name, member) in members {
                    self.cut(member, shape, &Place::Member(place, name))?;
                }
            }
            (Object(shapes), Value::Object(members)) => {
                members.retain(|name, _| shapes.iter().any(|(known, _)| known == name));
                for (name, shape) in *shapes {
                    self.member(members, name, shape, &Place::Member(place, name))?;
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn member(
        &self,
        members: &mut Map<String, Value>,
        name: &str,
        shape: &Shape,
        place: &Place<'_>,
    ) -> Result<(), SceneError> {
        let Some(member) = members.get_mut(name) else { return Ok(()) };
        self.cut(member, shape, place)?;
        let problem = match (shape, &*member) {
            (_, Value::Null) => "is null".to_owned(),
            (Name, other) if !other.is_string() => "is no string".to_owned(),
            (Object(_), other) if name == "extensions" && !other.is_object() => "is no object".to_owned(),
            (Among(known), Value::Number(n)) if !n.as_u64().is_some_and(|n| known.contains(&n)) => {
                format!("{n} is none of {known:?}")
            }
            // Tightly packed, as OpenGL has it.
            (Integer, Value::Number(n)) if name == "byteStride" && n.as_u64() == Some(0) => "is 0".to_owned(),
            _ => return Ok(()),
        };
        members.remove(name);
        self.mend(place, problem, "it is taken as absent")
    }
}

/// The same number as an integer, if it is one.
fn integral(number: &Number) -> Number {
    const EXACT: f64 = 9_007_199_254_740_992.0;
    match number.as_f64() {
        Some(value) if number.is_f64() && value.fract() == 0.0 && (0.0..EXACT).contains(&value) => {
            Number::from(value as u64)
        }
        _ => number.clone(),
    }
}

const ANIMATIONS: Shape = List(&Object(&[
    ("name", Name),
    (
        "channels",
        List(&Object(&[
            ("sampler", Integer),
            (
                "target",
                Object(&[
                    ("node", Integer),
                    ("path", Plain),
                    ("extensions", Object(&[("KHR_animation_pointer", Object(&[("pointer", Plain)]))])),
                ]),
            ),
        ])),
    ),
    ("samplers", List(&Object(&[("input", Integer), ("output", Integer), ("interpolation", Plain)]))),
]));

/// The JSON of a file, cut to what is read of it, and its animations: if they are not `played` they are as they come.
///
/// # Errors
/// It is no JSON; where the load is strict, also what is harmless.
pub(super) fn parse(
    path: &Path,
    text: &[u8],
    mended: &Mended,
    played: bool,
) -> Result<(Value, Vec<Value>), SceneError> {
    let tidy = Tidy { file: path, mended };
    let text = utf8(&tidy, text)?;
    let parsed = serde_json::from_str(&text).or_else(|error| {
        // Where such a number is read it is refused as not finite.
        let out_of_range = error.to_string().starts_with("number out of range");
        if out_of_range { serde_json::from_str(&bounded(&text)) } else { Err(error) }
    });
    let mut root: Value = parsed.map_err(|error| SceneError::new(path, "JSON", error.to_string()))?;
    if !root.is_object() {
        return Err(SceneError::new(path, "JSON", "is no object"));
    }
    let mut animations = root.get_mut("animations").map_or(Value::Null, Value::take);
    tidy.cut(&mut root, &ROOT, &Place::Root)?;
    if played {
        tidy.cut(&mut animations, &ANIMATIONS, &Place::Member(&Place::Root, "animations"))?;
    }
    let animations = match animations {
        Value::Array(animations) => animations,
        _ => Vec::new(),
    };
    attributes(&tidy, &mut root)?;
    accessors(&tidy, &mut root, if played { &animations } else { &[] })?;
    complete(&mut root);
    Ok((root, animations))
}

/// The text without its byte order mark and what pads it.
fn utf8<'a>(tidy: &Tidy<'_>, text: &'a [u8]) -> Result<Cow<'a, str>, SceneError> {
    let text = crate::read::without_mark(text);
    let length = text.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
    let text = String::from_utf8_lossy(&text[..length]);
    if let Cow::Owned(_) = text {
        let element = Place::Member(&Place::Root, "JSON");
        tidy.mend(&element, "is not UTF-8".to_owned(), "what is not is read as U+FFFD")?;
    }
    Ok(text)
}

/// The text with numbers that 64-bit floats do not hold at the most that they do.
fn bounded(text: &str) -> String {
    let mut bounded = String::with_capacity(text.len());
    let (mut rest, mut quoted) = (text, false);
    while let Some(first) = rest.chars().next() {
        let number = |c: char| c.is_ascii_digit() || matches!(c, '+' | '-' | '.' | 'e' | 'E');
        let length = match first {
            '\\' if quoted => 1 + rest[1..].chars().next().map_or(0, char::len_utf8),
            '0'..='9' | '-' if !quoted => rest.find(|c| !number(c)).unwrap_or(rest.len()),
            _ => first.len_utf8(),
        };
        let (token, behind) = rest.split_at(length);
        match token.parse::<f64>() {
            Ok(value) if length > 1 && value.is_infinite() => {
                bounded.push_str(if value > 0.0 { "1e308" } else { "-1e308" });
            }
            _ => bounded.push_str(token),
        }
        quoted ^= token == "\"";
        rest = behind;
    }
    bounded
}

/// The items of a list, if it is one.
fn items<'a>(parent: &'a Value, list: &str) -> impl Iterator<Item = &'a Value> {
    parent.get(list).and_then(Value::as_array).into_iter().flatten()
}

fn items_mut<'a>(parent: &'a mut Value, list: &str) -> impl Iterator<Item = &'a mut Value> {
    parent.get_mut(list).and_then(Value::as_array_mut).into_iter().flatten()
}

/// Leaves out attributes of names that are neither glTF's nor an application's.
fn attributes(tidy: &Tidy<'_>, root: &mut Value) -> Result<(), SceneError> {
    let numbered = |name: &str| {
        let sets = ["TEXCOORD_", "COLOR_", "JOINTS_", "WEIGHTS_"];
        sets.iter().filter_map(|set| name.strip_prefix(set)).any(|set| set.parse::<u32>().is_ok())
    };
    let known = |name: &str| {
        name.starts_with('_') || matches!(name, "POSITION" | "NORMAL" | "TANGENT") || numbered(name)
    };
    for (i, mesh) in items_mut(root, "meshes").enumerate() {
        for (j, primitive) in items_mut(mesh, "primitives").enumerate() {
            let Some(Value::Object(members)) = primitive.get_mut("attributes") else { continue };
            let strange: Vec<String> = members.keys().filter(|name| !known(name)).cloned().collect();
            for name in strange {
                members.remove(&name);
                let place = format!("meshes[{i}].primitives[{j}].attributes");
                let problem = format!("`{}` is no attribute of glTF", file::shortened(&name));
                tidy.mend(&Place::Member(&Place::Root, &place), problem, "it is left out")?;
            }
        }
    }
    Ok(())
}

/// Puts something harmless in place of accessors that nothing reads and that can't be typed.
fn accessors(tidy: &Tidy<'_>, root: &mut Value, animations: &[Value]) -> Result<(), SceneError> {
    let samplers = animations.iter().flat_map(|animation| items(animation, "samplers"));
    let keys = samplers.flat_map(|sampler| ["input", "output"].map(|key| sampler[key].as_u64()));
    let of_keys: HashSet<u64> = keys.flatten().collect();
    let mut read = HashSet::new();
    let mut members = |parent: Option<&Value>| {
        read.extend(parent.and_then(Value::as_object).into_iter().flatten().filter_map(|(_, v)| v.as_u64()));
    };
    for primitive in items(root, "meshes").flat_map(|mesh| items(mesh, "primitives")) {
        members(Some(primitive));
        members(primitive.get("attributes"));
        items(primitive, "targets").for_each(|target| members(Some(target)));
    }
    for node in items(root, "nodes") {
        members(node.pointer("/extensions/EXT_mesh_gpu_instancing/attributes"));
    }
    items(root, "skins").for_each(|skin| members(Some(skin)));
    for (i, item) in items_mut(root, "accessors").enumerate().filter(|(i, _)| !read.contains(&(*i as u64))) {
        let problem = match Accessor::deserialize(&*item) {
            Err(error) => file::shortened(&error.to_string()),
            Ok(Accessor { component_type: Checked::Valid(_), type_: Checked::Valid(_), .. }) => continue,
            Ok(_) => "unknown component or element type".to_owned(),
        };
        // Of a shape that no channel has: the channel is told.
        let keys = of_keys.contains(&(i as u64));
        *item = json!({"componentType": 5126, "count": 1, "type": if keys { "MAT2" } else { "SCALAR" }});
        if keys {
            continue;
        }
        tidy.mend(&Place::Item(&Place::Member(&Place::Root, "accessors"), i), problem, UNNEEDED)?;
    }
    Ok(())
}

/// Adds what the standard wants and nobody reads, and puts something harmless in place of what nothing names.
fn complete(root: &mut Value) {
    let fill = |parent: &mut Value, key: &str, value: Value| {
        if let Value::Object(members) = parent {
            members.entry(key).or_insert(value);
        }
    };
    items_mut(root, "scenes").for_each(|scene| fill(scene, "nodes", json!([])));
    for camera in items_mut(root, "cameras") {
        for (projection, keys) in
            [("perspective", &["znear"][..]), ("orthographic", &["xmag", "znear", "zfar"])]
        {
            if let Some(view) = camera.get_mut(projection) {
                keys.iter().for_each(|key| fill(view, key, json!(1)));
            }
        }
    }
    const LIGHTS: &str = "/extensions/KHR_lights_punctual";
    if let Some(extension) = root.pointer_mut(LIGHTS) {
        fill(extension, "lights", json!([]));
    }

    let named = |root: &Value, list: &str, pointer: &str| -> HashSet<u64> {
        items(root, list).filter_map(|item| item.pointer(pointer)?.as_u64()).collect()
    };
    let keep = |parent: &mut Value, list: &str, named: &HashSet<u64>, stand_in: Value| {
        let unnamed = (0..).zip(items_mut(parent, list)).filter(|(i, _)| !named.contains(i));
        unnamed.for_each(|(_, item)| *item = stand_in.clone());
    };
    let cameras = named(root, "nodes", "/camera");
    let view = json!({"type": "perspective", "perspective": {"yfov": 1, "znear": 1}});
    keep(root, "cameras", &cameras, view);
    let skins = named(root, "nodes", "/skin");
    keep(root, "skins", &skins, json!({"joints": []}));
    let lights = named(root, "nodes", &format!("{LIGHTS}/light"));
    if let Some(extension) = root.pointer_mut(LIGHTS) {
        keep(extension, "lights", &lights, json!({"type": "point"}));
    }
    let mut textures = HashSet::new();
    items(root, "materials").for_each(|material| indices(material, &mut textures));
    keep(root, "textures", &textures, json!({}));
    let mut images = named(root, "textures", "/source");
    for texture in items(root, "textures") {
        let extensions = texture.get("extensions").and_then(Value::as_object).into_iter().flatten();
        images.extend(extensions.filter_map(|(_, extension)| extension.get("source")?.as_u64()));
    }
    keep(root, "images", &images, json!({}));
    let samplers = named(root, "textures", "/sampler");
    keep(root, "samplers", &samplers, json!({}));
}

/// Textures that a material names.
fn indices(value: &Value, found: &mut HashSet<u64>) {
    if let Value::Object(members) = value {
        found.extend(members.get("index").and_then(Value::as_u64));
        members.values().for_each(|member| indices(member, found));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_out_of_range_are_bounded_outside_of_strings() {
        let text = r#"{"a\"1e999":[1e999,-1e400,2,-0.5,"1e999\\",0]}"#;
        assert_eq!(bounded(text), r#"{"a\"1e999":[1e308,-1e308,2,-0.5,"1e999\\",0]}"#);
    }
}
