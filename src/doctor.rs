//! `eagpt doctor`: what this machine can do.

use crate::args::GlobalArgs;
use crate::bench::{Unit, figure};
use crate::device::DeviceArgs;
use crate::progress::Reporter;
use crate::terminal;
use anyhow::Result;
use clap::Args;
use eagpt_denoise::Oidn;
use eagpt_scene::machine;
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::parity::{self, PARITY_TOLERANCE, Parity};
use eagpt_trace::{Device, TraceError};
use serde::Serialize;
use std::path::Path;
#[cfg(not(feature = "onnx"))]
use std::path::PathBuf;
use std::process::ExitCode;

/// Report the capabilities of this machine, and check that it computes right
///
/// Cores, memory, the programs and libraries that are found and what each missing one would give.
/// The self-test traces a scene that is known everywhere with the engine and with a simple
/// double-precision oracle, with one thread and with all of them; if they differ, the exit code is
/// 1. Takes a second or two, with a slow device some more, and writes nothing.
///
/// The same test runs on the GPU where there is one that is hardware, or on the device that
/// --device names.
#[derive(Debug, Args)]
#[command(
    after_long_help = "Examples:\n  eagpt doctor\n  eagpt doctor --json\n  eagpt doctor --device gpu:llvmpipe"
)]
pub(crate) struct DoctorArgs {
    #[command(flatten)]
    device: DeviceArgs,
}

/// Status of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum State {
    /// As it should be.
    Good,
    /// Not there, and not needed.
    Missing,
    /// Wrong.
    Bad,
}

/// A part of the machine that was checked.
#[derive(Debug, Serialize)]
struct Finding {
    topic: &'static str,
    state: State,
    /// The finding.
    text: String,
    /// Benefit of a missing part, and how to get it.
    #[serde(skip_serializing_if = "Option::is_none")]
    would_give: Option<&'static str>,
}

impl Finding {
    fn good(topic: &'static str, text: String) -> Self {
        Self {
            topic,
            state: State::Good,
            text,
            would_give: None,
        }
    }

    fn missing(topic: &'static str, text: String, would_give: &'static str) -> Self {
        Self {
            topic,
            state: State::Missing,
            text,
            would_give: Some(would_give),
        }
    }

    /// For people.
    fn line(&self) -> String {
        let mark = match self.state {
            State::Good => "ok",
            State::Missing => "--",
            State::Bad => "NO",
        };
        let Self { topic, text, .. } = self;
        let mut line = format!("{mark}  {topic:<14} {text}\n");
        if let Some(gives) = self.would_give {
            line.push_str(&format!("{:19}{gives}\n", ""));
        }
        line
    }
}

pub(crate) fn run(args: &DoctorArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let device = args.device.open(&mut Reporter::new(global))?;
    let mut findings = vec![program(), processor(), memory()];
    findings.extend(gpus());
    findings.extend([denoiser(), colmap(), normals()]);
    findings.push(self_test(parity::compare(|gaussians| {
        Ok(CpuScene::new(gaussians))
    })));
    findings.extend(device_test(&device));
    for finding in &findings {
        let text = if global.json {
            let mut value = serde_json::to_value(finding)?;
            value["message"] = "finding".into();
            format!("{value}\n")
        } else {
            finding.line()
        };
        terminal::print(&text)?;
    }
    let is_well = findings.iter().all(|finding| finding.state != State::Bad);
    Ok(ExitCode::from(u8::from(!is_well)))
}

fn program() -> Finding {
    let features = [
        ("gpu", cfg!(feature = "gpu")),
        ("rawler", cfg!(feature = "rawler")),
        ("rawloader", cfg!(feature = "rawloader")),
        ("onnx", cfg!(feature = "onnx")),
    ];
    let built: Vec<&str> = features
        .into_iter()
        .filter_map(|(name, is_in)| is_in.then_some(name))
        .collect();
    let features = match built.as_slice() {
        [] => "no optional features".to_owned(),
        some => format!("with {}", some.join(", ")),
    };
    let (version, os, arch) = (
        env!("CARGO_PKG_VERSION"),
        std::env::consts::OS,
        std::env::consts::ARCH,
    );
    Finding::good(
        "program",
        format!("eagpt {version} for {os} on {arch}, {features}"),
    )
}

fn processor() -> Finding {
    let name = machine::processor().unwrap_or_else(|| "processor of unknown name".to_owned());
    let threads = rayon::current_num_threads();
    let vectors = match machine::vector_instructions().as_slice() {
        [] => "no vector instructions that are used".to_owned(),
        some => some.join(", "),
    };
    Finding::good(
        "processor",
        format!("{name}; computing with {threads} threads, {vectors}"),
    )
}

