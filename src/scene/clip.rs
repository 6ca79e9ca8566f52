//! Values over time: keys and what lies between them (glTF 2.0, section 3.11 and appendix C).

use glam::{DQuat, DVec4, Vec4};
use std::collections::HashSet;

/// How values between two keys follow from them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// The earlier key's.
    Step,
    /// Straight from one to the other; rotations along the shorter arc, at an even speed.
    Linear,
    /// Hermite splines: each key has an in-tangent, a value and an out-tangent.
    CubicSpline,
}

/// Values at key times (s), as many numbers for each. Before the first key and after the last there is no change.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    times: Vec<f32>,
    values: Vec<f32>,
    interpolation: Interpolation,
    width: usize,
}

impl Track {
    /// `values` are key by key, of splines the in-tangent, the value and the out-tangent of each.
    ///
    /// # Errors
    /// No key, times that fall, numbers that are not finite, or not as many values for each key.
    pub fn new(interpolation: Interpolation, times: Vec<f32>, values: Vec<f32>) -> Result<Self, String> {
        let keys = times.len();
        if keys == 0 {
            return Err("it has no key".into());
        }
        if let Some(i) = times.iter().chain(&values).position(|value| !value.is_finite()) {
            return Err(match times.get(i) {
                Some(time) => format!("the time of key {i} is {time}"),
                None => format!("value {} is {}", i - keys, values[i - keys]),
            });
        }
        if let Some(i) = (1..keys).find(|&i| times[i] < times[i - 1]) {
            let [before, time] = [times[i - 1], times[i]];
            return Err(format!(
                "its keys are not in order: key {i} is at {time} s, the one before at {before} s"
            ));
        }
        let parts = keys * if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        if values.is_empty() || !values.len().is_multiple_of(parts) {
            return Err(format!("{} values for {keys} keys", values.len()));
        }
        Ok(Self { width: values.len() / parts, times, values, interpolation })
    }

    /// Numbers of a value.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// The time of the last key (s).
    #[must_use]
    pub fn end(&self) -> f64 {
        f64::from(self.times[self.times.len() - 1])
    }

    /// Makes values of four numbers unit quaternions, and says by how much the worst was off in length; none if one has no
    /// direction. Tangents stay.
    pub(crate) fn normalise(&mut self) -> Option<f32> {
        let part = usize::from(self.interpolation == Interpolation::CubicSpline);
        let mut worst = 0.0_f32;
        for key in self.values.chunks_exact_mut(4 * (1 + 2 * part)) {
            let value = &mut key[4 * part..4 * part + 4];
            let length = Vec4::from_slice(value).length();
            if length == 0.0 {
                return None;
            }
            if (length - 1.0).abs() > 1e-2 {
                worst = worst.max((length - 1.0).abs());
                value.iter_mut().for_each(|number| *number /= length);
            }
        }
        Some(worst)
    }

    /// The value at a time (s).
    #[must_use]
    pub fn at(&self, time: f64) -> Vec<f64> {
        self.mixed(time, |a, b, t| a.iter().zip(b).map(|(a, b)| a + t * (b - a)).collect())
    }

    /// The unit quaternion at a time (s), of values of four numbers: x, y, z, w.
    #[must_use]
    pub fn rotation_at(&self, time: f64) -> DQuat {
        let of = |v: &[f64]| DVec4::from_slice(v);
        let value = self.mixed(time, |a, b, t| slerp(of(a), of(b), t).to_array().into());
        match of(&value).try_normalize() {
            Some(unit) => DQuat::from_vec4(unit),
            None => DQuat::IDENTITY,
        }
    }

    /// Number `part` of key `key`: 0 the in-tangent, 1 the value, 2 the out-tangent.
    fn key(&self, key: usize, part: usize) -> Vec<f64> {
        let start = match self.interpolation {
            Interpolation::CubicSpline => 3 * key + part,
            _ => key,
        } * self.width;
        self.values[start..start + self.width].iter().map(|&value| f64::from(value)).collect()
    }

    fn mixed(&self, time: f64, straight: impl Fn(&[f64], &[f64], f64) -> Vec<f64>) -> Vec<f64> {
        // A frame's time is often a key's, but for the rounding of keys.
        let time = f64::from(time as f32);
        let passed = self.times.partition_point(|&key| f64::from(key) <= time);
        let Some(before) = passed.checked_sub(1) else { return self.key(0, 1) };
        if passed == self.times.len() || self.interpolation == Interpolation::Step {
            return self.key(before, 1);
        }
        let [start, end] = [before, passed].map(|key| f64::from(self.times[key]));
        let (length, t) = (end - start, (time - start) / (end - start));
        let (a, b) = (self.key(before, 1), self.key(passed, 1));
        if self.interpolation == Interpolation::Linear {
            return straight(&a, &b, t);
        }
        let (leaving, arriving) = (self.key(before, 2), self.key(passed, 0));
        let (t2, t3) = (t * t, t * t * t);
        let of = |i: usize| {
            (2.0 * t3 - 3.0 * t2 + 1.0) * a[i]
                + length * (t3 - 2.0 * t2 + t) * leaving[i]
                + (3.0 * t2 - 2.0 * t3) * b[i]
                + length * (t3 - t2) * arriving[i]
        };
        (0..self.width).map(of).collect()
    }
}

