use crate::renderer::{BackendChoice, Progress};
use std::sync::atomic::AtomicBool;

/// Width and height of pictures unless others are asked for; what is known to fail is known at this size.
pub const SIZE: [u32; 2] = [32, 24];

/// How the cases are run.
#[derive(Clone, Copy, Default)]
pub struct Options<'a> {
    /// The name of the only case to run; all are run otherwise.
    pub only: Option<&'a str>,
    /// Which backend to trace rays with.
    pub backend: BackendChoice,
    /// Width and height (pixels) in place of [`SIZE`].
    pub size: Option<[u32; 2]>,
    /// Which of the equally good sample sets.
    pub seed: u32,
    /// Set to stop.
    pub cancel: Option<&'a AtomicBool>,
    /// Told what is being done.
    pub progress: Option<&'a dyn Fn(Progress<'_>)>,
}
