//! Tiles, clouds and other formats hold the same points when they are read back one by one.

mod common;

use common::{N, clouds, copc, folder, intensity, label, read, source_id, world};
use contract::Label;
use export::*;
use std::path::Path;

#[test]
fn tiles_hold_every_point_once_whatever_the_memory_and_compression() {
    let mut seen: Option<Vec<(i64, u8, Vec<u8>)>> = None;
    let variants =
        [(false, false, 1 << 20), (false, false, 4000), (true, false, 4000), (true, true, 1 << 20)];
    for (k, (compress, with_color, memory)) in variants.into_iter().enumerate() {
        let out = folder(&format!("tiles_{k}"));
        let written = clouds(&out, N, [compress, with_color], memory);
        assert!(written.tiles.len() > 6);
        let mut all = Vec::new();
        for tile in &written.tiles {
            let (header, points) = read(&tile.path);
            assert_eq!(header.number_of_points(), tile.n_points);
            assert_eq!(points.len() as u64, tile.n_points);
            let bounds = header.bounds();
            assert!((bounds.min.x - tile.bounds.min[0]).abs() < 1e-9);
            for p in &points {
                assert!(tile.bounds.grown(1e-6).contains([p.x, p.y, p.z]));
                assert_eq!(p.color.is_some(), with_color);
                let i = (p.gps_time.expect("has time") * 1000.0).round() as i64;
                let xyz = world(i as usize);
                assert!((p.x - xyz[0]).abs() < 6e-5 && (p.y - xyz[1]).abs() < 6e-5);
                assert!((p.z - xyz[2]).abs() < 6e-5);
                let ids = (intensity(i as usize), source_id(i as usize));
                assert_eq!((p.intensity, p.point_source_id), ids);
                if let Some(color) = p.color {
                    assert_eq!([color.red, color.green, color.blue], [i as u16, 2, 65535]);
                }
                all.push((i, u8::from(p.classification), p.extra_bytes.clone()));
            }
        }
        all.sort();
        assert_eq!(all.len(), N);
        assert!(
            all.iter().enumerate().all(|(i, p)| p.0 == i as i64 && p.1 == class_of(label(i).kind))
        );
        assert_eq!(all[6].2, [1, 0, 1, 0]);
        assert_eq!(all[3].2, [0, 0, 0, 0]);
        assert_eq!(seen.get_or_insert_with(|| all.clone()), &all);
        let names: Vec<_> =
            std::fs::read_dir(out.join("tiles")).expect("folder").flatten().collect();
        assert_eq!(names.len(), written.tiles.len(), "nothing half-written is left");
        let (robots, fixed) = (written.robots, written.fixed.expect("asked"));
        assert_eq!(robots.n_points + fixed.n_points, N as u64);
        assert_eq!(read(&robots.path).1.len(), N * 3 / 10);
    }
}

#[test]
fn tiles_make_one_copc_file_the_same_for_any_number_of_threads() {
    let n = 700_000;
    let mut files = Vec::new();
    for (n_threads, compress) in [(1, false), (2, false), (3, true)] {
        let out = folder(&format!("copc_{n_threads}"));
        let written = clouds(&out, n, [compress, true], 1 << 20);
        assert!(copc(&out, n_threads));
        files.push(std::fs::read(out.join(COPC)).expect("reads"));
        assert!(files[0] == files[files.len() - 1], "{n_threads} threads");
        assert_eq!(std::fs::read_dir(out.join("scratch")).expect("lists").count(), 0);
        let (header, points) = read(&out.join(COPC));
        let vlr = &header.vlrs()[0];
        assert_eq!((vlr.user_id.as_str(), vlr.record_id), ("copc", 1));
        assert!(header.date().is_none());
        let line = |p: las::Point| {
            let i = (p.gps_time.expect("has time") * 1000.0).round() as i64;
            let color = p.color.expect("has color");
            let ids = (p.intensity, p.point_source_id, u8::from(p.classification), p.extra_bytes);
            (i, [p.x, p.y, p.z].map(f64::to_bits), [color.red, color.green, color.blue], ids)
        };
        let mut whole: Vec<_> = points.into_iter().map(line).collect();
        let of_tiles = written.tiles.iter().flat_map(|tile| read(&tile.path).1);
        let mut tiles: Vec<_> = of_tiles.map(line).collect();
        whole.sort();
        tiles.sort();
        assert_eq!(whole.len(), n);
        assert!(whole == tiles);
    }
    assert!(!copc(&folder("copc_of_nothing"), 1));
}

