//! The triangles of a mesh file as it holds them, before they are joined and placed.

/// Largest number of triangles of one file; the largest known robots have 480,000 in all.
const MAX_TRIANGLES: usize = 4_000_000;

/// The triangles of a file, in metres by the file's own unit.
#[derive(Debug, Default, Clone, PartialEq)]
pub(crate) struct Soup {
    pub(crate) vertices: Vec<[f64; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Remarks about the file for the user.
    pub(crate) notes: Vec<String>,
}

impl Soup {
    /// Adds a vertex and returns its index, or why it cannot be added.
    pub(crate) fn add_vertex(&mut self, p: [f64; 3]) -> Result<u32, String> {
        let at = u32::try_from(self.vertices.len()).map_err(|_| "too many vertices".to_owned())?;
        self.vertices.push(p);
        Ok(at)
    }

    pub(crate) fn add_triangle(&mut self, corners: [u32; 3]) -> Result<(), String> {
        if self.triangles.len() >= MAX_TRIANGLES {
            return Err(format!("more triangles than a link can have \"{MAX_TRIANGLES}\""));
        }
        self.triangles.push(corners);
        Ok(())
    }

    pub(crate) fn note(&mut self, note: &str) {
        if !self.notes.iter().any(|known| known == note) {
            self.notes.push(note.to_owned());
        }
    }
}

/// The bytes of a text file as UTF-8.
pub(crate) fn text(bytes: &[u8]) -> Result<&str, String> {
    std::str::from_utf8(bytes).map_err(|e| format!("not UTF-8 from byte {}", e.valid_up_to()))
}
