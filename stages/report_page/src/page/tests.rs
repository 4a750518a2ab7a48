//! Tests of whole pages: what is escaped, what is allowed, what comes back, and how long pages get.

use super::*;
use crate::input::PagePoint;
use contract::{Label, PointKind};

const NASTY: &str = "</script><img src=x onerror=alert(1)> & \u{202e}<!--";

fn texts(name: &str) -> PageTexts {
    let result = serde_json::json!({
        "schema": "stillpoint.result/1", "version": name, "robots": [{"id": name, "joints": {name: 1.5}}],
        "inputs": [{"path": name}], "stages": [], "warnings": [name]
    });
    PageTexts {
        title: name.into(),
        program: "0".into(),
        result: serde_json::to_string_pretty(&result).expect("JSON"),
        changes: Some(format!("{{\"base\": {}}}", serde_json::json!(name))),
        summary: name.into(),
        is_partial: false,
        run: vec![("memory".into(), name.into())],
    }
}

fn arm(name: &str) -> robot::Model {
    let vertices = vec![[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]];
    let mesh =
        robot::Mesh { vertices, triangles: vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]] };
    let link = robot::Link {
        name: name.into(),
        role: robot::Role::Main,
        parent_joint: None,
        mesh: mesh.into(),
        cad: robot::CadCloud::default().into(),
        bounds: geometry::Aabb { min: [0.0; 3], max: [0.1; 3] },
    };
    robot::Model { name: name.into(), links: vec![link], ..robot::Model::default() }
}

fn page(name: &str) -> ReportPage {
    let scanners = vec![PageScanner { name: name.into(), at: [1.0, 2.0, 3.0] }];
    let mut page = ReportPage::new(texts(name), scanners);
    let pose = geometry::Pose::translation(1.0, 0.0, 0.0);
    let model = arm(name);
    let bodies = vec![(0, (*model.links[0].mesh).clone())];
    page.add_robot(Some(PageRobot {
        model,
        world_from_link: vec![pose],
        loops: Vec::new(),
        bodies,
        hanging: Vec::new(),
    }));
    page.add_robot(None);
    page
}

/// The text of the element with this id.
fn element<'a>(html: &'a str, id: &str) -> &'a str {
    let behind = html.split_once(&format!("id=\"{id}\">")).expect("an element").1;
    behind.split_once("</script>").expect("its end").0
}

#[test]
fn no_name_gets_out_of_its_place() {
    let page = page(NASTY);
    let html = page.html(&page.points([0.0; 3])).expect("a page");
    for bad in ["<img src", "onerror=alert(1)>", "\u{202e}", "<!--"] {
        assert!(!html.contains(bad), "{bad}");
    }
    assert_eq!(html.matches("</script>").count(), 5, "its own five");
    let data: serde_json::Value = serde_json::from_str(element(&html, "data")).expect("JSON");
    assert_eq!(data["result"]["robots"][0]["id"], NASTY);
    assert_eq!(data["result"]["robots"][0]["joints"][NASTY], 1.5);
    assert_eq!((&data["changes"]["base"], &data["title"]), (&NASTY.into(), &NASTY.into()));
    let view: serde_json::Value = serde_json::from_str(element(&html, "view-data")).expect("JSON");
    assert_eq!(view["trees"][0]["links"][0], NASTY);
    assert_eq!(view["robots"][1], serde_json::Value::Null);
}

#[test]
fn the_policy_allows_its_own_script_and_style_and_nothing_else() {
    let page = page("hall");
    let html = page.html(&page.points([0.0; 3])).expect("a page");
    let script = html.rsplit_once("<script>").expect("a script").1;
    let script = script.split_once("</script>").expect("its end").0;
    let style = html.split_once("<style>").expect("a style").1;
    let style = style.split_once("</style>").expect("its end").0;
    let policy = html.split_once("Security-Policy\" content=\"").expect("a policy").1;
    let policy = policy.split_once('"').expect("its end").0;
    assert!(policy.starts_with("default-src 'none'"), "{policy}");
    for text in [script, style] {
        assert!(policy.contains(&policy_digest(text)), "{policy}");
    }
    // The name space of SVG is a name; nothing else looks like an address.
    let addresses = html.matches("://").count();
    assert_eq!(addresses, html.matches("http://www.w3.org/2000/svg").count());
    assert!(!script.contains("innerHTML") && !script.contains("eval("));
    assert!(!html.contains(" style=\"") && !html.contains(" onclick="));
}

