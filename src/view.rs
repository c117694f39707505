//! `eagpt view`: a scene in a browser, with an edit under way.

use crate::args::GlobalArgs;
use crate::bake;
use crate::device::DeviceArgs;
use crate::interrupt;
use crate::page::{PageArgs, ScenePage};
use crate::progress::Reporter;
use crate::source::Source;
use anyhow::{Result, bail};
use clap::Args;
use eagpt_scene::ply;
use eagpt_viewer::live::{Edit, Original};
use eagpt_viewer::page::PageKind;
use eagpt_viewer::server::{Served, Server};
use eagpt_viewer::workshop::Workshop;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

/// Show a scene in a browser, and edit it
///
/// A server for browsers of this machine shows the page of `eagpt export --format html` at the
/// address that is printed, until Ctrl-C. What is done there to what was selected, what is
/// inserted, and, of a scene that was baked with --per-light, every change of a lamp is a step of
/// an edit script, shown beside, with undo and redo. The script is on disk after every step; `eagpt
/// edit` replays it to the same bits, and the same command goes on from it. After a step that
/// changes more than lamps the light is baked anew, as `eagpt bake` does, for the cameras of the
/// dataset.
///
/// The page also has path-traced pictures made, as `eagpt render --mode path` does.
///
/// Of a run or a project the trained scene is shown, with cameras and photographs of the dataset
/// that it was trained on, if that is still there and unchanged.
///
/// The address has a token that nobody else knows. The server has the page, the edit and the
/// pictures it has made, and no other file of the disk.
#[derive(Debug, Clone, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct ViewArgs {
    /// Scene of 2D Gaussians, as `eagpt train` or `eagpt bake` writes it; folder of a run, as
    /// `eagpt train` or `eagpt run` leaves it; or project of `eagpt run`
    #[arg(value_name = "SCENE.ply|RUN|PROJECT.toml")]
    scene: PathBuf,
    /// Port of the server, 0 to 65535; 0 is any that is free
    #[arg(long, value_name = "PORT", default_value_t = 0)]
    port: u16,
    /// Address to listen at; any but 127.0.0.1 lets other machines in that know the token
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    address: IpAddr,
    /// Edit script, written after every change; goes on from it if it is there [default:
    /// SCENE.view.toml beside the scene]
    #[arg(long, value_name = "SCRIPT.toml")]
    script: Option<PathBuf>,
    /// Directions traced at each Gaussian when the light is baked after an edit, at least 1
    /// [default: as `eagpt bake` has it]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    samples: Option<u32>,
    /// Folder of path-traced pictures; created when there is one [default: SCENE.stills beside the
    /// scene]
    #[arg(long, value_name = "DIR")]
    stills: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgs,
    #[command(flatten)]
    page: PageArgs,
}

const EXAMPLES: &str = "Examples:
  eagpt view runs/room
  eagpt view room.toml
  eagpt view bakes/lamps.ply --dataset room/evening
  eagpt edit bakes/lamps.ply bakes/lamps.view.toml --out edits/dimmed.ply";

pub(crate) fn run(args: &ViewArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let mut reporter = Reporter::new(global);
    let source = Source::find(&args.scene)?;
    let scene = &source.scene;
    let script = match &args.script {
        Some(path) => path.clone(),
        None => scene.with_extension("view.toml"),
    };
    if script.is_dir() {
        bail!("{}: --script is a folder", script.display());
    }
    let page = source.page(&args.page, &reporter)?;
    let cameras = page.dataset().map(Path::to_path_buf);
    let gaussians = ply::read_gaussians(scene)?;
    let page = ScenePage::new(scene, &gaussians, &page)?;
    let html = page.html(&gaussians, PageKind::Edit)?;
    let original = Original {
        gaussians: Arc::new(gaussians),
        lamps: page.lamps,
        basis: page.basis,
    };
    let served = Served {
        page: html,
        order: page.pack.order,
        edit: Edit::open(&script, original)?,
        workshop: Workshop {
            device: args.device.open(&mut reporter)?,
            cameras,
            options: bake::usual_options(args.samples),
            stills: (args.stills.clone()).unwrap_or_else(|| scene.with_extension("stills")),
        },
    };
    let stop = interrupt::stop_flag_with(
        "the server stops, after a picture under way; Ctrl-C again stops at once",
    )?;
    let server = Server::bind(SocketAddr::new(args.address, args.port), served)?;
    reporter.note(&format!("{}: {}", scene.display(), server.url()));
    reporter.message(&serde_json::json!({
        "message": "listening",
        "url": server.url(),
        "script": script,
    }))?;
    server.run(&stop)?;
    let script = script.exists().then_some(script);
    match &script {
        Some(path) => reporter.note(&format!("script: {}", path.display())),
        None => reporter.note("no script: nothing was edited"),
    }
    reporter.message(&serde_json::json!({ "message": "stopped", "script": script }))?;
    Ok(ExitCode::SUCCESS)
}
