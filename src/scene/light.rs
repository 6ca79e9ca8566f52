use glam::Vec3;

/// A light source without extent. `range` of glTF lights is ignored: light falls off as 1/d² for ever.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// As in the file.
    pub name: String,
    /// Shape of the emission.
    pub kind: LightKind,
    /// Position (m) in the world; unused by directional lights.
    pub position: Vec3,
    /// Unit direction the light shines along; unused by point lights.
    pub direction: Vec3,
    /// Intensity per channel: W/sr for point and spot, irradiance W/m² on a facing surface for directional.
    pub intensity: Vec3,
}

/// Shape of a light's emission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// The same intensity in all directions.
    Point,
    /// Full intensity inside the inner cone, none outside the outer, in between as `KHR_lights_punctual` says.
    Spot {
        /// Half-angle (radians) of full intensity.
        inner: f32,
        /// Half-angle (radians) of none, greater than `inner`, at most π/2.
        outer: f32,
    },
    /// Parallel light from infinitely far away.
    Directional,
}