fn memory() -> Finding {
    let gib = |bytes: u64| bytes as f64 / f64::from(1 << 30);
    match (machine::available_memory(), machine::total_memory()) {
        (Some(available), Some(total)) => Finding::good(
            "memory",
            format!("{:.1} GiB free of {:.1} GiB", gib(available), gib(total)),
        ),
        _ => Finding::missing(
            "memory",
            "this system does not tell how much there is".to_owned(),
            "with it, jobs that do not fit are refused before they begin",
        ),
    }
}

#[cfg(feature = "gpu")]
fn gpus() -> Vec<Finding> {
    let found = eagpt_trace::gpu::adapters();
    if found.is_empty() {
        return vec![Finding::missing(
            "gpu",
            "no adapter for Vulkan, Metal or DirectX 12".to_owned(),
            NO_GPU,
        )];
    }
    found.iter().map(gpu).collect()
}

#[cfg(feature = "gpu")]
fn gpu(adapter: &eagpt_trace::gpu::Adapter) -> Finding {
    let mib = |bytes: u64| bytes >> 20;
    let flag = |is_there, name| if is_there { name } else { "" };
    let kind = format!("{:?}", adapter.kind).to_lowercase();
    let subgroups = adapter.subgroups.map_or(String::new(), |[least, most]| {
        format!(", subgroups of {least} to {most}")
    });
    Finding::good(
        "gpu",
        format!(
            "{} ({kind}, {}, {}): {} MiB a binding, {} MiB a buffer, {} storage buffers{subgroups}{}{}",
            adapter.name,
            adapter.backend,
            adapter.driver,
            mib(adapter.max_binding),
            mib(adapter.max_buffer),
            adapter.max_storage_buffers,
            flag(adapter.has_float_atomics, ", float atomics"),
            flag(adapter.has_timestamps, ", timestamps"),
        ),
    )
}

#[cfg(not(feature = "gpu"))]
fn gpus() -> Vec<Finding> {
    let text = "built without the feature gpu".to_owned();
    vec![Finding::missing("gpu", text, NO_GPU)]
}

const NO_GPU: &str = "the CPU computes: training and rendering take longer than on a GPU";

fn denoiser() -> Finding {
    match Oidn::find(None) {
        Ok(oidn) => Finding::good(
            "denoiser",
            format!(
                "Open Image Denoise {} ({})",
                oidn.version(),
                oidn.path().display()
            ),
        ),
        Err(error) => Finding::missing(
            "denoiser",
            error.to_string(),
            "`--denoise auto` takes the built-in filter; Open Image Denoise 2 from openimagedenoise.org, unpacked and named by \
             EAGPT_OIDN, keeps more of textures at few samples",
        ),
    }
}

fn colmap() -> Finding {
    match eagpt_colmap::run::version(Path::new("colmap")) {
        Ok(version) => Finding::good("poses", version),
        Err(error) => Finding::missing(
            "poses",
            error.to_string(),
            "`eagpt colmap run` and projects that begin at photographs find poses with it; models that are there are imported without",
        ),
    }
}

fn normals() -> Finding {
    #[cfg(feature = "onnx")]
    let found = eagpt_convert::normals::find_runtime();
    #[cfg(not(feature = "onnx"))]
    let found = Err::<PathBuf, _>("built without the feature onnx".to_owned());
    match found {
        Ok(path) => Finding::good("normals", format!("ONNX Runtime ({})", path.display())),
        Err(problem) => Finding::missing(
            "normals",
            problem,
            "`eagpt normals --onnx` runs networks that estimate normals with it; maps that are there are read without",
        ),
    }
}

/// Self-test of a device that is not the CPU.
#[cfg(feature = "gpu")]
fn device_test(device: &Device) -> Option<Finding> {
    match device {
        Device::Cpu => None,
        Device::Gpu(device) => Some(self_test(parity::compare(|gaussians| {
            Ok(eagpt_trace::gpu::GpuScene::new(device, gaussians)?)
        }))),
    }
}

#[cfg(not(feature = "gpu"))]
fn device_test(_: &Device) -> Option<Finding> {
    None
}

fn self_test(outcome: Result<Parity, TraceError>) -> Finding {
    let topic = "self-test";
    let bad = |text| Finding {
        topic,
        state: State::Bad,
        text,
        would_give: None,
    };
    let found = match outcome {
        Ok(found) => found,
        Err(error) => return bad(error.to_string()),
    };
    let bits = if found.is_repeatable {
        "the same"
    } else {
        "other"
    };
    let text = format!(
        "{}: {} rays within {:.1e} of the oracle ({PARITY_TOLERANCE:.1e} allowed), {bits} bits with one thread; {} from a \
         camera through 50,000 Gaussians",
        found.device,
        found.num_compared,
        found.worst,
        figure(Unit::Rays, found.rays_per_s)
    );
    if found.is_good() {
        Finding::good(topic, text)
    } else {
        bad(text)
    }
}
