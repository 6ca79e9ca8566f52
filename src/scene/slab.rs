//! Flat slabs of glass become panes: closed bodies of a smooth transmissive volume whose two faces are parallel, at most 2 %
//! as thick as wide, with nothing in them. A pane lies halfway between the faces and passes and reflects what the slab
//! does with all that goes to and fro in it, so that light goes straight through for every ray, shadow rays among them.
//! What is lost is the shift of a ray across the slab, less than its thickness.

use super::profile::DELTA_ROUGHNESS;
use super::{AlphaMode, Material, Scene};
use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// The thickest slab by its width.
const THICKNESS: f64 = 0.02;
/// Sine of the largest angle (0.5°) between the normals of one face, or of both.
const PARALLEL: f64 = 0.008_727;
/// Outline edges along which the width is measured at most.
const EDGES: usize = 64;

/// A slab of a mesh, in the world.
struct Slab {
    /// Triangles of one face.
    face: Vec<usize>,
    /// All of its triangles.
    all: Vec<usize>,
    normal: DVec3,
    thickness: f64,
    /// Optical depth across, by channel.
    depth: DVec3,
}

/// Replaces slabs by panes and says how many. Instances of a mesh that differ in which of its bodies are slabs, or how thick
/// those are that absorb, get meshes of their own.
pub(super) fn become_panes(scene: &mut Scene) {
    let may_be: Vec<bool> = scene.materials.iter().map(may_be_slab).collect();
    if !may_be.contains(&true) {
        return;
    }
    let vertices = Vertices::of(scene);
    let mut made: HashMap<(u32, [u32; 3]), u32> = HashMap::new();
    let mut count = 0;
    for index in 0..scene.meshes.len() {
        let parts = parts(scene, index, &may_be);
        if parts.is_empty() {
            continue;
        }
        let mut groups: Vec<(Vec<Option<Slab>>, Vec<usize>)> = Vec::new();
        for place in (0..scene.instances.len()).filter(|&i| scene.instances[i].mesh as usize == index) {
            let find =
                |part: &Vec<usize>| slab(scene, place, part).filter(|s| vertices.none_in(s, scene, place));
            let slabs: Vec<Option<Slab>> = parts.iter().map(find).collect();
            match groups.iter_mut().find(|(others, _)| alike(others, &slabs)) {
                Some((_, places)) => places.push(place),
                None => groups.push((slabs, vec![place])),
            }
        }
        let original = (groups.len() > 1).then(|| scene.meshes[index].clone());
        for (nth, (slabs, places)) in groups.iter().enumerate() {
            let mut mesh = index;
            if let Some(original) = original.as_ref().filter(|_| nth > 0) {
                mesh = scene.meshes.len();
                scene.meshes.push(original.clone());
                places.iter().for_each(|&place| scene.instances[place].mesh = mesh as u32);
            }
            let mut gone = vec![false; scene.meshes[mesh].triangles.len()];
            for slab in slabs.iter().flatten() {
                let source = scene.meshes[mesh].materials[slab.all[0]];
                let depth = slab.depth.as_vec3();
                let material =
                    *made.entry((source, depth.to_array().map(f32::to_bits))).or_insert_with(|| {
                        let pane = pane_of(&scene.materials[source as usize], depth);
                        scene.materials.push(pane);
                        scene.materials.len() as u32 - 1
                    });
                place_pane(scene, mesh, places[0], slab, material);
                slab.all.iter().for_each(|&triangle| gone[triangle] = true);
                count += places.len();
            }
            remove(scene, mesh, &gone);
        }
    }
    match count {
        0 => {}
        1 => scene.notes.push("a flat slab of glass is a pane: light goes straight through".into()),
        _ => scene.notes.push(format!("{count} flat slabs of glass are panes: light goes straight through")),
    }
}

/// Whether the same bodies are slabs that absorb the same, within 1 %.
fn alike(some: &[Option<Slab>], others: &[Option<Slab>]) -> bool {
    some.iter().zip(others).all(|(a, b)| match (a, b) {
        (Some(a), Some(b)) => (a.depth - b.depth).abs().cmple(0.01 * a.depth).all(),
        (None, None) => true,
        _ => false,
    })
}

