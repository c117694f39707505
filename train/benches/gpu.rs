//! The engine on a device, all of it in one command: `cargo bench -p eagpt-train --bench gpu`.
//!
//! Half a million Gaussians at 540×360 on a GPU, next to what the paper reports of its own program
//! on an RTX 4090; a fraction of that where there is only a program that stands in for a GPU.
//! `EAGPT_BENCH_SIZE=full|small|tiny` chooses otherwise. Figures are medians.
#![allow(
    clippy::print_stdout,
    reason = "a benchmark prints what it has measured"
)]

use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussians, Image, View};
use eagpt_testkit::gaussians::{cube, look_at, material, rectangle, sphere};
use eagpt_trace::DeviceSelector;
use eagpt_trace::blend::GradientMask;
use eagpt_trace::features::GBuffer;
use eagpt_trace::gpu::{Device, Frame, FrameRoom, GpuScene, Kind};
use eagpt_trace::ray::Ray;
use eagpt_trace::transport::EMISSION_THRESHOLD;
use eagpt_trace::transport::matrix::{Directions, Receiver};
use eagpt_trace::transport::start::Surface;
use eagpt_trace::{Integrator, LightOptions, Tracer};
use eagpt_train::backend::{self, AlbedoStep, Backend, RadianceStep, Taken, TrainingView};
use eagpt_train::loss::NormalTerms;
use eagpt_train::params::{ParameterState, StepSizes};
use eagpt_train::{Preset, TrainOptions};
use glam::{DVec3, Mat3, Vec3};
use std::error::Error;
use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Time for one row, but for a first run and one that counts.
const ROW_BUDGET: Duration = Duration::from_secs(10);
/// Runs of a row, at most.
const MAX_RUNS: usize = 20;

/// What is measured.
struct Size {
    name: &'static str,
    num_gaussians: usize,
    image: [u32; 2],
    num_rays: usize,
    /// Samples of the path-traced frames.
    spp: [u32; 2],
}

const SIZES: [Size; 3] = [
    Size {
        name: "full",
        num_gaussians: 500_000,
        image: [540, 360],
        num_rays: 4_000_000,
        spp: [64, 1024],
    },
    Size {
        name: "small",
        num_gaussians: 60_000,
        image: [270, 180],
        num_rays: 50_000,
        spp: [1, 4],
    },
    Size {
        name: "tiny",
        num_gaussians: 5_000,
        image: [96, 64],
        num_rays: 5_000,
        spp: [1, 2],
    },
];

fn chosen_size(kind: Kind) -> Outcome<&'static Size> {
    let usual = if kind == Kind::Software {
        "small"
    } else {
        "full"
    };
    let wanted = std::env::var("EAGPT_BENCH_SIZE").unwrap_or_else(|_| usual.to_owned());
    let found = SIZES.iter().find(|size| size.name == wanted);
    found.ok_or_else(|| format!("EAGPT_BENCH_SIZE is {wanted}: not full, small or tiny").into())
}

/// A room with a lamp and a ball, of about `num` discs.
fn room(num: usize) -> Gaussians {
    // Five sixths of them on the walls: 24 square units.
    let spacing = (24.0 / (num as f32 * 5.0 / 6.0)).sqrt();
    let walls = cube(1.0, spacing, |side| {
        material(Vec3::splat(0.3), 0.0, Vec3::splat(0.5) + side * 0.2)
    });
    let lamp = material(Vec3::splat(5.0), 1.0, Vec3::ZERO);
    let lamp = rectangle(Vec3::Z * 0.97, Vec3::X * 0.3, Vec3::Y * 0.3, 0.03, lamp);
    let ball = sphere(num / 6, 0.3, |_| material(Vec3::ONE, 0.0, Vec3::splat(0.7)));
    walls.into_iter().chain(lamp).chain(ball.iter()).collect()
}