/// Along the shorter arc from one unit quaternion to another.
fn slerp(a: DVec4, b: DVec4, t: f64) -> DVec4 {
    let cosine = a.dot(b);
    let b = if cosine < 0.0 { -b } else { b };
    let angle = cosine.abs().min(1.0).acos();
    // So close that the arc is straight.
    if angle < 1e-6 {
        return a.lerp(b, t);
    }
    (a * (angle * (1.0 - t)).sin() + b * (angle * t).sin()) / angle.sin()
}

/// What moves, and what of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Target {
    /// A node of the file.
    Node(u32, NodeProperty),
    /// A light source of the file, wherever nodes place it.
    Light(u32, LightProperty),
    /// A camera of the file, wherever nodes place it.
    Camera(u32, CameraProperty),
    /// A material.
    Material(u32, MaterialProperty),
}

/// What moves of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum NodeProperty {
    /// In its parent (m).
    Translation,
    /// In its parent, a quaternion.
    Rotation,
    /// Along its own axes.
    Scale,
    /// Of its mesh's morph targets.
    Weights,
    /// Whether it and all below it are there: 0 hides them.
    Visible,
}

/// What changes of a light source.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LightProperty {
    /// Linear Rec. 709.
    Color,
    /// W/sr or, of a directional one, W/m².
    Intensity,
    /// Half-angle of full intensity (radians).
    InnerCone,
    /// Half-angle of none (radians).
    OuterCone,
}

/// What changes of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CameraProperty {
    /// Vertical field of view (radians).
    Yfov,
    /// Half of the visible height (m).
    Ymag,
}

/// What changes of a material; as of [`Material`](crate::scene::Material)'s fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)] // the fields' names
pub enum MaterialProperty {
    BaseColor,
    Metallic,
    Roughness,
    /// Emission is this times the strength.
    EmissiveFactor,
    EmissiveStrength,
    AlphaCutoff,
    NormalScale,
    Ior,
    Transmission,
    Specular,
    SpecularColor,
    Clearcoat,
    ClearcoatRoughness,
    AttenuationDistance,
    AttenuationColor,
}

impl Target {
    /// Numbers of its value; any number of a node's weights.
    #[must_use]
    pub fn width(self) -> Option<usize> {
        use MaterialProperty::{AttenuationColor, BaseColor, EmissiveFactor, SpecularColor};
        match self {
            Self::Node(_, NodeProperty::Weights) => None,
            Self::Node(_, NodeProperty::Rotation) | Self::Material(_, BaseColor) => Some(4),
            Self::Node(_, NodeProperty::Translation | NodeProperty::Scale)
            | Self::Light(_, LightProperty::Color)
            | Self::Material(_, EmissiveFactor | SpecularColor | AttenuationColor) => Some(3),
            _ => Some(1),
        }
    }
}

/// One property's values over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// What it moves.
    pub target: Target,
    /// Its values.
    pub track: Track,
}

/// An animation: what it moves, from time 0 on.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    /// As in the file, or made up.
    pub name: String,
    /// Which of the file's animations it is.
    pub index: usize,
    /// At most one for each property.
    pub channels: Vec<Channel>,
}

impl Clip {
    /// The time of the last key (s).
    #[must_use]
    pub fn end(&self) -> f64 {
        self.channels.iter().map(|channel| channel.track.end()).fold(0.0, f64::max)
    }
}

