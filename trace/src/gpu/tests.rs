//! Kernels against the CPU, stage by stage, on whatever device there is.

use super::GpuScene;
use super::declarations::light::RayQuery;
use super::device::Device;
use super::error::GpuError;
use super::kernels::{self, Access, Binding, Kernel};
use super::scan::scan;
use super::shader;
use super::sort::Sorter;
use crate::blend::{GradientMask, LocalGradient};
use crate::features::{Features, NUM_LANES};
use crate::parity;
use crate::ray::Ray;
use crate::selector::DeviceSelector;
use crate::transport::matrix::{Directions, Receiver};
use crate::transport::points::Points;
use crate::transport::start::Surface;
use crate::{Integrator, LightOptions, Tracer};
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussian, Gaussians, random_cloud};
use glam::{DAffine3, Mat3, Vec3};
use std::sync::{Arc, OnceLock};

/// Any device; `None`, with a line that names `what`, where there is none.
fn device(what: &str) -> Option<Arc<Device>> {
    static DEVICE: OnceLock<Result<Arc<Device>, GpuError>> = OnceLock::new();
    let opened = DEVICE.get_or_init(|| Device::open(&DeviceSelector::Gpu));
    eagpt_testkit::opened_device(what, opened.as_ref()).map(Arc::clone)
}

fn words(num: u32, seed: u64) -> Vec<u32> {
    let key = RandomKey::new(seed, Purpose::Initialise, 0);
    (0..num).map(|i| key.stream(i, 0).next_words()[0]).collect()
}

#[test]
fn prefix_sums_are_exact_over_several_levels() {
    let Some(device) = device("prefix features") else {
        return;
    };
    // One value, one block and a few, blocks of blocks, and one value more than those.
    for num in [1, 2048, 2049, 2048 * 8, 2048 * 8 + 1, 2048 * 2048 + 1] {
        let values: Vec<u32> = words(num, 1).iter().map(|word| word % 1000).collect();
        let buffer = device
            .upload("values", bytemuck::cast_slice(&values))
            .unwrap();
        device.run(&scan(&device, &buffer, num).unwrap()).unwrap();
        let got: Vec<u32> = device.read(&buffer, 0..num as usize).unwrap();
        let mut sum = 0;
        for (got, value) in got.iter().zip(values) {
            assert_eq!(*got, sum);
            sum += value;
        }
    }
}

#[test]
fn a_sum_beyond_32_bits_is_not_taken_for_a_small_one() {
    let Some(device) = device("large prefix features") else {
        return;
    };
    // Beyond it within a thread, within a workgroup, and over workgroups.
    for (num, value) in [(8, 1 << 30), (2048, 1 << 22), (300_000, 1 << 15)] {
        let mut values = vec![value; num];
        values.push(0);
        let buffer = device
            .upload("values", bytemuck::cast_slice(&values))
            .unwrap();
        device
            .run(&scan(&device, &buffer, values.len() as u32).unwrap())
            .unwrap();
        assert_eq!(
            device.read::<u32>(&buffer, num..num + 1).unwrap(),
            [u32::MAX]
        );
    }
}

#[test]
fn sorting_is_stable() {
    let Some(device) = device("sorting") else {
        return;
    };
    // Few keys, so that most are equal; more capacity than there are elements.
    for (num, capacity, bits) in [(5, 5, 4), (3000, 4000, 9), (20_000, 20_000, 20)] {
        let keys: Vec<u32> = words(num, 2)
            .iter()
            .map(|word| word & ((1 << bits) - 1))
            .collect();
        let values: Vec<u32> = (0..num).collect();
        let totals = device
            .upload("totals", bytemuck::cast_slice(&[7, num]))
            .unwrap();
        let sorter = Sorter::new(&device, capacity, bits, (&totals, 1)).unwrap();
        let (to_keys, to_values) = sorter.unsorted();
        device.write(to_keys, bytemuck::cast_slice(&keys));
        device.write(to_values, bytemuck::cast_slice(&values));
        device.run(sorter.passes()).unwrap();
        let (sorted_keys, sorted_values) = sorter.sorted();
        let got_keys: Vec<u32> = device.read(sorted_keys, 0..num as usize).unwrap();
        let got_values: Vec<u32> = device.read(sorted_values, 0..num as usize).unwrap();
        let mut wanted: Vec<(u32, u32)> = keys.into_iter().zip(values).collect();
        wanted.sort_by_key(|&(key, _)| key);
        let got: Vec<(u32, u32)> = got_keys.into_iter().zip(got_values).collect();
        assert!(got == wanted, "{num} of {capacity} by {bits} bits");
    }
}

