//! How large a scene may be.

/// Most triangles a scene may have, each instance counted.
pub const MAX_TRIANGLES: usize = 1 << 28;
/// Most vertices of all meshes together.
pub const MAX_VERTICES: usize = 1 << 28;
/// Largest side of an image (texels).
pub const MAX_IMAGE_SIDE: u32 = 1 << 14;
/// Most texels of all images together; those of 16 bits a channel count twice.
pub const MAX_TEXELS: usize = 1 << 29;
/// Largest coordinate of a vertex in the world (m): products of four lengths still fit into 32-bit floats. Cameras
/// and lights may be ten times as far.
pub const MAX_COORDINATE: f32 = 1e9;
/// Smallest extent of a scene (m): the square of an area within it still is a 32-bit float.
pub const MIN_EXTENT: f32 = 1e-12;
/// Largest radiance (W/(sr·m²)), intensity (W/sr) or irradiance (W/m²) of anything that shines: ten thousand suns seen from
/// a micrometre off still fit into 32-bit floats.
pub const MAX_RADIANCE: f32 = 1e24;
/// Largest index of refraction: all light is reflected.
pub const MAX_IOR: f32 = 1e6;
/// Largest texture coordinate, and scale and offset of their transform: 32-bit floats have no fractions beyond.
pub const MAX_TEXTURE_COORDINATE: f32 = 16_777_216.0;
/// Largest factor without a range of its own: of normal maps, and of the colour of specular reflection.
pub const MAX_FACTOR: f32 = 1e6;
/// Largest absorption (1/m): nothing is left behind a thousandth of a wavelength.
pub const MAX_ABSORPTION: f32 = 1e12;

/// `Err(problem)`; the caller knows which element it concerns.
pub(super) type Checked = Result<(), String>;
