//! Settings that methods have for themselves.

use super::REGISTRY;
use crate::techniques::setting::{BadValue, Settings};
use serde::de::{DeserializeOwned, Error};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;
use std::collections::BTreeMap;

/// A method's group of settings: their defaults, types and ranges.
#[derive(Clone, Copy, Debug)]
pub struct Group {
    defaults: fn() -> Value,
    read: fn(Value) -> Result<Value, String>,
    check: fn(&Value) -> Result<(), BadValue>,
}

impl Group {
    /// The group of the fields of `T`, which has `#[serde(default, deny_unknown_fields)]`.
    #[must_use]
    pub const fn of<T: Settings + Default + Serialize + DeserializeOwned>() -> Self {
        fn write<T: Serialize>(settings: &T) -> Value {
            serde_json::to_value(settings).expect("settings are numbers, words and lists of them")
        }
        Self {
            defaults: || write(&T::default()),
            read: |value| T::deserialize(value).map(|s| write(&s)).map_err(|error| error.to_string()),
            check: |value| T::deserialize(value).map_or(Ok(()), |settings| settings.check()),
        }
    }
}

/// What a configuration holds of every method's own group, each under its method's name.
#[derive(Clone, Debug, PartialEq)]
pub struct Own(BTreeMap<&'static str, Value>);

/// Every method's group.
fn groups() -> impl Iterator<Item = (&'static str, Group)> {
    REGISTRY.iter().filter_map(|method| Some((method.name, method.own?)))
}

impl Own {
    /// The settings of the method called `method`; the defaults where it has none.
    #[must_use]
    pub fn get<T: Default + DeserializeOwned>(&self, method: &str) -> T {
        self.0.get(method).and_then(|value| T::deserialize(value).ok()).unwrap_or_default()
    }

    pub(super) fn check(&self) -> Result<(), BadValue> {
        groups().try_for_each(|(name, group)| self.0.get(name).map_or(Ok(()), |value| (group.check)(value)))
    }
}

impl Default for Own {
    fn default() -> Self {
        Self(groups().map(|(name, group)| (name, (group.defaults)())).collect())
    }
}

impl<'de> Deserialize<'de> for Own {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut own = Self::default();
        for (name, value) in BTreeMap::<String, Value>::deserialize(deserializer)? {
            let Some((name, group)) = groups().find(|(there, _)| *there == name) else {
                return Err(D::Error::unknown_field(&name, &[]));
            };
            own.0.insert(name, (group.read)(value).map_err(D::Error::custom)?);
        }
        Ok(own)
    }
}

impl Serialize for Own {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, value)| (name, Optional(value))))
    }
}

/// A value whose nulls are absent options, as in formats that know no null.
struct Optional<'a>(&'a Value);

impl Serialize for Optional<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Value::Null => serializer.serialize_none(),
            Value::Object(fields) => {
                serializer.collect_map(fields.iter().map(|(key, value)| (key, Optional(value))))
            }
            value => value.serialize(serializer),
        }
    }
}