pub(super) fn may_be_slab(material: &Material) -> bool {
    material.volume.is_some()
        && !material.unlit
        && material.transmission == 1.0
        && material.metallic == 0.0
        && material.roughness <= DELTA_ROUGHNESS
        && material.specular == 1.0
        && material.specular_color == Vec3::ONE
        && material.clearcoat.is_none()
        && material.emission == Vec3::ZERO
        && material.alpha_mode == AlphaMode::Opaque
        && material.textures().next().is_none()
}

fn pane_of(material: &Material, depth: Vec3) -> Material {
    let color = material.base_color.truncate();
    Material {
        name: format!("{} (pane)", material.name),
        base_color: (color * color).extend(material.base_color.w),
        volume: None,
        slab: Some(depth),
        ..material.clone()
    }
}

/// Triangles of bodies that hang together by their corners, of one material that may be a slab's.
fn parts(scene: &Scene, mesh: usize, may_be: &[bool]) -> Vec<Vec<usize>> {
    let mesh = &scene.meshes[mesh];
    if !mesh.colors.iter().all(|&color| color == glam::Vec4::ONE) {
        return Vec::new();
    }
    let mut at: HashMap<(u32, [u32; 3]), usize> = HashMap::new();
    let mut root: Vec<usize> = Vec::new();
    fn find(root: &mut [usize], mut i: usize) -> usize {
        while root[i] != i {
            root[i] = root[root[i]];
            i = root[i];
        }
        i
    }
    let mut bodies: Vec<(usize, usize)> = Vec::new();
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        let material = mesh.materials[index];
        if !may_be[material as usize] {
            continue;
        }
        let corners = triangle.map(|v| {
            *at.entry((material, key(mesh.positions[v as usize]))).or_insert_with(|| {
                root.push(root.len());
                root.len() - 1
            })
        });
        let first = find(&mut root, corners[0]);
        for corner in &corners[1..] {
            let other = find(&mut root, *corner);
            root[other] = first;
        }
        bodies.push((index, corners[0]));
    }
    let mut parts: Vec<Vec<usize>> = Vec::new();
    let mut place: HashMap<usize, usize> = HashMap::new();
    for (triangle, corner) in bodies {
        let body = find(&mut root, corner);
        let slot = *place.entry(body).or_insert_with(|| {
            parts.push(Vec::new());
            parts.len() - 1
        });
        parts[slot].push(triangle);
    }
    parts
}

/// Bits of a position, both zeros alike.
fn key(position: Vec3) -> [u32; 3] {
    (position + 0.0).to_array().map(f32::to_bits)
}

/// The body as a slab where an instance places it, if it is one.
fn slab(scene: &Scene, place: usize, part: &[usize]) -> Option<Slab> {
    let instance = &scene.instances[place];
    let mesh = &scene.meshes[instance.mesh as usize];
    let corners = |triangle: usize| {
        mesh.triangles[triangle]
            .map(|v| instance.transform.transform_point3(mesh.positions[v as usize]).as_dvec3())
    };
    if !closed(part.iter().map(|&triangle| mesh.triangles[triangle].map(|v| key(mesh.positions[v as usize]))))
    {
        return None;
    }
    let across = |[a, b, c]: [DVec3; 3]| 0.5 * (b - a).cross(c - a);
    let areas: Vec<DVec3> = part.iter().map(|&triangle| across(corners(triangle))).collect();
    let normal = areas.iter().copied().max_by(|a, b| a.length().total_cmp(&b.length()))?.normalize_or_zero();
    let (mut face, mut back, mut rest) = (Vec::new(), 0.0, 0.0);
    let mut front = 0.0;
    for (&triangle, area) in part.iter().zip(&areas) {
        if area.cross(normal).length() > PARALLEL * area.length() {
            rest += area.length();
        } else if area.dot(normal) > 0.0 {
            face.push(triangle);
            front += area.length();
        } else {
            back += area.length();
        }
    }
    let origin = corners(part[0])[0];
    // By the divergence theorem; inside out where a mirror turned it.
    let volume: f64 = part
        .iter()
        .zip(&areas)
        .map(|(&triangle, area)| (corners(triangle)[0] - origin).dot(*area) / 3.0)
        .sum();
    let thickness = volume.abs() / front.max(f64::MIN_POSITIVE);
    let heights = part.iter().flat_map(|&triangle| corners(triangle)).map(|p| (p - origin).dot(normal));
    let (low, high) =
        heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| (low.min(h), high.max(h)));
    let width = width(&face.iter().map(|&triangle| corners(triangle)).collect::<Vec<_>>(), normal);
    let flat = thickness > 0.0
        && thickness <= 1.001 * THICKNESS * width
        && high - low <= 1.5 * thickness + PARALLEL * width
        && (front - back).abs() <= 0.05 * front
        && rest <= 0.2 * front;
    // Outwards from the middle.
    let outwards = if volume < 0.0 { -normal } else { normal };
    let volume = scene.materials[mesh.materials[part[0]] as usize].volume?;
    let depth = volume.absorption().as_dvec3() * thickness;
    flat.then(|| Slab { face, all: part.to_vec(), normal: outwards, thickness, depth })
}

