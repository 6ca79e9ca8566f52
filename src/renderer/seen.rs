//! How much of the light that is shot arrives where the camera looks.

use super::drawing::modelling;
use super::error::Error;
use super::submit::Renderer;
use super::window::Window;
use crate::config::RenderConfig;
use crate::graph::Graph;
use crate::scene::Camera;
use crate::shaders::Receiver;
use crate::techniques::indirect;
use crate::techniques::vpl_shoot;

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
        let mut shot = config.vpl_shoot.of(&kernels.profile);
        let paths = shot.paths().min(PATHS);
        shot.candidates = 1;
        shot.vpls = paths * (shot.vpls / shot.paths());
        let Window { origin, extent, traced_origin, .. } = Window::of(config);
        let origin = [0, 1].map(|axis| origin[axis] - traced_origin[axis]);
        let mut g = Graph::new();
        let paths = vpl_shoot::paths(&mut g, &kernels, &shot, 1);
        let vpls = vpl_shoot::compact(&mut g, &kernels, &shot, &paths, 1, 0.0);
        let seen = vpl_shoot::seen(&mut g, &kernels, &shot, &vpls, origin, extent);
        let (points, seen) = (g.read_buffer(seen.points), g.read_buffer::<u32>(seen.paths));
        let mut run = self.run(g, config, camera)?;
        let (points, seen) = (run.take(points), run.take(seen));
        let any = points.iter().any(|point: &Receiver| point.normal != [0.0; 3]);
        Ok(any.then(|| f64::from(seen.iter().sum::<u32>()) / seen.len() as f64))
    }

    /// The median length (m) of cosine-distributed rays from what the camera sees all over the whole picture, where it sees
    /// anything that sees anything.
    pub(super) fn free_path(&mut self, config: &RenderConfig, camera: &Camera) -> Result<Option<f32>, Error> {
        let whole = RenderConfig { crop: None, seed: 0, ..config.clone() };
        if let Some((revision, of, from, known)) = &self.free_path
            && (*revision, of, from) == (self.revision(), &whole, camera)
        {
            return Ok(*known);
        }
        let kernels = modelling(self.kernels(config.whitted.mirror_roughness), &whole, &[]);
        let mut g = Graph::new();
        let lengths = indirect::free_path(&mut g, &kernels, [0, 0], whole.size);
        let lengths = g.read_buffer::<f32>(lengths);
        let mut run = self.run(g, &whole, camera)?;
        let mut lengths = run.take(lengths);
        lengths.retain(|&length| length > 0.0);
        lengths.sort_by(f32::total_cmp);
        let found = lengths.get(lengths.len() / 2).copied();
        self.free_path = Some((self.revision(), whole, camera.clone(), found));
        Ok(found)
    }
}
