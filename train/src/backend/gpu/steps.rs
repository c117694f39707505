//! Steps on the device ([`GpuBackend::submit`] records one), a few of which are queued: the host
//! prepares the next ones while the device computes, and reads the report of a step when others are
//! queued behind it.
//!
//! A step that overflows its buffers, or whose gradients are no numbers, moves nothing, and nor do
//! those behind it until the host has read its report. Then the host grows the buffers and records
//! all of them again, each in the light of its view: the results are bit-identical to those of
//! steps taken one by one.

use super::loss::{self, LossBuffers};
use super::report::Report;
use super::task::{PendingStep, StepLoss, StepTask};
use super::{GpuBackend, Parameters, resident};
use crate::backend::step::{AlbedoStep, Backend as _, RadianceStep, Taken};
use crate::error::Result;
use eagpt_trace::gpu::{Counters, Frame};

/// Steps that may be queued when the next one has been submitted.
const MOST_AHEAD: usize = 3;

impl GpuBackend {
    /// Begins a step; returns those that are over.
    pub(super) fn begin(&mut self, task: StepTask) -> Result<Vec<Taken>> {
        // Buffers are those of one size of cameras.
        if let Some(first) = self.under_way.front()
            && first.task.rays.grid_size() != task.rays.grid_size()
        {
            self.catch_up(0)?;
        }
        self.submit_or_take(task)?;
        self.catch_up(MOST_AHEAD)?;
        Ok(std::mem::take(&mut self.over))
    }

    /// Waits until at most so many steps are under way.
    pub(super) fn catch_up(&mut self, most_ahead: usize) -> Result<()> {
        while self.under_way.len() > most_ahead {
            let Some(first) = self.under_way.pop_front() else {
                break;
            };
            let read = first.report.wait(&self.device)?;
            let report = read.first().copied().unwrap_or(Report::EMPTY);
            if !first.capacity.holds(&report.needed) {
                let behind = self.under_way.drain(..);
                let again = std::iter::once((first.task, first.num_steps))
                    .chain(behind.map(|step| (step.task, step.num_steps)))
                    .collect();
                self.record_again(again, &report.needed)?;
                continue;
            }
            let terms = loss::terms(&report, &first.task.target, &first.options);
            let bad = match &self.parameters {
                Parameters::Device(resident) => resident.bad_gradient(&report)?,
                Parameters::Host(_) => None,
            };
            if bad.is_some() {
                self.under_way.clear();
            }
            self.over.push(Taken {
                iteration: first.task.iteration,
                view: first.task.view,
                outcome: bad.map_or(Ok(terms), Err),
            });
        }
        Ok(())
    }

    /// Records steps again, with how many there were before each, after the first has overflowed
    /// its buffers.
    fn record_again(&mut self, steps: Vec<(StepTask, [u32; 2])>, needed: &Counters) -> Result<()> {
        let shown = self.light();
        for (task, num_steps) in steps.iter().rev() {
            self.show_light(task.view.light)?;
            if let Parameters::Device(resident) = &mut self.parameters {
                resident.go_back(*num_steps);
            }
        }
        if let Some((first, _)) = steps.first() {
            self.trainer.scene.grow(&first.rays, needed);
        }
        for (task, _) in steps {
            self.submit_or_take(task)?;
        }
        self.show_light(shown)
    }

    /// Gives a step to the device, or where one buffer does not hold all rays takes it on the host;
    /// in the light of its view.
    fn submit_or_take(&mut self, task: StepTask) -> Result<()> {
        self.show_light(task.view.light)?;
        if let Some(frame) = self.trainer.scene.frame(&task.rays)? {
            return self.submit(task, &frame);
        }
        let (trainer, parameters) = self.host()?;
        let taken = match &task.loss {
            StepLoss::Radiance { weights, normals } => {
                let step = RadianceStep {
                    iteration: task.iteration,
                    weights,
                    normals: *normals,
                    antialias: task.rays.split().is_some(),
                    sizes: task.sizes,
                };
                trainer.radiance_step(parameters, &task.view, &step)?
            }
            StepLoss::Albedo {
                options,
                ssim_share,
                seed,
                ..
            } => {
                let step = AlbedoStep {
                    options,
                    ssim_share: *ssim_share,
                    seed: *seed,
                    iteration: task.iteration,
                    sizes: task.sizes,
                };
                trainer.albedo_step(parameters, &task.view, &step)?
            }
        };
        self.over.push(taken);
        Ok(())
    }

    /// Records a step from top to bottom, for a `frame` that holds all of its `rays`: forward,
    /// loss, adjoint, optimiser. Nothing waits; kernels move nothing once a step has failed.
    fn submit(&mut self, task: StepTask, frame: &Frame) -> Result<()> {
        let camera = task.view.view.camera;
        let options = task.loss_options();
        let device = &*self.device;
        let resident = resident(&mut self.parameters, &mut self.trainer.scene)?;
        let scene = &self.trainer.scene;
        if !matches!(&self.loss, Some(loss) if loss.fits(camera.num_pixels())) {
            // The old one's memory goes first.
            self.loss = None;
        }
        let loss = match &mut self.loss {
            Some(loss) => loss,
            none => none.insert(LossBuffers::new(device, camera.num_pixels())?),
        };
        let num_steps = resident.num_steps();
        resident.begin();
        // Gaussians to lists of tiles, features of every ray, and a record of the blended hits.
        let mut commands = device.commands();
        scene.forward(&task.rays, &mut commands)?;
        // Features to the terms of the loss, and to its derivatives by them.
        let compared = (&camera, &task.target);
        let of_loss = loss.passes(device, compared, &options, (frame, resident.report()));
        device.record(&of_loss, &mut commands);
        // Derivatives by features to gradients of every Gaussian.
        scene.backward(&task.rays, &mut commands)?;
        // Gradients by the raw parameters; Adam moves these, and the Gaussians with them.
        let seen = (frame, camera.origin());
        device.record(&resident.passes(scene, seen, &task.sizes), &mut commands);
        resident.count(&task.sizes);
        // The host reads the report when other steps are queued behind this one.
        let report = resident.submit(commands)?;
        self.under_way.push_back(PendingStep {
            task,
            options,
            capacity: frame.capacity,
            num_steps,
            report,
        });
        Ok(())
    }
}