/// Whether every edge is met once each way.
fn closed(triangles: impl Iterator<Item = [[u32; 3]; 3]>) -> bool {
    let mut edges: HashMap<([u32; 3], [u32; 3]), i32> = HashMap::new();
    let mut once = true;
    for [a, b, c] in triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            once &= edges.insert((from, to), 1).is_none();
        }
    }
    once && edges.keys().all(|&(from, to)| edges.contains_key(&(to, from)))
}

/// The least extent (m) of a face, along the normals of its edges: the least of a convex outline lies along one.
fn width(face: &[[DVec3; 3]], normal: DVec3) -> f64 {
    let points: Vec<DVec3> = face.iter().flatten().copied().collect();
    let mut edges: Vec<DVec3> =
        face.iter().flat_map(|&[a, b, c]| [b - a, c - b, a - c]).map(|edge| edge.cross(normal)).collect();
    edges.sort_by(|a, b| b.length().total_cmp(&a.length()));
    edges.truncate(EDGES);
    let extent = |along: DVec3| {
        let along = along.normalize_or_zero();
        let (low, high) = points
            .iter()
            .map(|p| (*p - points[0]).dot(along))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        high - low
    };
    edges.into_iter().map(extent).reduce(f64::min).unwrap_or(0.0)
}

/// Adds the face, moved to the middle of the slab.
fn place_pane(scene: &mut Scene, mesh: usize, place: usize, slab: &Slab, material: u32) {
    let to_object = scene.instances[place].transform.inverse();
    let inwards = to_object.transform_vector3((slab.normal * (-0.5 * slab.thickness)).as_vec3());
    let mesh = scene.mesh_mut(mesh);
    let mut moved: HashMap<u32, u32> = HashMap::new();
    for &triangle in &slab.face {
        let corners = mesh.triangles[triangle].map(|v| {
            *moved.entry(v).or_insert_with(|| {
                let from = v as usize;
                mesh.positions.push(mesh.positions[from] + inwards);
                if !mesh.normals.is_empty() {
                    mesh.normals.push(Vec3::ZERO);
                }
                if !mesh.uv0.is_empty() {
                    mesh.uv0.push(mesh.uv0[from]);
                }
                if !mesh.uv1.is_empty() {
                    mesh.uv1.push(mesh.uv1[from]);
                }
                if !mesh.colors.is_empty() {
                    mesh.colors.push(mesh.colors[from]);
                }
                mesh.positions.len() as u32 - 1
            })
        });
        mesh.triangles.push(corners);
        mesh.materials.push(material);
        if !mesh.tangents.is_empty() {
            mesh.tangents.push(mesh.tangents[triangle]);
        }
    }
}

/// Drops the triangles that are gone; those added behind stay.
fn remove(scene: &mut Scene, mesh: usize, gone: &[bool]) {
    if !gone.contains(&true) {
        return;
    }
    let mesh = scene.mesh_mut(mesh);
    let stays = |index: usize| gone.get(index).is_none_or(|gone| !gone);
    let mut index = 0..;
    mesh.triangles.retain(|_| stays(index.next().unwrap_or_default()));
    index = 0..;
    mesh.materials.retain(|_| stays(index.next().unwrap_or_default()));
    index = 0..;
    mesh.tangents.retain(|_| stays(index.next().unwrap_or_default()));
}

