//! Draws what is wanted of one scene with one set of options.

use std::{
    cell::OnceCell,
    sync::mpsc::SyncSender,
    time::{Duration, Instant},
};

use super::{
    exchange::{Pixels, Update, Wanted},
    inspect,
    pace::Pace,
    worker::Worker,
};
use crate::{
    error::Result,
    frame::{Ahead, Frame, Observer, Renderer, Step},
    options::{EffortOptions, ViewOptions},
    report::FloatImage,
    scene::{Scene, View},
    trace::{Settings, Tracer, reference},
};

/// Budgets between two steps that are shown while the camera rests: each is drawn at the cost of refinement.
const STEP_INTERVAL: u32 = 4;

/// A frame of a moving camera on its way to the window.
pub struct Parcel {
    frame: Ahead,
    wanted: Wanted,
    view: View,
}

impl Parcel {
    /// Waits for the picture.
    pub fn open(self) -> Update {
        match self.frame.finish() {
            Ok(Frame { image, stats }) => self.wanted.finished(&image, self.view, stats),
            Err(error) => Update::Problem(error),
        }
    }
}

/// Draws one scene with one set of options.
pub struct Artist<'l> {
    /// Whose work it is.
    pub worker: &'l Worker,
    /// What draws.
    pub renderer: Renderer<'l>,
    /// What is drawn.
    pub scene: &'l Scene,
    /// For paths and the reference, where the renderer traces nothing itself.
    pub tracer: OnceCell<Tracer<'l>>,
    /// How coarse a moving picture is.
    pub pace: Pace,
}

impl Artist<'_> {
    /// Draws what is wanted, in as many pictures as it takes; `deliver` takes that of a moving camera.
    ///
    /// # Errors
    /// [`Interrupted`](crate::error::Error::Interrupted) by something newer; a lost device; no memory left.
    pub fn draw(&mut self, wanted: &Wanted, deliver: &SyncSender<Parcel>) -> Result<()> {
        let view = wanted.options.view.resolve(self.scene)?;
        let settings = Settings::new(&wanted.options.paths, &wanted.options.scene);
        let send = &self.worker.send;
        if let Some(pixel) = wanted.pixel {
            send(Update::Path(inspect::follow(self.tracer(), &settings, &view, pixel)));
        }
        if wanted.moving {
            return self.draw_moving(wanted, deliver);
        }
        self.renderer.set_effort(wanted.options.effort.clone());
        self.renderer.set_step_interval(wanted.budget * STEP_INTERVAL);
        let mut show = |step: &Step| {
            let progress = (step.number, step.samples, step.predicted_error);
            send(wanted.picture(&step.image, view, progress, None));
            Ok(())
        };
        // Pictures of data exist once refinement ended.
        let observer: Option<Observer> = if wanted.options.show.is_none() { Some(&mut show) } else { None };
        let Frame { image, stats } = self.renderer.render_steps(&view, observer)?;
        send(wanted.finished(&image, view, stats));
        if wanted.reference {
            let interrupt = &self.worker.mailbox.interrupt;
            let traced = reference::render(self.tracer(), &view, &settings, 1, None, interrupt, &|_| {})?;
            let image = FloatImage { width: view.width, height: view.height, pixels: traced.image };
            send(Update::Reference(Pixels::encoded(&image, wanted.exposure)));
        }
        Ok(())
    }

    /// Draws one frame within the budget, coarser if that is what it takes; its picture is delivered while the next
    /// one is made.
    fn draw_moving(&mut self, wanted: &Wanted, deliver: &SyncSender<Parcel>) -> Result<()> {
        let started = Instant::now();
        let coarse = wanted.coarse.unwrap_or(self.pace.coarse());
        let ViewOptions { width, height, .. } = wanted.options.view;
        let (width, height) = (width.div_ceil(coarse), height.div_ceil(coarse));
        let view = ViewOptions { width, height, ..wanted.options.view.clone() }.resolve(self.scene)?;
        self.renderer.set_effort(moving_effort(wanted));
        let frame = self.renderer.render_ahead(&view)?;
        self.renderer.learn_reserve();
        let times = &frame.stats().time_ms;
        let sampling = Duration::from_secs_f64((times.trace + times.refine) * 1e-3);
        self.pace.took(started.elapsed().saturating_sub(sampling), wanted.budget);
        // Nobody is there to see it once the picture thread is gone.
        let _ = deliver.send(Parcel { frame, wanted: wanted.clone(), view });
        Ok(())
    }

    fn tracer(&self) -> &Tracer<'_> {
        self.renderer.tracer().unwrap_or_else(|| self.tracer.get_or_init(|| Tracer::new(self.scene)))
    }
}

/// What a frame of a moving camera is allowed.
fn moving_effort(wanted: &Wanted) -> EffortOptions {
    let effort = wanted.options.effort.clone();
    if effort.preview { effort } else { EffortOptions { budget: Some(wanted.budget), error: None, ..effort } }
}
