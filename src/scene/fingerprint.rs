use super::{Camera, Scene};
use glam::DVec3;
use std::fmt::{self, Write};

/// FNV-1a, 64 bits.
struct Fnv(u64);

impl Fnv {
    fn bytes(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }

    /// An array and its length, so that no two arrays run into each other.
    fn array<T: bytemuck::NoUninit>(&mut self, array: &[T]) {
        self.bytes(&(array.len() as u64).to_le_bytes());
        self.bytes(bytemuck::cast_slice(array));
    }
}

impl Write for Fnv {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.bytes(text.as_bytes());
        Ok(())
    }
}

impl Scene {
    /// A number that changes with anything that a picture seen by `camera` depends on: geometry, materials, images,
    /// lights, environment and camera. The same on every machine of one byte order.
    #[must_use]
    pub fn fingerprint(&self, camera: &Camera) -> u64 {
        let mut hash = Fnv(0xcbf2_9ce4_8422_2325);
        for mesh in &self.meshes {
            hash.array(&mesh.positions);
            hash.array(&mesh.normals);
            hash.array(&mesh.tangents);
            hash.array(&mesh.uv0);
            hash.array(&mesh.uv1);
            hash.array(&mesh.colors);
            hash.array(&mesh.triangles);
            hash.array(&mesh.materials);
        }
        for image in &self.images {
            hash.array(&[image.width, image.height]);
            hash.array(&image.texels);
        }
        if let Some(environment) = &self.environment {
            hash.array(&[environment.width, environment.height]);
            hash.array(&environment.texels);
        }
        // Debug output of floats tells them apart.
        let instances: Vec<_> = self.instances.iter().map(|i| (&i.name, i.mesh, i.transform)).collect();
        let rest = (instances, &self.materials, &self.lights, camera.transform, camera.view);
        // Writing to a hash never fails.
        let _ = write!(hash, "{rest:?}");
        for deformation in &self.deformations {
            let _ = write!(hash, "{:?}", deformation.key());
        }
        if self.origin != DVec3::ZERO {
            hash.array(&self.origin.to_array());
        }
        hash.0
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::{Environment, builtin};
    use glam::Vec3;

    #[test]
    fn everything_seen_counts() {
        let scene = builtin::by_name("cornell").unwrap();
        let camera = scene.cameras[0].clone();
        let print = scene.fingerprint(&camera);
        assert_eq!(print, builtin::by_name("cornell").unwrap().fingerprint(&camera));
        let mut prints = vec![print];
        let mut other = scene.clone();
        other.mesh_mut(0).positions[0].x += 1e-3;
        prints.push(other.fingerprint(&camera));
        let mut other = scene.clone();
        other.materials[0].roughness *= 0.999;
        prints.push(other.fingerprint(&camera));
        let mut other = scene.clone();
        other.lights.clear();
        prints.push(other.fingerprint(&camera));
        let mut other = scene.clone();
        other.environment = Some(Environment::constant(Vec3::ONE).into());
        prints.push(other.fingerprint(&camera));
        let mut moved = camera.clone();
        moved.transform.translation.x += 1e-3;
        prints.push(scene.fingerprint(&moved));
        let count = prints.len();
        prints.sort_unstable();
        prints.dedup();
        assert_eq!(prints.len(), count);
    }
}