/// Clips that can be played together: the first, and each that moves nothing which an earlier one of them moves.
pub(super) fn together(clips: &[Clip]) -> Vec<usize> {
    let (mut moved, mut together) = (HashSet::new(), Vec::new());
    for (index, clip) in clips.iter().enumerate() {
        let targets = || clip.channels.iter().map(|channel| channel.target);
        if targets().all(|target| !moved.contains(&target)) {
            moved.extend(targets());
            together.push(index);
        }
    }
    together
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_1_SQRT_2;

    fn close(a: &[f64], b: &[f64]) {
        assert!(a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-7), "{a:?} {b:?}");
    }

    fn track(interpolation: Interpolation, times: &[f32], values: &[f32]) -> Track {
        Track::new(interpolation, times.to_vec(), values.to_vec()).unwrap()
    }

    #[test]
    fn values_between_keys_are_those_of_the_standard() {
        let keys = ([1.0, 2.0, 4.0], [10.0, 20.0, -20.0]);
        let step = track(Interpolation::Step, &keys.0, &keys.1);
        let linear = track(Interpolation::Linear, &keys.0, &keys.1);
        // Ends are kept, a key's own value is met, steps change at keys.
        for (time, stepped, straight) in [
            (-5.0, 10.0, 10.0),
            (1.0, 10.0, 10.0),
            (1.25, 10.0, 12.5),
            (2.0, 20.0, 20.0),
            (3.0, 20.0, 0.0),
            (4.0, -20.0, -20.0),
            (1e9, -20.0, -20.0),
        ] {
            close(&step.at(time), &[stepped]);
            close(&linear.at(time), &[straight]);
        }
        // In-tangent, value, out-tangent by key: p(t) of appendix C by hand, over 2 s.
        let cubic = track(Interpolation::CubicSpline, &[1.0, 3.0], &[9.0, 1.0, 2.0, -4.0, 5.0, 7.0]);
        // t = ½: ½·1 + 2·⅛·2 + ½·5 − 2·⅛·(−4) = 4.5; t = ¼: 54/64, 9/64, 10/64, −3/64.
        close(&cubic.at(2.0), &[0.5 + 0.5 + 2.5 + 1.0]);
        close(&cubic.at(1.5), &[54.0 / 64.0 + 2.0 * 2.0 * 9.0 / 64.0 + 50.0 / 64.0 + 2.0 * 4.0 * 3.0 / 64.0]);
        close(&cubic.at(0.0), &[1.0]);
        close(&cubic.at(8.0), &[5.0]);
        // A spline through equal values without slope stays.
        let flat = track(Interpolation::CubicSpline, &[0.0, 1.0], &[0.0, 3.0, 0.0, 0.0, 3.0, 0.0]);
        close(&flat.at(0.3), &[3.0]);
        let one = track(Interpolation::CubicSpline, &[7.0], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(one.width(), 2);
        close(&one.at(-1.0), &[3.0, 4.0]);
        close(&one.at(9.0), &[3.0, 4.0]);
    }

    #[test]
    fn rotations_go_the_short_way_at_an_even_speed() {
        let half = FRAC_1_SQRT_2 as f32;
        // From rest by 90° around y, once as itself and once as its negative, which is the same rotation.
        for sign in [1.0, -1.0] {
            let turn = track(
                Interpolation::Linear,
                &[0.0, 3.0],
                &[0.0, 0.0, 0.0, 1.0, 0.0, sign * half, 0.0, sign * half],
            );
            for third in 0..=3 {
                let angle = f64::from(third) * 30.0_f64.to_radians();
                let expected = DQuat::from_rotation_y(angle);
                assert!(turn.rotation_at(f64::from(third)).dot(expected).abs() > 1.0 - 1e-12);
            }
        }
        // Splines of quaternions are made unit again.
        let values = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0];
        let next = [0.0, 0.0, 0.0, 0.0, 0.0, half, 0.0, half, 0.0, 0.0, 0.0, 0.0];
        let spline = track(Interpolation::CubicSpline, &[0.0, 1.0], &[values, next].concat());
        let middle = spline.rotation_at(0.5);
        assert!((middle.length() - 1.0).abs() < 1e-12);
        assert!(middle.dot(DQuat::from_rotation_y(45.0_f64.to_radians())) > 1.0 - 1e-9);
    }

    #[test]
    fn broken_keys_are_refused() {
        let refused = |times: &[f32], values: &[f32]| {
            Track::new(Interpolation::Linear, times.to_vec(), values.to_vec()).unwrap_err()
        };
        assert!(refused(&[], &[]).contains("no key"));
        assert!(refused(&[0.0, 2.0, 1.0], &[0.0; 3]).contains("key 2 is at 1 s"));
        assert!(refused(&[0.0, f32::NAN], &[0.0; 2]).contains("time of key 1"));
        assert!(refused(&[0.0, 1.0], &[0.0, f32::INFINITY]).contains("value 1 is inf"));
        assert!(refused(&[0.0, 1.0], &[0.0; 3]).contains("3 values for 2 keys"));
        // A frame's time, but for a rounding, is a key's.
        let frames: Vec<f32> = (0..25).map(|k| k as f32 / 24.0).collect();
        let step = track(Interpolation::Step, &frames, &(0..25).map(|k| k as f32).collect::<Vec<_>>());
        (0..25).for_each(|k| close(&step.at(f64::from(k) / 24.0), &[f64::from(k)]));
        // Of keys at one time the last counts.
        close(&track(Interpolation::Linear, &[0.0, 1.0, 1.0], &[0.0, 1.0, 5.0]).at(1.0), &[5.0]);
    }
}
