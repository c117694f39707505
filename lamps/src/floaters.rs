//! Floaters beside lamps: discs in the air that look like what is far behind them.
//!
//! Between the wires of a cage, views see the wall beyond. A disc that fills the gaps and has the
//! colour of the wall costs stage 0 nothing, but keeps the light of the lamp from the room. Without
//! it the pictures are the same: nothing tells of it, and it goes.

use crate::strays::beside;
use eagpt_scene::color::luminance;
use eagpt_scene::lamps::Lamps;
use eagpt_scene::spread::evenly;
use eagpt_scene::{Camera, Gaussians, SceneEdit};
use eagpt_trace::{Device, Features, TraceError};
use glam::Vec3;

/// A pixel tells of the discs in it if a channel is brighter or darker without them by this part of
/// the luminance …
const LEAST_CHANGE: f32 = 0.2;
/// … or if what it shows then is not farther by this part: layers of one wall are alike.
const FARTHER: f32 = 0.1;
/// A disc with this share of its weight in such pixels is no floater: of a floater some lie in
/// pixels with wires.
const SHARE_TOLD: f32 = 0.8;
/// Opaque pixels' worth of weight in all views, below which nothing is known of a disc.
const LEAST_WEIGHT: f32 = 0.05;
/// Most cameras that are asked, of those towards which a disc may be.
const MOST_CAMERAS: usize = 32;
/// Most times that discs are left out, without those that pixels told of before.
const MOST_TIMES: usize = 3;

/// Whether each of the Gaussians of `scene` stays, `[n]`, which comes with the number of those that
/// are not fixed. Of others, which are beside bare `lamps`, no picture of the `cameras` tells.
///
/// # Errors
/// If the device fails.
pub fn without_floaters(
    device: &Device,
    scene: (&Gaussians, usize),
    lamps: &Lamps,
    cameras: &[Camera],
) -> Result<Vec<bool>, TraceError> {
    let is_beside = beside(scene, lamps);
    let gaussians = scene.0;
    let mut edit = SceneEdit::keeping((0..gaussians.len()).map(|i| !is_beside(i)).collect());
    if edit.keep.iter().all(|stays| *stays) {
        return Ok(edit.keep);
    }
    let left_out = (gaussians.positions.iter().zip(&edit.keep)).filter(|(_, stays)| !**stays);
    let places: Vec<Vec3> = left_out.map(|(place, _)| *place).collect();
    let mut cameras = towards(&places, cameras);
    let whole = device.scene(gaussians)?;
    for _ in 0..MOST_TIMES {
        let rest = device.scene(&edit.applied(gaussians))?;
        let mut seen = vec![Seen::default(); gaussians.len()];
        let mut showing = Vec::with_capacity(cameras.len());
        for camera in cameras {
            let without = rest.gbuffer(&camera)?;
            let value =
                |pixel: usize, with: &Features| f32::from(tells(with, &without.pixels[pixel]));
            let (_, contributions) = whole.contributions(&camera, &value)?;
            for c in &contributions {
                let seen = &mut seen[c.gaussian as usize];
                seen.weight += c.weight;
                seen.told += c.weighted_value;
            }
            if contributions
                .iter()
                .any(|c| !edit.keep[c.gaussian as usize])
            {
                showing.push(camera);
            }
        }
        cameras = showing;
        let mut is_over = true;
        for (keep, seen) in edit.keep.iter_mut().zip(seen).filter(|(keep, _)| !**keep) {
            *keep = seen.stays();
            is_over &= !*keep;
        }
        if is_over {
            break;
        }
    }
    Ok(edit.keep)
}

/// Cameras that have some of the `places` in their pictures, at most [`MOST_CAMERAS`].
fn towards(places: &[Vec3], cameras: &[Camera]) -> Vec<Camera> {
    let has = |camera: &Camera| {
        let mut places = places.iter();
        places.any(|place| camera.is_in_picture(camera.project(*place)))
    };
    let all: Vec<&Camera> = cameras.iter().filter(|camera| has(camera)).collect();
    evenly(&all, MOST_CAMERAS).map(|camera| **camera).collect()
}

/// Weight of a disc in pixels.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    /// In all, and …
    weight: f32,
    /// … in those that tell.
    told: f32,
}

impl Seen {
    fn stays(&self) -> bool {
        self.weight < LEAST_WEIGHT || self.told > SHARE_TOLD * self.weight
    }
}

