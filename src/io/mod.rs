//! Files in and out: reads past the system's cache, pieces of inputs read by several threads and
//! summed up, copies of folders, paths that lie inside a result.

pub(crate) mod copy_folder;
pub(crate) mod direct;
pub(crate) mod hash_tree;
pub(crate) mod own_paths;
pub(crate) mod read_parts;