/// Points as [`Points`] has them, for elements 0 to 63 and samples that a word of the input names.
static SAMPLE: Kernel = Kernel::new(
    ("sample_numbers", "sample_numbers"),
    &[],
    |name| match name {
        "sample_numbers" => Some(
            "#import points
            @group(0) @binding(0) var<storage, read> input: array<vec4u>;
            @group(0) @binding(1) var<storage, read_write> blocks: array<vec4f>;
            @group(0) @binding(2) var<storage, read_write> words: array<u32>;
            @compute @workgroup_size(64)
            fn sample_numbers(
                @builtin(workgroup_id) group: vec3u,
                @builtin(local_invocation_index) element: u32,
            ) {
                let at = group.x * 64u + element;
                let numbers = input[1u + group.x];
                blocks[at] = block_of(input[0], element, numbers.x, numbers.y);
                words[at] = word_of(input[0], element, numbers.x);
            }"
            .into(),
        ),
        _ => shader::sources(name),
    },
    &[
        bound(0, "input", Access::Read),
        bound(1, "blocks", Access::Write),
        bound(2, "words", Access::Write),
    ],
);

const fn bound(number: u32, name: &'static str, access: Access) -> Binding {
    Binding {
        number,
        name,
        access,
        bytes: 16,
    }
}

#[test]
fn random_numbers_and_sobol_points_have_the_bits_of_the_cpu() {
    let Some(device) = device("random numbers") else {
        return;
    };
    let key = RandomKey::new(0x1234_5678_9abc, Purpose::Render, 3);
    let samples: Vec<[u32; 4]> = [0, 1, 2, 3, 255, 65_535, 65_536, 1_000_000]
        .into_iter()
        .flat_map(|sample| [0, 1, 13].map(|block| [sample, block, 0, 0]))
        .collect();
    let input: Vec<[u32; 4]> = std::iter::once(key.words())
        .chain(samples.clone())
        .collect();
    let input = device
        .upload("input", bytemuck::cast_slice(&input))
        .unwrap();
    let num = 64 * samples.len();
    let blocks = device.buffer("blocks", 16 * num as u64).unwrap();
    let words = device.buffer("words", 4 * num as u64).unwrap();
    let pass = device.pass(&SAMPLE, &[&input, &blocks, &words], samples.len() as u32);
    device.run(&[pass]).unwrap();
    let blocks: Vec<[f32; 4]> = device.read(&blocks, 0..num).unwrap();
    let words: Vec<u32> = device.read(&words, 0..num).unwrap();
    for (at, (got, word)) in blocks.iter().zip(words).enumerate() {
        let [sample, block, ..] = samples[at / 64];
        let points = Points::new(key, at as u32 % 64);
        assert_eq!(
            *got,
            points.block(sample, block),
            "sample {sample}, block {block}"
        );
        assert_eq!(word, points.word(sample), "sample {sample}");
    }
}

#[test]
fn what_does_not_fit_is_told_with_its_size() {
    let Some(device) = device("sizes of buffers") else {
        return;
    };
    let limit = device.max_bytes();
    let error = device.buffer("too much", limit + 4).unwrap_err();
    let said = error.to_string();
    assert!(
        said.contains("too much") && said.contains(&limit.to_string()) && !said.contains('\n'),
        "{said}"
    );
    // That was found out before the device was asked, and it goes on working.
    assert_eq!(device.check(), Ok(()));
}

