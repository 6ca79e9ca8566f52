use glam::{Affine3A, Vec3};

/// A camera in the world, looking along its own −Z with +Y up, as in glTF.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// The node's name; `--camera` also matches `camera_name`.
    pub name: String,
    /// The camera object's own name, where it has one.
    pub camera_name: Option<String>,
    /// Camera to world, rigid.
    pub transform: Affine3A,
    /// What it sees.
    pub view: View,
}

/// Projection of a [`Camera`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum View {
    /// Full vertical angle (radians); the horizontal one follows from the picture's size.
    Perspective {
        /// Vertical field of view (radians).
        yfov: f32,
    },
    /// Parallel projection.
    Orthographic {
        /// Half of the visible height (m).
        ymag: f32,
    },
}

impl Camera {
    /// A perspective camera at `eye` that looks at `target`, Y up (Z up where it looks along Y).
    #[must_use]
    pub fn look_at(name: impl Into<String>, eye: Vec3, target: Vec3, yfov: f32) -> Self {
        let forward = (target - eye).normalize_or(Vec3::NEG_Z);
        let up = if forward.cross(Vec3::Y).length_squared() > 1e-8 { Vec3::Y } else { Vec3::Z };
        let right = forward.cross(up).normalize();
        let rotation = glam::Mat3::from_cols(right, right.cross(forward), -forward);
        Self {
            name: name.into(),
            camera_name: None,
            transform: Affine3A::from_mat3_translation(rotation, eye),
            view: View::Perspective { yfov },
        }
    }
}
