//! glTF files put together by hand.

use super::{SQUARE, UV, png, write};
use glam::Vec3;
use parhelion::scene::{self, LoadOptions, Scene, SceneError};
use serde_json::{Value, json};

pub(crate) const I8: u32 = 5120;
pub(crate) const U8: u32 = 5121;
pub(crate) const I16: u32 = 5122;
pub(crate) const U16: u32 = 5123;
pub(crate) const U32: u32 = 5125;
pub(crate) const F32: u32 = 5126;

/// A glTF file being put together: JSON and the bytes of its only buffer.
#[derive(Clone)]
pub(crate) struct Asset {
    pub(crate) json: Value,
    pub(crate) bin: Vec<u8>,
}

impl Asset {
    pub(crate) fn empty() -> Self {
        Self {
            json: json!({"asset": {"version": "2.0"}, "bufferViews": [], "accessors": []}),
            bin: Vec::new(),
        }
    }

    pub(crate) fn push(&mut self, list: &str, item: Value) -> usize {
        let items =
            self.json.as_object_mut().unwrap().entry(list).or_insert(json!([])).as_array_mut().unwrap();
        items.push(item);
        items.len() - 1
    }

    pub(crate) fn view(&mut self, bytes: &[u8], stride: Option<usize>) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let mut view = json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()});
        if let Some(stride) = stride {
            view["byteStride"] = stride.into();
        }
        self.bin.extend_from_slice(bytes);
        self.push("bufferViews", view)
    }

    pub(crate) fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes, None);
        self.push(
            "accessors",
            json!({"bufferView": view, "componentType": component, "type": kind, "count": count,
                "min": [0, 0, 0], "max": [1, 1, 1]}),
        )
    }

    pub(crate) fn positions(&mut self, positions: &[Vec3]) -> usize {
        self.accessor(bytemuck::cast_slice(positions), F32, "VEC3", positions.len())
    }

    /// A mesh of one primitive, on a root node of its own.
    pub(crate) fn show(&mut self, primitive: Value) -> usize {
        let mesh = self.push("meshes", json!({"primitives": [primitive]}));
        self.push("nodes", json!({"mesh": mesh}))
    }

    pub(crate) fn require(&mut self, extension: &str) {
        self.push("extensionsUsed", extension.into());
        self.push("extensionsRequired", extension.into());
    }

    pub(crate) fn text(&self) -> String {
        let mut json = self.json.clone();
        for list in ["bufferViews", "accessors"] {
            if json[list] == json!([]) {
                json.as_object_mut().unwrap().remove(list);
            }
        }
        if json.get("buffers").is_none() && !self.bin.is_empty() {
            json["buffers"] = json!([{"byteLength": self.bin.len()}]);
        }
        json.to_string()
    }

    pub(crate) fn glb(&self) -> Vec<u8> {
        let mut bin = self.bin.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        container(self.text().as_bytes(), (!bin.is_empty()).then_some(&bin[..]))
    }

    pub(crate) fn load(&self) -> Result<Scene, SceneError> {
        self.load_as(&LoadOptions::default())
    }

    pub(crate) fn load_as(&self, options: &LoadOptions) -> Result<Scene, SceneError> {
        let folder = tempfile::tempdir().unwrap();
        scene::load(&write(folder.path(), "scene.glb", &self.glb()), options)
    }
}

pub(crate) fn container(json: &[u8], bin: Option<&[u8]>) -> Vec<u8> {
    let mut json = json.to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut body = Vec::new();
    for (kind, chunk) in [(b"JSON", Some(&json[..])), (b"BIN\0", bin)] {
        if let Some(chunk) = chunk {
            body.extend_from_slice(&(chunk.len() as u32).to_le_bytes());
            body.extend_from_slice(kind);
            body.extend_from_slice(chunk);
        }
    }
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend_from_slice(&(body.len() as u32 + 12).to_le_bytes());
    file.extend_from_slice(&body);
    file
}

/// A textured square with a camera, a spot light and one of everything else that can break:
/// accessors 0 positions, 1 indices, 2 texture coordinates; nodes 0 square, 1 camera, 2 light, 3 parent of all.
pub(crate) fn square() -> Asset {
    let mut asset = Asset::empty();
    let positions = asset.positions(&SQUARE);
    let indices = asset.accessor(bytemuck::cast_slice(&[0_u16, 1, 2, 0, 2, 3]), U16, "SCALAR", 6);
    let uv = asset.accessor(bytemuck::cast_slice(&UV), F32, "VEC2", 4);
    let view = asset.view(&png(2, &[[255, 0, 0, 255], [0, 255, 0, 128]]), None);
    asset.push("images", json!({"bufferView": view, "mimeType": "image/png"}));
    asset.push("samplers", json!({}));
    asset.push("textures", json!({"source": 0, "sampler": 0}));
    asset.push(
        "materials",
        json!({"name": "paint", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}),
    );
    asset.show(
        json!({"attributes": {"POSITION": positions, "TEXCOORD_0": uv}, "indices": indices, "material": 0}),
    );
    asset.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}));
    asset.push("nodes", json!({"name": "eye", "camera": 0, "translation": [0, 0, 3]}));
    asset.push("extensionsUsed", "KHR_lights_punctual".into());
    asset.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "spot", "color": [1, 0.5, 0.25], "intensity": 8, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.4}}]}});
    asset.push("nodes", json!({"extensions": {"KHR_lights_punctual": {"light": 0}}}));
    asset.push("nodes", json!({"children": [0, 1, 2]}));
    asset.push("scenes", json!({"nodes": [3]}));
    asset.json["scene"] = json!(0);
    asset
}
