//! Meshes: triangle primitives merged into one [`Mesh`], in the pose their default weights give.

use super::accessor::Elements;
use super::context::Context;
use super::skin::{self, Skin};
use crate::memory::Shortage;
use crate::scene::import::unit_normal;
use crate::scene::limits::{MAX_TEXTURE_COORDINATE, MAX_TRIANGLES, MAX_VERTICES};
use crate::scene::{Mesh, SceneError};
use ::gltf::json::accessor::{ComponentType, Type};
use ::gltf::json::mesh::{Mode, Primitive, Semantic};
use ::gltf::json::validation::Checked;
use glam::{DAffine3, DVec3, Vec2, Vec3, Vec4};
use std::ops::Range;

/// What all meshes read so far amount to and lack.
#[derive(Default)]
pub(super) struct Tally {
    /// Vertices kept.
    vertices: usize,
    /// Primitives of points or lines.
    pub(super) points_and_lines: usize,
    /// Primitives without positions.
    pub(super) without_positions: usize,
    /// Vertices behind the last whole triangle.
    pub(super) incomplete: usize,
    /// Triangles of zero area that were not made.
    pub(super) flat: usize,
    /// Meshes with morph targets.
    pub(super) morphed: usize,
}

/// Bytes of a vertex that has every attribute.
const VERTEX: usize = size_of::<(Vec3, Vec3, Vec2, Vec2, Vec4)>();

/// How a mesh is read.
#[derive(Default)]
pub(super) struct Pose<'a> {
    /// Of morph targets: the node's, or else the mesh's own.
    pub(super) weights: Option<&'a [f32]>,
    /// What positions are relative to: in the mesh's space, or in the world where it has a skin.
    pub(super) origin: DVec3,
    pub(super) skin: Option<&'a Skin>,
}

/// What moves a primitive's vertices.
struct Motion<'a> {
    weights: &'a [f32],
    origin: DVec3,
    /// One a vertex in use, to the world, where there is a skin.
    blend: Option<&'a [DAffine3]>,
}

/// Which component types an attribute may have, by what `KHR_mesh_quantization` allows beyond glTF itself.
fn allowed(semantic: &Semantic, e: &Elements<'_>, quantized: bool) -> bool {
    use ComponentType::{F32, I8, I16, U8, U16, U32};
    let small = matches!(e.component, I8 | U8 | I16 | U16);
    match semantic {
        Semantic::Positions => e.shape == Type::Vec3 && (e.component == F32 || quantized && small),
        Semantic::Normals => {
            e.shape == Type::Vec3
                && (e.component == F32 || quantized && e.normalized && matches!(e.component, I8 | I16))
        }
        Semantic::Tangents => {
            e.shape == Type::Vec4
                && (e.component == F32 || quantized && e.normalized && matches!(e.component, I8 | I16))
        }
        Semantic::TexCoords(_) => {
            let core = e.component == F32 || e.normalized && matches!(e.component, U8 | U16);
            e.shape == Type::Vec2 && (core || quantized && small)
        }
        Semantic::Colors(_) => {
            matches!(e.shape, Type::Vec3 | Type::Vec4)
                && (e.component == F32 || e.normalized && matches!(e.component, U8 | U16))
        }
        Semantic::Joints(_) => {
            e.shape == Type::Vec4 && matches!(e.component, U8 | U16 | U32) && !e.normalized
        }
        Semantic::Weights(_) => {
            e.shape == Type::Vec4 && (e.component == F32 || e.normalized && matches!(e.component, U8 | U16))
        }
        Semantic::Extras(_) => true,
    }
}

/// How many triangles so many corners are.
fn count(mode: Mode, corners: usize) -> usize {
    match mode {
        Mode::TriangleStrip | Mode::TriangleFan => corners.saturating_sub(2),
        _ => corners / 3,
    }
}

