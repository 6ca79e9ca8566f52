//! Cameras on a way: positions by key times.

use super::{Camera, Scene};
use crate::read;
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A camera's way in the file's coordinates: through all keys, smooth between them (cubic Hermite splines, whose slope at a key
/// is that from the key before to the one behind), still before the first and after the last.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraPath {
    /// By increasing time, at least one.
    #[serde(rename = "key")]
    pub keys: Vec<CameraKey>,
}

/// Where a camera is at a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraKey {
    /// Seconds.
    pub time: f64,
    /// Its position (m).
    #[serde(deserialize_with = "point")]
    pub eye: [f64; 3],
    /// The point it looks at (m).
    #[serde(deserialize_with = "point")]
    pub look_at: [f64; 3],
    /// Vertical field of view (degrees).
    #[serde(default = "fov")]
    pub fov: f64,
}

fn fov() -> f64 {
    45.0
}

/// Three numbers, no more.
fn point<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<[f64; 3], D::Error> {
    let numbers = Vec::<f64>::deserialize(deserializer)?;
    let wrong = |numbers: Vec<f64>| serde::de::Error::invalid_length(numbers.len(), &"three numbers");
    numbers.try_into().map_err(wrong)
}

/// No key is further off (m, s).
const LIMIT: f64 = 1e10;

impl CameraKey {
    fn numbers(&self) -> [f64; 7] {
        let ([a, b, c], [d, e, f]) = (self.eye, self.look_at);
        [a, b, c, d, e, f, self.fov]
    }
}

impl CameraPath {
    /// Reads a TOML file: a table `[[key]]` with `time`, `eye`, `look_at` and, if it is not 45, `fov` for each key.
    ///
    /// # Errors
    /// What is wrong with the file or a key, without the file's name.
    pub fn read(file: &Path) -> Result<Self, String> {
        let text = read::text(file, read::SETTINGS).map_err(|error| error.to_string())?;
        let path: Self = toml::from_str(&text).map_err(|error| error.to_string().trim_end().to_owned())?;
        path.check()?;
        Ok(path)
    }

    /// Whether the keys are such.
    ///
    /// # Errors
    /// The first that is not, in words.
    pub fn check(&self) -> Result<(), String> {
        if self.keys.is_empty() {
            return Err("it has no key".into());
        }
        for (i, key) in self.keys.iter().enumerate() {
            if let Some(number) =
                key.numbers().iter().chain([&key.time]).find(|n| !(-LIMIT..=LIMIT).contains(*n))
            {
                return Err(format!("{number} of key {i} is not within {LIMIT:e}"));
            }
            if i > 0 && key.time <= self.keys[i - 1].time {
                return Err(format!("key {i} is not later than the one before"));
            }
            if !(key.fov > 0.0 && key.fov < 180.0) {
                return Err(format!("fov of key {i} is {}, expected more than 0 and less than 180", key.fov));
            }
            if key.eye == key.look_at {
                return Err(format!("eye and look_at of key {i} are the same point"));
            }
        }
        Ok(())
    }

    /// The camera at a time (s), in the coordinates of `scene`.
    #[must_use]
    pub fn camera(&self, time: f64, scene: &Scene) -> Camera {
        let behind = self.keys.partition_point(|key| key.time <= time);
        let last = self.keys.len() - 1;
        let [a, b] = [behind.saturating_sub(1), behind.min(last)];
        let (from, to) = (self.keys[a].numbers(), self.keys[b].numbers());
        let length = self.keys[b].time - self.keys[a].time;
        let t = if length > 0.0 { (time - self.keys[a].time) / length } else { 0.0 };
        let slope = |key: usize, i: usize| {
            let [before, after] = [&self.keys[key.saturating_sub(1)], &self.keys[(key + 1).min(last)]];
            match after.time - before.time {
                0.0 => 0.0,
                time => (after.numbers()[i] - before.numbers()[i]) / time,
            }
        };
        let (t2, t3) = (t * t, t * t * t);
        let [ex, ey, ez, lx, ly, lz, fov] = std::array::from_fn(|i| {
            (2.0 * t3 - 3.0 * t2 + 1.0) * from[i]
                + (3.0 * t2 - 2.0 * t3) * to[i]
                + length * ((t3 - 2.0 * t2 + t) * slope(a, i) + (t3 - t2) * slope(b, i))
        });
        let fov = (fov.clamp(0.1, 179.9) as f32).to_radians();
        let [eye, look_at] = [DVec3::new(ex, ey, ez), DVec3::new(lx, ly, lz)].map(|p| scene.local(p));
        Camera::look_at("camera path", eye, look_at, fov)
    }
}

