//! Meshes brought into shape on the device: vertices morphed and skinned, triangles in leaf order moved to them, nodes over
//! these fitted anew, and packed anew where fitting has made them slow. Each shape has buffers of its own, copied from those
//! of the one before, which runs under way may still use.

use super::error::Error;
use super::resident::Resident;
use crate::accel::levels::{Deforming, packed_levels};
use crate::accel::{DEFORMED, Geometry, Rebuild, StructureReport};
use crate::graph::{Buffer, Executor, Graph, Grid, PassTime, Res, Run, RunOptions, Ticket};
use crate::scene::Scene;
use crate::shaders::deform::{cost, keys, nodes, pack, sort, triangles, vertices};
use crate::shaders::{DeformTriangle, DeformVertex, Influence, MorphDelta, NodeBox};
use crate::vk::{self, Access, Backend, MemoryKind};
use bytemuck::Pod;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// Transients are small.
const OPTIONS: RunOptions<'_> = RunOptions {
    scene: None,
    alias: false,
    submit_ms: 100.0,
    pass_times: true,
    cancel: None,
    progress: None,
};

/// Growth of what a ray is expected to visit by which nodes have become slow.
const SLOW: f32 = 2.0;

/// What brings a scene's meshes into shape.
#[derive(Clone)]
pub(super) struct Deformer {
    executor: Arc<Mutex<Executor>>,
    fixed: Arc<Fixed>,
    tree: Tree,
    rebuild: Rebuild,
}

/// What no shape changes.
struct Fixed {
    /// Indices into the scene's meshes.
    sources: Vec<u32>,
    vertices: Arc<vk::Buffer>,
    deltas: Arc<vk::Buffer>,
    influences: Arc<vk::Buffer>,
    vertex_count: u32,
    first_triangle: u32,
    first_node: u32,
    node_count: u32,
}

/// Nodes as they were last built.
#[derive(Clone)]
struct Tree {
    /// In leaf order.
    triangles: Arc<vk::Buffer>,
    /// Nodes, and how many follow in each step.
    order: Arc<vk::Buffer>,
    steps: Vec<u32>,
    meshes: Arc<[Deforming]>,
    /// What a ray was expected to visit after the last build, one a mesh.
    costs: Vec<f32>,
}

impl fmt::Debug for Deformer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Deformer").field("vertices", &self.fixed.vertex_count).finish_non_exhaustive()
    }
}

/// What is on the device after an edit.
pub(super) struct Deformed {
    pub(super) deformer: Option<Deformer>,
    pub(super) resident: Resident,
    pub(super) passes: Vec<PassTime>,
}

/// Kernels are bound to something.
fn filled<T: Pod>(device: &vk::Device, name: &str, mut data: Vec<T>) -> Result<Arc<vk::Buffer>, vk::Error> {
    if data.is_empty() {
        data.push(T::zeroed());
    }
    Ok(Arc::new(device.upload(name, bytemuck::cast_slice(&data))?))
}

impl Deformer {
    /// None where nothing is to be brought into shape.
    pub(super) fn new(
        device: &vk::Device,
        scene: &Scene,
        geometry: &Geometry,
        resident: &Resident,
        rebuild: Rebuild,
    ) -> Result<Option<Self>, Error> {
        let Some((nodes, leaves, meshes)) = resident.structure.deforming() else { return Ok(None) };
        let (fixed, triangles) = Fixed::of(device, scene, geometry, meshes)?;
        let tree = Tree::of(device, triangles, meshes.into())?;
        // At rest all is where it was built.
        let mut executor = Executor::new(device, Backend::Software)?;
        let mut g = Graph::new();
        let (nodes, leaves) = (g.import_buffer("nodes", nodes), g.import_buffer("leaves", leaves));
        let (_, costs) = tree.fit(&mut g, &fixed, nodes, leaves);
        let costs = executor.run(g, &OPTIONS)?.take(costs);
        let tree = Tree { costs, ..tree };
        Ok(Some(Self { executor: Arc::new(Mutex::new(executor)), fixed: Arc::new(fixed), tree, rebuild }))
    }

