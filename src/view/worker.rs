//! The render thread: always at work on what was wanted last, so that the window never waits for a picture.

use std::{
    cell::OnceCell,
    path::{Path, PathBuf},
    sync::{Arc, mpsc},
    thread,
};

use glam::Vec3;

use super::{
    artist::{Artist, Parcel},
    exchange::{Facts, Mailbox, Update, Wanted},
    pace::Pace,
};
use crate::{
    error::{Error, Result},
    frame::{Kept, Renderer},
    gpu::Gpu,
    scene::{Light, Scene, gltf},
};

/// Pictures of a moving camera that may be on their way to the window while the next is made.
const UNDER_WAY: usize = 2;

/// Bytes of samples that are kept from frame to frame: about half a million of them.
const SAMPLE_BYTES: usize = 512 << 20;

/// Reads and classifies a scene file.
pub type Loader = Box<dyn Fn(&Path) -> Result<Scene> + Send>;

/// What the render thread works with.
pub struct Worker {
    /// The device.
    pub gpu: Arc<Gpu>,
    /// Where it finds what is wanted.
    pub mailbox: Arc<Mailbox>,
    /// How it reads scenes.
    pub load: Loader,
    /// Where its updates go.
    pub send: Arc<dyn Fn(Update) + Send + Sync>,
}

/// A scene in use.
struct Loaded {
    source: (PathBuf, u32),
    scene: Scene,
    /// The file's own lights.
    lights: Vec<Light>,
    /// Where the headlight is, in a scene without lights of its own.
    headlight: Option<Vec3>,
    /// What the last renderer has left.
    kept: Option<Kept>,
    pace: Pace,
}

impl Worker {
    /// Works until the mailbox is closed.
    ///
    /// # Errors
    /// The first scene cannot be read; the device fails.
    pub fn run(self) -> Result<()> {
        let (deliver, delivered) = mpsc::sync_channel(UNDER_WAY);
        let send = self.send.clone();
        let courier = thread::Builder::new()
            .name("pictures".into())
            .spawn(move || delivered.into_iter().for_each(|parcel: Parcel| send(parcel.open())))
            .map_err(Error::io("picture thread"))?;
        let done = self.work(&deliver);
        drop(deliver);
        // What went wrong there, the device will say here too.
        let _ = courier.join();
        done
    }

    fn work(&self, deliver: &mpsc::SyncSender<Parcel>) -> Result<()> {
        let mut loaded: Option<Loaded> = None;
        let mut next = self.mailbox.next();
        while let Some(wanted) = next {
            match self.serve_source(&mut loaded, wanted, deliver) {
                Ok(other) => next = other,
                Err(error) if loaded.is_none() || matches!(error, Error::Vulkan { .. }) => return Err(error),
                Err(error) => {
                    (self.send)(Update::Problem(error));
                    next = self.mailbox.next();
                }
            }
        }
        Ok(())
    }

    /// Draws what is wanted until another scene is; returns what asks for it.
    fn serve_source(
        &self,
        loaded: &mut Option<Loaded>,
        mut wanted: Wanted,
        deliver: &mpsc::SyncSender<Parcel>,
    ) -> Result<Option<Wanted>> {
        let current = match loaded.take() {
            Some(current) if current.source == wanted.source => loaded.insert(current),
            before => match (self.load)(&wanted.source.0) {
                Ok(scene) => {
                    let read = Loaded::new(scene, wanted.source.clone());
                    (self.send)(Update::Scene(Box::new(read.facts())));
                    loaded.insert(read)
                }
                Err(error) => {
                    // What was shown before goes on being shown.
                    *loaded = before.map(|before| match before.source.0 == wanted.source.0 {
                        true => Loaded { source: wanted.source.clone(), ..before },
                        false => before,
                    });
                    return Err(error);
                }
            },
        };
        loop {
            current.light(&wanted)?;
            let kept = current.kept.take();
            let lit = &*current;
            let mut artist = self.artist(lit, kept, &wanted)?;
            let other = loop {
                match artist.draw(&wanted, deliver) {
                    Ok(()) | Err(Error::Interrupted) => {}
                    Err(error) => return Err(error),
                }
                let Some(newer) = self.mailbox.next() else { return Ok(None) };
                if !newer.shares_renderer(&wanted) || lit.needs_light(&newer)? {
                    break newer;
                }
                wanted = newer;
            };
            let Artist { renderer, pace, .. } = artist;
            (current.kept, current.pace) = (Some(renderer.into_kept()), pace);
            if other.source != current.source {
                return Ok(Some(other));
            }
            wanted = other;
        }
    }

    /// A renderer of the current scene, made of what the one before has left.
    fn artist<'l>(&'l self, current: &'l Loaded, kept: Option<Kept>, wanted: &Wanted) -> Result<Artist<'l>> {
        let Loaded { scene, pace, .. } = current;
        let first = kept.is_none();
        let mut renderer = Renderer::reusing(kept.unwrap_or_default(), &self.gpu, scene, &wanted.options)?;
        renderer.set_interrupt(self.mailbox.interrupt.clone());
        if first {
            renderer.keep_samples(SAMPLE_BYTES);
            match renderer.warm_up(&wanted.options.view.resolve(scene)?) {
                // Something newer is wanted: what is drawn first will be slower.
                Ok(_) | Err(Error::Interrupted) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(Artist { worker: self, renderer, scene, tracer: OnceCell::new(), pace: *pace })
    }
}

/// Centre of the box around all specular VT objects.
fn specular_centre(scene: &Scene) -> Option<Vec3> {
    let ranges = scene.objects.iter().filter(|object| object.vt).map(|object| object.vertices.clone());
    let mut points = ranges.flatten().map(|vertex| scene.geometry.positions[vertex as usize]);
    let first = points.next()?;
    let (low, high) = points.fold((first, first), |(low, high), p| (low.min(p), high.max(p)));
    Some((low + high) * 0.5)
}

impl Loaded {
    fn new(scene: Scene, source: (PathBuf, u32)) -> Self {
        Self {
            source,
            lights: scene.lights.clone(),
            scene,
            headlight: None,
            kept: None,
            pace: Pace::default(),
        }
    }

    fn facts(&self) -> Facts {
        let Scene { origin, cameras, .. } = &self.scene;
        let bounds = self.scene.bounds();
        Facts {
            bounds,
            focus: specular_centre(&self.scene).unwrap_or((bounds.0 + bounds.1) * 0.5),
            origin: *origin,
            cameras: cameras.clone(),
            lights: self.lights.clone(),
            beside: gltf::files_beside(&self.source.0, &gltf::Limits::default()),
        }
    }

    /// Whether a camera that came to rest left the headlight behind.
    fn needs_light(&self, wanted: &Wanted) -> Result<bool> {
        let Some(headlight) = self.headlight else { return Ok(false) };
        Ok(!wanted.moving && wanted.options.view.resolve(&self.scene)?.eye != headlight)
    }

    /// Lights the scene as wanted: by the lights given, else the file's, else from the eye as `vtrace render` does.
    fn light(&mut self, wanted: &Wanted) -> Result<()> {
        let view = wanted.options.view.resolve(&self.scene)?;
        let lights = wanted.lights.as_deref().unwrap_or(&self.lights);
        self.headlight = lights.is_empty().then_some(view.eye);
        self.scene.lights = lights.to_vec();
        if self.headlight.is_some() {
            let notes = std::mem::take(&mut self.scene.notes);
            self.scene.add_default_lights(&view);
            self.scene.notes = notes;
        }
        Ok(())
    }
}