/// From points in the room in all directions.
fn bounce_rays(num: usize) -> Vec<Ray> {
    (0..num)
        .map(|i| {
            let turn = |step: f32| (i as f32 * step).fract() * 1.6 - 0.8;
            let azimuth = i as f32 * 2.399_963;
            let z = 1.0 - (2 * (i * 7919 % num) + 1) as f32 / num as f32;
            let flat = (1.0 - z * z).sqrt();
            let direction = Vec3::new(flat * azimuth.cos(), flat * azimuth.sin(), z).normalize();
            let origin = [turn(0.618_034), turn(0.754_877), turn(0.569_84)];
            Ray::free(origin, direction.to_array())
        })
        .collect()
}

/// What does not emit, from the side of the middle of the room.
fn receivers(gaussians: &Gaussians) -> impl Iterator<Item = Receiver> {
    let all = (0..).zip(gaussians.iter());
    let reflecting = all.filter(|(_, g)| g.emission <= EMISSION_THRESHOLD);
    reflecting.map(|(i, g)| {
        let normal = Mat3::from_quat(g.rotation).z_axis;
        let surface = Surface {
            position: g.position,
            normal: -normal * normal.dot(g.position).signum(),
            offset: 0.5 * g.scale.x,
        };
        (i, surface)
    })
}

/// Rows of the table, printed as they come.
struct Table {
    device: Arc<Device>,
    most_memory: Option<u64>,
    /// Where time goes, to be printed after the table.
    profiles: String,
}

impl Table {
    /// Measures `work`, which does `amount` of `unit`; the first run, which makes room and kernels,
    /// does not count.
    fn row(
        &mut self,
        what: &str,
        (amount, unit): (f64, &str),
        published: &str,
        mut work: impl FnMut() -> Outcome<()>,
    ) -> Outcome<()> {
        work()?;
        let begun = Instant::now();
        let mut times = Vec::new();
        while times.is_empty() || (begun.elapsed() < ROW_BUDGET && times.len() < MAX_RUNS) {
            let started = Instant::now();
            work()?;
            times.push(started.elapsed().as_secs_f64());
        }
        times.sort_by(f64::total_cmp);
        let median = times[times.len() / 2];
        let rate = match amount / median {
            rate if rate >= 1e6 => format!("{:.2} M {unit}/s", 1e-6 * rate),
            rate if rate >= 1e3 => format!("{:.1} k {unit}/s", 1e-3 * rate),
            rate => format!("{rate:.2} {unit}/s"),
        };
        let (ms, runs) = (1e3 * median, times.len());
        println!("| {what} | {ms:.2} | {rate} | {published} | {runs} |");
        // Buffers stay from call to call, so that looking after each row finds the most of all.
        self.most_memory = self.most_memory.max(self.device.memory_bytes());
        Ok(())
    }

    /// Notes where the time of `work` goes.
    fn profile(&mut self, what: &str, work: impl FnOnce() -> Outcome<()>) -> Outcome<()> {
        let (done, found) = self.device.profile(work)?;
        done?;
        let found = found.map_or_else(
            || format!("{} has no timestamps\n", self.device.adapter().name),
            |found| found.to_string(),
        );
        self.profiles.push_str(&format!("\n{what}:\n\n{found}"));
        Ok(())
    }
}

/// A view to be trained on: what the scene looks like, a little brighter.
fn training_view(camera: Camera, seen: &GBuffer) -> Outcome<TrainingView> {
    let pixels: Vec<[f32; 3]> = seen
        .pixels
        .iter()
        .map(|features| (features.radiance() * 1.1).to_array())
        .collect();
    let view = View {
        name: "room".to_owned(),
        camera,
        radiance: Image::from_pixels(camera.width, camera.height, pixels)
            .ok_or("a value for every pixel")?,
        emission: None,
        normal: None,
        alpha: None,
        depth: None,
        albedo: None,
        valid: None,
    };
    Ok(TrainingView {
        index: 0,
        view: Arc::new(view),
    })
}

