//! `eagpt view`: a scene in a browser, with an edit under way.

mod source;

use crate::args::GlobalArgs;
use crate::interrupt;
use crate::page::{PageArgs, PageKind, ScenePage};
use crate::progress::Reporter;
use anyhow::{Result, bail};
use clap::Args;
use eagpt_scene::ply;
use eagpt_viewer::live::Edit;
use eagpt_viewer::server::Server;
use source::Source;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::process::ExitCode;

/// Show a scene in a browser, and edit its lamps
///
/// A server for browsers of this machine shows the page of `eagpt export --format html` at the
/// address that is printed, until Ctrl-C. Of a scene that was baked with --per-light each change of
/// a lamp is a step of an edit script, shown beside, with undo and redo. The script is on disk after
/// every change; `eagpt edit` replays it, and the same command goes on from it.
///
/// Of a run the trained scene is shown, with cameras and photographs of the dataset that it was
/// trained on, if that is still there and unchanged.
///
/// The address has a token that nobody else knows. The server has the page and the edit, and no
/// file of the disk.
#[derive(Debug, Clone, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct ViewArgs {
    /// Scene of 2D Gaussians, as `eagpt train` or `eagpt bake` writes it, or folder of a run, as
    /// `eagpt train` or `eagpt run` leaves it
    #[arg(value_name = "SCENE.ply|RUN")]
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
    #[command(flatten)]
    page: PageArgs,
}

const EXAMPLES: &str = "Examples:
  eagpt view runs/room
  eagpt view bakes/lamps.ply --dataset room/evening
  eagpt edit bakes/lamps.ply bakes/lamps.view.toml --out edits/dimmed.ply";

pub(crate) fn run(args: &ViewArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let reporter = Reporter::new(global);
    let source = Source::find(&args.scene)?;
    let scene = &source.scene;
    let script = match &args.script {
        Some(path) => path.clone(),
        None => scene.with_extension("view.toml"),
    };
    if script.is_dir() {
        bail!("{}: --script is a folder", script.display());
    }
    let page = args.page.for_run(source.run.as_deref(), source.dataset);
    if let (None, Some(lost)) = (page.dataset(), &source.lost) {
        let text = format!(
            "{}: the dataset of the training is not there or has changed: --dataset names one",
            lost.display()
        );
        reporter.warning(&text);
        reporter.message(&serde_json::json!({ "message": "warning", "text": text }))?;
    }
    let gaussians = ply::read_gaussians(scene)?;
    let page = ScenePage::new(scene, &gaussians, &page)?;
    let edit = Edit::open(&script, page.pack.lights.clone())?;
    let html = page.html(&gaussians, PageKind::Live)?;
    let stop = interrupt::stop_flag_with("the server stops")?;
    let server = Server::bind(SocketAddr::new(args.address, args.port), html, edit)?;
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