    /// Whether kernels can be bound to all that is written.
    pub(super) fn fits(device: &vk::Device, geometry: &Geometry) -> bool {
        let triangles = geometry.world_triangle_count() * size_of::<[[f32; 4]; 3]>() as u64;
        let vertices = size_of_val(&geometry.positions[..]) as u64;
        // Pieces of large triangles are stored as often as there are; nodes take less.
        device.check_storage_range("triangles", triangles.max(vertices).saturating_mul(2)).is_ok()
    }

    /// Brings what is resident of a scene into the shape of `scene`, whose deformations are of the same meshes.
    pub(super) fn deform(
        &self,
        device: &vk::Device,
        scene: &Scene,
        resident: &Resident,
    ) -> Result<Deformed, Error> {
        let Self { fixed, tree, rebuild, .. } = self;
        let mut executor = self.executor.lock().unwrap_or_else(PoisonError::into_inner);
        let (nodes, leaves, _) = resident.structure.deforming().expect("it has what is deformed");
        let (positions, normals) = resident.gpu.vertices().expect("a triangle has vertices");
        let another =
            |old: &Arc<vk::Buffer>| device.buffer(old.name(), old.size(), MemoryKind::Device).map(Arc::new);
        let [new_nodes, new_leaves, new_positions] = [another(nodes)?, another(leaves)?, another(positions)?];
        let new_normals = normals.map(another).transpose()?;

        let mut g = Graph::new();
        let costs = g.group("deform", |g| {
            let copied = |g: &mut Graph, name: &'static str, old: &Arc<vk::Buffer>, new: &Arc<vk::Buffer>| {
                let from = g.import_buffer(format!("{name} before"), old);
                let to = g.import_buffer(name, new);
                g.copy_buffer(name, (from, 0), (to, 0), old.size());
                to
            };
            let positions = copied(g, "positions", positions, &new_positions);
            let normals = normals.zip(new_normals.as_ref()).map(|(old, new)| copied(g, "normals", old, new));
            let leaves = copied(g, "leaves", leaves, &new_leaves);
            let nodes = copied(g, "nodes", nodes, &new_nodes);
            fixed.place(g, scene, positions, normals);
            tree.place(g, fixed, positions, leaves);
            tree.fit(g, fixed, nodes, leaves).1
        });
        let mut run = executor.run(g, &OPTIONS)?;
        let costs = run.take(costs);
        let bytes = fixed.bytes() + tree.bytes();
        let report = |name: &str, run: &Run, triangles: u32| StructureReport {
            name: name.into(),
            build_ms: run.device_ms.unwrap_or_default(),
            bytes,
            primitives: triangles.into(),
        };
        let mut reports = vec![report(DEFORMED[0], &run, tree.triangle_count())];
        let mut passes = run.passes;
        let mut tree = tree.clone();
        let is_slow = |&i: &usize| match rebuild {
            Rebuild::AsNeeded => costs[i] > SLOW * tree.costs[i],
            Rebuild::Never => false,
            Rebuild::Always => true,
        };
        let slow: Vec<usize> = (0..costs.len()).filter(is_slow).collect();
        if !slow.is_empty() {
            let mut g = Graph::new();
            let rebuilt = g.group("rebuild", |g| {
                let nodes = g.import_buffer("nodes", &new_nodes);
                let leaves = g.import_buffer("leaves", &new_leaves);
                let positions = g.import_buffer("positions", &new_positions);
                tree.rebuild(g, device, fixed, &slow, (nodes, leaves, positions))
            });
            let (rebuilt, costs) = rebuilt?;
            let mut run = executor.run(g, &OPTIONS)?;
            let costs: Vec<f32> = run.take(costs);
            let count = slow.iter().map(|&i| tree.meshes[i].triangle_count).sum();
            reports.push(report(DEFORMED[1], &run, count));
            passes.extend(run.passes);
            let kept = |i: usize| if slow.contains(&i) { costs[i] } else { tree.costs[i] };
            tree = Tree { costs: (0..costs.len()).map(kept).collect(), ..rebuilt };
        }
        let remade = resident.structure.remake(device, &new_positions, &slow)?;
        if !remade.is_empty() {
            let mut g = Graph::new();
            let positions = g.import_buffer("positions", &new_positions);
            for remade in &remade {
                let (device, remade) = (device.clone(), Arc::clone(remade));
                g.raw("deform/blas", &[(positions.into(), Access::Read)], move |context| {
                    let recorded = remade.record(&device, context.command_buffer());
                    recorded.expect("a device that has built structures builds structures");
                });
            }
            passes.extend(executor.run(g, &OPTIONS)?.passes);
        }
        let mut gpu = resident.gpu.clone();
        gpu.set_vertices(new_positions, new_normals);
        let structure = resident.structure.deformed(new_nodes, new_leaves, &remade, reports);
        let deformer = Self { tree, ..self.clone() };
        passes.retain(|pass| !pass.path.starts_with("readback"));
        Ok(Deformed { deformer: Some(deformer), resident: Resident { structure, gpu }, passes })
    }
}

