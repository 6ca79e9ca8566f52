//! Settings that methods have for themselves.

use crate::techniques::setting::{BadValue, Settings};
use serde::de::DeserializeOwned;
use serde::{Serialize, Serializer};
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

impl Own {
    /// The defaults of these groups.
    pub(super) fn of(groups: impl Iterator<Item = (&'static str, Group)>) -> Self {
        Self(groups.map(|(name, group)| (name, (group.defaults)())).collect())
    }

    /// The settings of the method called `method`; the defaults where it has none.
    #[must_use]
    pub fn get<T: Default + DeserializeOwned>(&self, method: &str) -> T {
        self.0.get(method).and_then(|value| T::deserialize(value).ok()).unwrap_or_default()
    }

    /// Sets a method's group: what `value` names, and the rest to its defaults.
    pub(super) fn set(&mut self, method: &'static str, group: Group, value: Value) -> Result<(), String> {
        self.0.insert(method, (group.read)(value)?);
        Ok(())
    }

    /// Checks these groups' ranges.
    pub(super) fn check(
        &self,
        mut groups: impl Iterator<Item = (&'static str, Group)>,
    ) -> Result<(), BadValue> {
        groups.try_for_each(|(name, group)| self.0.get(name).map_or(Ok(()), |value| (group.check)(value)))
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
