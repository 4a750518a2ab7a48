//! Triangles as records of a binary STL file: a head of 84 bytes that ends with their number, then
//! 50 bytes for each, all numbers little-endian.

/// Length of the head of a binary STL file, bytes.
pub const STL_HEAD: usize = 84;
/// Length of the record of a triangle, bytes: normal, three corners, two bytes without meaning.
pub const STL_TRIANGLE: usize = 50;

/// Triangles, by their corners, as a binary STL file in single precision, in the unit of the
/// corners.
pub fn binary_stl(triangles: impl ExactSizeIterator<Item = [[f64; 3]; 3]>) -> Vec<u8> {
    let mut out = vec![0_u8; 80];
    out.reserve(4 + STL_TRIANGLE * triangles.len());
    out.extend((triangles.len() as u32).to_le_bytes());
    for [a, b, c] in triangles {
        let edge = |to: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| to[i] - a[i]) };
        let (u, v) = (edge(b), edge(c));
        let turned = |i: usize| u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3];
        let n: [f64; 3] = std::array::from_fn(turned);
        let length = n.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        for value in n.map(|x| x / length).into_iter().chain(a).chain(b).chain(c) {
            out.extend((value as f32).to_le_bytes());
        }
        out.extend([0, 0]);
    }
    out
}

/// The corners of the triangles whose records these bytes are: what follows the head of a binary
/// STL file. An incomplete record at the end is left out.
pub fn stl_corners(records: &[u8]) -> impl Iterator<Item = [[f32; 3]; 3]> + '_ {
    let number = |bytes: &[u8]| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    records.chunks_exact(STL_TRIANGLE).map(move |record| {
        let at = |corner: usize, axis: usize| number(&record[12 + 12 * corner + 4 * axis..]);
        std::array::from_fn(|corner| std::array::from_fn(|axis| at(corner, axis)))
    })
}
