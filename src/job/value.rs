//! Conversion of a single setting between TOML and its Rust type.

use super::method::Method;
use contract::{Error, Kind, Result};
use toml::Value as Toml;

/// A type that a setting can have.
pub(super) trait SettingValue: Sized {
    /// Name of the type, for messages.
    fn kind() -> String;
    /// Converts from TOML; `None` where the value has another type.
    fn read(value: &Toml) -> Option<Self>;
    /// Converts to TOML.
    fn write(&self) -> Toml;
}

macro_rules! whole {
    ($($kind:ty),*) => {$(
        impl SettingValue for $kind {
            fn kind() -> String {
                "a whole number".into()
            }
            fn read(value: &Toml) -> Option<Self> {
                value.as_integer().and_then(|v| v.try_into().ok())
            }
            fn write(&self) -> Toml {
                i64::try_from(*self).map_or_else(|_| Toml::String(self.to_string()), Toml::Integer)
            }
        }
    )*};
}
whole!(u8, u16, u32, u64, usize, i16, i32, i64);

impl SettingValue for f64 {
    fn kind() -> String {
        "a number".into()
    }
    fn read(value: &Toml) -> Option<Self> {
        let number = value.as_float().or_else(|| value.as_integer().map(|v| v as f64));
        number.filter(|v| v.is_finite())
    }
    fn write(&self) -> Toml {
        Toml::Float(*self)
    }
}

impl SettingValue for f32 {
    fn kind() -> String {
        f64::kind()
    }
    fn read(value: &Toml) -> Option<Self> {
        // A number beyond the range of single precision would become infinite.
        f64::read(value).map(|v| v as f32).filter(|v| v.is_finite())
    }
    /// The shortest text that reads back the same: 0.025, not 0.02500000037.
    fn write(&self) -> Toml {
        Toml::Float(self.to_string().parse().unwrap_or(f64::from(*self)))
    }
}

impl SettingValue for Method {
    fn kind() -> String {
        "\"beam\" or \"paper\"".into()
    }
    fn read(value: &Toml) -> Option<Self> {
        match value.as_str()? {
            "beam" => Some(Self::Beam),
            "paper" => Some(Self::Paper),
            _ => None,
        }
    }
    fn write(&self) -> Toml {
        Toml::String(if *self == Self::Beam { "beam" } else { "paper" }.into())
    }
}

impl SettingValue for bool {
    fn kind() -> String {
        "true or false".into()
    }
    fn read(value: &Toml) -> Option<Self> {
        value.as_bool()
    }
    fn write(&self) -> Toml {
        Toml::Boolean(*self)
    }
}

impl SettingValue for String {
    fn kind() -> String {
        "a word".into()
    }
    fn read(value: &Toml) -> Option<Self> {
        value.as_str().map(Into::into)
    }
    fn write(&self) -> Toml {
        Toml::String(self.clone())
    }
}

impl<T: SettingValue, const N: usize> SettingValue for [T; N] {
    fn kind() -> String {
        format!("a list of {N}, each {}", T::kind())
    }
    fn read(value: &Toml) -> Option<Self> {
        let list: Vec<T> = value.as_array()?.iter().map(T::read).collect::<Option<_>>()?;
        list.try_into().ok()
    }
    fn write(&self) -> Toml {
        Toml::Array(self.iter().map(T::write).collect())
    }
}

/// Optional settings without a value are absent from the record of a run.
impl<T: SettingValue> SettingValue for Option<T> {
    fn kind() -> String {
        T::kind()
    }
    fn read(value: &Toml) -> Option<Self> {
        // A setting without a value is written as "none" and must read back as such.
        if value.as_str() == Some("none") { Some(None) } else { T::read(value).map(Some) }
    }
    fn write(&self) -> Toml {
        self.as_ref().map_or_else(|| Toml::String("none".into()), T::write)
    }
}

/// Assigns a TOML value to a setting.
pub(super) fn assign<T: SettingValue>(to: &mut T, key: &str, value: &Toml) -> Result<()> {
    *to = T::read(value).ok_or_else(|| {
        let given = value.as_str().map_or_else(|| value.to_string(), Into::into);
        Error::new(Kind::Usage, format!("{key} is {}, got \"{given}\"", T::kind()))
    })?;
    Ok(())
}
