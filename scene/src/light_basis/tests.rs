use super::*;
use crate::gaussians::random_cloud;
use crate::lamps::{Lamp, LampShape, Lamps};
use crate::testing::assert_error;
use glam::Quat;

/// A lamp whose box holds all centres with x in a range.
fn lamp(name: &str, from: f32, to: f32) -> Lamp {
    // Grown by 15 % of the largest size on every side, which is y and z.
    let size = Vec3::new(to - from - 1.2, 4.0, 4.0);
    let frame = (Vec3::X * 0.5 * (from + to), Quat::IDENTITY, size);
    Lamp {
        name: name.to_owned(),
        ..Lamp::unmeasured(LampShape::Other, frame, (1.0, Vec3::ONE))
    }
}

/// Light of Gaussian `i` from lamp `k`, from 1e-4 to 30.
fn reflected(i: usize, k: usize) -> Vec3 {
    let t = (7 * i + 3 * k) as f32;
    let exponent = Vec3::new(t.sin(), (1.3 * t).cos(), (0.7 * t).sin());
    (exponent * 6.0).map(f32::exp) * 0.1
}

/// A cloud in which about half of the Gaussians emit, and its basis: lamp "left" below x = 0,
/// "nothing" far away, all other emitters the rest.
fn example() -> (Gaussians, LightGroups, LightBasis) {
    let mut scene = random_cloud(3000, 4);
    for emission in &mut scene.emissions {
        *emission = if *emission > 0.5 { 1.0 } else { 0.0 };
    }
    let lamps = Lamps {
        lamps: vec![lamp("nothing", 50.0, 60.0), lamp("left", -3.0, 0.0)],
    };
    let groups = LightGroups::new(&scene, &lamps).unwrap();
    let light = |i: usize| {
        let emits = groups.of[i] != NO_LIGHT;
        [0, 1].map(|k| if emits { Vec3::ZERO } else { reflected(i, k) })
    };
    let all: Vec<[Vec3; 2]> = (0..scene.len()).map(light).collect();
    let basis = LightBasis::new(&scene, &groups, all.as_flattened());
    (scene, groups, basis)
}

#[test]
fn emitters_belong_to_lamps_or_to_the_rest() {
    let (scene, groups, basis) = example();
    assert_eq!(groups.names, ["left", REST]);
    for (i, g) in scene.iter().enumerate() {
        let expected = match (g.emission > 0.1, g.position.x) {
            (false, _) => NO_LIGHT,
            (true, x) => u32::from(x > 0.0),
        };
        assert_eq!(groups.of[i], expected, "{}", g.position);
    }
    let emitters: Vec<(usize, usize)> = basis.emitters().collect();
    assert_eq!(
        emitters.len(),
        scene.emissions.iter().filter(|e| **e > 0.1).count()
    );
    assert!(
        emitters
            .iter()
            .all(|&(i, light)| groups.of[i] as usize == light)
    );
    let named_rest = Lamps {
        lamps: vec![lamp(REST, 0.0, 1.0)],
    };
    assert!(
        LightGroups::new(&scene, &named_rest)
            .unwrap_err()
            .contains("`rest`")
    );
}

