//! Reads the units of coordinates from the GeoTIFF keys of a LAS file.

use super::declared::{Declaration, StatedUnit, System};
use super::known;

const MODEL: u16 = 1024;
const GEOGRAPHIC: u16 = 2048;
const GEOCENTRIC_UNIT: u16 = 2052;
const PROJECTED: u16 = 3072;
const UNIT: u16 = 3076;
const UNIT_METRES: u16 = 3077;
const VERTICAL: u16 = 4096;
const VERTICAL_UNIT: u16 = 4099;
/// Location that says that a key's value is in the record of doubles.
const IN_DOUBLES: u16 = 34_736;
/// Value that says that the unit or system is defined elsewhere.
const USER_DEFINED: u16 = 32_767;

/// The directory of keys and the doubles that it refers to.
struct Keys<'a> {
    directory: &'a [u8],
    doubles: &'a [u8],
}

/// The declaration of the keys; `None` where they say nothing of units.
pub(crate) fn read(directory: &[u8], doubles: &[u8]) -> Option<Declaration> {
    let keys = Keys { directory, doubles };
    let mut found = Declaration::new("GeoTIFF keys");
    let system = keys.code(PROJECTED);
    found.system = match keys.short(MODEL) {
        Some(1) => System::Lengths,
        Some(2) => System::Degrees,
        Some(3) => System::EarthCentred,
        _ if system.is_some() || keys.short(UNIT).is_some() => System::Lengths,
        _ if keys.code(GEOGRAPHIC).is_some() => System::Degrees,
        _ if keys.short(GEOCENTRIC_UNIT).is_some() => System::Lengths,
        _ => System::Unknown,
    };
    let of_system = || system.and_then(|code| known::of_system("projected", code));
    found.horizontal = match keys.short(UNIT) {
        Some(USER_DEFINED) => {
            let metres = keys.double(UNIT_METRES);
            metres.map(|metres| StatedUnit { name: None, metres: Some(metres) })
        }
        Some(code) => match known::by_code(code.into()) {
            Some(unit) => {
                found.remarks.extend(contradiction(&unit.name, unit.metres, of_system()));
                Some(unit.into())
            }
            None => {
                found.remarks.push(format!("the GeoTIFF keys name an unknown unit: {code}"));
                None
            }
        },
        None => None,
    };
    if found.horizontal.is_none() {
        found.horizontal = of_system().map(StatedUnit::from);
    }
    let of_unit = keys.short(VERTICAL_UNIT).and_then(|code| known::by_code(code.into()));
    let vertical = || keys.code(VERTICAL).and_then(|code| known::of_system("vertical", code));
    found.vertical = of_unit.or_else(vertical).map(StatedUnit::from);
    (found.system != System::Unknown || found.vertical.is_some()).then_some(found)
}

/// The message where the key of the unit and the system differ; the key counts, as in other
/// readers.
fn contradiction(
    name: &str,
    metres: f64,
    system: Option<super::length_unit::LengthUnit>,
) -> Option<String> {
    let system = system.filter(|unit| !super::length_unit::is_same(unit.metres, metres))?;
    Some(format!(
        "the GeoTIFF keys name a system in {} and the unit {name}: the unit counts",
        system.name
    ))
}