/// Whether a pixel is another without discs, or what it shows then is as near.
fn tells(with: &Features, without: &Features) -> bool {
    let [light, other] = [with, without].map(Features::radiance);
    let change = (other - light).abs().max_element();
    let is_alike = change <= LEAST_CHANGE * luminance(light.to_array());
    let is_farther = without.mean_distance() > (1.0 + FARTHER) * with.mean_distance();
    !is_alike || !is_farther
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::Gaussian;
    use eagpt_scene::lamps::{Lamp, LampShape};
    use eagpt_testkit::gaussians::{look_at, material};
    use glam::{DVec3, Quat, Vec2};

    const WALL: f32 = 0.5;

    /// An upright disc, towards −y, of standard deviation `scale`.
    fn disc(at: Vec3, scale: f32, radiance: f32) -> Gaussian {
        Gaussian {
            position: at,
            scale: Vec2::splat(scale),
            rotation: Quat::from_rotation_arc(Vec3::Z, Vec3::NEG_Y),
            ..material(Vec3::splat(radiance), 0.0, Vec3::splat(0.5))
        }
    }

    /// Which of `discs` stay: a ball lamp hangs 1 m before a wall, and 3 m before the cameras,
    /// whose backs are towards the rest of the room.
    fn kept(discs: &[Gaussian], shape: LampShape) -> Vec<bool> {
        let wall = disc(Vec3::new(0.0, 1.0, 0.0), 5.0, WALL);
        let lamp_disc = Gaussian {
            emission: 1.0,
            ..disc(Vec3::ZERO, 0.02, 100.0)
        };
        let moving = discs.iter().copied().chain([wall]);
        let room = [disc(Vec3::new(0.0, -6.0, 0.0), 0.1, WALL); 8];
        let scene: Gaussians = moving.chain([lamp_disc]).chain(room).collect();
        let frame = (Vec3::ZERO, Quat::IDENTITY, Vec3::splat(0.08));
        let lamps = Lamps {
            lamps: vec![Lamp::unmeasured(shape, frame, (0.01, Vec3::ONE))],
        };
        let cameras =
            [-1.0, 0.0, 1.0].map(|x| look_at(DVec3::new(x, -3.0, 0.3), DVec3::ZERO, 60, 40));
        let num_moving = discs.len() + 1;
        let keep = without_floaters(&Device::Cpu, (&scene, num_moving), &lamps, &cameras).unwrap();
        assert!(keep[discs.len()..].iter().all(|stays| *stays));
        keep[..discs.len()].to_vec()
    }

    #[test]
    fn of_what_hangs_beside_a_lamp_that_stays_of_which_pictures_tell() {
        let at = |y: f32| Vec3::new(0.2, y, 0.0);
        let kept = |disc: Gaussian| kept(&[disc], LampShape::Ball)[0];
        assert!(!kept(disc(at(0.3), 0.05, WALL)));
        assert!(!kept(disc(at(0.3), 0.05, 0.85 * WALL)));
        // A wire.
        assert!(kept(disc(at(0.3), 0.05, 0.7 * WALL)));
        // Of the wall's luminance, and redder.
        let red = Vec3::new(1.8, 0.78, 0.82) * WALL;
        assert!((luminance(red.to_array()) / WALL - 1.0).abs() < 0.01);
        assert!(kept(Gaussian {
            radiance: red,
            ..disc(at(0.3), 0.05, WALL)
        }));
        // The wall is 4 m away, and 3.2 m is a fifth less.
        assert!(!kept(disc(at(0.2), 0.05, WALL)));
        // A layer of the wall, though within reach of the lamp.
        assert!(kept(disc(at(0.7), 0.05, WALL)));
        // Beyond its reach, and where no camera looks.
        assert!(kept(disc(Vec3::new(1.2, 0.0, 0.0), 0.05, WALL)));
        assert!(kept(disc(Vec3::new(0.0, 0.0, 0.6), 0.001, WALL)));
        let emits = Gaussian {
            emission: 1.0,
            ..disc(at(0.3), 0.05, WALL)
        };
        assert!(kept(emits));
    }

    #[test]
    fn layers_of_a_floater_go_together() {
        let layers = [0.3, 0.32, 0.34].map(|y| disc(Vec3::new(0.2, y, 0.0), 0.06, WALL));
        assert_eq!(kept(&layers, LampShape::Ball), [false; 3]);
    }

    #[test]
    fn a_floater_behind_wires_goes_and_the_wires_stay() {
        let wire = |x: f32| Gaussian {
            scale: Vec2::new(0.01, 0.15),
            ..disc(Vec3::new(x, 0.15, 0.0), 0.0, 0.1)
        };
        let floater = disc(Vec3::new(0.2, 0.3, 0.0), 0.15, WALL);
        let discs = [wire(0.1), wire(0.2), wire(0.3), floater];
        assert_eq!(kept(&discs, LampShape::Ball), [true, true, true, false]);
        // It is in nobody's light beside a flat lamp.
        assert_eq!(kept(&discs, LampShape::Panel), [true; 4]);
    }
}