#[test]
fn a_mix_is_a_sum() {
    let (scene, _, mut basis) = example();
    let within = |found: Vec3, expected: Vec3| {
        // Half floats have eleven bits; one rounding for each f32 operation beside that.
        (found - expected).abs().max_element() <= 2_f32.powi(-11) * 1.001 * expected.max_element()
            && (found / expected - Vec3::ONE).abs().max_element() <= 2_f32.powi(-11) * 1.001
    };
    let reflecting = || (0..scene.len()).filter(|&i| scene.emissions[i] == 0.0);
    let all = basis.radiances();
    for i in 0..scene.len() {
        match scene.emissions[i] == 0.0 {
            true => assert!(within(all[i], reflected(i, 0) + reflected(i, 1)), "{i}"),
            false => assert_eq!(all[i], scene.radiances[i]),
        }
    }
    let mix = [Vec3::new(1.0, 0.8, 0.6), Vec3::splat(2.5)];
    let find = |pattern: &str| basis.matching(pattern);
    assert_eq!(
        (find("left"), find("re*"), find("right")),
        (vec![0], vec![1], vec![])
    );
    for (k, factor) in mix.into_iter().enumerate() {
        basis.set_factor(k, factor);
    }
    let mixed = basis.radiances();
    let alone = [basis.alone(0), basis.alone(1)];
    for i in reflecting() {
        let expected = mix[0] * reflected(i, 0) + mix[1] * reflected(i, 1);
        assert!(
            within(mixed[i], expected),
            "{i}: {} not {expected}",
            mixed[i]
        );
        // Scales are powers of two: the same products.
        assert_eq!(mixed[i], mix[0] * alone[0][i] + mix[1] * alone[1][i]);
    }
    for (i, light) in basis.emitters() {
        assert_eq!(mixed[i], mix[light] * scene.radiances[i]);
        assert_eq!(alone[light][i], scene.radiances[i]);
        assert_eq!(alone[1 - light][i], Vec3::ZERO);
    }
    basis.set_factor(1, Vec3::ZERO);
    basis.set_factor(0, Vec3::ONE);
    assert_eq!(basis.radiances(), alone[0]);
    basis.set_factor(0, Vec3::ZERO);
    assert!(basis.radiances().iter().all(|light| *light == Vec3::ZERO));
}

/// A lamp shows what it reflects of the others once it is off, and is as before with all on.
#[test]
fn emitters_reflect_the_other_lights() {
    let (scene, groups, _) = example();
    let of_own = |i: usize, k: usize| groups.of[i] as usize == k;
    let light = |i: usize, k: usize| match of_own(i, k) {
        true => Vec3::ZERO,
        // At most a tenth of what the lamp sends, but where it would be more than all of it.
        false if i.is_multiple_of(50) => 2.0 * scene.radiances[i],
        false => 0.1 * scene.radiances[i],
    };
    let all: Vec<Vec3> = (0..scene.len())
        .flat_map(|i| [0, 1].map(|k| light(i, k)))
        .collect();
    let mut basis = LightBasis::new(&scene, &groups, &all);
    // Half floats of what is reflected, and the rounding of sums.
    let close = |found: Vec3, expected: Vec3, radiance: Vec3| {
        let bound = 1.01 * 2_f32.powi(-11) * radiance.max_element();
        let off = (found - expected).abs().max_element();
        assert!(off <= bound, "{found} instead of {expected}");
    };
    let radiances = basis.radiances();
    let alone = [basis.alone(0), basis.alone(1)];
    let mix = [Vec3::ZERO, Vec3::new(0.5, 1.0, 2.0)];
    for (k, factor) in mix.into_iter().enumerate() {
        basis.set_factor(k, factor);
    }
    let mixed = basis.radiances();
    for (i, own) in basis.emitters() {
        let radiance = scene.radiances[i];
        let share = if i.is_multiple_of(50) {
            MAX_REFLECTED
        } else {
            0.1
        };
        close(radiances[i], radiance, radiance);
        close(alone[1 - own][i], share * radiance, radiance);
        close(alone[own][i], (1.0 - share) * radiance, radiance);
        let expected = mix[own] * alone[own][i] + mix[1 - own] * alone[1 - own][i];
        close(mixed[i], expected, radiance);
    }
}

/// Directions to the eyes that see the Gaussians of [`highlights`].
fn to_eyes() -> Vec<Vec3> {
    let to_eye = |k: u8| {
        let k = f32::from(k);
        Vec3::new(k.cos(), k.sin(), 0.3 + 0.1 * k).normalize()
    };
    (0..8).map(to_eye).collect()
}