impl Keys<'_> {
    /// An entry of the directory: key, location of its value, number of values, value or offset.
    fn entry(&self, key: u16) -> Option<[u16; 4]> {
        let words =
            |chunk: &[u8]| [0, 2, 4, 6].map(|at| u16::from_le_bytes([chunk[at], chunk[at + 1]]));
        let entries = self.directory.get(8..)?.chunks_exact(8).map(words);
        let n = usize::from(u16::from_le_bytes([self.directory[6], self.directory[7]]));
        entries.take(n).find(|entry| entry[0] == key)
    }

    fn short(&self, key: u16) -> Option<u16> {
        self.entry(key).filter(|entry| entry[1] == 0).map(|entry| entry[3])
    }

    /// A key's code in the EPSG registry.
    fn code(&self, key: u16) -> Option<u32> {
        self.short(key).filter(|code| (1024..USER_DEFINED).contains(code)).map(u32::from)
    }

    fn double(&self, key: u16) -> Option<f64> {
        let entry = self.entry(key).filter(|entry| entry[1] == IN_DOUBLES)?;
        let at = 8 * usize::from(entry[3]);
        let bytes = self.doubles.get(at..at + 8)?;
        bytes.first_chunk().map(|bytes| f64::from_le_bytes(*bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::declared::Sense;

    fn read_keys(keys: &[[u16; 4]], doubles: &[f64]) -> Option<Declaration> {
        let n = keys.len() as u16;
        let words = [[1, 1, 0, n]].into_iter().chain(keys.iter().copied()).flatten();
        let directory: Vec<u8> = words.flat_map(u16::to_le_bytes).collect();
        let doubles: Vec<u8> = doubles.iter().flat_map(|v| v.to_le_bytes()).collect();
        read(&directory, &doubles)
    }

    fn metres(stated: Option<StatedUnit>) -> Option<f64> {
        match stated?.sense() {
            Sense::Unit(unit) => Some(unit.metres),
            _ => None,
        }
    }

    #[test]
    fn units_come_from_keys_else_from_systems() {
        let key = |key, value| [key, 0, 1, value];
        for (keys, horizontal, vertical) in [
            // California zone 5 in US survey feet, heights too.
            (
                vec![key(1024, 1), key(3072, 2229), key(4099, 9003)],
                Some(known::US_FOOT),
                Some(known::US_FOOT),
            ),
            (vec![key(1024, 1), key(3072, 2994), key(3076, 9002)], Some(0.3048), None),
            (vec![key(1024, 1), key(3072, 26915), key(3076, 9001)], Some(1.0), None),
            (vec![key(3076, 9001), key(4096, 6360)], Some(1.0), Some(known::US_FOOT)),
            // The number of a system in place of that of a unit.
            (vec![key(1024, 1), key(3076, 32632), key(4099, 9001)], None, Some(1.0)),
            // The unit counts where the system is in another.
            (vec![key(1024, 1), key(3072, 2229), key(3076, 9001)], Some(1.0), None),
        ] {
            let found = read_keys(&keys, &[]).expect("it declares something");
            assert_eq!(found.system, System::Lengths, "{keys:?}");
            assert_eq!(metres(found.horizontal), horizontal, "{keys:?}");
            assert_eq!(metres(found.vertical), vertical, "{keys:?}");
        }
        let contradicts = read_keys(&[key(3072, 2229), key(3076, 9001)], &[]).expect("keys");
        assert!(contradicts.remarks[0].contains("US survey foot"), "{:?}", contradicts.remarks);
    }

    #[test]
    fn a_unit_of_the_writers_own_has_its_metres_among_the_doubles() {
        let keys = [[3076, 0, 1, 32_767], [3077, 34_736, 1, 1]];
        let found = read_keys(&keys, &[5.0, 0.001]).expect("keys");
        assert_eq!(metres(found.horizontal), Some(0.001));
        // A place behind the last double.
        assert_eq!(read_keys(&keys, &[5.0]).expect("keys").horizontal, None);
    }

    #[test]
    fn degrees_are_recognised_and_broken_keys_are_ignored() {
        let system = |keys: &[[u16; 4]]| read_keys(keys, &[]).map(|found| found.system);
        assert_eq!(system(&[[1024, 0, 1, 2], [2048, 0, 1, 4326]]), Some(System::Degrees));
        assert_eq!(system(&[[2048, 0, 1, 4326]]), Some(System::Degrees));
        assert_eq!(system(&[[1024, 0, 1, 3]]), Some(System::EarthCentred));
        assert_eq!(system(&[]), None);
        for bytes in [&[][..], &[1], &[1, 0, 1, 0, 0, 0, 255], &[1, 0, 1, 0, 0, 0, 255, 255, 0, 4]]
        {
            assert_eq!(read(bytes, &[]), None);
        }
    }
}
