/// A structure that was built: time and memory.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct StructureReport {
    /// `software`, `blas` or `tlas` over triangles, `software-top` over placements. Over their boxes `boxes`; where the driver builds, `boxes-blas` and
    /// `boxes-tlas` too, and `boxes` are the bounds that the kernel tests.
    pub name: String,
    /// Milliseconds from the geometry to a structure on the device.
    pub build_ms: f64,
    /// Bytes on the device.
    pub bytes: u64,
    /// Triangles or boxes in it; for a top level, placements that differ.
    pub primitives: u64,
}