/// The basis with three glossy Gaussians, each with a highlight of the first light in one direction
/// and of the second in another; and their indices.
fn highlights(scene: &Gaussians, basis: LightBasis) -> (LightBasis, Vec<usize>) {
    let peak = |towards: Vec3| {
        let functions = crate::harmonics::functions(-towards.normalize());
        Harmonics(std::array::from_fn(|at| functions[at / 3]))
    };
    let peaks = [Vec3::new(1.0, 0.2, 0.7), Vec3::new(-0.5, 0.8, 0.4)];
    let reflecting = (0..scene.len()).filter(|&i| scene.emissions[i] == 0.0);
    let glossy: Vec<usize> = reflecting.step_by(5).take(3).collect();
    let seen: Vec<(u32, Vec<Vec3>)> = glossy.iter().map(|&i| (i as u32, to_eyes())).collect();
    let of_light = |_: &LightBasis, light: usize| Ok::<_, ()>(vec![peak(peaks[light]); 3]);
    (basis.with_highlights(&seen, of_light).unwrap(), glossy)
}

#[test]
fn highlights_follow_the_lights() {
    let (scene, _, basis) = example();
    let (mut basis, glossy) = highlights(&scene, basis);
    let mut lit = scene.clone();
    let factor = |scene: &Gaussians, i: usize, to_eye: Vec3| {
        scene.harmonics[i].factor(&crate::harmonics::functions(-to_eye))
    };
    let mut alone = Vec::new();
    for k in 0..2 {
        basis.light_alone(&mut lit, k);
        assert_eq!(lit.radiances, basis.alone(k));
        alone.push(lit.clone());
        // The same by factors.
        basis.set_factor(k, Vec3::ONE);
        basis.set_factor(1 - k, Vec3::ZERO);
        let mut by_factors = scene.clone();
        basis.light(&mut by_factors);
        assert_eq!(by_factors, lit);
    }
    let mix = [Vec3::new(0.7, 1.0, 0.2), Vec3::splat(1.5)];
    for (k, factor) in mix.into_iter().enumerate() {
        basis.set_factor(k, factor);
    }
    basis.light(&mut lit);
    for &i in &glossy {
        for to_eye in to_eyes() {
            let part = |k: usize| mix[k] * alone[k].radiances[i] * factor(&alone[k], i, to_eye);
            let expected = part(0) + part(1);
            let found = lit.radiances[i] * factor(&lit, i, to_eye);
            // Eight directions, which as many functions explain but for the ridge.
            let off = (found / expected - Vec3::ONE).abs().max_element();
            assert!(off < 0.05, "{found} {expected}");
        }
    }
    for i in (0..scene.len()).filter(|i| !glossy.contains(i)) {
        assert_eq!(lit.harmonics[i], Harmonics::NONE);
    }
}

#[test]
fn units_leave_room_for_the_brightest() {
    for brightest in [1e-30, 3e-5, 0.5, 1.0, 1.999_999_9, 2.0, 65_504.0, 3e38] {
        let top = brightest / unit(brightest);
        assert!((16_384.0..=32_768.0).contains(&top), "{brightest}: {top}");
        assert_eq!(unit(brightest).to_bits() & 0x7f_ffff, 0);
    }
    assert_eq!(unit(0.0), 1.0);
}

#[test]
fn the_scene_has_to_be_the_one_of_the_basis() {
    let (mut scene, _, mut basis) = example();
    basis.check(&scene).unwrap();
    basis.set_factor(0, Vec3::splat(0.3));
    let other_light = basis.check(&scene).unwrap_err();
    assert!(other_light.contains("another light"), "{other_light}");
    scene.radiances = basis.radiances();
    basis.check(&scene).unwrap();
    // Gaussians that reflect may carry anything.
    let dark = scene.emissions.iter().position(|e| *e == 0.0).unwrap();
    scene.radiances[dark] = Vec3::splat(9.0);
    basis.check(&scene).unwrap();
    for (change, expected) in [
        (
            (|s| s.albedos[5].x *= 0.5) as fn(&mut Gaussians),
            "other albedos",
        ),
        (|s| s.positions[5].y += 1e-3, "another geometry"),
        (|s| s.emissions.fill(0.0), "another geometry"),
        (|s| s.push(s.get(0)), "3000 Gaussians, this one has 3001"),
    ] {
        let mut changed = scene.clone();
        change(&mut changed);
        let problem = basis.check(&changed).unwrap_err();
        assert!(problem.contains(expected), "{problem}");
    }
}

