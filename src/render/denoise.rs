//! Choice of the denoiser of rendered views.

use super::RenderArgs;
use anyhow::{Result, bail};
use clap::ValueEnum;
use eagpt_denoise::{Denoiser, Identity};
use serde::Serialize;

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Choice {
    /// Leave the noise
    None,
    /// Open Image Denoise where it is found, the filter elsewhere
    Auto,
    /// Open Image Denoise 2, a library loaded at run time; an error where it is not found
    Oidn,
    /// The program's own filter
    Filter,
}

/// The denoiser that was asked for and the one that runs, for the record.
#[derive(Serialize)]
pub(super) struct Denoising {
    pub(super) asked: Choice,
    /// Null if nothing is denoised.
    pub(super) ran: Option<Identity>,
}

/// The denoiser of a job; `None` if nothing is to be denoised.
///
/// # Errors
/// If the library that was asked for cannot be used.
pub(super) fn denoiser(args: &RenderArgs) -> Result<Option<Denoiser>> {
    let path = args.oidn.as_deref();
    if let (Some(path), Choice::None | Choice::Filter) = (path, args.denoise) {
        bail!(
            "--oidn {}: of use only with --denoise auto or oidn",
            path.display()
        );
    }
    Ok(match args.denoise {
        Choice::None => None,
        Choice::Auto => Some(Denoiser::auto(path)?),
        Choice::Oidn => Some(Denoiser::oidn(path)?),
        Choice::Filter => Some(Denoiser::filter()),
    })
}