impl Fixed {
    /// With the triangles in leaf order.
    fn of(
        device: &vk::Device,
        scene: &Scene,
        geometry: &Geometry,
        meshes: &[Deforming],
    ) -> Result<(Self, Arc<vk::Buffer>), Error> {
        let (mut all, mut deltas, mut influences) = (Vec::new(), Vec::new(), Vec::new());
        let (mut leaves, mut sources) = (Vec::new(), Vec::new());
        let (mut first_weight, mut first_joint) = (0, 0);
        for of in meshes {
            let first = geometry.meshes[of.mesh as usize].first_triangle as usize;
            let source = geometry.source[first];
            sources.push(source.mesh);
            let deformation = scene.deformation(source.mesh).expect("it is to be brought into shape");
            let corner = scene.meshes[source.mesh as usize].triangles[source.triangle as usize][0];
            let first_vertex = geometry.triangles[first][0] - corner;
            for (index, vertex) in deformation.vertices().enumerate() {
                deltas.extend(deformation.deltas(index).map(|(target, position, normal)| {
                    let [position, normal] = [position, normal].map(|delta| delta.to_array());
                    MorphDelta { position, weight: first_weight + target, normal }
                }));
                let sum: f64 = vertex.influences.iter().map(|&(_, weight)| f64::from(weight)).sum();
                influences.extend(vertex.influences.iter().map(|&(joint, weight)| Influence {
                    joint: first_joint + joint,
                    weight: (f64::from(weight) / sum) as f32,
                }));
                all.push(DeformVertex {
                    position: vertex.position.to_array(),
                    at: first_vertex + index as u32,
                    normal: vertex.normal.to_array(),
                    deltas_end: deltas.len() as u32,
                    influences_end: influences.len() as u32,
                });
            }
            first_weight += deformation.weights().len() as u32;
            first_joint += deformation.joints().len() as u32;
            leaves.extend(of.leaves.iter().map(|&[primitive, blocks]| DeformTriangle {
                vertices: geometry.triangles[first + primitive as usize],
                name: primitive << 3 | blocks,
            }));
        }
        let fixed = Self {
            sources,
            vertex_count: all.len() as u32,
            first_triangle: meshes[0].first_triangle,
            first_node: meshes[0].first_node,
            node_count: meshes.iter().map(|of| of.node_count).sum(),
            vertices: filled(device, "deform.vertices", all)?,
            deltas: filled(device, "deform.deltas", deltas)?,
            influences: filled(device, "deform.influences", influences)?,
        };
        Ok((fixed, filled(device, "deform.triangles", leaves)?))
    }

    fn bytes(&self) -> u64 {
        self.vertices.size() + self.deltas.size() + self.influences.size()
    }

