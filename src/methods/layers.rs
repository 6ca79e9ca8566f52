//! What a method draws.

use super::Aov;
use crate::graph::{Buffer, Graph, Image, Res};
use crate::techniques::gbuffer::{self, GBuffer, Geometry};
use crate::techniques::{Kernels, compose};
use std::collections::BTreeMap;
use std::fmt;

/// Records a layer and returns it.
type Make = Box<dyn Fn(&mut Graph) -> Res<Image>>;

/// What a method draws. All images are of the window's size.
pub struct Layers {
    /// Radiance of everything together.
    pub beauty: Res<Image>,
    /// Primary hits, from which albedo, normals, positions and depths come.
    pub gbuffer: GBuffer,
    /// Normals, depths and positions, where the method has made them.
    pub geometry: Option<Geometry>,
    /// VPLs, of methods that have some.
    pub vpls: Option<VplCounts>,
    /// Four unsigned integers, the last of them how many pixels no filter could serve; where some may be.
    pub regathered: Option<Res<Buffer>>,
    others: BTreeMap<Aov, Make>,
}

/// How many VPLs there are, and by which paths.
#[derive(Clone, Copy, Debug)]
pub struct VplCounts {
    /// VPLs that exist, an unsigned integer.
    pub count: Res<Buffer>,
    /// Light paths launched.
    pub paths: u32,
    /// The paper's min_d in force (m).
    pub min_distance: f32,
}

impl Layers {
    /// Beauty and what primary hits tell.
    #[must_use]
    pub fn new(beauty: Res<Image>, gbuffer: GBuffer) -> Self {
        Self { beauty, gbuffer, geometry: None, vpls: None, regathered: None, others: BTreeMap::new() }
    }

    /// Adds a layer that has been drawn.
    pub fn add(&mut self, aov: Aov, image: Res<Image>) {
        self.add_made(aov, move |_| image);
    }

    /// Adds one that is black where there is none.
    pub fn add_or_black(&mut self, aov: Aov, image: Option<Res<Image>>) {
        let beauty = self.beauty;
        self.add_made(aov, move |g| image.unwrap_or_else(|| compose::black(g, beauty)));
    }

    /// Adds one that is drawn only if it is asked for.
    pub fn add_made(&mut self, aov: Aov, make: impl Fn(&mut Graph) -> Res<Image> + 'static) {
        self.others.insert(aov, Box::new(make));
    }

    /// A layer.
    ///
    /// # Panics
    /// If the method draws none such, which [`super::Method::check`] tells.
    pub fn image(&mut self, g: &mut Graph, k: &Kernels, aov: Aov) -> Res<Image> {
        let gbuffer = &self.gbuffer;
        let mut geometry = || *self.geometry.get_or_insert_with(|| gbuffer::unpack(g, k, gbuffer));
        match aov {
            Aov::Albedo => gbuffer.albedo,
            Aov::N | Aov::Depth => geometry().normal_depth,
            Aov::P => geometry().position,
            _ => self.others.get(&aov).expect("methods draw the layers they name")(g),
        }
    }
}

impl fmt::Debug for Layers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let others: Vec<_> = self.others.keys().collect();
        f.debug_struct("Layers")
            .field("beauty", &self.beauty)
            .field("others", &others)
            .finish_non_exhaustive()
    }
}
