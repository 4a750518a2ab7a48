//! The Python module `_stillpoint`: arguments and arrays in, answers and arrays out. It computes
//! nothing itself and knows no file format; `python/stillpoint` is what people import.

mod calls;
mod errors;
mod fits;
mod points;

/// The allocator of the program: it returns memory to the system when a stage ends. Memory of
/// Python itself is not affected.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// The module as Python imports it.
#[pyo3::pymodule]
mod _stillpoint {
    #[pymodule_export]
    use super::calls::call;
    #[pymodule_export]
    use super::fits::fit;
    #[pymodule_export]
    use super::points::LabelledTiles;
}
