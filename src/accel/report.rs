/// What was built, how long it took and what it takes.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct StructureReport {
    /// `software`, `blas` or `tlas`; over triangles' boxes `boxes`, and where the driver builds `boxes-blas` and
    /// `boxes-tlas` (`boxes` are then those that the kernel decides with).
    pub name: String,
    /// Milliseconds from the geometry to a structure on the device.
    pub build_ms: f64,
    /// Bytes on the device.
    pub bytes: u64,
    /// Triangles or boxes in it; for a top level, instances.
    pub primitives: u64,
}