    /// Brings vertices to their places.
    fn place(&self, g: &mut Graph, scene: &Scene, positions: Res<Buffer>, normals: Option<Res<Buffer>>) {
        let deformations =
            || self.sources.iter().map(|&mesh| scene.deformation(mesh).expect("the same meshes"));
        let mut weights: Vec<f32> = deformations().flat_map(|d| d.weights().iter().copied()).collect();
        let mut joints: Vec<[f32; 12]> = deformations()
            .flat_map(|d| d.joints().map(|joint| joint.to_cols_array().map(|e| e as f32)))
            .collect();
        // Kernels are bound to something.
        weights.push(0.0);
        joints.push([0.0; 12]);
        let bind = vertices::Bind {
            vertices: g.import_buffer("vertices", &self.vertices),
            deltas: g.import_buffer("deltas", &self.deltas),
            influences: g.import_buffer("influences", &self.influences),
            weights: g.buffer_with("weights", bytemuck::cast_slice(&weights).to_vec()),
            joints: g.buffer_with("joints", bytemuck::cast_slice(&joints).to_vec()),
            positions,
            normals: normals.unwrap_or_else(|| g.buffer("no normals", 16)),
        };
        let params = vertices::Params { count: self.vertex_count, with_normals: normals.is_some().into() };
        g.pass("vertices", &vertices::kernel(), bind, params, Grid::Of([self.vertex_count, 1, 1]));
    }
}

impl Tree {
    /// As built, its costs to be measured.
    fn of(device: &vk::Device, triangles: Arc<vk::Buffer>, meshes: Arc<[Deforming]>) -> Result<Self, Error> {
        let tallest = meshes.iter().map(|of| of.heights.len()).max().unwrap_or(0);
        let (mut order, mut steps) = (Vec::new(), Vec::new());
        for height in 0..tallest {
            let before = order.len();
            order.extend(meshes.iter().filter_map(|of| of.heights.get(height)).flatten().copied());
            steps.push((order.len() - before) as u32);
        }
        let order = filled(device, "deform.order", order)?;
        Ok(Self { triangles, order, steps, meshes, costs: Vec::new() })
    }

    fn bytes(&self) -> u64 {
        self.triangles.size() + self.order.size()
    }

    fn triangle_count(&self) -> u32 {
        self.meshes.iter().map(|of| of.triangle_count).sum()
    }

    /// Brings triangles in leaf order to where their vertices are.
    fn place(&self, g: &mut Graph, fixed: &Fixed, positions: Res<Buffer>, leaves: Res<Buffer>) {
        let count = self.triangle_count();
        let own = g.import_buffer("triangles", &self.triangles);
        let bind = triangles::Bind { triangles: own, positions, leaves };
        let params = triangles::Params { first: fixed.first_triangle, count };
        g.pass("triangles", &triangles::kernel(), bind, params, Grid::Of([count, 1, 1]));
    }

    /// Fits nodes to triangles. Returns all nodes' boxes, and what a ray is expected to visit of each mesh.
    fn fit(
        &self,
        g: &mut Graph,
        fixed: &Fixed,
        nodes: Res<Buffer>,
        leaves: Res<Buffer>,
    ) -> (Res<Buffer>, Ticket<f32>) {
        let order = g.import_buffer("order", &self.order);
        let boxes = g.buffer("boxes", size_of::<NodeBox>() as u64 * u64::from(fixed.node_count));
        let costs = g.buffer("costs", 4 * u64::from(fixed.node_count));
        // Not every node that there is room for is there.
        g.fill("clear", boxes, 0);
        g.fill("clear", costs, 0);
        let mut first = 0;
        for &count in &self.steps {
            let bind = nodes::Bind { order, leaves, nodes, boxes, costs };
            let params = nodes::Params { first, count, first_node: fixed.first_node };
            g.pass("nodes", &nodes::kernel(), bind, params, Grid::Of([count, 1, 1]));
            first += count;
        }
        let tree = |of: &Deforming| [of.first_node - fixed.first_node, of.node_count];
        let trees: Vec<[u32; 2]> = self.meshes.iter().map(tree).collect();
        let trees = g.buffer_with("trees", bytemuck::cast_slice(&trees).to_vec());
        let sums = g.buffer("sums", 4 * self.meshes.len() as u64);
        let threads = cost::CODE.workgroup[0] * self.meshes.len() as u32;
        let bind = cost::Bind { trees, boxes, costs, sums };
        g.pass("cost", &cost::kernel(), bind, cost::Params {}, Grid::Of([threads, 1, 1]));
        (boxes, g.read_buffer(sums))
    }

