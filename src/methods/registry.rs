//! The list of methods, and what looks words up in it.

use super::method::RenderConfig;
#[cfg(test)]
use super::toy;
use super::{Group, Method, Own, igi, path};
use serde::de::Error;
use serde::{Deserialize, Deserializer};
use serde_json::Value;
use std::collections::BTreeMap;

/// All methods there are, the default first.
pub static REGISTRY: &[&Method] = &[
    &igi::METHOD,
    &path::METHOD,
    #[cfg(test)]
    &toy::METHOD,
];

/// The method that others are measured against.
pub static REFERENCE: &Method = &path::METHOD;

/// Makes the pictures of all methods comparable, as [`Method::comparable`] does for one.
pub fn comparable(config: &mut RenderConfig, max_depth: Option<u32>) {
    REGISTRY.iter().for_each(|method| (method.comparable)(config, max_depth));
}

/// The method called `name`, if there is one.
#[must_use]
pub fn named(name: &str) -> Option<&'static Method> {
    REGISTRY.iter().copied().find(|method| method.name == name)
}

/// The one with this name.
impl<'de> Deserialize<'de> for &'static Method {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        named(&name).ok_or_else(|| {
            let names: Vec<_> = REGISTRY.iter().map(|method| format!("`{}`", method.name)).collect();
            D::Error::custom(format!("unknown variant `{name}`, expected {}", names.join(" or ")))
        })
    }
}

/// The groups that methods have for themselves, each with its method's name.
pub(super) fn groups() -> impl Iterator<Item = (&'static str, Group)> {
    REGISTRY.iter().filter_map(|method| Some((method.name, method.own?)))
}

impl Default for Own {
    fn default() -> Self {
        Self::of(groups())
    }
}

impl<'de> Deserialize<'de> for Own {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut own = Self::default();
        for (name, value) in BTreeMap::<String, Value>::deserialize(deserializer)? {
            let Some((name, group)) = groups().find(|(there, _)| *there == name) else {
                return Err(D::Error::unknown_field(&name, &[]));
            };
            own.set(name, group, value).map_err(D::Error::custom)?;
        }
        Ok(own)
    }
}
