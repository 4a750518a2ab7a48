//! Reads the folder of a result and writes its page: `page OUT LIBRARY PAGE`. It looks at files
//! without comparing them; the program itself does that.

use contract::{Label, PointKind};
use geometry::Pose;
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use report_page::{PageLoop, PagePoint, PageRobot, PageScanner, PageTexts, ReportPage};
use robot::{Model, Settings};
use std::path::Path;

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let [out, library, to] = [&args[1], &args[2], &args[3]];
    let out = Path::new(out);
    let read = |name: &str| std::fs::read_to_string(out.join(name));
    let result = export::ResultFile::read(out).expect("a result");
    let texts = PageTexts {
        title: out.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        program: result.version.clone(),
        result: read("result.json").expect("reads"),
        changes: read("changes.json").ok(),
        summary: String::new(),
        is_partial: false,
    };
    let scanners = (0..4).map(|k| {
        let at = [[-5.4, 4.4, 1.88], [-0.6, -3.4, 1.70], [0.9, 1.3, 2.10], [5.4, 0.6, 1.61]][k];
        PageScanner { name: format!("scan_{}", k + 1), at }
    });
    let mut page = ReportPage::new(texts, scanners.collect());
    for entry in &result.robots {
        page.add_robot(robot(out, Path::new(library), entry));
    }
    let mut points = page.points();
    for tile in export::tiles(out).expect("tiles") {
        add_tile(&tile, &mut points);
    }
    for space in result.robots.iter().filter_map(|r| r.space.as_ref()) {
        points.add_space(&space.read(out).expect("space"));
    }
    let html = page.html(&points).expect("a page");
    println!("{} points kept, {} bytes", points.n_points(), html.len());
    std::fs::write(to, html).expect("writes");
}

fn robot(out: &Path, library: &Path, entry: &export::RobotEntry) -> Option<PageRobot> {
    let folder = out.join("robots").join(&entry.id);
    let settings = Settings::without_clouds();
    let (model, _) = Model::load(&folder, &settings).ok()?;
    let loops = Model::load(&library.join(&entry.model), &settings);
    let loops = loops.map(|(own, _)| PageLoop::of(&own)).unwrap_or_default();
    let pose = |name: &str| {
        let (_, pose) = entry.link_poses.0.iter().find(|(n, _)| n == name).expect("a pose");
        let [w, i, j, k] = pose.quat_wxyz;
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
        Pose::from_parts(Translation3::from(pose.xyz), turn)
    };
    let world_from_link = model.links.iter().map(|link| pose(&link.name)).collect();
    let mut files: Vec<_> = std::fs::read_dir(folder.join("meshes"))
        .expect("meshes")
        .map(|entry| entry.expect("an entry").path())
        .collect();
    files.sort();
    let export::WrittenBodies { links: bodies, hanging } =
        export::WrittenBodies::read(&files).expect("meshes");
    Some(PageRobot { model, world_from_link, loops, bodies, hanging })
}

fn add_tile(tile: &Path, points: &mut report_page::PagePoints) {
    let mut reader = las::Reader::from_path(tile).expect("opens");
    let mut piece = las::PointDataBuilder::new().for_header(reader.header()).build();
    while reader.fill_points(1 << 16, &mut piece).expect("reads") > 0 {
        let extra = piece.record_len() - usize::from(piece.format().extra_bytes);
        let of_record = |record: &[u8]| {
            let number =
                |at: usize| u16::from_le_bytes([record[extra + at], record[extra + at + 1]]);
            [number(0), number(2)].map(|n| n.wrapping_sub(1) as i16)
        };
        let owners = piece.raw_bytes().chunks_exact(piece.record_len()).map(of_record);
        let places = piece.x().zip(piece.y()).zip(piece.z());
        let kinds = piece.classification().map(|class| match class {
            2 => PointKind::Floor,
            64 => PointKind::Fixed,
            65 => PointKind::Link,
            66 => PointKind::Attachment,
            _ => PointKind::Uncertain,
        });
        let of = |((((x, y), z), kind), [robot, link]): ((((f64, f64), f64), _), [i16; 2])| {
            PagePoint { world: [x, y, z], label: Label { kind, robot, link } }
        };
        let all: Vec<PagePoint> = places.zip(kinds).zip(owners).map(of).collect();
        points.add(&all);
    }
    points.settle();
}
