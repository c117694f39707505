//! Light and material of Gaussians.

use crate::features::{NUM_LANES, lane};
use eagpt_scene::Gaussian;
use glam::{Mat3, Vec3};

/// Light and material of a Gaussian in the lanes of [`crate::Features`], without the lanes that
/// depend on the ray.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C, align(64))]
pub struct Attributes(pub [f32; NUM_LANES]);

impl Attributes {
    /// Those of a Gaussian; the radiance is that of all directions.
    pub(crate) fn new(g: &Gaussian) -> Self {
        let mut lanes = [0.0; NUM_LANES];
        lanes[lane::RADIANCE..][..3].copy_from_slice(&g.radiance.to_array());
        lanes[lane::EMISSION] = g.emission;
        lanes[lane::ALBEDO..][..3].copy_from_slice(&g.albedo.to_array());
        lanes[lane::NORMAL..][..3].copy_from_slice(&Mat3::from_quat(g.rotation).z_axis.to_array());
        lanes[lane::ALPHA] = 1.0;
        lanes[lane::SIZE] = (g.scale.x * g.scale.y).sqrt();
        Self(lanes)
    }

    /// Radiance, linear.
    #[inline(always)]
    pub fn radiance(&self) -> Vec3 {
        Vec3::from_slice(&self.0[lane::RADIANCE..][..3])
    }

    /// Emission, 0 to 1.
    pub fn emission(&self) -> f32 {
        self.0[lane::EMISSION]
    }

    /// With the normal turned towards the origin of rays that see the Gaussian from `face`.
    #[inline(always)]
    pub(crate) fn turned(&self, face: Face) -> Self {
        let mut lanes = self.0;
        for (lane, sign) in lanes.iter_mut().zip(face.signs()) {
            *lane *= sign;
        }
        Self(lanes)
    }
}

/// Side of a Gaussian that a ray hits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Face {
    /// Against its normal.
    Front,
    /// Along its normal.
    Back,
}

impl Face {
    /// Of a Gaussian whose plane lies `plane` from the origin along its normal: in front of the
    /// origin the plane has the sign of the cosine between ray and normal.
    #[inline(always)]
    pub(crate) fn of_plane(plane: f32) -> Self {
        if plane > 0.0 { Self::Back } else { Self::Front }
    }

    /// Factors of the lanes of attributes: the normal is turned towards the ray's origin.
    #[inline(always)]
    pub(crate) fn signs(self) -> &'static [f32; NUM_LANES] {
        const SIGNS: [[f32; NUM_LANES]; 2] = {
            let mut signs = [[1.0; NUM_LANES]; 2];
            let mut k = lane::NORMAL;
            while k < lane::NORMAL + 3 {
                signs[1][k] = -1.0;
                k += 1;
            }
            signs
        };
        &SIGNS[self as usize]
    }
}
