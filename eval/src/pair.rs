//! All image metrics of one pair.

use crate::encode::{assert_comparable, pq_encoded, srgb_clipped};
use crate::error::Result;
use crate::flip::{self, FlipHdr, FlipOptions, FlipParameters, flip_hdr, flip_ldr};
use crate::known::{KnownPixels, pack};
use crate::psnr::psnr;
use crate::ssim::ssim_in;
use eagpt_scene::Image;
use serde::{Deserialize, Serialize};

/// Image metrics of one pair. The keys are the same in every output.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ImageMetrics {
    /// See [`crate::psnr_srgb`]; infinite for equal images, which is `null` in JSON.
    #[serde(with = "decibels")]
    pub psnr_srgb_db: f64,
    /// See [`crate::psnr_linear`]; infinite for equal images, which is `null` in JSON.
    #[serde(with = "decibels")]
    pub psnr_linear_db: f64,
    /// See [`crate::psnr_pq`]; infinite for equal images, which is `null` in JSON.
    #[serde(with = "decibels")]
    pub psnr_pq_db: f64,
    /// See [`crate::ssim_srgb`]; 1 for equal images.
    pub ssim_srgb: f64,
    /// Mean of [`flip_hdr`]; 0 for equal images.
    pub flip_hdr: f64,
    /// Mean of [`flip_ldr`] in sRGB clipped to [0, 1]; 0 for equal images.
    pub flip_ldr_srgb: f64,
    /// Parameters of `flip_hdr`.
    pub flip_hdr_parameters: FlipParameters,
}

/// [`ImageMetrics`] and the map behind one of them.
#[derive(Debug, Clone)]
pub struct Comparison {
    /// The numbers.
    pub metrics: ImageMetrics,
    /// HDR-FLIP error of each pixel in [0, 1].
    pub flip_hdr_error: Image<1>,
}

/// Measures a linear Rec.709 image against its reference. LDR-FLIP shares the pixels per degree of
/// HDR-FLIP.
///
/// # Errors
/// As [`flip_hdr`].
///
/// # Panics
/// If the sizes differ or the images have no pixels.
pub fn compare(reference: &Image<3>, test: &Image<3>, options: &FlipOptions) -> Result<Comparison> {
    compare_known(reference, test, None, options)
}

/// As [`compare`] where `known` says which pixels of the reference mean something: see
/// [`crate::known`]. The error of others is 0 in the map.
///
/// # Errors
/// As [`flip_hdr`].
///
/// # Panics
/// As [`compare`], and if no pixel is known.
pub(crate) fn compare_known(
    reference: &Image<3>,
    test: &Image<3>,
    known: Option<&KnownPixels>,
    options: &FlipOptions,
) -> Result<Comparison> {
    assert_comparable(reference, test);
    let completed = known.map(|known| known.with_reference(reference, test));
    let test = completed.as_ref().unwrap_or(test);
    let hdr = flip_hdr_known(reference, test, known, options)?;
    let pq = [reference, test].map(|image| pq_encoded(&pack(known, image)));
    let linear = [reference, test].map(|image| pack(known, image));
    let srgb = [reference, test].map(srgb_clipped);
    let known_srgb = [&srgb[0], &srgb[1]].map(|image| pack(known, image));
    let windows = known.map(KnownPixels::windows);
    let ldr = flip_ldr(&srgb[0], &srgb[1], options.ppd)?;
    Ok(Comparison {
        metrics: ImageMetrics {
            psnr_srgb_db: psnr(&known_srgb[0], &known_srgb[1]),
            psnr_linear_db: psnr(&linear[0], &linear[1]),
            psnr_pq_db: psnr(&pq[0], &pq[1]),
            ssim_srgb: ssim_in(&srgb[0], &srgb[1], windows.as_ref()),
            flip_hdr: hdr.mean,
            flip_ldr_srgb: known.map_or(ldr.mean, |_| flip::mean(&pack(known, &ldr.error))),
            flip_hdr_parameters: hdr.parameters,
        },
        flip_hdr_error: hdr.error,
    })
}

/// HDR-FLIP at the exposures of what is known of the reference, averaged over that.
pub(crate) fn flip_hdr_known(
    reference: &Image<3>,
    test: &Image<3>,
    known: Option<&KnownPixels>,
    options: &FlipOptions,
) -> Result<FlipHdr> {
    if known.is_none() {
        return flip_hdr(reference, test, options);
    }
    let chosen = FlipParameters::for_reference(options, &pack(known, reference))?;
    let options = FlipOptions {
        start_exposure: Some(chosen.start_exposure),
        stop_exposure: Some(chosen.stop_exposure),
        num_exposures: Some(chosen.num_exposures),
        ..*options
    };
    let mut hdr = flip_hdr(reference, test, &options)?;
    hdr.mean = flip::mean(&pack(known, &hdr.error));
    Ok(hdr)
}

/// JSON has no infinity: equal images have `null` decibels.
pub(crate) mod decibels {
    use serde::{Deserialize, Deserializer, Serializer};

    #[expect(
        clippy::trivially_copy_pass_by_ref,
        reason = "the signature that serde calls"
    )]
    pub(crate) fn serialize<S: Serializer>(db: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        if db.is_finite() {
            serializer.serialize_f64(*db)
        } else {
            serializer.serialize_none()
        }
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
    }

    /// The same for values that may be absent altogether.
    pub(crate) mod optional {
        use serde::{Deserializer, Serializer};

        #[expect(clippy::ref_option, reason = "the signature that serde calls")]
        pub(crate) fn serialize<S: Serializer>(
            db: &Option<f64>,
            serializer: S,
        ) -> Result<S::Ok, S::Error> {
            match db {
                Some(db) => super::serialize(db, serializer),
                None => serializer.serialize_none(),
            }
        }

        pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
            deserializer: D,
        ) -> Result<Option<f64>, D::Error> {
            super::deserialize(deserializer).map(Some)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_images_survive_json() {
        let image = Image::filled(12, 12, [0.3, 0.6, 2.0]);
        let found = compare(&image, &image, &FlipOptions::default()).unwrap();
        let json = serde_json::to_string(&found.metrics).unwrap();
        assert!(
            json.starts_with(r#"{"psnr_srgb_db":null,"psnr_linear_db":null,"#),
            "{json}"
        );
        assert!(
            json.contains(r#""flip_hdr":0.0,"flip_ldr_srgb":0.0,"#),
            "{json}"
        );
        assert!(json.contains(r#""tonemapper":"aces""#), "{json}");
        let back: ImageMetrics = serde_json::from_str(&json).unwrap();
        assert_eq!(back, found.metrics);
        assert_eq!(back.psnr_pq_db, f64::INFINITY);
    }
}
