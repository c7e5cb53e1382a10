//! Pictures on their way to the host: a ring of staging buffers, so that the next frame need not wait for them.

use std::sync::{Arc, Mutex, PoisonError};

use glam::Vec3;

use crate::error::Result;
use crate::gpu::{Commands, Gpu, Image, ReadbackBuffer, ReadbackChoice};
use crate::memory;
use crate::report::image::FloatImage;

/// Buffers that nobody reads at the moment.
type Free = Arc<Mutex<Vec<ReadbackBuffer>>>;

/// Staging buffers that go round between who draws pictures and who reads them.
pub struct PictureRing {
    gpu: Arc<Gpu>,
    commands: Commands,
    free: Free,
}

/// A picture that the device may still be copying.
pub struct PendingImage {
    width: u32,
    height: u32,
    staging: ReadbackBuffer,
    home: Free,
}

impl PictureRing {
    /// A ring without buffers: there will be as many as pictures are under way at a time.
    ///
    /// # Errors
    /// No memory left.
    pub fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        Ok(Self { gpu: gpu.clone(), commands: Commands::new(gpu, "picture", 0)?, free: Free::default() })
    }

    /// Starts to copy `color`, four halves a pixel, once what was submitted before is done; waits for nothing but the
    /// copy before.
    ///
    /// # Errors
    /// No memory left; a lost device.
    pub fn start(&mut self, color: &Image) -> Result<PendingImage> {
        let free = self.free.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut staging = match free.filter(|staging| staging.size() >= color.bytes()) {
            Some(staging) => staging,
            None => ReadbackBuffer::new(&self.gpu, "picture staging", color.bytes(), ReadbackChoice::Best)?,
        };
        let mut recording = self.commands.begin()?;
        recording.read_image(color, &mut staging);
        let _ = recording.submit()?; // reading waits for it
        Ok(PendingImage { width: color.width(), height: color.height(), staging, home: self.free.clone() })
    }
}

impl PendingImage {
    /// Waits for the copy; the image, linear. The staging buffer goes back to its ring.
    ///
    /// # Errors
    /// No memory left; a lost device.
    pub fn finish(mut self) -> Result<FloatImage> {
        let (width, height) = (self.width, self.height);
        memory::check_picture(width, height, 12)?;
        let pixels = linear(&mut self.staging, width as usize * height as usize)?.collect();
        let image = FloatImage { width, height, pixels };
        self.home.lock().unwrap_or_else(PoisonError::into_inner).push(self.staging);
        Ok(image)
    }
}

/// Copies `color`, four halves a pixel, to the host, linear, as many rows at a time as `staging` has room for, one at least.
///
/// # Errors
/// No memory left; a lost device.
pub fn read_in_bands(
    commands: &mut Commands,
    color: &Image,
    staging: &mut ReadbackBuffer,
) -> Result<FloatImage> {
    let (width, height) = (color.width(), color.height());
    memory::check_picture(width, height, 12)?;
    let at_once = (staging.size() / color.row_bytes()).max(1) as u32;
    let mut pixels = Vec::with_capacity(width as usize * height as usize);
    let mut top = 0;
    while top < height {
        let rows = top..height.min(top + at_once);
        let mut recording = commands.begin()?;
        recording.read_rows(color, rows.clone(), staging);
        recording.submit_and_wait()?;
        pixels.extend(linear(staging, width as usize * rows.len())?);
        top = rows.end;
    }
    Ok(FloatImage { width, height, pixels })
}

/// The linear colours of these `pixels`, y · width + x, of `color`, four halves a pixel: copies the bands that hold any, of as
/// many rows as `staging` has room for, one at least.
///
/// # Errors
/// A lost device.
pub fn read_pixels(
    commands: &mut Commands,
    color: &Image,
    pixels: &[u32],
    staging: &mut ReadbackBuffer,
) -> Result<Vec<Vec3>> {
    let (width, height) = (color.width(), color.height());
    let at_once = (staging.size() / color.row_bytes()).max(1) as u32;
    let mut colors = vec![Vec3::ZERO; pixels.len()];
    for top in (0..height).step_by(at_once as usize) {
        let rows = top..height.min(top + at_once);
        let band = width * rows.start..width * rows.end;
        if !pixels.iter().any(|pixel| band.contains(pixel)) {
            continue;
        }
        let mut recording = commands.begin()?;
        recording.read_rows(color, rows.clone(), staging);
        recording.submit_and_wait()?;
        let halves: &[[half::f16; 4]] = staging.read(width as usize * rows.len())?;
        for (color, pixel) in colors.iter_mut().zip(pixels).filter(|(_, pixel)| band.contains(pixel)) {
            let [r, g, b, _] = halves[(pixel - band.start) as usize].map(half::f16::to_f32);
            *color = Vec3::new(r, g, b);
        }
    }
    Ok(colors)
}

/// The first `count` pixels, of four halves each, that were copied to `staging`.
fn linear(staging: &mut ReadbackBuffer, count: usize) -> Result<impl Iterator<Item = [f32; 3]>> {
    let halves: &[[half::f16; 4]] = staging.read(count)?;
    Ok(halves.iter().map(|p| [p[0].to_f32(), p[1].to_f32(), p[2].to_f32()]))
}
