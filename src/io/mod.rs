//! Reading and copying of files: reads past the page cache, pieces of inputs that several threads
//! read, decode and digest, copies of folders, and checks of paths inside a result.

pub(crate) mod copy_folder;
pub(crate) mod direct;
pub(crate) mod hash_tree;
pub(crate) mod own_paths;
pub(crate) mod read_parts;