/// Every vertex of a triangle in the world, in order of x.
struct Vertices {
    sorted: Vec<(f32, u32, u32)>,
}

impl Vertices {
    fn of(scene: &Scene) -> Self {
        let mut sorted = Vec::new();
        for (place, instance) in (0_u32..).zip(&scene.instances) {
            let mesh = &scene.meshes[instance.mesh as usize];
            let mut used = vec![false; mesh.positions.len()];
            mesh.triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
            for (vertex, _) in (0_u32..).zip(&mesh.positions).filter(|&(v, _)| used[v as usize]) {
                let x = instance.transform.transform_point3(mesh.positions[vertex as usize]).x;
                sorted.push((x, place, vertex));
            }
        }
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self { sorted }
    }

    /// Whether none lies in a slab but between its faces' own.
    fn none_in(&self, slab: &Slab, scene: &Scene, place: usize) -> bool {
        let at = |place: u32, vertex: u32| {
            let instance = &scene.instances[place as usize];
            let mesh = &scene.meshes[instance.mesh as usize];
            instance.transform.transform_point3(mesh.positions[vertex as usize]).as_dvec3()
        };
        let mesh = &scene.meshes[scene.instances[place].mesh as usize];
        let face: Vec<[DVec3; 3]> =
            slab.face.iter().map(|&t| mesh.triangles[t].map(|v| at(place as u32, v))).collect();
        let (low, high) = face
            .iter()
            .flatten()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p.x), high.max(p.x)));
        let reach = slab.thickness;
        let first = self.sorted.partition_point(|v| f64::from(v.0) < low - reach);
        self.sorted[first..].iter().take_while(|v| f64::from(v.0) <= high + reach).all(
            |&(_, place, vertex)| {
                let p = at(place, vertex);
                !face.iter().any(|&[a, b, c]| {
                    let depth = (a - p).dot(slab.normal) / slab.thickness;
                    let side = |a: DVec3, b: DVec3| (b - a).cross(p - a).dot(slab.normal);
                    let sides = [side(a, b), side(b, c), side(c, a)];
                    let inside = sides.iter().all(|&s| s > 0.0) || sides.iter().all(|&s| s < 0.0);
                    inside && depth > 1e-3 && depth < 1.0 - 1e-3
                })
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Instance, Mesh, Volume};
    use glam::{Affine3A, Quat, vec3};

    /// A box from the origin, faces outwards; corner 6 is the far one.
    fn block(size: Vec3) -> Mesh {
        let at = |i: u32| size * vec3((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32);
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let triangles: Vec<_> = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let materials = vec![0; triangles.len()];
        Mesh { positions: (0..8).map(at).collect(), triangles, materials, ..Mesh::default() }
    }

    fn glass() -> Material {
        let volume = Volume { attenuation_distance: 0.02, attenuation_color: vec3(1.0, 0.5, 0.25) };
        let base_color = vec3(0.5, 1.0, 1.0).extend(1.0);
        Material {
            base_color,
            metallic: 0.0,
            roughness: 0.0,
            transmission: 1.0,
            volume: Some(volume),
            ..Material::default()
        }
    }

    fn placed(mesh: Mesh, transforms: &[Affine3A]) -> Scene {
        let instance =
            |&transform: &Affine3A| Instance { name: String::new(), mesh: 0, transform, moves: false };
        Scene {
            meshes: vec![mesh.into()],
            instances: transforms.iter().map(instance).collect(),
            materials: vec![glass()],
            ..Scene::default()
        }
    }

    /// Whether it is a pane now; nothing else changes otherwise.
    fn is_pane(mut scene: Scene) -> bool {
        let before = scene.meshes[0].triangles.len();
        become_panes(&mut scene);
        let mesh = &scene.meshes[0];
        let pane = mesh.triangles.len() == 2;
        assert!(
            pane || mesh.triangles.len() == before && scene.materials.len() == 1 && scene.notes.is_empty()
        );
        pane
    }

    #[test]
    fn a_flat_slab_becomes_a_pane_in_its_middle() {
        let turned = Affine3A::from_rotation_translation(Quat::from_rotation_y(0.7), vec3(1.0, 2.0, 3.0));
        for transform in [Affine3A::IDENTITY, turned, Affine3A::from_scale(vec3(-1.0, 1.0, 1.0)) * turned] {
            let mut scene = placed(block(vec3(1.0, 2.0, 0.02)), &[transform]);
            become_panes(&mut scene);
            let mesh = &scene.meshes[0];
            assert_eq!((mesh.triangles.len(), mesh.materials.len()), (2, 2));
            for &corner in mesh.triangles.iter().flatten() {
                let p = mesh.positions[corner as usize];
                assert!(
                    (p.z - 0.01).abs() < 1e-6 && (p.x - 0.5).abs() == 0.5 && (p.y - 1.0).abs() == 1.0,
                    "{p}"
                );
            }
            let material = &scene.materials[mesh.materials[0] as usize];
            let depth = material.slab.unwrap();
            assert!(depth.abs_diff_eq(vec3(0.0, 2.0_f32.ln(), 4.0_f32.ln()), 1e-4), "{depth}");
            assert!(material.volume.is_none() && material.base_color == vec3(0.25, 1.0, 1.0).extend(1.0));
            assert_eq!(scene.notes.len(), 1);
            scene.validate().unwrap();
        }
    }

    #[test]
    fn other_bodies_stay_what_they_are() {
        let one = [Affine3A::IDENTITY];
        let slab = || block(vec3(1.0, 2.0, 0.015));
        assert!(is_pane(placed(slab(), &one)));
        assert!(!is_pane(placed(block(vec3(1.0, 2.0, 0.021)), &one)), "too thick");
        let mut open = slab();
        open.triangles.pop();
        open.materials.pop();
        assert!(!is_pane(placed(open, &one)), "open");
        for (tilt, expected) in [(0.4_f32, true), (0.7, false)] {
            let mut wedge = slab();
            for i in [5, 7] {
                wedge.positions[i].z += tilt.to_radians().tan();
            }
            assert_eq!(is_pane(placed(wedge, &one)), expected, "{tilt}° from parallel");
        }
        // Absorption is by thickness, and what is too thick stays a body: each instance has its own mesh then.
        let scales = [1.0, 2.0, 1.0].map(|z| Affine3A::from_scale(vec3(1.0, 1.0, z)));
        let mut several = placed(slab(), &scales);
        become_panes(&mut several);
        let triangles = |place: usize| several.meshes[several.instances[place].mesh as usize].triangles.len();
        assert_eq!([0, 1, 2].map(triangles), [2, 12, 2]);
        assert_eq!((several.meshes.len(), several.materials.len(), several.notes.len()), (2, 2, 1));
        let scales = [Affine3A::IDENTITY, Affine3A::from_scale(vec3(1.0, 1.0, 0.5))];
        let mut thin = placed(slab(), &scales);
        become_panes(&mut thin);
        let depths =
            [0, 1].map(|mesh: usize| thin.materials[thin.meshes[mesh].materials[0] as usize].slab.unwrap().y);
        assert!((depths[0] / depths[1] - 2.0).abs() < 1e-4, "{depths:?}");
        let mut clear = placed(slab(), &scales);
        clear.materials[0].volume =
            Some(Volume { attenuation_distance: f32::INFINITY, attenuation_color: Vec3::ONE });
        assert!(is_pane(clear));
        let mut speck = block(Vec3::splat(0.002));
        speck.materials.fill(1);
        let mut filled = placed(slab(), &one);
        filled.meshes.push(speck.into());
        filled.materials.push(Material::default());
        let transform = Affine3A::from_translation(vec3(0.5, 0.7, 0.006));
        filled.instances.push(Instance { name: String::new(), mesh: 1, transform, moves: false });
        become_panes(&mut filled);
        assert_eq!(filled.meshes[0].triangles.len(), 12, "something is inside");
        let changes: [fn(&mut Material); 4] = [
            |m| m.roughness = 0.2,
            |m| m.transmission = 0.9,
            |m| m.alpha_mode = AlphaMode::Blend,
            |m| m.specular = 0.5,
        ];
        for change in changes {
            let mut scene = placed(slab(), &one);
            change(&mut scene.materials[0]);
            assert!(!is_pane(scene));
        }
    }
}