#[test]
fn points_come_back_where_they_were() {
    let page = page("hall");
    let mut points = page.points([0.0; 3]);
    let at = |i: u32| [f64::from(i) * 0.37 - 9.0, f64::from(i % 17), 0.4];
    let of = |i: u32| PagePoint {
        world: at(i),
        label: Label { kind: PointKind::Fixed, ..Label::FIXED },
    };
    points.add(&(0..50).map(of).collect::<Vec<_>>());
    let html = page.html(&points).expect("a page");
    let view: serde_json::Value = serde_json::from_str(element(&html, "view-data")).expect("JSON");
    let bytes = miniz_oxide::inflate::decompress_to_vec(&unbase64(element(&html, "packed")));
    let bytes = bytes.expect("inflates");
    let mut read = bytes.iter();
    let mut places = Vec::new();
    for block in view["blocks"].as_array().expect("blocks") {
        let number = |i: usize| block[i].as_i64().expect("a number");
        for count in 5..13 {
            let mut place = 0_u32;
            for _ in 0..number(count) {
                let mut shift = 0;
                loop {
                    let byte = *read.next().expect("a byte");
                    place += u32::from(byte & 0x7f) << shift;
                    shift += 7;
                    if byte < 0x80 {
                        break;
                    }
                }
                let step =
                    |axis: u32| (0..10).map(|b| (place >> (3 * b + axis) & 1) << b).sum::<u32>();
                places.push([0, 1, 2].map(|i| {
                    (f64::from(step(i as u32)) + 0.5) / 1024.0 * 6.4 + 6.4 * number(1 + i) as f64
                }));
            }
        }
    }
    assert_eq!(places.len(), 50);
    for i in 0..50 {
        let near = |p: &[f64; 3]| (0..3).all(|k| (p[k] - at(i)[k]).abs() < 0.0032);
        assert!(places.iter().any(near), "{:?}", at(i));
    }
}

#[test]
fn a_large_hall_is_a_page_of_bounded_length_and_equal_bytes() {
    let page = page("hall");
    let mut points = page.points([0.0; 3]);
    // Without any surface nothing is thinned by voxels alone.
    let at = |k: u64| {
        let of = |i: u64| (crate::morton::scatter(3 * k + i) % 100_000) as f64 * 1e-3;
        [of(0), of(1), of(2) * 0.1]
    };
    for part in 0..12_u64 {
        let some =
            (0..300_000).map(|k| PagePoint { world: at(part * 300_000 + k), label: Label::FIXED });
        points.add(&some.collect::<Vec<_>>());
        points.settle();
        assert!(points.n_points() <= 2 * MOST_POINTS);
    }
    let html = page.html(&points).expect("a page");
    assert!(html.len() < 15_000_000, "{} bytes", html.len());
    assert!(element(&html, "packed").len() > 6_000_000, "room is used");
    assert!(html == page.html(&points).expect("a page"), "the same bytes");
}

fn unbase64(text: &str) -> Vec<u8> {
    let value = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let letters: Vec<u32> =
        text.bytes().filter(|c| *c != b'=').map(|c| u32::from(value(c))).collect();
    let mut out = Vec::new();
    for four in letters.chunks(4) {
        let bits = (0..4).fold(0, |sum, i| sum << 6 | four.get(i).copied().unwrap_or(0));
        out.extend(&bits.to_be_bytes()[1..four.len()]);
    }
    out
}

#[test]
fn pictures_stand_on_the_page_as_far_as_they_fit() {
    let mut own = page("R1");
    own.add_picture("R1", b"first".to_vec());
    own.add_picture("R2", vec![7; MOST_TEXT]);
    own.add_picture("R3", b"third".to_vec());
    let html = own.html(&own.points([0.0; 3])).expect("a page");
    let known: serde_json::Value =
        serde_json::from_str(element(&html, "pictures")).expect("parses");
    // "R2" does not fit: the page refers to its file.
    assert_eq!(known, serde_json::json!({"R1": base64(b"first"), "R3": base64(b"third")}));
}