/// Rows of camera rays, and where those of a training step spend their time.
fn looking(table: &mut Table, gaussians: &Gaussians, camera: Camera) -> Outcome<GBuffer> {
    let device = Arc::clone(&table.device);
    let num_pixels = camera.num_pixels() as f64;
    let mut scene = GpuScene::new(&device, gaussians)?;
    let features = scene.gbuffer(&camera)?;
    table.row(
        "camera rays, forward, read back",
        (num_pixels, "rays"),
        "",
        || {
            black_box(scene.gbuffer(&camera)?);
            Ok(())
        },
    )?;
    table.row(
        "camera rays, forward and adjoint of given derivatives, both ways through the host",
        (num_pixels, "rays"),
        "",
        || {
            black_box(scene.adjoint(&camera, &features.pixels, GradientMask::Everything)?);
            Ok(())
        },
    )?;
    drop(scene);

    let fit = GpuScene::new(&device, gaussians)?;
    let forward = || -> Outcome<()> { Ok(fit.forward(&camera)?) };
    let both = || -> Outcome<()> {
        forward()?;
        Ok(fit.backward(&camera)?)
    };
    // Until there is room for all hits, as training does it.
    loop {
        let frame = fit
            .frame(&camera)?
            .ok_or("one buffer does not hold the view")?;
        forward()?;
        let totals: Vec<u32> = device.read(&frame.totals, 0..4)?;
        let needed = FrameRoom {
            entries: totals[Frame::ENTRIES as usize],
            chunks: totals[Frame::CHUNKS as usize],
        };
        if !fit.make_room(&camera, needed)? {
            break;
        }
    }
    table.row(
        "camera rays with a record, forward",
        (num_pixels, "rays"),
        "",
        || {
            forward()?;
            Ok(device.wait()?)
        },
    )?;
    table.row(
        "camera rays with a record, forward and adjoint",
        (num_pixels, "rays"),
        "5 M rays/s",
        || {
            both()?;
            Ok(device.wait()?)
        },
    )?;
    table.profile("forward and adjoint of one view", both)?;
    table.row(
        "what Gaussians contribute to a view, read back",
        (num_pixels, "rays"),
        "",
        || {
            black_box(fit.contributions(&camera, &|_, _| 1.0)?);
            Ok(())
        },
    )?;
    Ok(features)
}

/// Rows of training, and where a step spends its time.
fn training(
    table: &mut Table,
    gaussians: &Gaussians,
    camera: Camera,
    seen: &GBuffer,
    num_gathered: usize,
) -> Outcome<()> {
    let device = Arc::clone(&table.device);
    let options = TrainOptions::preset(Preset::Fast).radiance;
    let step = RadianceStep {
        iteration: 1,
        weights: &options.weights,
        normals: NormalTerms::On,
        rays_per_axis: 1,
        sizes: StepSizes::radiance(&options.rates, 1.0, 1.0),
    };
    let view = training_view(camera, seen)?;
    let on = eagpt_trace::Device::Gpu(Arc::clone(&device));
    let mut backend = backend::new(&on, ParameterState::new(gaussians), 1 << 30)?;
    let take = |backend: &mut dyn Backend, step: &RadianceStep<'_>| -> Outcome<()> {
        check(backend.radiance_step(&view, step)?)
    };
    let one = (1.0, "it");
    table.row("training, stage 0", one, "26 it/s", || {
        take(&mut *backend, &step)
    })?;
    table.profile("a step of stage 0", || take(&mut *backend, &step))?;
    backend.begin_harmonics()?;
    let with_harmonics = RadianceStep {
        sizes: step.sizes.with_harmonics(&options.harmonics, 1.0),
        ..step
    };
    table.row("training, stage 0 with harmonics", one, "", || {
        take(&mut *backend, &with_harmonics)
    })?;

    // Light for some of the Gaussians: how much there is makes no difference to a step.
    let num_seen = backend.begin_gathering(&[camera])?;
    backend.gather(0..num_seen.min(num_gathered), 16, 0)?;
    backend.begin_albedo()?;
    let options = TrainOptions::preset(Preset::Fast).albedo;
    let step = AlbedoStep {
        options: &options,
        ssim_share: 0.2,
        seed: 0,
        iteration: 1,
        sizes: StepSizes::albedo(1e-3),
    };
    // 400 iterations in 32 minutes.
    table.row("training, stage 1", one, "0.21 it/s", || {
        check(backend.albedo_step(&view, &step)?)
    })?;
    check(backend.finish()?)
}

/// Steps are good if their gradients are numbers.
fn check(taken: Vec<Taken>) -> Outcome<()> {
    for step in taken {
        step.outcome.map_err(|bad| bad.to_string())?;
    }
    Ok(())
}