/// Triangles of `corners` as glTF 2.0, section 3.7.2.1, defines them, and how many corners are left over.
fn triangles(mode: Mode, corners: &[u32]) -> (Vec<[u32; 3]>, usize) {
    let n = corners.len();
    match mode {
        Mode::TriangleStrip if n > 2 => {
            let order = |i: usize| [i, i + 1 + i % 2, i + 2 - i % 2].map(|j| corners[j]);
            ((0..n - 2).map(order).collect(), 0)
        }
        Mode::TriangleFan if n > 2 => {
            ((0..n - 2).map(|i| [corners[i + 1], corners[i + 2], corners[0]]).collect(), 0)
        }
        Mode::TriangleStrip | Mode::TriangleFan => (Vec::new(), n),
        _ => (corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(), n % 3),
    }
}

impl Context<'_> {
    /// Reads mesh `index`. Triangles without a material get the one behind the file's last.
    pub(super) fn mesh(&self, index: usize, pose: &Pose<'_>, tally: &mut Tally) -> Result<Mesh, SceneError> {
        let source = &self.root.meshes[index];
        let mut mesh =
            Mesh { name: source.name.clone().unwrap_or_else(|| format!("mesh {index}")), ..Mesh::default() };
        let weights = pose.weights.or(source.weights.as_deref()).unwrap_or(&[]);
        if !weights.iter().all(|w| w.is_finite()) {
            return Err(self.error(format!("meshes[{index}]"), "a morph weight is not finite"));
        }
        tally.morphed += usize::from(source.primitives.iter().any(|p| p.targets.is_some()));
        for (i, primitive) in source.primitives.iter().enumerate() {
            let element = format!("meshes[{index}].primitives[{i}]");
            let (budget, vertices, triangles) =
                (*self.budget.borrow(), mesh.positions.len(), mesh.triangles.len());
            self.primitive(&mut mesh, primitive, &element, (weights, pose), tally)?;
            // What was read on the way is gone.
            self.budget.replace(budget);
            let triangle = size_of::<([u32; 3], u32)>()
                + if mesh.tangents.is_empty() { 0 } else { size_of::<[Vec4; 3]>() };
            let bytes =
                (mesh.positions.len() - vertices) * VERTEX + (mesh.triangles.len() - triangles) * triangle;
            self.take::<u8>(bytes).map_err(|shortage| self.fault(element, shortage))?;
        }
        if !mesh.tangents.is_empty() {
            mesh.tangents.resize(mesh.triangles.len(), [Vec4::ZERO; 3]);
        }
        Ok(mesh)
    }

    /// Takes what mesh `index` needs at the least: vertices that indices leave out are not known yet.
    pub(super) fn foresee_mesh(
        &self,
        index: usize,
        skinned: bool,
        tally: &mut Tally,
    ) -> Result<(), SceneError> {
        for (i, primitive) in self.root.meshes[index].primitives.iter().enumerate() {
            let element = format!("meshes[{index}].primitives[{i}]");
            let Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) =
                primitive.mode
            else {
                continue;
            };
            let positions = self.attribute(primitive, &element, Semantic::Positions)?;
            let Some(positions) = positions else { continue };
            let indices = self.indices(primitive, &element)?;
            let flat = !skinned && positions.is_zero() && self.is_still(primitive)?;
            if flat || indices.as_ref().is_some_and(Elements::is_zero) {
                continue;
            }
            let corners = indices.as_ref().map_or(positions.count, |indices| indices.count);
            let vertices = if indices.is_some() { 0 } else { positions.count };
            tally.vertices = tally.vertices.saturating_add(vertices);
            if tally.vertices > MAX_VERTICES {
                return Err(self.error(element, format!("more than {MAX_VERTICES} vertices up to here")));
            }
            let bytes = vertices * VERTEX + count(mode, corners) * size_of::<([u32; 3], u32)>();
            self.take::<u8>(bytes).map_err(|shortage| self.fault(element, shortage))?;
        }
        Ok(())
    }

    /// Whether no morph target moves a vertex of the primitive.
    fn is_still(&self, primitive: &Primitive) -> Result<bool, SceneError> {
        for positions in primitive.targets.iter().flatten().filter_map(|target| target.positions) {
            if !self.elements(positions.value())?.is_zero() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn primitive(
        &self,
        mesh: &mut Mesh,
        primitive: &Primitive,
        element: &str,
        (weights, pose): (&[f32], &Pose<'_>),
        tally: &mut Tally,
    ) -> Result<(), SceneError> {
        let short = |shortage: Shortage| self.fault(element, shortage);
        let Checked::Valid(mode) = primitive.mode else { return Err(self.error(element, "unknown mode")) };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            tally.points_and_lines += 1;
            return Ok(());
        }
        if !primitive.attributes.contains_key(&Checked::Valid(Semantic::Positions)) {
            tally.without_positions += 1;
            return Ok(());
        }
        let targets = primitive.targets.as_deref().unwrap_or(&[]);
        if !weights.is_empty() && targets.len() != weights.len() {
            let problem = format!("{} morph targets, but {} weights", targets.len(), weights.len());
            if !targets.is_empty() {
                return Err(self.error(element, problem));
            }
            self.mend(element, problem, "weights of nothing change nothing")?;
        }
        let vertices = self.vertices(primitive, element)?;
        let positions = self.attribute(primitive, element, Semantic::Positions)?;
        let indices = self.indices(primitive, element)?;
        let nowhere = |elements: &Option<Elements<'_>>| elements.as_ref().is_some_and(Elements::is_zero);
        let compressed = primitive.extensions.as_ref().and_then(|extensions| extensions.others.keys().next());
        if let Some(name) = compressed.filter(|_| nowhere(&positions) || nowhere(&indices)) {
            let problem = format!("it is there by {name} alone, which is not supported");
            return Err(self.error(element, problem));
        }
        if nowhere(&indices) || pose.skin.is_none() && nowhere(&positions) && self.is_still(primitive)? {
            let corners = indices.map_or(vertices, |indices| indices.count);
            tally.flat += count(mode, corners);
            return Ok(());
        }
        let corners = self.corners(indices.as_ref(), element, vertices)?;
        let made = count(mode, corners.len());
        if mesh.triangles.len() + made > MAX_TRIANGLES {
            return Err(self.error(element, format!("more than {MAX_TRIANGLES} triangles up to here")));
        }
        self.take::<[[u32; 3]; 2]>(made).map_err(short)?;
        let (mut triangles, incomplete) = triangles(mode, &corners);
        tally.incomplete += incomplete;
        // Exporters let primitives share one large vertex buffer: take only what this one uses.
        self.take::<[u32; 2]>(vertices).map_err(short)?;
        let used = compact(&mut triangles);
        tally.vertices += used.len();
        if tally.vertices > MAX_VERTICES {
            return Err(self.error(element, format!("more than {MAX_VERTICES} vertices up to here")));
        }
        let blend = pose.skin.map(|skin| self.blend(primitive, element, skin, &used)).transpose()?;
        let blend = blend.as_deref();
        for triangle in &mut triangles {
            // What was the front stays it.
            if blend.is_some_and(|blend| skin::mirrors(&blend[triangle[0] as usize]) < 0.0) {
                triangle.swap(1, 2);
            }
        }
        let material = primitive.material.map_or(self.root.materials.len(), |m| m.value()) as u32;
        let base = mesh.positions.len() as u32;
        let motion = Motion { weights, origin: pose.origin, blend };
        self.append(mesh, primitive, element, &motion, &used)?;
        if let Some(tangents) = self.tangents(primitive, element, blend, &used)? {
            self.take::<[Vec4; 3]>(triangles.len()).map_err(short)?;
            mesh.tangents.resize(mesh.triangles.len(), [Vec4::ZERO; 3]);
            mesh.tangents.extend(triangles.iter().map(|t| t.map(|v| tangents[v as usize])));
        }
        mesh.triangles.extend(triangles.iter().map(|t| t.map(|v| v + base)));
        mesh.materials.resize(mesh.triangles.len(), material);
        Ok(())
    }

    /// Tangents of the `used` vertices, before any morph, where the material needs them. The standard wants them
    /// ignored where there are no normals.
    fn tangents(
        &self,
        primitive: &Primitive,
        element: &str,
        blend: Option<&[DAffine3]>,
        used: &[u32],
    ) -> Result<Option<Vec<Vec4>>, SceneError> {
        let mapped = primitive.material.is_some_and(|material| self.is_normal_mapped(material.value()));
        let (Some(&first), Some(&last)) = (used.first(), used.last()) else { return Ok(None) };
        let found = self.attribute(primitive, element, Semantic::Tangents)?;
        let normals = primitive.attributes.contains_key(&Checked::Valid(Semantic::Normals));
        let Some(tangents) = found.filter(|_| mapped && normals) else { return Ok(None) };
        let values = tangents.floats::<4>(first as usize..last as usize + 1)?;
        let tangent = |(i, &v): (usize, &u32)| {
            let [x, y, z, mut w] = values[(v - first) as usize];
            let mut tangent = unit_normal(Vec3::new(x, y, z));
            if let Some(blend) = blend.map(|blend| &blend[i]) {
                tangent = skin::turned(blend, tangent.as_dvec3(), true).as_vec3();
                w *= skin::mirrors(blend) as f32;
            }
            match tangent {
                Vec3::ZERO => Vec4::ZERO,
                unit => unit.extend(1.0_f32.copysign(w)),
            }
        };
        Ok(Some(used.iter().enumerate().map(tangent).collect()))
    }

    /// Elements of an attribute, checked for type.
    pub(super) fn attribute(
        &self,
        primitive: &Primitive,
        element: &str,
        semantic: Semantic,
    ) -> Result<Option<Elements<'_>>, SceneError> {
        let Some(accessor) = primitive.attributes.get(&Checked::Valid(semantic.clone())) else {
            return Ok(None);
        };
        self.typed(accessor.value(), element, &semantic).map(Some)
    }

    fn typed(&self, accessor: usize, element: &str, semantic: &Semantic) -> Result<Elements<'_>, SceneError> {
        let elements = self.elements(accessor)?;
        if allowed(semantic, &elements, self.quantized) {
            return Ok(elements);
        }
        let normalized = if elements.normalized { "normalized " } else { "" };
        Err(self.error(
            element,
            format!(
                "accessors[{accessor}] holds {normalized}{:?} of {:?}, which {} can't be{}",
                elements.shape,
                elements.component,
                semantic.to_string(),
                if self.quantized { "" } else { " (the file does not name KHR_mesh_quantization)" }
            ),
        ))
    }

    /// Number of vertices, the same for all attributes and morph targets.
    fn vertices(&self, primitive: &Primitive, element: &str) -> Result<usize, SceneError> {
        let targets = primitive.targets.iter().flatten().flat_map(|t| [t.positions, t.normals, t.tangents]);
        let mut counts = primitive
            .attributes
            .values()
            .copied()
            .chain(targets.flatten())
            .map(|a| (a.value(), self.root.accessors[a.value()].count.0 as usize));
        let (first, vertices) = counts.next().unwrap_or_default();
        match counts.find(|&(_, count)| count != vertices) {
            None => Ok(vertices),
            Some((other, count)) => Err(self.error(
                element,
                format!("its attributes differ in length: accessors[{first}] has {vertices}, accessors[{other}] {count}"),
            )),
        }
    }

    /// The accessor of the primitive's vertex indices, checked for type.
    fn indices(&self, primitive: &Primitive, element: &str) -> Result<Option<Elements<'_>>, SceneError> {
        let Some(accessor) = primitive.indices else { return Ok(None) };
        let elements = self.elements(accessor.value())?;
        let unsigned =
            matches!(elements.component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32);
        if elements.shape == Type::Scalar && unsigned && !elements.normalized {
            return Ok(Some(elements));
        }
        Err(self.error(element, format!("accessors[{accessor}] can't be indices: they are unsigned scalars")))
    }

    /// Vertices in the order of `indices`, or one after the other without them; all below `vertices`.
    fn corners(
        &self,
        indices: Option<&Elements<'_>>,
        element: &str,
        vertices: usize,
    ) -> Result<Vec<u32>, SceneError> {
        let Some(indices) = indices else {
            if vertices > MAX_VERTICES {
                return Err(
                    self.error(element, format!("{vertices} vertices, expected at most {MAX_VERTICES}"))
                );
            }
            self.take::<u32>(vertices).map_err(|shortage| self.fault(element, shortage))?;
            return Ok((0..vertices as u32).collect());
        };
        let corners = indices.unsigned()?;
        match corners.iter().position(|&v| v as usize >= vertices) {
            None => Ok(corners),
            Some(i) => Err(self.error(
                format!("{element}.indices"),
                format!(
                    "index {} at {i} of {}, but there are {vertices} vertices",
                    corners[i],
                    indices.element()
                ),
            )),
        }
    }

    /// Appends the `used` vertices of a primitive; fills attributes that only some primitives have.
    fn append(
        &self,
        mesh: &mut Mesh,
        primitive: &Primitive,
        element: &str,
        motion: &Motion<'_>,
        used: &[u32],
    ) -> Result<(), SceneError> {
        let (Some(&first), Some(&last)) = (used.first(), used.last()) else { return Ok(()) };
        let range = first as usize..last as usize + 1;
        let base = mesh.positions.len();
        let total = base + used.len();
        let pick = |v: u32| v as usize - range.start;
        self.take::<u8>(used.len() * VERTEX).map_err(|shortage| self.fault(element, shortage))?;

        let Motion { weights, origin, blend } = *motion;
        let posed =
            |semantic, origin| self.posed(primitive, element, (weights, origin), semantic, range.clone());
        let origin_of_posed = if blend.is_some() { DVec3::ZERO } else { origin };
        let positions = posed(Semantic::Positions, origin_of_posed)?.unwrap_or_default();
        let position = |(i, &v): (usize, &u32)| match blend {
            Some(blend) => (blend[i].transform_point3(positions[pick(v)].as_dvec3()) - origin).as_vec3(),
            None => positions[pick(v)],
        };
        mesh.positions.extend(used.iter().enumerate().map(position));
        if let Some(normals) = posed(Semantic::Normals, DVec3::ZERO)? {
            let normal = |(i, &v): (usize, &u32)| match blend {
                Some(blend) => skin::turned(&blend[i], normals[pick(v)].as_dvec3(), false).as_vec3(),
                None => unit_normal(normals[pick(v)]),
            };
            mesh.normals.resize(base, Vec3::ZERO);
            mesh.normals.extend(used.iter().enumerate().map(normal));
        } else if !mesh.normals.is_empty() {
            mesh.normals.resize(total, Vec3::ZERO);
        }
        for (set, target) in [(0, &mut mesh.uv0), (1, &mut mesh.uv1)] {
            if let Some(uv) = self.attribute(primitive, element, Semantic::TexCoords(set))? {
                let uv = uv.floats::<2>(range.clone())?;
                target.resize(base, Vec2::ZERO);
                let bounded =
                    |uv: [f32; 2]| uv.map(|c| c.clamp(-MAX_TEXTURE_COORDINATE, MAX_TEXTURE_COORDINATE));
                target.extend(used.iter().map(|&v| Vec2::from(bounded(uv[pick(v)]))));
                if let Some(&v) = used.iter().find(|&&v| bounded(uv[pick(v)]) != uv[pick(v)]) {
                    let problem = format!("texture coordinates {v} are {:?}", uv[pick(v)]);
                    self.mend(element, problem, "they are clamped: so far off there are no fractions")?;
                }
            } else if !target.is_empty() {
                target.resize(total, Vec2::ZERO);
            }
        }
        if let Some(colors) = self.attribute(primitive, element, Semantic::Colors(0))? {
            let rgba: Vec<Vec4> = match colors.shape {
                Type::Vec3 => {
                    colors.floats::<3>(range.clone())?.iter().map(|&c| Vec3::from(c).extend(1.0)).collect()
                }
                _ => colors.floats::<4>(range.clone())?.iter().map(|&c| Vec4::from(c)).collect(),
            };
            mesh.colors.resize(base, Vec4::ONE);
            // glTF 2.0, section 3.7.2.1: colours must be clamped.
            mesh.colors.extend(used.iter().map(|&v| rgba[pick(v)].clamp(Vec4::ZERO, Vec4::ONE)));
        } else if !mesh.colors.is_empty() {
            mesh.colors.resize(total, Vec4::ONE);
        }
        Ok(())
    }

    /// Positions or normals, relative to `origin`, with the weighted sum of morph targets added.
    fn posed(
        &self,
        primitive: &Primitive,
        element: &str,
        (weights, origin): (&[f32], DVec3),
        semantic: Semantic,
        range: Range<usize>,
    ) -> Result<Option<Vec<Vec3>>, SceneError> {
        let Some(base) = self.attribute(primitive, element, semantic.clone())? else { return Ok(None) };
        self.take::<(Vec3, DVec3)>(range.len()).map_err(|shortage| self.fault(element, shortage))?;
        let mut values: Vec<Vec3> = base.floats::<3>(range.clone())?.into_iter().map(Vec3::from).collect();
        let relative = if origin == DVec3::ZERO { &[] } else { &values[..] };
        let mut relative: Vec<DVec3> = relative.iter().map(|value| value.as_dvec3() - origin).collect();
        let targets = primitive.targets.as_deref().unwrap_or(&[]);
        for (i, (target, &weight)) in targets.iter().zip(weights).enumerate() {
            let accessor = if semantic == Semantic::Positions { target.positions } else { target.normals };
            let Some(accessor) = accessor.filter(|_| weight != 0.0) else { continue };
            let deltas = self.typed(accessor.value(), &format!("{element}.targets[{i}]"), &semantic)?;
            let budget = *self.budget.borrow();
            let deltas = deltas.floats::<3>(range.clone())?;
            self.budget.replace(budget);
            for (value, &delta) in values.iter_mut().zip(&deltas) {
                *value += weight * Vec3::from(delta);
            }
            for (value, &delta) in relative.iter_mut().zip(&deltas) {
                *value += f64::from(weight) * Vec3::from(delta).as_dvec3();
            }
        }
        match values.iter().position(|v| !v.is_finite()) {
            None if relative.is_empty() => Ok(Some(values)),
            None => Ok(Some(relative.into_iter().map(|value| value.as_vec3()).collect())),
            Some(i) => Err(self.error(element, format!("morphed vertex {} is not finite", range.start + i))),
        }
    }
}

/// Renumbers `triangles` by the vertices they use, which are returned in increasing order.
fn compact(triangles: &mut [[u32; 3]]) -> Vec<u32> {
    let corners = triangles.as_flattened_mut();
    let (Some(&first), Some(&last)) = (corners.iter().min(), corners.iter().max()) else { return Vec::new() };
    let mut new_index = vec![0_u32; (last - first) as usize + 1];
    for &mut v in &mut *corners {
        new_index[(v - first) as usize] = 1;
    }
    let used: Vec<u32> = (first..=last).filter(|&v| new_index[(v - first) as usize] == 1).collect();
    for (i, &v) in used.iter().enumerate() {
        new_index[(v - first) as usize] = i as u32;
    }
    for v in corners {
        *v = new_index[(*v - first) as usize];
    }
    used
}
