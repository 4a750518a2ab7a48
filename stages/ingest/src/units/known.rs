//! The length in metres of units by name or EPSG code. Units by code, and systems that are not in
//! metres, come from the EPSG registry (`epsg.txt`).

use super::length_unit::LengthUnit;

/// The relevant part of the EPSG registry; its first lines say how it was made.
const EPSG: &str = include_str!("epsg.txt");
/// The EPSG code of the metre.
const METRE: u32 = 9001;
/// Metres of a US survey foot: 1200/3937 by definition.
pub(super) const US_FOOT: f64 = 1200.0 / 3937.0;

/// Spellings of one unit in lower case with letters and digits only; its display name; its length
/// in metres.
type Spelled = (&'static [&'static str], &'static str, f64);

/// Spellings in files and on the command line; the names of the EPSG registry come after them.
const SPELLED: [Spelled; 9] = [
    (&["m", "metre", "metres", "meter", "meters"], "metre", 1.0),
    (&["mm", "millimetre", "millimetres", "millimeter", "millimeters"], "millimetre", 1e-3),
    (&["cm", "centimetre", "centimetres", "centimeter", "centimeters"], "centimetre", 1e-2),
    (&["dm", "decimetre", "decimetres", "decimeter", "decimeters"], "decimetre", 1e-1),
    (&["km", "kilometre", "kilometres", "kilometer", "kilometers"], "kilometre", 1e3),
    (&["in", "inch", "inches"], "inch", 0.0254),
    (&["ft", "foot", "feet", "internationalfoot", "footinternational"], "foot", 0.3048),
    (
        &["usft", "ftus", "footus", "usfoot", "usfeet", "ussurveyfoot", "ussurveyfeet"],
        "US survey foot",
        US_FOOT,
    ),
    (&["yd", "yard", "yards"], "yard", 0.9144),
];

/// The unit with a name, as files or people spell it.
pub(super) fn by_name(name: &str) -> Option<LengthUnit> {
    let plain = plain(name);
    let spelled = SPELLED.iter().find(|(spellings, ..)| spellings.contains(&plain.as_str()));
    let of_list = || units().find(|(_, unit)| self::plain(&unit.name) == plain).map(|(_, u)| u);
    spelled.map(|(_, name, metres)| LengthUnit::new(*name, *metres)).or_else(of_list)
}

/// The unit with a code of the EPSG registry.
pub(super) fn by_code(code: u32) -> Option<LengthUnit> {
    // The registry gives the survey foot with too few decimals for map coordinates.
    let exact = |unit: LengthUnit| by_name(&unit.name).unwrap_or(unit);
    units().find(|(known, _)| *known == code).map(|(_, unit)| exact(unit))
}

/// The unit of a system of the EPSG registry, `projected` or `vertical`; the metre where the list
/// names no other.
pub(super) fn of_system(kind: &str, code: u32) -> Option<LengthUnit> {
    let holds = |range: &str| {
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        let number = |word: &str| word.parse::<u32>().ok();
        number(first).zip(number(last)).is_some_and(|(a, b)| (a..=b).contains(&code))
    };
    let mut lines = EPSG.lines().filter_map(|line| line.strip_prefix(kind)?.strip_prefix(' '));
    let named = lines.find_map(|line| {
        let (unit, ranges) = line.split_once(' ')?;
        ranges.split(' ').any(holds).then(|| unit.parse().ok())?
    });
    by_code(named.unwrap_or(METRE))
}

/// The units of the registry with their codes.
fn units() -> impl Iterator<Item = (u32, LengthUnit)> {
    EPSG.lines().filter_map(|line| line.strip_prefix("unit ")).filter_map(|line| {
        let mut words = line.splitn(3, ' ');
        let (code, metres) = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
        Some((code, LengthUnit::new(words.next()?, metres)))
    })
}

fn plain(name: &str) -> String {
    name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_and_people_are_known() {
        for (name, metres) in [
            ("US survey foot", US_FOOT),
            ("Foot_US", US_FOOT),
            ("us-ft", US_FOOT),
            ("Foot", 0.3048),
            ("foot (International)", 0.3048),
            ("Meter", 1.0),
            ("millimetre", 1e-3),
            ("Clarke's foot", 0.304_797_265_4),
            ("in", 0.0254),
        ] {
            assert_eq!(by_name(name).map(|u| u.metres), Some(metres), "{name}");
        }
        assert_eq!(by_name("degree"), None);
        assert_eq!(by_name(""), None);
    }

    #[test]
    fn systems_have_the_units_of_the_registry() {
        for (kind, code, metres) in [
            ("projected", 2229, US_FOOT), // California zone 5
            ("projected", 2994, 0.3048),  // Oregon
            ("projected", 2993, 1.0),     // the same in metres
            ("projected", 26915, 1.0),    // UTM
            ("projected", 6880, US_FOOT), // Nebraska
            ("vertical", 6360, US_FOOT),  // NAVD88 in feet
            ("vertical", 5703, 1.0),      // NAVD88 in metres
        ] {
            let unit = of_system(kind, code).expect("a unit");
            assert!((unit.metres - metres).abs() < 1e-15, "{kind} {code}: {unit:?}");
        }
        assert_eq!(by_code(9003).map(|u| u.metres), Some(US_FOOT));
        assert_eq!(by_code(32632), None);
        assert!(units().count() > 40);
    }
}