    /// Packs the nodes of some meshes anew, by where their triangles are now.
    fn rebuild(
        &self,
        g: &mut Graph,
        device: &vk::Device,
        fixed: &Fixed,
        which: &[usize],
        (nodes, leaves, positions): (Res<Buffer>, Res<Buffer>, Res<Buffer>),
    ) -> Result<(Self, Ticket<f32>), Error> {
        let (boxes, _) = self.fit(g, fixed, nodes, leaves);
        let size = self.triangles.size();
        let another = Arc::new(device.buffer("deform.triangles", size, MemoryKind::Device)?);
        let before = g.import_buffer("triangles before", &self.triangles);
        let after = g.import_buffer("triangles", &another);
        g.copy_buffer("triangles", (before, 0), (after, 0), size);
        let mut meshes = self.meshes.to_vec();
        for &index in which {
            let of = &mut meshes[index];
            let &mut Deforming { first_node, first_triangle: first, triangle_count: count, .. } = of;
            let keys = sorted(g, of, first_node - fixed.first_node, leaves, boxes);
            let levels = packed_levels(count);
            let mut level = first_node + levels.iter().sum::<u32>();
            let mut span = 1;
            of.heights = Vec::new();
            for &level_size in levels.iter().rev() {
                level -= level_size;
                let own = first - fixed.first_triangle;
                let params = pack::Params { first, count, own, first_node: level, level_size, span };
                let bind = pack::Bind { keys, leaves, before, after, nodes };
                let threads = if span == 1 { count } else { level_size };
                g.pass("pack", &pack::kernel(), bind, params, Grid::Of([threads, 1, 1]));
                of.heights.push((level..level + level_size).collect());
                span *= 8;
            }
        }
        let tree = Self::of(device, another, meshes.into())?;
        tree.place(g, fixed, positions, leaves);
        let (_, costs) = tree.fit(g, fixed, nodes, leaves);
        Ok((tree, costs))
    }
}

