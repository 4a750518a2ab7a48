//! The picture of what changed shows robots in both postures, coordinates, and names that can be
//! read.

use export::*;
use geometry::Aabb;

/// Points of an upright box's surface, 1 cm apart.
fn surface(min: [f64; 3], size: [f64; 3]) -> Vec<[f64; 3]> {
    let n = size.map(|s| (s / 0.01) as i32);
    let at = |i: usize, k: i32| min[i] + 0.01 * f64::from(k);
    let all = (0..=n[0]).flat_map(|i| (0..=n[1]).map(move |j| [i, j]));
    all.flat_map(|[i, j]| (0..=n[2]).map(move |k| [at(0, i), at(1, j), at(2, k)])).collect()
}

/// Share of the pixels within a rectangle (left, top, right, bottom) for which a condition holds.
fn share(canvas: &Canvas, [left, top, right, bottom]: [usize; 4], is: impl Fn(Rgb) -> bool) -> f64 {
    let file = tempfile::NamedTempFile::new().expect("a file");
    canvas.write(file.path()).expect("writes");
    let opened = std::fs::File::open(file.path()).expect("opens");
    let mut read = png::Decoder::new(std::io::BufReader::new(opened)).read_info().expect("reads");
    let mut bytes = vec![0; read.output_buffer_size().expect("a size")];
    let info = read.next_frame(&mut bytes).expect("reads");
    let n = info.color_type.samples();
    let of = |(x, y): (usize, usize)| {
        let at = (y * canvas.width() + x) * n;
        [0, 1, 2].map(|i| bytes[at + i])
    };
    let all = (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y)));
    all.filter(|at| is(of(*at))).count() as f64 / ((right - left) * (bottom - top)) as f64
}

#[test]
fn changes_show_a_robot_as_it_stood_and_as_it_stands() {
    let bounds = Aabb { min: [10.0, 20.0, 0.0], max: [13.0, 23.0, 2.0] };
    let robot = |then: Vec<[f64; 3]>, now: Vec<[f64; 3]>| ComparedRobot {
        name: "R1 moved".into(),
        at: [11.5, 21.5, 0.0],
        then,
        now,
    };
    let draw = |robots: &[ComparedRobot], things: &[ChangedThing]| {
        let (stands, unseen) = (&[[10.5, 22.5, 0.5]][..], &[][..]);
        draw_changes(&ComparedCell { bounds: &bounds, stands, unseen, things, robots })
    };
    // It stood to the west (left) and stands to the east, each 0.5 m by 1 m by 1 m.
    let [west, east] = [10.5, 12.0].map(|x| surface([x, 21.0, 0.2], [0.5, 1.0, 1.0]));
    let moved = draw(&[robot(west.clone(), east.clone())], &[]);
    let (empty, stayed) = (draw(&[], &[]), draw(&[robot(Vec::new(), east)], &[]));
    let is_then = |[r, g, b]: Rgb| r > 150 && g < 110 && b < 60;
    let is_now = |[r, g, b]: Rgb| b > 160 && r < 200 && i16::from(b) - i16::from(r) > 40 && g > 90;
    // 300 pixels a metre from the corner at (48, 88): the box of each, and a little beside it.
    let boxes = [10.5, 12.0].map(|x: f64| {
        let left = 48 + ((x - 10.0) * 300.0) as usize;
        [left - 8, 88 + 300 - 8, left + 158, 88 + 600 + 8]
    });
    let then = boxes.map(|at| share(&moved, at, is_then));
    let now = boxes.map(|at| share(&moved, at, is_now));
    assert!(then[0] > 0.005 && then[1] == 0.0, "the old outline: {then:?}");
    assert!(now[1] > 0.5 && now[0] < 0.01, "the new body, filled: {now:?}");
    assert_eq!(share(&stayed, boxes[0], is_then), 0.0);
    for canvas in [&empty, &stayed] {
        assert_eq!((canvas.width(), canvas.height()), (moved.width(), moved.height()));
    }
    // A grid with coordinates in the margin, which is white without them.
    let ink = share(&empty, [0, 88, 47, 988], |[r, g, b]| r < 160 && g < 160 && b < 160);
    assert!(ink > 0.001, "coordinates beside the view: {ink}");
}

#[test]
fn names_of_changes_do_not_cover_each_other() {
    let bounds = Aabb { min: [0.0; 3], max: [4.0, 4.0, 2.0] };
    let thing = |name: &str| ChangedThing {
        name: name.into(),
        gone: Vec::new(),
        filled: Vec::new(),
        at: [2.0, 2.0, 1.0],
    };
    let draw = |names: &[&str]| {
        let things: Vec<ChangedThing> = names.iter().map(|name| thing(name)).collect();
        let (things, robots) = (&things[..], &[][..]);
        draw_changes(&ComparedCell { bounds: &bounds, stands: &[], unseen: &[], things, robots })
    };
    let dark = |canvas: &Canvas| {
        share(canvas, [500, 88, 700, 980], |[r, g, b]| r < 90 && g < 90 && b < 90)
    };
    let none = dark(&draw(&[]));
    let [one, three] =
        [&["WWW"][..], &["WWW", "WWW", "WWW"]].map(|names| dark(&draw(names)) - none);
    assert!(one > 0.0 && three > 2.8 * one, "one name {one}, three {three}");
}

#[test]
fn links_have_colours_of_their_own() {
    let colours: std::collections::BTreeSet<Rgb> = (0..24).map(link_color).collect();
    assert_eq!(colours.len(), 24);
}

#[test]
fn the_plan_shows_what_stands_under_a_ceiling() {
    use contract::Label;
    let bounds = Aabb { min: [0.0; 3], max: [4.0, 4.0, 5.0] };
    let draw = |floor: Option<f64>, ceiling: f64| {
        let plan = PlanPicture::new(&bounds).over_floor(floor);
        let level = |z: f64| surface([0.0, 0.0, z], [3.99, 3.99, 0.0]);
        plan.add(&level(0.0), &vec![Label::FLOOR; 160_000]);
        for at in [level(ceiling), surface([1.0, 1.0, 0.0], [0.5, 0.5, 0.5])] {
            plan.add(&at, &vec![Label::FIXED; at.len()]);
        }
        plan.draw("hall", &[], &[])
    };
    // The upper right quarter of the plan, which has the floor and the ceiling alone.
    let dark = |canvas: &Canvas| {
        let side = canvas.width() - 96;
        let quarter = [58 + side / 2, 106, 38 + side, 86 + side / 2];
        share(canvas, quarter, |[r, g, b]| r < 190 && g < 190 && b < 190)
    };
    let [cut, whole, low] = [(Some(0.0), 4.5), (None, 4.5), (Some(0.0), 2.5)]
        .map(|(floor, ceiling)| dark(&draw(floor, ceiling)));
    assert!(cut < 0.1 && whole > 0.9 && low > 0.9, "{cut} {whole} {low}");
}
