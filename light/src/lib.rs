//! The light of a scene, as its Gaussians and their photographs tell it.
//!
//! - [`surfaces`]: the surface that each Gaussian is part of, where a camera sees it best.
//! - [`irradiance`]: light that Gaussians receive, gathered and smoothed.
//! - [`segments`]: receivers that are alike in colour, side by side.
//! - `alike`: the fit of light that makes the albedos of each segment alike; by it
//!   [`unseen`] finds light from where no view looks, [`luminaires`] bulbs that no view shows, and
//!   [`lamp_powers`] how strong lamps are.
//! - [`makes`]: lamps of one make.
//! - [`luminous`] and [`glows`]: Gaussians that shine without a mask, near lamps and elsewhere.
//! - [`energy`]: albedos that are no more than a surface can have.

mod alike;
pub mod energy;
pub mod glows;
pub mod hidden_lamps;
pub mod irradiance;
pub mod lamp_powers;
pub mod luminaires;
pub mod luminous;
pub mod makes;
pub mod segments;
pub mod surfaces;
pub mod unseen;
