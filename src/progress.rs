//! How long work reports how far it is, and learns that it should stop.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use crate::error::{Error, Result};

/// Receives the progress of long work, from any thread.
pub trait Observer: Send + Sync {
    /// `done` of `total` units of `stage` are finished; a stage ends with `done == total`.
    fn progress(&self, stage: &'static str, done: u64, total: u64);
}

/// A handle that long work polls; clones share one stop flag and one observer.
#[derive(Clone, Default)]
pub struct Control {
    stop: Arc<AtomicBool>,
    observer: Option<Arc<dyn Observer>>,
}

impl Control {
    /// A handle that reports to `observer`.
    pub fn observed_by(observer: Arc<dyn Observer>) -> Self {
        Self { stop: Arc::default(), observer: Some(observer) }
    }

    /// Asks the work to stop at its next check; may be called from a signal handler's thread.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Whether the work may go on.
    ///
    /// # Errors
    /// [`Error::Interrupted`] after [`Control::stop`].
    pub fn check(&self) -> Result<()> {
        if self.stop.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// Reports that `done` of `total` units of `stage` are finished, and [checks](Control::check).
    ///
    /// # Errors
    /// [`Error::Interrupted`] after [`Control::stop`].
    pub fn progress(&self, stage: &'static str, done: u64, total: u64) -> Result<()> {
        if let Some(observer) = &self.observer {
            observer.progress(stage, done, total);
        }
        self.check()
    }
}
