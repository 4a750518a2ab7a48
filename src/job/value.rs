//! One setting: a TOML value in, a plain number or word out, and back.

use super::method::Method;
use contract::{Error, Kind, Result};
use toml::Value as Toml;

/// A kind of setting.
pub(super) trait Value: Sized {
    /// What it is, for people.
    fn kind() -> String;
    /// From TOML; `None` where it is of another kind.
    fn read(value: &Toml) -> Option<Self>;
    /// To TOML.
    fn write(&self) -> Toml;
}

macro_rules! whole {
    ($($kind:ty),*) => {$(
        impl Value for $kind {
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

impl Value for f64 {
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

impl Value for f32 {
    fn kind() -> String {
        f64::kind()
    }
    fn read(value: &Toml) -> Option<Self> {
        // A number that single precision cannot hold would become infinite.
        f64::read(value).map(|v| v as f32).filter(|v| v.is_finite())
    }
    /// As short as it was written: 0.025, not 0.02500000037.
    fn write(&self) -> Toml {
        Toml::Float(self.to_string().parse().unwrap_or(f64::from(*self)))
    }
}

impl Value for Method {
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

impl Value for bool {
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

impl Value for String {
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

impl<T: Value, const N: usize> Value for [T; N] {
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

/// Optional settings are absent from the record where they are not set.
impl<T: Value> Value for Option<T> {
    fn kind() -> String {
        T::kind()
    }
    fn read(value: &Toml) -> Option<Self> {
        // What is written of one that is not set reads back as that.
        if value.as_str() == Some("none") { Some(None) } else { T::read(value).map(Some) }
    }
    fn write(&self) -> Toml {
        self.as_ref().map_or_else(|| Toml::String("none".into()), T::write)
    }
}

/// Puts a TOML value into a setting.
pub(super) fn assign<T: Value>(to: &mut T, key: &str, value: &Toml) -> Result<()> {
    *to = T::read(value).ok_or_else(|| {
        let given = value.as_str().map_or_else(|| value.to_string(), Into::into);
        Error::new(Kind::Usage, format!("{key} is {}, got \"{given}\"", T::kind()))
    })?;
    Ok(())
}
