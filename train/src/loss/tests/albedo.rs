//! The loss of stage 1 against central differences.

use super::*;

#[test]
fn albedo_loss_leaves_emitters_alone_and_matches_differences() {
    for clipped in [None, Some(clipped())] {
        check_albedo_gradients(clipped.as_ref());
    }
}

fn check_albedo_gradients(clipped: Option<&Image<3>>) {
    let mut base = frame();
    for (i, pixel) in base.pixels.iter_mut().enumerate() {
        pixel.0[lane::EMISSION] = if i % 3 == 0 { 0.2 } else { 0.05 };
    }
    let view = view(true);
    let target = pq_image(&view.radiance);
    let irradiance: Vec<Vec3> = (0..WIDTH * HEIGHT)
        .map(|i| Vec3::new(0.5, 1.0, 1.5) * (0.5 + noise(i)[0]))
        .collect();
    let light = PixelLight::new(&base, irradiance, 0.1);
    let loss = |albedos: &[Vec3]| albedo_loss(albedos, &light, &target, 0.2, None, clipped);
    let albedos = albedos_of(&base);
    let (_, analytic) = loss(&albedos);
    let largest = analytic
        .iter()
        .fold(0.0_f32, |m, d| m.max(d.abs().max_element()));
    for pixel in [3, 4, 50, 91] {
        for k in 0..3 {
            let h = 2e-3;
            let (mut up, mut down) = (albedos.clone(), albedos.clone());
            up[pixel][k] += h;
            down[pixel][k] -= h;
            let width = f64::from(up[pixel][k] - down[pixel][k]);
            let numeric = (loss(&up).0.total - loss(&down).0.total) / width;
            let got = f64::from(analytic[pixel][k]);
            assert!(
                (got - numeric).abs() < 0.02 * f64::from(largest),
                "pixel {pixel} channel {k}: {got:e} {numeric:e}"
            );
            assert!(pixel % 3 != 0 || got == 0.0);
        }
    }
}