/// A Gaussian's own plane.
fn receiver((i, gaussian): (u32, Gaussian)) -> Receiver {
    let surface = Surface {
        position: gaussian.position,
        normal: Mat3::from_quat(gaussian.rotation).z_axis,
        offset: gaussian.scale.x,
    };
    (i, surface)
}

#[test]
fn an_image_with_more_tiles_than_can_be_counted_is_told() {
    let Some(device) = device("sizes of images") else {
        return;
    };
    let scene = GpuScene::new(&device, &random_cloud(3, 1)).unwrap();
    let camera = Camera::centred([70_000, 1], 1.0, DAffine3::IDENTITY);
    let said = scene.gbuffer(&camera).unwrap_err().to_string();
    assert!(
        said.ends_with(": image of 70000×1 pixels: no side may have more than 65535"),
        "{said}"
    );
}

/// The self-test that users run.
#[test]
fn the_device_engine_is_right() {
    let Some(device) = device("the self-test") else {
        return;
    };
    let found = parity::compare(|gaussians| Ok(GpuScene::new(&device, gaussians)?)).unwrap();
    assert!(found.is_good() && found.rays_per_s > 0.0, "{found:?}");
}

#[test]
fn passes_are_timed_where_the_device_can() {
    if device("times of passes").is_none() {
        return;
    }
    // One that no other test works with: all that a device does is timed.
    let device = Device::open(&DeviceSelector::Gpu).unwrap();
    let values = device.buffer("values", 4 * 20_000).unwrap();
    let passes = scan(&device, &values, 20_000).unwrap();
    let (_, profile) = device.profile(|| device.run(&passes)).unwrap();
    let Some(profile) = profile else {
        assert!(!device.adapter().has_timestamps);
        return;
    };
    let names: Vec<_> = profile
        .stages
        .iter()
        .map(|s| (s.name, s.num_passes))
        .collect();
    assert_eq!(names, [("scan_blocks", 2), ("scan_add", 1)]);
    // Steps follow one another within the time of the host.
    let timed: f64 = profile.stages.iter().map(|stage| stage.seconds).sum();
    assert!(
        timed > 0.0 && timed <= profile.elapsed.as_secs_f64(),
        "{profile}"
    );
    assert_eq!(profile.num_untimed, 0);
    // Over and done with: nothing else is timed.
    assert!(device.memory_bytes().is_none_or(|bytes| bytes > 0));
}

/// A device whose buffers hold a part of an image at a time gives the bits of one whose buffers
/// hold all of it; the rows of gradients are added in another order.
#[test]
fn work_in_parts_gives_the_same() {
    let Some(whole) = device("work in parts") else {
        return;
    };
    let parts = Device::open_limited(&DeviceSelector::Gpu, 400 << 10).unwrap();
    // Features of 465 KB, and records of hits of some 3 MB.
    let camera = Camera {
        width: 97,
        height: 75,
        fx: 80.0,
        fy: 80.0,
        cx: 48.0,
        cy: 37.0,
        world_from_camera: DAffine3::IDENTITY,
    };
    let cloud = random_cloud(300, 9);
    let [whole, parts] = [whole, parts].map(|device| {
        let mut scene = GpuScene::new(&device, &cloud).unwrap();
        let view = scene
            .render(
                &camera,
                &Integrator::OneBounce { num_samples: 1 },
                &LightOptions::default(),
            )
            .unwrap();
        let gradients = scene
            .adjoint(
                &camera.into(),
                &view.features.pixels,
                GradientMask::Everything,
            )
            .unwrap();
        // 38,400 directions about the normal, of which 25,600 fit.
        let receivers: Vec<Receiver> = (0..).zip(cloud.iter()).map(receiver).collect();
        let key = RandomKey::new(1, Purpose::Bake, 0);
        let matrix = scene.trace_transport(&receivers, Directions::divided(160, 5), key);
        (view, gradients, matrix.unwrap())
    });
    assert!(whole.0 == parts.0);
    assert!(whole.2 == parts.2);
    for lane in 0..NUM_LANES {
        let largest = |a: f32, gradient: &LocalGradient| a.max(gradient.0[lane].abs());
        let largest = whole.1.iter().fold(0.0, largest);
        for (a, b) in whole.1.iter().zip(&parts.1) {
            let off = (a.0[lane] - b.0[lane]).abs();
            // Some hundred rows of a Gaussian, each rounded to 6e-8.
            assert!(off <= 1e-5 * largest, "lane {lane}: {off:e} of {largest:e}");
        }
    }
    assert!(whole.1.iter().any(|gradient| gradient.0[0] != 0.0));
}

