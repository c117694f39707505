//! Pixels of views, as fits compare them with shapes: silhouettes, and the light in them.

pub(crate) mod measure;
pub(crate) mod patches;
pub(crate) mod silhouette;
