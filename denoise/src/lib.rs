//! Denoising of rendered light.
//!
//! - `frame`: the input of a denoiser: the exact and the noisy part of the light, and noise-free
//!   guides.
//! - [`filter`]: our own filter, local regression on the guides.
//! - `oidn`: Open Image Denoise, loaded at run time where the machine has it.
//!
//! [`Denoiser`] is the one interface of both. Light is linear and may be of any scale; nothing is
//! clipped. Light of emitters is exact: it keeps its bits and does not bleed into its surroundings.

mod error;
pub mod filter;
mod frame;
mod oidn;

pub use error::{DenoiseError, Result};
pub use frame::Frame;
pub use oidn::Oidn;

use eagpt_scene::Image;
use filter::Settings;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// A denoiser.
#[derive(Debug)]
pub enum Denoiser {
    /// Open Image Denoise.
    Oidn(Oidn),
    /// The filter of this crate.
    Filter,
}

/// Identity of a denoiser, recorded beside every result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Identity {
    /// `oidn` or `filter`.
    pub name: &'static str,
    /// Version of the library.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub version: Option<String>,
    /// The library's file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub library: Option<PathBuf>,
}

impl Denoiser {
    /// Open Image Denoise where it is found ([`Oidn::find`]), the filter elsewhere.
    ///
    /// # Errors
    /// [`DenoiseError::NotFound`] if there is a `path` and no library that works at it.
    pub fn auto(path: Option<&Path>) -> Result<Self> {
        match Oidn::find(path) {
            Ok(oidn) => Ok(Self::Oidn(oidn)),
            Err(error) if path.is_some() => Err(error),
            Err(error) => {
                tracing::info!("{error}; the filter runs instead");
                Ok(Self::Filter)
            }
        }
    }

    /// Open Image Denoise.
    ///
    /// # Errors
    /// As [`Oidn::find`].
    pub fn oidn(path: Option<&Path>) -> Result<Self> {
        Oidn::find(path).map(Self::Oidn)
    }

    /// The filter of this crate.
    pub fn filter() -> Self {
        Self::Filter
    }

    /// Identity of this denoiser.
    pub fn identity(&self) -> Identity {
        match self {
            Self::Oidn(oidn) => Identity {
                name: "oidn",
                version: Some(oidn.version()),
                library: Some(oidn.path().to_owned()),
            },
            Self::Filter => Identity {
                name: "filter",
                version: None,
                library: None,
            },
        }
    }

    /// The light of `frame`, emitted and reflected together, without the noise of the latter. The
    /// same bits for any number of threads.
    ///
    /// # Errors
    /// [`DenoiseError::Size`] if the images differ in size, [`DenoiseError::Failed`] if the library
    /// gives up.
    pub fn denoise(&self, frame: &Frame) -> Result<Image<3>> {
        frame.check()?;
        let frame = &frame.repaired();
        let mut reflected = match self {
            Self::Oidn(oidn) => oidn.reflected(frame)?,
            Self::Filter => filter::reflected(frame, &Settings::default()),
        };
        let noisy = frame.reflected.pixels().iter().zip(frame.coverage.pixels());
        for (pixel, (noisy, [coverage])) in reflected.pixels_mut().iter_mut().zip(noisy) {
            if *coverage <= 0.0 || pixel.iter().any(|value| !value.is_finite()) {
                *pixel = *noisy;
            }
        }
        Ok(frame.with_reflected(&reflected))
    }
}
