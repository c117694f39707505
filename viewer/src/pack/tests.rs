use super::*;
use eagpt_scene::gaussians::{MAX_ALBEDO, random_cloud};
use eagpt_scene::light_basis::LightGroups;
use eagpt_scene::rng;
use eagpt_testkit::lamps::boxed;
use eagpt_trace::model::MIN_ALPHA;
use glam::Quat;

/// A cloud with harmonics, dark and bright light, and albedos up to the largest.
fn cloud(num: usize) -> Gaussians {
    let key = rng::RandomKey::new(5, rng::Purpose::Initialise, 0);
    let gaussians = random_cloud(num, 3);
    let changed = gaussians.iter().enumerate().map(|(i, mut g)| {
        let mut stream = key.stream(i as u32, 0);
        for four in g.harmonics.0.as_chunks_mut::<4>().0 {
            *four = stream.next_uniforms().map(|u| 1.2 * (u - 0.5));
        }
        let [stops, ..] = stream.next_uniforms();
        g.albedo *= MAX_ALBEDO;
        g.radiance *= (20.0 * stops - 12.0).exp2();
        g
    });
    changed.collect()
}

/// The stated steps bound the error: half a step of each quantity, in its own terms.
#[test]
fn what_was_packed_is_within_the_stated_error() {
    let gaussians = cloud(2000);
    let pack = Pack::new(&gaussians, &Lamps::default(), None).unwrap();
    assert!(pack.num > 1900 && pack.has_harmonics);
    let error = pack.error(&gaussians).unwrap();
    // Boxes of 2 units in 65,536 steps.
    assert!(error.position < 0.51 * 2.0 / 65_535.0, "{error:?}");
    assert!(
        error.scale < 0.002_72 && error.radiance < 0.002_75,
        "{error:?}"
    );
    // Half a step is 1.7e-4; three components, and twice for an angle, at worst 2·√3·1.7e-4·2 rad.
    assert!(error.rotation_deg < 0.07, "{error:?}");
    assert!(
        error.opacity < 0.000_123 && error.harmonic < 0.010_01,
        "{error:?}"
    );
    assert!(
        error.emission < 0.001_97 && error.albedo < 0.0158,
        "{error:?}"
    );
    // And it is an error: nothing is compared with itself.
    assert!(error.position > 1e-6 && error.radiance > 1e-3 && error.harmonic > 5e-3);
    assert!(error.albedo > 5e-3);
}

#[test]
fn neighbours_stand_together_and_the_invisible_is_left_out() {
    let mut gaussians = cloud(500);
    gaussians.opacities[7] = 0.9 * MIN_ALPHA;
    let pack = Pack::new(&gaussians, &Lamps::default(), None).unwrap();
    assert!(!pack.order.contains(&7));
    let steps = |order: &mut dyn Iterator<Item = usize>| {
        let places: Vec<Vec3> = order.map(|i| gaussians.positions[i]).collect();
        places
            .windows(2)
            .map(|pair| pair[0].distance(pair[1]))
            .sum::<f32>()
    };
    let packed = steps(&mut pack.order.iter().map(|&i| i as usize));
    assert!(packed < 0.4 * steps(&mut (0..500)), "{packed}");
    gaussians.opacities.fill(0.0);
    let refused = Pack::new(&gaussians, &Lamps::default(), None).unwrap_err();
    assert!(refused.to_string().contains("no Gaussian"));
}

#[test]
fn what_emits_knows_its_lamp() {
    let mut gaussians = random_cloud(300, 4);
    gaussians.opacities.fill(0.9);
    let lamp = boxed("half", [0.5, 0.0, 0.0], [0.7, 2.0, 2.0]);
    let lamps = Lamps { lamps: vec![lamp] };
    let pack = Pack::new(&gaussians, &lamps, None).unwrap();
    let (_, ids) = pack.unpack().unwrap();
    let mut num = [0; 2];
    for (&index, &id) in pack.order.iter().zip(&ids) {
        let g = gaussians.get(index as usize);
        let wanted = g.emission > EMISSION_THRESHOLD && lamps.lamps[0].contains(g.position);
        assert_eq!(id, u8::from(wanted));
        num[usize::from(id)] += 1;
    }
    assert!(num[0] > 50 && num[1] > 50, "{num:?}");
    let many = Lamps {
        lamps: vec![lamps.lamps[0].clone(); 256],
    };
    let refused = Pack::new(&gaussians, &many, None).unwrap_err().to_string();
    assert!(refused.contains("256 lamps"), "{refused}");
}

/// The light of each lamp alone stands at its Gaussians, and their sum is the light of the scene.
#[test]
fn lights_are_packed_one_by_one() {
    let gaussians = random_cloud(200, 8);
    let groups = LightGroups::new(&gaussians, &Lamps::default()).unwrap();
    let reflected: Vec<Vec3> = (0..200)
        .map(|i| Vec3::new(0.5, 1.0, 2.0) * i as f32)
        .collect();
    let basis = LightBasis::new(&gaussians, &groups, &reflected);
    let pack = Pack::new(&gaussians, &Lamps::default(), Some(&basis)).unwrap();
    assert_eq!(pack.lights, ["rest"]);
    let wanted = basis.alone(0);
    let mut num_lit = 0;
    for (light, &index) in pack.unpack_light(0).unwrap().iter().zip(&pack.order) {
        let wanted = wanted[index as usize];
        num_lit += u32::from(wanted.y > 0.0);
        assert!(
            (*light - wanted).abs().cmple(0.002_75 * wanted).all(),
            "{light} {wanted}"
        );
    }
    assert!(num_lit > 150);
    // The columns before are those of the pack without.
    let (with, _) = pack.unpack().unwrap();
    let plain = Pack::new(&gaussians, &Lamps::default(), None).unwrap();
    assert_eq!(with, plain.unpack().unwrap().0);
}

#[test]
fn rotations_survive_whatever_component_is_the_largest() {
    for q in [
        Quat::from_xyzw(0.0, 0.0, 0.0, 1.0),
        Quat::from_xyzw(-1.0, 0.0, 0.0, 0.0),
        Quat::from_xyzw(0.5, -0.5, 0.5, -0.5),
        Quat::from_xyzw(0.1, -0.9, 0.3, 0.2).normalize(),
        Quat::from_xyzw(0.1, 0.2, -0.7, 0.2).normalize(),
    ] {
        let back = RotationCode::new(q).rotation();
        assert!(q.dot(back).abs() > 1.0 - 1e-6, "{q} {back}");
    }
}

#[test]
fn signs_survive() {
    for value in [0, 1, -1, 127, -128, 300, i16::MAX, i16::MIN] {
        assert_eq!(signed_from_code(signed_to_code(value)), value);
    }
    assert_eq!([0, -1, 1, -2].map(signed_to_code), [0, 1, 2, 3]);
}

#[test]
fn broken_bytes_are_refused() {
    let gaussians = cloud(50);
    let mut pack = Pack::new(&gaussians, &Lamps::default(), None).unwrap();
    pack.num += 1;
    assert!(
        pack.unpack()
            .unwrap_err()
            .to_string()
            .contains("51 Gaussians")
    );
    pack.num -= 2;
    assert!(pack.unpack().is_err());
    pack.num += 1;
    pack.bytes.truncate(100);
    assert!(pack.unpack().is_err());
}