/// A mesh's triangles along a curve through its box, the root's of `boxes`.
fn sorted(g: &mut Graph, of: &Deforming, root: u32, leaves: Res<Buffer>, boxes: Res<Buffer>) -> Res<Buffer> {
    let &Deforming { first_triangle: first, triangle_count: count, .. } = of;
    let block = 2 * sort::CODE.workgroup[0];
    let room = count.next_power_of_two().max(block);
    let keys = g.buffer("keys", 8 * u64::from(room));
    let params = keys::Params { first, count, room, root };
    g.pass("keys", &keys::kernel(), keys::Bind { leaves, boxes, keys }, params, Grid::Of([room, 1, 1]));
    let mut size = 2;
    while size <= room {
        let mut reach = size / 2;
        while reach > 0 {
            let params = sort::Params { pairs: room / 2, size, reach };
            g.pass("sort", &sort::kernel(), sort::Bind { keys }, params, Grid::Of([room / 2, 1, 1]));
            // Steps within a workgroup's block are taken at once.
            reach = if reach < block { 0 } else { reach / 2 };
        }
        size *= 2;
    }
    keys
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::software::LeafTriangle;
    use crate::accel::{Arrangement, Structure, levels};
    use crate::common;
    use crate::gpu_scene::GpuScene;
    use crate::scene::{LoadOptions, Scene, load};
    use glam::{DVec3, Vec3};
    use obvhs::cwbvh::node::CwBvhNode;
    use std::path::Path;

    /// A scene of our own and a time at which it is far from rest.
    fn moving(name: &str) -> (Scene, f64) {
        let options = LoadOptions { motion: true, ..LoadOptions::default() };
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
        let scene = load(&path, &options).unwrap();
        let clips = scene.clips_together();
        let end = clips.iter().map(|&clip| scene.clips()[clip].end()).fold(0.0, f64::max);
        (scene, end)
    }

    struct Made {
        device: vk::Device,
        geometry: Geometry,
        resident: Resident,
        deformer: Deformer,
        at_rest: Vec<CwBvhNode>,
    }

    impl Made {
        fn of(device: &vk::Device, scene: &Scene) -> Self {
            let geometry = Geometry::of(scene).unwrap();
            let built = levels::Meshes::build(&geometry, true, false).unwrap();
            let structure =
                Structure::build(device, Backend::Software, &geometry, Arrangement::default()).unwrap();
            let gpu = GpuScene::upload(device, scene, &geometry).unwrap();
            let resident = Resident { structure, gpu };
            let deformer = Deformer::new(device, scene, &geometry, &resident, Rebuild::Never);
            let deformer = deformer.unwrap().unwrap();
            Self { device: device.clone(), geometry, resident, deformer, at_rest: built.nodes }
        }

        fn nodes(&self) -> Vec<CwBvhNode> {
            let (nodes, ..) = self.resident.structure.deforming().unwrap();
            bytemuck::pod_collect_to_vec(&self.device.download(nodes).unwrap())
        }

        fn triangles(&self) -> Vec<LeafTriangle> {
            let (_, triangles, _) = self.resident.structure.deforming().unwrap();
            bytemuck::pod_collect_to_vec(&self.device.download(triangles).unwrap())
        }

        fn positions(&self) -> Vec<Vec3> {
            let (positions, _) = self.resident.gpu.vertices().unwrap();
            bytemuck::pod_collect_to_vec(&self.device.download(positions).unwrap())
        }

        fn normals(&self) -> Vec<Vec3> {
            let (_, normals) = self.resident.gpu.vertices().unwrap();
            let bytes = normals.map(|normals| self.device.download(normals).unwrap());
            bytes.map(|bytes| bytemuck::pod_collect_to_vec(&bytes)).unwrap_or_default()
        }

        fn deform(&mut self, scene: &Scene, rebuild: Rebuild) {
            self.deformer.rebuild = rebuild;
            let deformed = self.deformer.deform(&self.device, scene, &self.resident).unwrap();
            (self.resident, self.deformer) = (deformed.resident, deformed.deformer.unwrap());
        }

        /// Each triangle of each mesh is where its vertices are, in one leaf, and in all decoded boxes above that.
        fn check(&self) {
            let (nodes, triangles, positions) = (self.nodes(), self.triangles(), self.positions());
            for of in &*self.deformer.tree.meshes {
                let range = self.geometry.meshes[of.mesh as usize];
                let mut seen = vec![0; range.triangle_count as usize];
                let mut stack = vec![(of.first_node, Vec::<[DVec3; 2]>::new())];
                while let Some((index, boxes)) = stack.pop() {
                    let node = &nodes[index as usize];
                    assert!(index >= of.first_node && index < of.first_node + of.node_count);
                    for slot in (0..8).filter(|&slot| !node.is_child_empty(slot)) {
                        let cell = |axis: usize| f64::from(f32::from_bits(u32::from(node.e[axis]) << 23));
                        let cell = DVec3::new(cell(0), cell(1), cell(2));
                        let corner = Vec3::from_array(node.p.into()).as_dvec3();
                        let at = |x: u8, y: u8, z: u8| {
                            corner + cell * DVec3::new(f64::from(x), f64::from(y), f64::from(z))
                        };
                        let n = node;
                        let mut boxes = boxes.clone();
                        boxes.push([
                            at(n.child_min_x[slot], n.child_min_y[slot], n.child_min_z[slot]),
                            at(n.child_max_x[slot], n.child_max_y[slot], n.child_max_z[slot]),
                        ]);
                        if !node.is_leaf(slot) {
                            stack.push((node.child_node_index(slot), boxes));
                            continue;
                        }
                        let (first, count) = node.child_primitives(slot);
                        for triangle in &triangles[first as usize..(first + count) as usize] {
                            seen[triangle.primitive as usize] += 1;
                            let corners =
                                self.geometry.triangles[(range.first_triangle + triangle.primitive) as usize];
                            let vertices = [triangle.a, triangle.b, triangle.c].map(Vec3::from);
                            assert_eq!(vertices, corners.map(|corner| positions[corner as usize]));
                            let inside = |p: Vec3| {
                                let p = p.as_dvec3();
                                boxes.iter().all(|[low, high]| p.cmpge(*low).all() && p.cmple(*high).all())
                            };
                            assert!(vertices.into_iter().all(inside), "{vertices:?} in {boxes:?}");
                        }
                    }
                }
                assert!(seen.iter().all(|&count| count == 1));
            }
        }
    }

    /// How far positions and normals are off what the host makes of them, in units of 2⁻²³ of the largest coordinate.
    fn off(made: &Made, pose: &Scene) -> (f32, f32) {
        let shaped = pose.shaped().unwrap();
        let host = Geometry::of(&shaped).unwrap();
        let (positions, normals) = (made.positions(), made.normals());
        let largest = made.geometry.largest_coordinate();
        let (mut worst, mut turned) = (0.0_f32, 0.0_f32);
        for (&corners, source) in made.geometry.triangles.iter().zip(&made.geometry.source) {
            let mesh = &shaped.meshes[source.mesh as usize];
            let merged = pose.deformation(source.mesh).is_none();
            for (corner, vertex) in corners.into_iter().zip(mesh.triangles[source.triangle as usize]) {
                let at = positions[corner as usize];
                let normal = normals.get(corner as usize).copied().unwrap_or_default();
                if !merged {
                    worst = worst.max((at - mesh.positions[vertex as usize]).abs().max_element());
                    let own = mesh.normals.get(vertex as usize).copied().unwrap_or_default();
                    turned = turned.max((normal - own).length());
                }
            }
        }
        assert_eq!(host.triangles.len(), made.geometry.triangles.len());
        (worst / (f32::EPSILON * largest), turned / f32::EPSILON)
    }

    /// Vertices are where the host has them: positions within 4 units in the last place of the largest coordinate, normals
    /// within 16 of 1. Nodes hold their triangles, fitted and built anew; at rest they are those that the host built.
    #[test]
    fn shapes_are_those_of_the_host() {
        let Some((_guard, device)) = common::device() else { return };
        for name in ["conference-walk.glb", "cornell-moving.glb"] {
            let (scene, end) = moving(name);
            let clips = scene.clips_together();
            let pose = |share: f64| scene.pose_lazily(&clips, share * end).unwrap();
            assert!(!pose(0.0).deformations.is_empty(), "{name}");
            let mut made = Made::of(&device, &pose(0.0));
            assert!(
                bytemuck::cast_slice::<_, u8>(&made.nodes()) == bytemuck::cast_slice::<_, u8>(&made.at_rest)
            );
            made.check();
            for (share, rebuild) in [
                (0.3, Rebuild::Never),
                (0.62, Rebuild::Never),
                (0.62, Rebuild::Always),
                (0.9, Rebuild::AsNeeded),
            ] {
                let pose = pose(share);
                made.deform(&pose, rebuild);
                made.check();
                let (worst, turned) = off(&made, &pose);
                assert!(worst < 4.0 && turned < 16.0, "{name} at {share}: {worst}, {turned}");
            }
        }
    }
}
