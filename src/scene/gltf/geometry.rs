//! Meshes: triangle primitives merged into one [`Mesh`], and what morphs and skins it.

use super::accessor::Elements;
use super::context::Context;
use super::skin::Skin;
use crate::memory::Shortage;
use crate::scene::limits::{MAX_TEXTURE_COORDINATE, MAX_TRIANGLES, MAX_VERTICES};
use crate::scene::mesh::unit_normal;
use crate::scene::shape::{MorphTarget, Shape};
use crate::scene::{Mesh, SceneError};
use ::gltf::json::accessor::{ComponentType, Type};
use ::gltf::json::mesh::{Mode, Primitive, Semantic};
use ::gltf::json::validation::Checked;
use glam::{DVec3, Vec2, Vec3, Vec4};

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
    /// Targets without weight may get one.
    pub(super) every_target: bool,
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
        let shape = self.shape(index, pose, tally)?;
        self.posed(index, shape, pose)
    }

    /// A shape of mesh `index` as it is posed at rest.
    pub(super) fn posed(&self, index: usize, shape: Shape, pose: &Pose<'_>) -> Result<Mesh, SceneError> {
        let joints = pose.skin.map_or(&[][..], |skin| &skin.joints);
        shape.posed(self.weights(index, pose), joints, pose.origin).map_err(|vertex| {
            self.error(format!("meshes[{index}]"), format!("vertex {vertex} of its pose is not finite"))
        })
    }

    /// Weights of morph targets at rest.
    pub(super) fn weights<'a>(&'a self, index: usize, pose: &Pose<'a>) -> &'a [f32] {
        pose.weights.or(self.root.meshes[index].weights.as_deref()).unwrap_or(&[])
    }

    /// Reads mesh `index` before it is posed.
    pub(super) fn shape(
        &self,
        index: usize,
        pose: &Pose<'_>,
        tally: &mut Tally,
    ) -> Result<Shape, SceneError> {
        let source = &self.root.meshes[index];
        let name = source.name.clone().unwrap_or_else(|| format!("mesh {index}"));
        let mut shape = Shape { base: Mesh { name, ..Mesh::default() }, ..Shape::default() };
        let weights = self.weights(index, pose);
        if !weights.iter().all(|w| w.is_finite()) {
            return Err(self.error(format!("meshes[{index}]"), "a morph weight is not finite"));
        }
        tally.morphed += usize::from(source.primitives.iter().any(|p| p.targets.is_some()));
        for (i, primitive) in source.primitives.iter().enumerate() {
            let element = format!("meshes[{index}].primitives[{i}]");
            let budget = *self.budget.borrow();
            let before = bytes(&shape);
            self.primitive(&mut shape, primitive, &element, (weights, pose), tally)?;
            // What was read on the way is gone.
            self.budget.replace(budget);
            self.take::<u8>(bytes(&shape) - before).map_err(|shortage| self.fault(element, shortage))?;
        }
        let Shape { base, targets, .. } = &mut shape;
        if !base.tangents.is_empty() {
            base.tangents.resize(base.triangles.len(), [Vec4::ZERO; 3]);
        }
        for values in targets.iter_mut().flat_map(|target| [&mut target.positions, &mut target.normals]) {
            if !values.is_empty() {
                values.resize(base.positions.len(), Vec3::ZERO);
            }
        }
        Ok(shape)
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
        shape: &mut Shape,
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
        if shape.base.triangles.len() + made > MAX_TRIANGLES {
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
        let base = shape.base.positions.len() as u32;
        self.append(&mut shape.base, primitive, element, &used)?;
        self.morphs(shape, primitive, element, (weights, pose.every_target), &used)?;
        if let Some(skin) = pose.skin {
            self.influences(shape.influences.get_or_insert_default(), primitive, element, skin, &used)?;
        }
        let mesh = &mut shape.base;
        if let Some(tangents) = self.tangents(primitive, element, &used)? {
            self.take::<[Vec4; 3]>(triangles.len()).map_err(short)?;
            mesh.tangents.resize(mesh.triangles.len(), [Vec4::ZERO; 3]);
            mesh.tangents.extend(triangles.iter().map(|t| t.map(|v| tangents[v as usize])));
        }
        mesh.triangles.extend(triangles.iter().map(|t| t.map(|v| v + base)));
        let material = primitive.material.map_or(self.root.materials.len(), |m| m.value()) as u32;
        mesh.materials.resize(mesh.triangles.len(), material);
        Ok(())
    }

    /// Tangents of the `used` vertices where the material needs them. The standard wants them ignored where there are no
    /// normals.
    fn tangents(
        &self,
        primitive: &Primitive,
        element: &str,
        used: &[u32],
    ) -> Result<Option<Vec<Vec4>>, SceneError> {
        let mapped = primitive.material.is_some_and(|material| self.is_normal_mapped(material.value()));
        let (Some(&first), Some(&last)) = (used.first(), used.last()) else { return Ok(None) };
        let found = self.attribute(primitive, element, Semantic::Tangents)?;
        let normals = primitive.attributes.contains_key(&Checked::Valid(Semantic::Normals));
        let Some(tangents) = found.filter(|_| mapped && normals) else { return Ok(None) };
        let values = tangents.floats::<4>(first as usize..last as usize + 1)?;
        let tangent = |&v: &u32| {
            let [x, y, z, w] = values[(v - first) as usize];
            match unit_normal(Vec3::new(x, y, z)) {
                Vec3::ZERO => Vec4::ZERO,
                unit => unit.extend(1.0_f32.copysign(w)),
            }
        };
        Ok(Some(used.iter().map(tangent).collect()))
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
        used: &[u32],
    ) -> Result<(), SceneError> {
        let (Some(&first), Some(&last)) = (used.first(), used.last()) else { return Ok(()) };
        let range = first as usize..last as usize + 1;
        let base = mesh.positions.len();
        let total = base + used.len();
        let pick = |v: u32| v as usize - range.start;
        self.take::<u8>(used.len() * VERTEX).map_err(|shortage| self.fault(element, shortage))?;

        let read = |semantic| match self.attribute(primitive, element, semantic)? {
            Some(elements) => elements.floats::<3>(range.clone()).map(Some),
            None => Ok(None),
        };
        let positions = read(Semantic::Positions)?.unwrap_or_default();
        mesh.positions.extend(used.iter().map(|&v| Vec3::from(positions[pick(v)])));
        if let Some(normals) = read(Semantic::Normals)? {
            mesh.normals.resize(base, Vec3::ZERO);
            mesh.normals.extend(used.iter().map(|&v| Vec3::from(normals[pick(v)])));
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

    /// Appends what morph targets add to the `used` vertices: those with a weight, or every one.
    fn morphs(
        &self,
        shape: &mut Shape,
        primitive: &Primitive,
        element: &str,
        (weights, every): (&[f32], bool),
        used: &[u32],
    ) -> Result<(), SceneError> {
        let (Some(&first), Some(&last)) = (used.first(), used.last()) else { return Ok(()) };
        let range = first as usize..last as usize + 1;
        let base = shape.base.positions.len() - used.len();
        let normals = primitive.attributes.contains_key(&Checked::Valid(Semantic::Normals));
        for (i, source) in primitive.targets.iter().flatten().enumerate() {
            if shape.targets.len() == i {
                shape.targets.push(MorphTarget::default());
            }
            if !every && weights.get(i).is_none_or(|&weight| weight == 0.0) {
                continue;
            }
            let target = &mut shape.targets[i];
            for (semantic, accessor, values) in [
                (Semantic::Positions, source.positions, &mut target.positions),
                (Semantic::Normals, source.normals.filter(|_| normals), &mut target.normals),
            ] {
                let Some(accessor) = accessor else { continue };
                let deltas = self.typed(accessor.value(), &format!("{element}.targets[{i}]"), &semantic)?;
                let deltas = deltas.floats::<3>(range.clone())?;
                values.resize(base, Vec3::ZERO);
                values.extend(used.iter().map(|&v| Vec3::from(deltas[v as usize - range.start])));
            }
        }
        Ok(())
    }
}

/// Bytes that a shape takes.
fn bytes(shape: &Shape) -> usize {
    let Shape { base, targets, influences } = shape;
    let triangle =
        size_of::<([u32; 3], u32)>() + if base.tangents.is_empty() { 0 } else { size_of::<[Vec4; 3]>() };
    let deltas = targets.iter().map(|target| target.positions.len() + target.normals.len()).sum::<usize>();
    base.positions.len() * VERTEX
        + base.triangles.len() * triangle
        + deltas * size_of::<Vec3>()
        + influences.as_ref().map_or(0, |all| all.ends.len() * 4 + all.of.len() * size_of::<(u32, f32)>())
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
