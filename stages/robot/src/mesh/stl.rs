//! Reads triangles from an STL file: ASCII, binary, or binary with a header that begins "solid".

use super::soup::Soup;

const HEADER_BYTES: usize = 84;
const RECORD_BYTES: usize = 50;

pub(super) fn read(bytes: &[u8]) -> Result<Soup, String> {
    let claimed = (bytes.get(80..HEADER_BYTES))
        .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let expected = claimed.map(|n| HEADER_BYTES + n * RECORD_BYTES);
    if expected == Some(bytes.len()) {
        return binary(bytes);
    }
    let head = &bytes[..bytes.len().min(4096)];
    let is_text =
        bytes.trim_ascii_start().starts_with(b"solid") && head.is_ascii() && !head.contains(&0);
    if is_text {
        return ascii(super::soup::text(bytes)?);
    }
    match (claimed, expected) {
        (Some(n), Some(expected)) if expected < bytes.len() => {
            let mut soup = binary(&bytes[..expected])?;
            if n > 0 {
                soup.note("bytes after the last triangle are ignored");
            }
            Ok(soup)
        }
        (Some(n), _) => {
            let n_present = (bytes.len() - HEADER_BYTES) / RECORD_BYTES;
            Err(format!("the header counts {n} triangles, the file holds {n_present}"))
        }
        _ => Err("too short for an STL file".to_owned()),
    }
}

fn binary(bytes: &[u8]) -> Result<Soup, String> {
    let mut soup = Soup::default();
    for record in bytes[HEADER_BYTES..].chunks_exact(RECORD_BYTES) {
        let number = |at: usize| {
            let b = &record[at..at + 4];
            f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        };
        let mut corners = [0; 3];
        for (k, corner) in corners.iter_mut().enumerate() {
            let at = 12 + 12 * k;
            *corner = soup.add_vertex([number(at), number(at + 4), number(at + 8)])?;
        }
        soup.add_triangle(corners)?;
    }
    Ok(soup)
}

fn ascii(text: &str) -> Result<Soup, String> {
    let mut soup = Soup::default();
    let mut corners: Vec<u32> = Vec::with_capacity(3);
    let mut closed = false;
    for (line_at, line) in text.lines().enumerate() {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("vertex") => {
                let mut p = [0.0; 3];
                for v in &mut p {
                    *v = words.next().and_then(|w| w.parse().ok()).ok_or_else(|| {
                        format!("line {}: a vertex needs three numbers", line_at + 1)
                    })?;
                }
                corners.push(soup.add_vertex(p)?);
            }
            Some("endloop") => {
                if corners.len() != 3 {
                    return Err(format!(
                        "line {}: a facet of {} corners",
                        line_at + 1,
                        corners.len()
                    ));
                }
                soup.add_triangle([corners[0], corners[1], corners[2]])?;
                corners.clear();
            }
            Some("endsolid") => closed = true,
            _ => {}
        }
    }
    if !closed || !corners.is_empty() {
        return Err("the text ends before \"endsolid\"".to_owned());
    }
    Ok(soup)
}
