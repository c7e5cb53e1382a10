//! The way in which a frame finds its visible faces, chosen by the user or, with `auto`, by measuring.

use std::sync::Arc;

use super::{
    Class, Found, Pass, device,
    single_pass::{CodedImage, Recovery},
};
use crate::{
    error::Result,
    gpu::{Gpu, ReadbackChoice},
    options::VisibilityWay,
    scene::{Scene, View},
};

/// `auto` counts on the device only where that is faster by this factor: pixels that are traced one by one
/// need primary rays then, and a choice between equals should not change from run to run.
const CLEARLY: f64 = 1.5;
/// Runs of each way that `auto` takes the fastest of.
const RUNS: usize = 3;

/// Finds the visible faces of one scene, view by view.
pub struct Finder<'s> {
    way: Way<'s>,
    /// Why `auto` chose what it chose, once it did.
    pub note: Option<String>,
}

enum Way<'s> {
    IdBuffer(Box<Pass>),
    Device(Box<device::Pass>),
    SinglePass(Recovery<'s>),
    /// Whether it is to be counted on the device is measured once.
    Auto {
        id_buffer: Box<Pass>,
        counting: Box<device::Pass>,
        on_device: Option<bool>,
    },
}

impl<'s> Finder<'s> {
    /// Uploads what `way` needs of `scene`; `classes` has one entry for each object.
    ///
    /// # Errors
    /// More faces than IDs; no device memory left.
    pub fn new(gpu: &Arc<Gpu>, scene: &'s Scene, classes: &[Class], way: VisibilityWay) -> Result<Self> {
        let id_buffer = || Pass::new(gpu, scene, classes).map(Box::new);
        let counting = || device::Pass::new(gpu, scene, classes, ReadbackChoice::Best).map(Box::new);
        let way = match way {
            VisibilityWay::IdBuffer => Way::IdBuffer(id_buffer()?),
            VisibilityWay::Device => Way::Device(counting()?),
            VisibilityWay::SinglePass => Way::SinglePass(Recovery::new(scene, classes)),
            VisibilityWay::Auto => {
                Way::Auto { id_buffer: id_buffer()?, counting: counting()?, on_device: None }
            }
        };
        Ok(Self { way, note: None })
    }

    /// The same for another scene of the same faces, materials and classes, whatever its lights; `None` for a way that
    /// has nothing on the device.
    pub fn outlive<'t>(self) -> Option<Finder<'t>> {
        let way = match self.way {
            Way::IdBuffer(pass) => Way::IdBuffer(pass),
            Way::Device(pass) => Way::Device(pass),
            Way::Auto { id_buffer, counting, on_device } => Way::Auto { id_buffer, counting, on_device },
            Way::SinglePass(_) => return None,
        };
        Some(Finder { way, note: self.note })
    }

    /// Draws every pipeline once, makes the buffers for the size of `view`, and lets `auto` decide.
    ///
    /// # Errors
    /// An image size that the device does not support; no device memory left; a lost device.
    pub fn warm_up(&mut self, view: &View) -> Result<()> {
        match &mut self.way {
            Way::IdBuffer(pass) => pass.warm_up(view),
            Way::Device(pass) => pass.warm_up(view),
            Way::SinglePass(_) => Ok(()),
            Way::Auto { id_buffer, counting, .. } => {
                id_buffer.warm_up(view)?;
                counting.warm_up(view)?;
                self.decide(view)
            }
        }
    }

    /// Finds the visible faces of `view`; `base` draws the base image, which only `single-pass` asks for.
    ///
    /// # Errors
    /// An image size that the device does not support; no device memory left; a lost device.
    pub fn find<'i>(
        &mut self,
        view: &View,
        base: impl FnOnce() -> Result<CodedImage<'i>>,
    ) -> Result<Found<'_>> {
        self.decide(view)?;
        match &mut self.way {
            Way::Auto { counting: pass, on_device: Some(true), .. } | Way::Device(pass) => pass.run(view),
            Way::Auto { id_buffer: pass, .. } | Way::IdBuffer(pass) => pass.run(view),
            Way::SinglePass(recovery) => recovery.run(view, base),
        }
    }

    /// Lets `auto` choose between the two exact ways, if it has not yet. A single pass is not among them:
    /// it may mark too much.
    fn decide(&mut self, view: &View) -> Result<()> {
        let Way::Auto { id_buffer, counting, on_device: on_device @ None } = &mut self.way else {
            return Ok(());
        };
        let (mut read, mut counted) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..RUNS {
            read = read.min(id_buffer.run(view)?.times.total());
            counted = counted.min(counting.run(view)?.times.total());
        }
        let counts = counted * CLEARLY < read;
        *on_device = Some(counts);
        let way = if counts { VisibilityWay::Device } else { VisibilityWay::IdBuffer };
        self.note = Some(format!(
            "--visibility auto took {way}: the ID buffer takes {read:.2} ms here, read back and scanned, \
             counting on the device {counted:.2} ms"
        ));
        Ok(())
    }
}
