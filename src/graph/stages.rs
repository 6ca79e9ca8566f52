//! Where in the pipeline passes run.

use ash::vk as raw;
use std::{fmt, ops::BitOr};

/// A set of the pipeline stages that passes run in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Stages(u8);

impl Stages {
    /// No stage.
    pub const NONE: Self = Self(0);
    /// Compute shaders.
    pub const COMPUTE: Self = Self(1);
    /// Copies, fills and clears.
    pub const TRANSFER: Self = Self(2);
    /// Reading the arguments of an indirect dispatch.
    pub const INDIRECT: Self = Self(4);
    /// Every stage, those above and all others.
    pub const ALL: Self = Self(15);
    /// How many bits a set has.
    pub(super) const COUNT: usize = 4;

    /// Whether every stage of `other` is in the set.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether some stage is in both.
    #[must_use]
    pub const fn intersects(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// Whether no stage is in the set.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The set with the stage of bit `i` alone.
    pub(super) const fn bit(i: usize) -> Self {
        Self(1 << i)
    }

    /// The stages as Vulkan names them, no more than the set: what is none of ours may be any.
    pub(super) fn flags(self) -> raw::PipelineStageFlags2 {
        type S = raw::PipelineStageFlags2;
        let names = [S::COMPUTE_SHADER, S::ALL_TRANSFER, S::DRAW_INDIRECT, S::ALL_COMMANDS];
        self.bits().fold(S::NONE, |flags, bit| flags | names[bit])
    }

    /// The bits that are set.
    pub(super) fn bits(self) -> impl Iterator<Item = usize> {
        (0..Self::COUNT).filter(move |&i| self.contains(Self::bit(i)))
    }
}

impl BitOr for Stages {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl std::ops::BitOrAssign for Stages {
    fn bitor_assign(&mut self, other: Self) {
        self.0 |= other.0;
    }
}

impl fmt::Display for Stages {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NONE => return f.write_str("none"),
            Self::ALL => return f.write_str("all"),
            _ => {}
        }
        let mut separator = "";
        for (i, name) in ["compute", "transfer", "indirect", "other"].iter().enumerate() {
            if self.contains(Self::bit(i)) {
                write!(f, "{separator}{name}")?;
                separator = "|";
            }
        }
        Ok(())
    }
}

impl serde::Serialize for Stages {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