/// The mean of sampled hits is the blended sum.
#[test]
fn sampled_hits_have_the_mean_of_blended_ones() {
    let Some(device) = device("sampled hits") else {
        return;
    };
    let scene = GpuScene::new(&device, &random_cloud(700, 3)).unwrap();
    let trees = scene.light().unwrap();
    let trace = |kernel, queries: &[RayQuery]| scene.rays(&trees).trace(kernel, queries).unwrap();
    // From inside the cloud in all directions; every other one leaves from a surface.
    let direction = |i: usize| {
        let azimuth = i as f32 * 2.399_963;
        let z = 1.0 - (2 * i + 1) as f32 / 24.0;
        let flat = (1.0 - z * z).sqrt();
        Vec3::new(flat * azimuth.cos(), flat * azimuth.sin(), z).normalize()
    };
    let rays: Vec<Ray> = (0..24)
        .map(|i| {
            let origin = [0.05, -0.02, 0.1 + 0.001 * i as f32];
            let free = Ray::free(origin, direction(i).to_array());
            match i % 2 {
                0 => free,
                _ => Ray {
                    t_min: 0.5,
                    own_normal: direction(7 * i % 24).to_array(),
                    ..free
                },
            }
        })
        .collect();
    let num_samples = 4000_u32;
    let sampled: Vec<RayQuery> = (rays.iter())
        .flat_map(|ray| {
            (0..num_samples).map(|sample| RayQuery::new(ray, sample.wrapping_mul(0x9e37_79b1)))
        })
        .collect();
    let blended: Vec<RayQuery> = rays.iter().map(|ray| RayQuery::new(ray, 0)).collect();
    let blended = trace(&kernels::BLEND_RAYS, &blended);
    assert!(blended.iter().any(|features| features.alpha() > 0.5));
    let sampled = trace(&kernels::SAMPLE_RAYS, &sampled);
    for (hits, features) in sampled.chunks_exact(num_samples as usize).zip(blended) {
        // Whether anything is hit, and the radiance of what is.
        let values: [fn(&Features) -> f32; 3] = [
            |hit| hit.alpha(),
            |hit| hit.radiance().x,
            |hit| hit.radiance().z,
        ];
        for of in values {
            let (n, wanted) = (f64::from(num_samples), f64::from(of(&features)));
            let of = |hit: &Features| f64::from(of(hit));
            let mean = hits.iter().map(of).sum::<f64>() / n;
            let variance = hits.iter().map(|hit| (of(hit) - mean).powi(2)).sum::<f64>() / (n - 1.0);
            // Five standard errors for 72 comparisons; the blend leaves out what is behind a
            // transmittance of 1e-4.
            let error = (variance / n).sqrt();
            let difference = (mean - wanted).abs();
            assert!(
                difference < 5.0 * error + 2e-4 * (1.0 + mean),
                "{mean} ± {error} instead of {wanted}"
            );
        }
    }
    let empty = GpuScene::new(&device, &Gaussians::default()).unwrap();
    let trees = empty.light().unwrap();
    let query = [RayQuery::new(&rays[0], 5)];
    let met = empty
        .rays(&trees)
        .trace(&kernels::SAMPLE_RAYS, &query)
        .unwrap();
    assert_eq!(met, [Features::default()]);
}
