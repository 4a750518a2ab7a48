//! Reads the units of coordinates from PROJJSON.

use super::declared::{Declaration, StatedUnit, System};
use super::known;
use serde_json::Value;

/// The declaration of a text; `None` where it is no PROJJSON.
pub(crate) fn read(bytes: &[u8]) -> Option<Declaration> {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    let crs: Value = serde_json::from_slice(&bytes[..end]).ok()?;
    let mut found = Declaration::new("PROJJSON");
    look(&crs, &mut found);
    (found.system != System::Unknown || found.vertical.is_some()).then_some(found)
}

/// Reads a system, or the parts of a compound one.
fn look(crs: &Value, found: &mut Declaration) {
    match crs["type"].as_str().unwrap_or_default() {
        "CompoundCRS" => {
            crs["components"].as_array().into_iter().flatten().for_each(|part| look(part, found));
        }
        "BoundCRS" => look(&crs["source_crs"], found),
        "ProjectedCRS" | "DerivedProjectedCRS" | "EngineeringCRS" | "DerivedEngineeringCRS"
            if found.system == System::Unknown =>
        {
            found.system = System::Lengths;
            found.horizontal = unit(crs, 0).or_else(|| of_registry(crs, "projected"));
            found.vertical = found.vertical.take().or_else(|| unit(crs, 2));
        }
        "GeographicCRS" | "GeodeticCRS" | "DerivedGeographicCRS" | "DerivedGeodeticCRS"
            if found.system == System::Unknown =>
        {
            let is_cartesian = crs["coordinate_system"]["subtype"] == "Cartesian";
            found.system = if is_cartesian { System::EarthCentred } else { System::Degrees };
        }
        "VerticalCRS" | "DerivedVerticalCRS" => {
            found.vertical = unit(crs, 0).or_else(|| of_registry(crs, "vertical"));
        }
        _ => {}
    }
}

/// The unit of an axis: a name that PROJ knows, or an object with its length in metres.
fn unit(crs: &Value, axis: usize) -> Option<StatedUnit> {
    let unit = &crs["coordinate_system"]["axis"].get(axis)?["unit"];
    match unit {
        Value::String(name) => Some(StatedUnit { name: Some(name.clone()), metres: None }),
        Value::Object(unit) => Some(StatedUnit {
            name: unit.get("name").and_then(Value::as_str).map(str::to_owned),
            metres: unit.get("conversion_factor").and_then(Value::as_f64),
        }),
        _ => None,
    }
}

fn of_registry(crs: &Value, kind: &str) -> Option<StatedUnit> {
    let id = &crs["id"];
    let code = if id["authority"] == "EPSG" { id["code"].as_u64() } else { None };
    known::of_system(kind, u32::try_from(code?).ok()?).map(StatedUnit::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn compounds_and_plain_names_are_read() {
        let projected = r#"{"type": "ProjectedCRS", "coordinate_system": {"subtype": "Cartesian", "axis": [
            {"name": "E", "unit": {"type": "LinearUnit", "name": "US survey foot",
             "conversion_factor": 0.304800609601219}}, {"name": "N", "unit": "metre"}]}}"#;
        let vertical =
            r#"{"type": "VerticalCRS", "coordinate_system": {"axis": [{"unit": "metre"}]}}"#;
        let text = format!(r#"{{"type": "CompoundCRS", "components": [{projected}, {vertical}]}}"#);
        let found = read(text.as_bytes()).expect("PROJJSON");
        assert_eq!(found.system, System::Lengths);
        assert_eq!(found.horizontal.and_then(|u| u.metres), Some(0.304_800_609_601_219));
        assert_eq!(found.vertical.and_then(|u| u.name), Some("metre".into()));
        let bound = format!(r#"{{"type": "BoundCRS", "source_crs": {projected}}}"#);
        assert!(read(bound.as_bytes()).expect("PROJJSON").horizontal.is_some());
    }

    #[test]
    fn degrees_numbers_of_systems_and_nonsense() {
        let system = |text: &str| read(text.as_bytes()).map(|found| found.system);
        assert_eq!(system(r#"{"type": "GeographicCRS"}"#), Some(System::Degrees));
        let centred = r#"{"type": "GeodeticCRS", "coordinate_system": {"subtype": "Cartesian"}}"#;
        assert_eq!(system(centred), Some(System::EarthCentred));
        let by_id = br#"{"type": "ProjectedCRS", "id": {"authority": "EPSG", "code": 2229}}"#;
        let found = read(by_id).expect("PROJJSON");
        assert_eq!(found.horizontal.and_then(|u| u.name), Some("US survey foot".into()));
        let deep = "[".repeat(100_000);
        for text in ["", "{", "[]", "3", r#"{"type": 3}"#, &deep] {
            assert_eq!(system(text), None);
        }
    }
}
