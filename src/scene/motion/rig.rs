//! Nodes in each other, and skins that follow them.

use glam::{DAffine3, DQuat, DVec3};

/// A node of the file.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub(crate) parent: Option<u32>,
    pub(crate) local: Local,
    /// Of its mesh's morph targets.
    pub(crate) weights: Vec<f64>,
    /// It and all below it are there.
    pub(crate) visible: bool,
}

/// Where a node is in its parent.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Local {
    Matrix(DAffine3),
    Parts {
        translation: DVec3,
        /// Of any length but 0.
        rotation: DQuat,
        scale: DVec3,
    },
}

impl Local {
    pub(crate) fn transform(&self) -> DAffine3 {
        match *self {
            Self::Matrix(matrix) => matrix,
            Self::Parts { translation, rotation, scale } => {
                DAffine3::from_scale_rotation_translation(scale, rotation.normalize(), translation)
            }
        }
    }
}

/// Joints, and where they have the mesh at rest.
#[derive(Clone, Debug)]
pub(crate) struct Skin {
    /// Nodes.
    pub(crate) joints: Vec<u32>,
    /// From the mesh's space to each joint's, or none where that is the same.
    pub(crate) inverse_bind: Vec<DAffine3>,
}

impl Skin {
    /// From the mesh's space to the world by each joint and, behind them, by the `node` that wears the skin.
    pub(crate) fn transforms<E>(
        &self,
        mut world: impl FnMut(u32) -> Result<DAffine3, E>,
        node: DAffine3,
    ) -> Result<Vec<DAffine3>, E> {
        let mut transforms = Vec::with_capacity(self.joints.len() + 1);
        for (i, &joint) in self.joints.iter().enumerate() {
            let world = world(joint)?;
            transforms.push(self.inverse_bind.get(i).map_or(world, |&inverse| world * inverse));
        }
        transforms.push(node);
        Ok(transforms)
    }
}

/// Where nodes are in the world.
#[derive(Debug)]
pub(crate) struct Worlds(Vec<DAffine3>, Vec<bool>);

impl Worlds {
    /// No node is its own ancestor.
    pub(crate) fn of(nodes: &[Node]) -> Self {
        let mut known: Vec<Option<(DAffine3, bool)>> = vec![None; nodes.len()];
        let mut way = Vec::new();
        for first in 0..nodes.len() {
            let (mut world, mut at) = ((DAffine3::IDENTITY, true), Some(first));
            while let Some(node) = at {
                if let Some(known) = known[node] {
                    world = known;
                    break;
                }
                way.push(node);
                at = nodes[node].parent.map(|parent| parent as usize);
            }
            while let Some(node) = way.pop() {
                world = (world.0 * nodes[node].local.transform(), world.1 && nodes[node].visible);
                known[node] = Some(world);
            }
        }
        let (worlds, visible) = known.into_iter().flatten().unzip();
        Self(worlds, visible)
    }

    pub(crate) fn at(&self, node: u32) -> DAffine3 {
        self.0[node as usize]
    }

    /// Whether nothing hides it.
    pub(crate) fn shows(&self, node: u32) -> bool {
        self.1[node as usize]
    }
}
