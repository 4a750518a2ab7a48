//! Reads triangles from an OBJ file. Materials, groups, normals, lines and curves are ignored.

use super::soup::Soup;

pub(super) fn read(text: &str) -> Result<Soup, String> {
    let mut soup = Soup::default();
    let mut face: Vec<u32> = Vec::new();
    for (line_at, line) in text.lines().enumerate() {
        let at = |what: &str| format!("line {}: {what}", line_at + 1);
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let mut p = [0.0; 3];
                for v in &mut p {
                    *v = words
                        .next()
                        .and_then(|w| w.parse().ok())
                        .ok_or_else(|| at("a vertex needs three numbers"))?;
                }
                soup.add_vertex(p)?;
            }
            Some("f") => {
                face.clear();
                for word in words.take_while(|w| !w.starts_with('#')) {
                    let index: i64 = (word.split('/').next().and_then(|w| w.parse().ok()))
                        .ok_or_else(|| at("a face names its corners by number"))?;
                    let n = soup.vertices.len() as i64;
                    let index = if index < 0 { n + index } else { index - 1 };
                    if !(0..n).contains(&index) {
                        return Err(at("a face names a corner that is not there"));
                    }
                    face.push(index as u32);
                }
                super::primitive::fan(&mut soup, &face)?;
            }
            _ => {}
        }
    }
    Ok(soup)
}