/// The header of a PLY file, and its points' bytes.
fn ply(path: &Path) -> (String, Vec<[u8; 40]>) {
    let bytes = std::fs::read(path).expect("reads");
    let end = b"end_header\n";
    let at = bytes.windows(end.len()).position(|w| w == end).expect("a header") + end.len();
    let (points, rest) = bytes[at..].as_chunks::<40>();
    assert!(rest.is_empty());
    (String::from_utf8(bytes[..at].to_vec()).expect("text"), points.to_vec())
}

#[test]
fn ply_files_hold_each_point_once_moving_and_fixed_apart() {
    let out = folder("ply");
    let written = clouds(&out, N, [true, true], 1 << 20);
    let n = export::write_ply(&export::tiles(&out).expect("lists"), &out.join("export"), || Ok(()))
        .expect("writes")
        .expect("has tiles");
    assert_eq!(n.iter().sum::<u64>(), N as u64);
    let mut whole = Vec::new();
    for (name, n) in export::PLY.iter().zip(n) {
        let (header, points) = ply(&out.join("export").join(name));
        assert!(header.contains(&format!("element vertex {n}\n")), "{header}");
        // Open3D's tensor reader ignores most other types, meshio takes `uchar` for signed, and
        // CloudCompare's command line ignores other names.
        for kept in ["scalar_kind", "scalar_robot", "scalar_link"] {
            assert!(header.contains(&format!(" {kept}\n")), "{header}");
        }
        for lost in ["char ", "uchar ", "short ", "ushort ", "uint "] {
            assert!(!header.contains(&format!("property {lost}")), "{header}");
        }
        assert_eq!(points.len() as u64, n);
        let moves = |p: &[u8; 40]| p[28] == 1 || p[28] == 2;
        assert!(points.iter().all(|p| moves(p) == (*name == export::PLY[0])));
        whole.extend(points);
    }
    let of_tiles = written.tiles.iter().flat_map(|tile| read(&tile.path).1);
    let extra = |p: &las::Point, at: usize| {
        i64::from(u16::from_le_bytes([p.extra_bytes[at], p.extra_bytes[at + 1]])) - 1
    };
    let mut tiles: Vec<([u64; 3], [i64; 3])> = of_tiles
        .map(|p| {
            let numbers = [i64::from(p.intensity), extra(&p, 0), extra(&p, 2)];
            ([p.x, p.y, p.z].map(f64::to_bits), numbers)
        })
        .collect();
    let number = |p: &[u8; 40], i: usize| {
        u64::from_le_bytes(p[8 * i..8 * i + 8].try_into().expect("eight bytes"))
    };
    let int = |p: &[u8; 40], at: usize| {
        i64::from(i32::from_le_bytes(p[at..at + 4].try_into().expect("four bytes")))
    };
    // Colours are those of the tiles.
    assert!(whole.iter().any(|p| p[37..] != [0; 3]));
    let mut found: Vec<([u64; 3], [i64; 3])> = (whole.iter())
        .map(|p| ([0, 1, 2].map(|i| number(p, i)), [24, 29, 33].map(|at| int(p, at))))
        .collect();
    tiles.sort_unstable();
    found.sort_unstable();
    assert!(tiles == found);
    assert!(export::write_ply(&[], &out, || Ok(())).expect("looks").is_none());
}

#[test]
fn bodies_are_an_extra_field_behind_labels() {
    let out = folder("bodies");
    let las = LasSettings::new(Quantum { scale: [1e-3; 3], offset: [0.0; 3] });
    let settings = Settings { bodies: true, fixed_cloud: false, ..Settings::default() };
    let las = settings.records(&las);
    let mut tiles = Tiles::create(&out, &las, &settings).expect("create").expect("asked");
    let points = PointColumns {
        world: &[[1.0; 3], [2.0; 3]],
        labels: &[label(6), Label::FLOOR],
        body: &[70_000, 0],
        ..PointColumns::default()
    };
    let packed = Pack::of_clouds(&las, &settings).pack(&points).expect("packs");
    tiles.add(&packed, &contract::OneByOne).expect("adds");
    let written = tiles.finish(&contract::OneByOne).expect("finish");
    let (_, points) = read(&written[0].path);
    let mut extra: Vec<_> = points.iter().map(|p| p.extra_bytes.clone()).collect();
    extra.sort();
    assert_eq!(extra, [vec![0; 8], vec![1, 0, 1, 0, 0x70, 0x11, 1, 0]]);
}

#[test]
fn a_dropped_file_leaves_nothing_and_an_empty_cloud_is_whole() {
    let out = folder("dropped");
    let path = out.join("a.las");
    let settings = LasSettings::new(Quantum { scale: [1e-4; 3], offset: [0.0; 3] });
    let mut writer = LasWriter::create(&path, settings.clone()).expect("create");
    let at = |world| PointColumns { world, labels: &[Label::FIXED], ..PointColumns::default() };
    writer.push(&at(&[[0.0; 3]])).expect("push");
    let error = writer.push(&at(&[[1e9, 0.0, 0.0]])).expect_err("too far for i32");
    assert!(error.to_string().contains("a.las"), "{error}");
    drop(writer);
    assert_eq!(std::fs::read_dir(&out).expect("folder").count(), 0);
    for compress in [false, true] {
        let settings = LasSettings { compress, ..settings.clone() };
        LasWriter::create(&path, settings).expect("create").finish().expect("finish");
        assert!(read(&path).1.is_empty());
    }
}