/// Rows of single rays and of light.
fn light(table: &mut Table, gaussians: &Gaussians, camera: Camera, size: &Size) -> Outcome<()> {
    let device = Arc::clone(&table.device);
    let mut scene = GpuScene::new(&device, gaussians)?;
    let rays = bounce_rays(size.num_rays);
    let queries: Vec<(Ray, u32)> = (0..).zip(&rays).map(|(seed, ray)| (*ray, seed)).collect();
    let num_rays = (rays.len() as f64, "rays");
    table.row("bounce rays, all hits blended", num_rays, "", || {
        black_box(scene.trace_rays(&rays)?);
        Ok(())
    })?;
    table.row("bounce rays, one hit by its weight", num_rays, "", || {
        black_box(scene.choose_hits(&queries)?);
        Ok(())
    })?;
    drop((rays, queries));
    let receivers: Vec<Receiver> = receivers(gaussians).take(size.num_rays / 64).collect();
    table.row(
        "matrix, half of 64 directions to emitters",
        (64.0 * receivers.len() as f64, "rays"),
        "",
        || {
            let key = RandomKey::new(0, Purpose::Bake, 1);
            black_box(scene.trace_transport(&receivers, Directions::divided(64, 2), key)?);
            Ok(())
        },
    )?;

    let options = LightOptions::default();
    let num_pixels = camera.num_pixels() as f64;
    let path = |num_samples| Integrator::Path {
        num_samples,
        max_bounces: 7,
        roulette_from: None,
    };
    let one_bounce = Integrator::OneBounce {
        num_samples: size.spp[0],
    };
    let mut frames = vec![("1-bounce", one_bounce, size.spp[0], "")];
    for spp in size.spp {
        frames.push(("path", path(spp), spp, "1.0–1.6 M paths/s"));
    }
    for (name, integrator, spp, published) in frames {
        table.row(
            &format!("{name} frame, {spp} spp, next-event estimation"),
            (num_pixels * f64::from(spp), "paths"),
            published,
            || {
                black_box(scene.render(&camera, &integrator, &options)?);
                Ok(())
            },
        )?;
    }
    table.profile("a path-traced frame of 1 spp", || {
        black_box(scene.render(&camera, &path(1), &options)?);
        Ok(())
    })?;
    table.row(
        "new Gaussians brought to the device",
        (1.0, "scenes"),
        "",
        || Ok(scene.update(gaussians)?),
    )
}

fn main() -> Outcome<()> {
    // Among tests, a benchmark has nothing to do.
    if !std::env::args().any(|argument| argument == "--bench") {
        return Ok(());
    }
    let device = match Device::open(&DeviceSelector::Gpu) {
        Ok(device) => device,
        Err(error) => {
            println!("skipped: {error}");
            return Ok(());
        }
    };
    let size = chosen_size(device.adapter().kind)?;
    let gaussians = room(size.num_gaussians);
    let [width, height] = size.image;
    let (eye, target) = (DVec3::new(-0.8, 0.7, 0.3), DVec3::new(0.3, -0.2, -0.1));
    let camera = look_at(eye, target, width, height);
    let adapter = device.adapter();
    println!(
        "{} ({}, {}), size {}: {} Gaussians, {width}×{height}\n",
        adapter.name,
        adapter.backend,
        adapter.driver,
        size.name,
        gaussians.len()
    );
    println!("| what | ms | rate | paper, RTX 4090, full size | runs |\n|---|---:|---:|---:|---:|");
    let mut table = Table {
        device,
        most_memory: None,
        profiles: String::new(),
    };
    let seen = looking(&mut table, &gaussians, camera)?;
    training(&mut table, &gaussians, camera, &seen, size.num_rays / 64)?;
    light(&mut table, &gaussians, camera, size)?;
    println!("{}", table.profiles);
    match table.most_memory {
        Some(bytes) => println!(
            "most memory of the device: {:.0} MiB (paper: under 2.5 GB)",
            bytes as f64 / f64::from(1 << 20)
        ),
        None => println!(
            "most memory of the device: not told by {}",
            table.device.adapter().backend
        ),
    }
    Ok(())
}
