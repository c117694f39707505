//! Renderings of a scene in one light, its baked light, and what is measured of them.

use super::Plan;
use crate::bake::BakeArgs;
use crate::command::JobCommand;
use crate::eval::EvalArgs;
use crate::render::Mode;
use crate::run::options::Options;
use crate::run::project::{Project, Relight, mode_name};
use anyhow::Result;
use eagpt_eval::{METRICS_FILE, TableFolder};
use eagpt_report::run::folders;
use eagpt_scene::dataset::TRANSFORMS_FILE;
use std::path::{Path, PathBuf};

/// A light to render and measure.
#[derive(Clone, Copy)]
pub(super) struct Condition<'a> {
    pub(super) name: &'a str,
    pub(super) scene: &'a Path,
    /// Dataset with the cameras.
    pub(super) dataset: &'a Path,
    pub(super) reference: Option<&'a Path>,
    /// The change of light; `None` for that of the photographs.
    pub(super) relight: Option<&'a Relight>,
}

impl Condition<'_> {
    /// Arguments of a command that needs only the scene and the cameras of the dataset.
    fn view_inputs(&self) -> impl Iterator<Item = PathBuf> + use<> {
        let cameras = if self.dataset.is_file() {
            self.dataset.to_owned()
        } else {
            self.dataset.join(TRANSFORMS_FILE)
        };
        [cameras, self.scene.to_owned()].into_iter()
    }
}

impl Plan {
    /// Baking, rendering and measuring of one light; returns the evaluations.
    pub(super) fn condition(
        &mut self,
        project: &Project,
        condition: &Condition<'_>,
    ) -> Result<Vec<TableFolder>> {
        let mut rendered = Vec::new();
        for mode in project.modes()? {
            let row = mode_name(&mode);
            self.render(project, condition, mode, &row)?;
            rendered.push(row);
        }
        if project.file.bake.is_some() && condition.relight.is_some() {
            let scene = self.bake(project, condition)?;
            let baked = Condition {
                scene: &scene,
                ..*condition
            };
            self.render(project, &baked, Mode::ZeroBounce, "baked")?;
            rendered.push("baked".to_owned());
        }
        let Some(reference) = condition.reference else {
            return Ok(Vec::new());
        };
        let rows = rendered.into_iter();
        rows.map(|row| self.eval(project, condition, reference, row))
            .collect()
    }

    fn bake(&mut self, project: &Project, condition: &Condition<'_>) -> Result<PathBuf> {
        let name = condition.name;
        let out = self.out.join(folders::BAKE).join(format!("{name}.ply"));
        let Options { mut args, paths } = project.options::<BakeArgs>("bake")?;
        args.scene = condition.scene.to_owned();
        args.cameras = condition.dataset.to_owned();
        args.out.clone_from(&out);
        let takes = condition.view_inputs().chain(paths);
        let command = JobCommand::Bake(args);
        Ok(self.add(format!("bake/{name}"), command, takes, out))
    }

    fn render(
        &mut self,
        project: &Project,
        condition: &Condition<'_>,
        mode: Mode,
        row: &str,
    ) -> Result<()> {
        let Condition { name, scene, .. } = condition;
        let out = self.out.join(folders::RENDER).join(name).join(row);
        let Options { mut args, paths } = project.render_options(mode)?;
        args.scene = (*scene).to_owned();
        args.cameras = condition.dataset.to_owned();
        args.mode = mode;
        args.out.clone_from(&out);
        let takes = condition.view_inputs().chain(paths);
        self.add(
            format!("render/{name}/{row}"),
            JobCommand::Render(args),
            takes,
            out,
        );
        Ok(())
    }

    fn eval(
        &mut self,
        project: &Project,
        condition: &Condition<'_>,
        reference: &Path,
        row: String,
    ) -> Result<TableFolder> {
        let Condition { name, dataset, .. } = condition;
        let renders = self.out.join(folders::RENDER).join(name).join(&row);
        let folder = self.out.join(folders::EVAL).join(name).join(&row);
        let Options { mut args, paths } = project.options::<EvalArgs>("eval")?;
        let mut takes = vec![reference.to_owned(), renders.clone()];
        if let Some(relight) = condition.relight {
            takes.push((*dataset).to_owned());
            args.before.push((*dataset).to_owned());
            if let Some(split) = relight.split {
                args.split = vec![split];
            }
        }
        args.renders = vec![renders];
        args.reference = vec![reference.to_owned()];
        args.name = vec![(*name).to_owned()];
        args.out = Some(folder.clone());
        takes.extend(paths);
        let product = folder.join(METRICS_FILE);
        self.add(
            format!("eval/{name}/{row}"),
            JobCommand::Eval(args),
            takes,
            product,
        );
        let row = Some(row);
        Ok(TableFolder { folder, row })
    }
}
