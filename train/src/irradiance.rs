//! Irradiance of Gaussians, as baking and stage 1 gather it.

pub mod smooth;