#[test]
fn a_tile_that_states_more_than_fits_takes_no_memory_for_it() {
    let path = folder("chunks").join("a.laz");
    let quantum = Quantum { scale: [1e-4; 3], offset: [0.0; 3] };
    let settings = LasSettings { compress: true, ..LasSettings::new(quantum) };
    let mut writer = LasWriter::create(&path, settings.clone()).expect("create");
    let points = PointColumns {
        world: &[[1.0, 2.0, 3.0]],
        labels: &[Label::FIXED],
        ..PointColumns::default()
    };
    writer.push(&points).expect("push");
    writer.finish().expect("finish");
    let n_read = |path| {
        let mut n = 0;
        export::read_tile(path, &settings, None, |points| {
            n += points.len();
            Ok(())
        })
        .map(|()| n)
    };
    assert_eq!(n_read(&path).expect("reads"), 1);
    // Colours and bodies add layers.
    for (with_color, with_bodies) in [(true, false), (false, true), (true, true)] {
        let settings = LasSettings { with_color, with_bodies, ..settings.clone() };
        let path = path.with_file_name("more.laz");
        let mut writer = LasWriter::create(&path, settings.clone()).expect("create");
        writer.push(&points).expect("push");
        writer.finish().expect("finish");
        export::read_tile(&path, &settings, None, |_| Ok(())).expect("reads");
    }
    let mut bytes = std::fs::read(&path).expect("bytes");
    let at = u32::from_le_bytes(bytes[96..100].try_into().expect("four")) as usize;
    let table = u64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight")) as usize;
    let mut wrong = |at: usize, n: u32, words: &str| {
        let before: [u8; 4] = bytes[at..at + 4].try_into().expect("four");
        bytes[at..at + 4].copy_from_slice(&n.to_le_bytes());
        std::fs::write(&path, &bytes).expect("writes");
        let error = n_read(&path).expect_err("it does not fit");
        assert!(error.to_string().contains(words), "{error}");
        bytes[at..at + 4].copy_from_slice(&before);
    };
    for n in [u32::MAX, 3] {
        wrong(table + 4, n, "table of chunks");
    }
    wrong(247, 2, "instead of 2");
    // Behind the first record and the number of points are the lengths of the layers.
    wrong(at + 8 + settings.record_len() + 4, u32::MAX, "layers of");
    // A tile of no points is not decoded, whatever its table states.
    bytes[247..255].copy_from_slice(&0_u64.to_le_bytes());
    bytes[table + 4..table + 8].copy_from_slice(&u32::MAX.to_le_bytes());
    std::fs::write(&path, &bytes).expect("writes");
    assert_eq!(n_read(&path).expect("there is nothing to read"), 0);
}

#[test]
fn a_reference_system_comes_back_by_the_reader_of_las() {
    let quantum = Quantum { scale: [1e-4; 3], offset: [0.0; 3] };
    let record = |record_id: u16| export::RawVlr {
        user_id: export::PROJECTION.into(),
        record_id,
        description: String::new(),
        data: vec![record_id as u8; 20],
    };
    for (ids, is_text) in [(vec![2112], true), (vec![34_735, 34_736], false), (vec![], true)] {
        let path = folder("system").join(format!("{}.las", ids.len()));
        let vlrs = ids.iter().copied().map(record).collect();
        let settings = LasSettings { vlrs, ..LasSettings::new(quantum) };
        let mut writer = LasWriter::create(&path, settings.clone()).expect("create");
        let points = PointColumns {
            world: &[[1.0, 2.0, 3.0]],
            labels: &[Label::FIXED],
            ..PointColumns::default()
        };
        writer.push(&points).expect("push");
        writer.finish().expect("finish");
        let reader = las::Reader::from_path(&path).expect("a LAS file");
        let vlrs = reader.header().vlrs();
        let found: Vec<u16> =
            vlrs.iter().filter(|v| v.user_id == "LASF_Projection").map(|v| v.record_id).collect();
        // The crate takes the bit for set wherever the format asks for text.
        let bit = std::fs::read(&path).expect("bytes")[6] & 16;
        assert_eq!((found, bit == 16), (ids, is_text));
        export::read_tile(&path, &settings, None, |_| Ok(())).expect("reads");
    }
}
