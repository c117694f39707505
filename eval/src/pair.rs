//! All image metrics of one pair.

use crate::encode::{assert_comparable, pq_encoded, srgb_clipped};
use crate::error::Result;
use crate::flip::{FlipOptions, FlipParameters, flip_hdr, flip_ldr};
use crate::psnr::psnr;
use crate::ssim::ssim;
use eagpt_scene::Image;
use serde::{Deserialize, Serialize};

/// How close a test image is to its reference. The keys are the same in every output.
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
    /// What `flip_hdr` was computed with.
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

/// Measures a linear Rec.709 image against its reference. LDR-FLIP shares the pixels per degree of HDR-FLIP.
///
/// # Errors
/// As [`flip_hdr`].
///
/// # Panics
/// If the sizes differ or the images have no pixels.
pub fn compare(reference: &Image<3>, test: &Image<3>, options: &FlipOptions) -> Result<Comparison> {
    assert_comparable(reference, test);
    let hdr = flip_hdr(reference, test, options)?;
    let psnr_pq_db = psnr(&pq_encoded(reference), &pq_encoded(test));
    let (reference_srgb, test_srgb) = (srgb_clipped(reference), srgb_clipped(test));
    Ok(Comparison {
        metrics: ImageMetrics {
            psnr_srgb_db: psnr(&reference_srgb, &test_srgb),
            psnr_linear_db: psnr(reference, test),
            psnr_pq_db,
            ssim_srgb: ssim(&reference_srgb, &test_srgb),
            flip_hdr: hdr.mean,
            flip_ldr_srgb: flip_ldr(&reference_srgb, &test_srgb, options.ppd)?.mean,
            flip_hdr_parameters: hdr.parameters,
        },
        flip_hdr_error: hdr.error,
    })
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
