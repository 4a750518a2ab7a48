//! Declarations of files, alone or contradicting each other, give the right units.
#![allow(clippy::unwrap_used)] // tests may panic

use super::*;

/// A unit as in real files, given by name and by length.
const NEW_MEXICO: &str = r#"PROJCS["NAD83(HARN) / New Mexico Central (ftUS)",GEOGCS["NAD83(HARN)",
    UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],
    UNIT["US survey foot",0.3048006096012192],AXIS["X",EAST],AXIS["Y",NORTH],
    VERTCS["North American Vertical Datum of 1988",UNIT["US survey foot",1.0],AXIS["H",UP]]]"#;

fn of(texts: &[&str]) -> Result<Units> {
    let declared: Vec<Declaration> = texts.iter().filter_map(|t| of_wkt(t.as_bytes())).collect();
    Units::of(&declared, None)
}

#[test]
fn nothing_declared_is_metres_assumed() {
    let units = of(&[]).unwrap();
    assert_eq!((units.origin, units.factors()), (Origin::Assumed, [1.0; 3]));
    assert!(units.to_string().contains("assumed"), "{units}");
}

#[test]
fn what_a_person_says_goes_before_all() {
    let foot = LengthUnit::new("foot", 0.3048);
    let degrees = of_wkt(br#"GEOGCS["WGS 84"]"#).unwrap();
    let units = Units::of(&[degrees], Some(&[foot.clone(), foot])).unwrap();
    assert_eq!((units.origin, units.factors()), (Origin::Given, [0.3048; 3]));
}

#[test]
fn heights_are_as_x_and_y_where_nothing_else_is_said() {
    let units = of(&[r#"PROJCS["a",UNIT["foot",0.3048]]"#]).unwrap();
    assert_eq!(units.factors(), [0.3048; 3]);
    assert!(units.remarks[0].contains("heights"), "{:?}", units.remarks);
    let units = of(&[r#"PROJCS["a",UNIT["metre",1]]"#]).unwrap();
    assert!(units.remarks.is_empty() && units.is_metres());
    let units =
        of(&[r#"COMPD_CS["c",PROJCS["a",UNIT["m",1]],VERT_CS["b",UNIT["foot",0.3048]]]"#]).unwrap();
    assert_eq!(units.factors(), [1.0, 1.0, 0.3048]);
    assert!(units.to_string().contains("heights foot (0.3048 m)"), "{units}");
}

#[test]
fn a_unit_that_contradicts_itself_is_settled_by_x_and_y_or_refused() {
    let units = of(&[NEW_MEXICO]).unwrap();
    assert_eq!(units.factors(), [known::US_FOOT; 3]);
    assert!(units.remarks.iter().any(|r| r.contains("contradicts")), "{:?}", units.remarks);
    for text in [
        r#"PROJCS["a",UNIT["foot",1.0]]"#,
        r#"COMPD_CS["c",PROJCS["a",UNIT["mm",0.001]],VERT_CS["b",UNIT["foot",1.0]]]"#,
    ] {
        let error = of(&[text]).unwrap_err();
        assert_eq!(error.kind(), Kind::BadInput, "{error}");
        assert!(error.to_string().contains("--units"), "{error}");
    }
}

#[test]
fn what_is_no_length_is_refused_with_a_way_out() {
    for text in [r#"GEOGCS["WGS 84"]"#, r#"GEOCCS["WGS 84",UNIT["metre",1]]"#] {
        let error = of(&[text]).unwrap_err();
        assert_eq!(error.kind(), Kind::Unsupported);
        assert!(error.to_string().contains("--units m"), "{error}");
    }
    let heights_alone = of(&[r#"VERT_CS["b",UNIT["foot",0.3048]]"#]).unwrap_err();
    assert_eq!(heights_alone.kind(), Kind::BadInput, "{heights_alone}");
}

#[test]
fn units_are_taken_in_order_and_contradictions_are_noted() {
    let (feet, metres) = (r#"PROJCS["a",UNIT["foot",0.3048]]"#, r#"PROJCS["a",UNIT["metre",1]]"#);
    let units = of(&[feet, metres]).unwrap();
    assert_eq!(units.factors(), [0.3048; 3]);
    assert!(units.remarks.iter().any(|r| r.contains("another unit")), "{:?}", units.remarks);
}

#[test]
fn names_of_units_reach_people_quoted_and_cut() {
    let name = format!("\u{1b}[2J\u{202e}{}", "x".repeat(1000));
    let units = of(&[&format!("PROJCS[\"a\",UNIT[\"{name}\",0.5]]")]).unwrap();
    assert_eq!(units.factors(), [0.5; 3]);
    for text in units.remarks.iter().chain([&units.to_string()]) {
        assert!(!text.contains(['\u{1b}', '\u{202e}']) && text.len() < 300, "{text:?}");
    }
}
