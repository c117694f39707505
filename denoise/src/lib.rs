//! Denoising.
