//! What views show of a lamp and of what is around it, pixel by pixel, compared with shapes.

pub(crate) mod measure;
pub(crate) mod patches;
pub(crate) mod silhouette;