impl Camera {
    /// The same camera turned around a vertical axis through `pivot` by so many radians, to the left as it sees it.
    #[must_use]
    pub fn turned(&self, pivot: Vec3, angle: f32) -> Self {
        let turn = glam::Affine3A::from_rotation_y(angle);
        let mut camera = self.clone();
        camera.transform.matrix3 = turn.matrix3 * self.transform.matrix3;
        let from = Vec3::from(self.transform.translation) - pivot;
        camera.transform.translation = (pivot + turn.transform_vector3(from)).into();
        camera
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::View;

    fn key(time: f64, x: f64) -> CameraKey {
        CameraKey { time, eye: [x, 1.0, 0.0], look_at: [x, 1.0, -2.0], fov: 30.0 + x }
    }

    #[test]
    fn keys_are_met_and_equal_steps_are_a_straight_line() {
        let path = CameraPath { keys: vec![key(1.0, 0.0), key(2.0, 1.0), key(3.0, 2.0), key(4.0, 3.0)] };
        path.check().unwrap();
        let scene = Scene::default();
        // Inner stretches of an even path are straight and even; ends stay.
        for (time, x) in [(0.0, 0.0), (1.0, 0.0), (2.0, 1.0), (2.5, 1.5), (3.0, 2.0), (4.0, 3.0), (9.0, 3.0)]
        {
            let camera = path.camera(time, &scene);
            let expected = Camera::look_at(
                "camera path",
                Vec3::new(x, 1.0, 0.0),
                Vec3::new(x, 1.0, -2.0),
                (30.0 + x).to_radians(),
            );
            assert!(camera.transform.abs_diff_eq(expected.transform, 1e-6), "{time}");
            let (View::Perspective { yfov: a }, View::Perspective { yfov: b }) = (camera.view, expected.view)
            else {
                panic!()
            };
            assert!((a - b).abs() < 1e-6);
        }
        let one = CameraPath { keys: vec![key(5.0, 2.0)] };
        assert_eq!(one.camera(-1.0, &scene), one.camera(7.0, &scene));
    }

    #[test]
    fn broken_keys_are_told_by_number() {
        let broken = |keys: Vec<CameraKey>| CameraPath { keys }.check().unwrap_err();
        assert!(broken(Vec::new()).contains("no key"));
        assert!(broken(vec![key(1.0, 0.0), key(1.0, 1.0)]).contains("key 1 is not later"));
        assert!(broken(vec![key(f64::NAN, 0.0)]).contains("of key 0 is not within"));
        assert!(broken(vec![key(0.0, 200.0)]).contains("fov of key 0"));
        assert!(broken(vec![CameraKey { look_at: [0.0, 1.0, 0.0], ..key(0.0, 0.0) }]).contains("same point"));
    }

    #[test]
    fn a_turntable_closes() {
        let camera = Camera::look_at("c", Vec3::new(2.0, 1.0, 0.0), Vec3::ZERO, 1.0);
        let quarter = camera.turned(Vec3::ZERO, std::f32::consts::FRAC_PI_2);
        let expected = Camera::look_at("c", Vec3::new(0.0, 1.0, -2.0), Vec3::ZERO, 1.0);
        assert!(quarter.transform.abs_diff_eq(expected.transform, 1e-6));
        let whole = camera.turned(Vec3::ZERO, std::f32::consts::TAU);
        assert!(whole.transform.abs_diff_eq(camera.transform, 1e-5));
    }
}
