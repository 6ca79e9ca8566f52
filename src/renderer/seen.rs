//! How much of the light that is shot arrives where the camera looks.

use super::drawing::modelling;
use super::error::Error;
use super::submit::Renderer;
use super::window::Window;
use crate::config::RenderConfig;
use crate::graph::Graph;
use crate::scene::Camera;
use crate::techniques::vpl_shoot::{self, VplShootConfig};

/// Most light paths that are looked at.
const PATHS: u32 = 4096;

impl Renderer {
    /// The share of light paths, as methods with VPLs shoot them, that leave a VPL which lights any of 256 points that the
    /// camera sees; of the first 4096 paths where there are more. None where it sees no surface. Runs by itself: no frame
    /// is drawn.
    ///
    /// # Errors
    /// A bad configuration, or the device's failure.
    pub fn paths_seen(&mut self, config: &RenderConfig, camera: &Camera) -> Result<Option<f64>, Error> {
        config.validate()?;
        let kernels = modelling(self.kernels(config.whitted.mirror_roughness), config, &[]);
        let bounces = config.vpl_shoot.bounces;
        let paths = config.vpl_shoot.paths().min(PATHS);
        let shot = VplShootConfig { vpls: paths * bounces, bounces };
        let Window { origin, extent, traced_origin, .. } = Window::of(config);
        let origin = [0, 1].map(|axis| origin[axis] - traced_origin[axis]);
        let mut g = Graph::new();
        let paths = vpl_shoot::paths(&mut g, &kernels, &shot);
        let seen = vpl_shoot::seen(&mut g, &kernels, &shot, &paths, origin, extent);
        let (points, seen) = (g.read_buffer(seen.points), g.read_buffer::<u32>(seen.paths));
        let mut run = self.run(g, config, camera)?;
        let (points, seen) = (run.take(points), run.take(seen));
        let any = points.iter().any(|point: &[f32; 9]| point[3..6] != [0.0; 3]);
        Ok(any.then(|| f64::from(seen.iter().sum::<u32>()) / seen.len() as f64))
    }
}