#[test]
fn files_are_the_basis_and_damaged_ones_are_refused() {
    let (scene, _, mut basis) = example();
    basis.set_factor(1, Vec3::new(0.1, 0.0, 7.0));
    let folder = tempfile::tempdir().unwrap();
    let path = lights_file_beside(&folder.path().join("scene.ply"));
    assert_eq!(path.file_name().unwrap(), "scene.lights");
    basis.write(&path).unwrap();
    assert_eq!(LightBasis::read(&path).unwrap(), basis);
    let bytes = std::fs::read(&path).unwrap();
    // As other programs read it: arrays at multiples of their size, from a header of JSON.
    let length = u64::from_le_bytes(bytes[12..20].try_into().unwrap()) as usize;
    let header: serde_json::Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    assert_eq!(length % 4, 0);
    assert_eq!(header["lights"][1]["name"], REST);
    let array = &header["arrays"]["reflected"];
    assert_eq!(
        (&array["type"], &array["shape"]),
        (&"f16".into(), &[2, 3000, 3].to_vec().into())
    );
    let start = 20 + length + array["offset"].as_u64().unwrap() as usize;
    assert_eq!(start + 2 * 2 * 3000 * 3 + 32, bytes.len());
    let dark = scene.emissions.iter().rposition(|e| *e == 0.0).unwrap();
    let (i, k) = (dark, 1);
    let place = start + 2 * (3 * (k * 3000 + i));
    let value = f16::from_le_bytes([bytes[place], bytes[place + 1]]).to_f32();
    let scale = header["lights"][k]["scale"].as_f64().unwrap() as f32;
    assert!(value > 0.0);
    assert_eq!(value * scale, basis.alone(k)[i].x);

    let mut flipped = bytes.clone();
    flipped[start] ^= 1;
    std::fs::write(&path, flipped).unwrap();
    assert_error(LightBasis::read(&path), &["scene.lights", "damaged"]);
    std::fs::write(&path, &bytes[..bytes.len() - 5]).unwrap();
    assert_error(LightBasis::read(&path), &["scene.lights", "damaged"]);
    std::fs::write(&path, b"ply\n").unwrap();
    assert_error(LightBasis::read(&path), &["scene.lights", "light basis"]);
    // Sealed, and impossible.
    let refused = |change: fn(&mut LightBasis), parts: &[&str]| {
        let mut other = basis.clone();
        change(&mut other);
        other.write(&path).unwrap();
        assert_error(LightBasis::read(&path), parts);
    };
    refused(
        |b| b.lights[0].factor.y = -1.0,
        &["lights[0].factor", "-1.0"],
    );
    refused(
        |b| b.lights[1].name = "left".to_owned(),
        &["lights[1].name", "`left`"],
    );
    refused(|b| b.emitters[3].light = 2, &["emitters", "damaged"]);
    refused(|b| b.emitters[3].index = 3000, &["emitters", "damaged"]);
    refused(|b| b.reflected.truncate(7), &["arrays", "damaged"]);

    let (glossy, _) = highlights(&scene, basis.clone());
    glossy.write(&path).unwrap();
    assert_eq!(LightBasis::read(&path).unwrap(), glossy);
    let mut other = glossy.clone();
    other.highlights.gaussians[2] = 3000;
    other.write(&path).unwrap();
    assert_error(LightBasis::read(&path), &["glossy", "damaged"]);
    let mut other = glossy;
    other.highlights.harmonics.truncate(9);
    other.write(&path).unwrap();
    assert_error(LightBasis::read(&path), &["arrays", "damaged"]);
}
