//! The window: winit's events as input, composed pictures into the swapchain.

use std::{
    panic,
    sync::{Arc, Mutex, PoisonError},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use winit::{
    application::ApplicationHandler,
    dpi::PhysicalSize,
    error::EventLoopError,
    event::{ElementState, MouseButton, MouseScrollDelta, WindowEvent},
    event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy},
    keyboard::{Key as WindowKey, NamedKey},
    window::{Window, WindowId},
};

use super::{
    Loader, Request,
    exchange::{Mailbox, Update},
    keys::Key,
    script::{Ask, Script},
    viewer::{Button, Input, Viewer},
    worker::Worker,
};
use crate::{
    error::{Error, Result},
    gpu::{self, Gpu, Shown, Surface, Swapchain},
};

/// When a window that took no image is tried again.
const AGAIN: Duration = Duration::from_millis(100);

/// Pixels of a touchpad's scrolling that make a notch of a wheel.
const PIXELS_PER_NOTCH: f64 = 40.0;

/// What to install where a library of the window system is missing.
const LIBRARIES: &str = "(X11 takes `apt-get install libx11-xcb1 libxcursor1 libxi6 libxkbcommon-x11-0`)";

/// Shows `request` in a window until it is closed; `load` reads scenes.
///
/// # Errors
/// No display, or no device that can show images on it; a first scene that cannot be read or drawn; a lost
/// device.
pub fn run(request: &Request, load: Loader) -> Result<()> {
    let script = request.script.as_deref().map(Script::read).transpose()?.unwrap_or_default();
    let events = event_loop()?;
    let mailbox = Arc::new(Mailbox::default());
    let mut app = App {
        request,
        viewer: Viewer::new(request, mailbox.clone()),
        mailbox,
        script,
        start: Some((load, events.create_proxy())),
        opened: None,
        again: None,
        failed: None,
    };
    let ended = events.run_app(&mut app);
    app.close();
    match app.failed {
        Some(error) => Err(error),
        None => ended.map_err(|error| Error::NoDevice(format!("the window system failed: {error}"))),
    }
}

struct App<'r> {
    request: &'r Request,
    viewer: Viewer,
    mailbox: Arc<Mailbox>,
    script: Script,
    /// What the render thread is started with.
    start: Option<(Loader, EventLoopProxy<Update>)>,
    opened: Option<Opened>,
    /// When to try again to show an image.
    again: Option<Instant>,
    failed: Option<Error>,
}

/// A window with its render thread. Fields go in this order: the swapchain before the window.
struct Opened {
    swapchain: Swapchain,
    gpu: Arc<Gpu>,
    window: Arc<Window>,
    thread: JoinHandle<Result<()>>,
}

impl App<'_> {
    fn open(&mut self, events: &ActiveEventLoop) -> Result<()> {
        let Some((load, proxy)) = self.start.take() else { return Ok(()) };
        let (width, height) = self.viewer.size;
        let name = self.request.scene.file_name().unwrap_or_default().to_string_lossy();
        let attributes = Window::default_attributes()
            .with_title(format!("{name} - vtrace view"))
            .with_inner_size(PhysicalSize::new(width, height))
            .with_min_inner_size(PhysicalSize::new(1, 1));
        let window = events
            .create_window(attributes)
            .map_err(|error| Error::NoDevice(format!("the display opens no window: {error}")))?;
        let window = Arc::new(window);
        let target: Arc<dyn gpu::Window> = window.clone();
        let options = gpu::Options { device: self.request.options.device.clone(), validation: false };
        let gpu = Gpu::for_window(&options, &target)?;
        let swapchain = Swapchain::new(Surface::new(&gpu, &target)?)?;
        let send = Arc::new(move |update| {
            // A loop that has ended needs no update.
            let _ = proxy.send_event(update);
        });
        let worker = Worker { gpu: gpu.clone(), mailbox: self.mailbox.clone(), load, send };
        let thread = thread::Builder::new()
            .name("render".into())
            .spawn(|| worker.run())
            .map_err(Error::io("render thread"))?;
        let PhysicalSize { width, height } = window.inner_size();
        self.viewer.input(Input::Resized(width, height));
        self.opened = Some(Opened { swapchain, gpu, window, thread });
        Ok(())
    }

    fn show(&mut self) -> Result<()> {
        let Some(opened) = &mut self.opened else { return Ok(()) };
        self.again = None;
        match opened.swapchain.show(self.viewer.size, &self.viewer.compose().rgba)? {
            Shown::Yes => self.viewer.shown(Instant::now()),
            Shown::Resized(width, height) => {
                self.viewer.input(Input::Resized(width, height));
                self.viewer.stale = true;
            }
            Shown::NotNow => self.again = Some(Instant::now() + AGAIN),
        }
        Ok(())
    }

    /// Everything that is due; returns when more is.
    fn go_on(&mut self) -> Result<Instant> {
        let now = Instant::now();
        let mut wake = self.viewer.tick(now);
        let (ask, until) = self.script.advance(&mut self.viewer, now)?;
        if let (Some(ask), Some(opened)) = (ask, &self.opened) {
            match ask {
                Ask::Resize(width, height) => {
                    // Some window systems resize at once and send no event.
                    if let Some(size) = opened.window.request_inner_size(PhysicalSize::new(width, height)) {
                        self.viewer.input(Input::Resized(size.width, size.height));
                    }
                }
                Ask::Minimise(yes) => opened.window.set_minimized(yes),
                Ask::Fail(call, fault) => opened.gpu.fail_next(call, fault),
            }
            wake = now;
        }
        if let Some(until) = until {
            wake = wake.min(until);
        }
        if self.viewer.stale {
            match (self.again, &self.opened) {
                (Some(again), _) if again > now => wake = wake.min(again),
                (_, Some(opened)) => opened.window.request_redraw(),
                _ => {}
            }
        }
        Ok(wake)
    }

    fn check<T>(&mut self, events: &ActiveEventLoop, result: Result<T>) -> Option<T> {
        result
            .map_err(|error| {
                self.failed.get_or_insert(error);
                events.exit();
            })
            .ok()
    }

    /// Ends the render thread, so that the device is free to go.
    fn close(&mut self) {
        self.mailbox.close();
        if let Some(Opened { swapchain, gpu, window, thread }) = self.opened.take() {
            window.set_visible(false); // a scene that is being read is read to its end
            let died = || Err(Error::NoDevice("the render thread died".into()));
            if let Err(error) = thread.join().unwrap_or_else(|_| died()) {
                self.failed.get_or_insert(error);
            }
            drop(swapchain);
            drop(gpu);
            drop(window);
        }
    }
}

impl ApplicationHandler<Update> for App<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        let opened = self.open(events);
        self.check(events, opened);
    }

    fn user_event(&mut self, events: &ActiveEventLoop, update: Update) {
        let updated = self.viewer.update(update);
        self.check(events, updated);
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        if event == WindowEvent::RedrawRequested {
            let shown = self.show();
            self.check(events, shown);
        } else if let Some(input) = input(event) {
            self.viewer.input(input);
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        let due = self.go_on();
        if let Some(wake) = self.check(events, due) {
            events.set_control_flow(ControlFlow::WaitUntil(wake));
        }
        let ended = self.opened.as_ref().is_some_and(|opened| opened.thread.is_finished());
        if self.viewer.quits() || ended {
            events.exit();
        }
    }
}

/// The window system's events.
///
/// winit loads its X11 libraries when it starts, and panics where one is missing: said in one line instead.
fn event_loop() -> Result<EventLoop<Update>> {
    let said = Arc::new(Mutex::new(String::new()));
    let (usual, hears) = (panic::take_hook(), said.clone());
    panic::set_hook(Box::new(move |info| {
        let payload = info.payload();
        let text =
            payload.downcast_ref::<String>().map(String::as_str).or(payload.downcast_ref::<&str>().copied());
        let text = text.unwrap_or_default().replace('\n', " ");
        *hears.lock().unwrap_or_else(PoisonError::into_inner) = text;
    }));
    let built = panic::catch_unwind(|| EventLoop::<Update>::with_user_event().build());
    panic::set_hook(usual);
    built.map_or_else(
        |_| {
            let said = said.lock().unwrap_or_else(PoisonError::into_inner);
            Err(Error::NoDevice(format!("the window system cannot be used: {said} {LIBRARIES}")))
        },
        |built| built.map_err(no_display),
    )
}

fn no_display(error: EventLoopError) -> Error {
    let text = error.to_string();
    // winit says first in which of its source files it failed.
    let cause = text
        .split_once(".rs:")
        .and_then(|(_, rest)| rest.split_once(": "))
        .map_or(&*text, |(_, cause)| cause);
    Error::NoDevice(format!(
        "no display to open a window on ({}); without one take `vtrace render`, or run under `xvfb-run`{}",
        cause.trim_end_matches('.'),
        if cause.contains(".so") { format!(" {LIBRARIES}") } else { String::new() },
    ))
}

/// What an event means to the viewer.
fn input(event: WindowEvent) -> Option<Input> {
    Some(match event {
        WindowEvent::CloseRequested | WindowEvent::Destroyed => Input::Close,
        WindowEvent::Resized(PhysicalSize { width, height }) => Input::Resized(width, height),
        WindowEvent::DroppedFile(file) => Input::Drop(file),
        WindowEvent::CursorMoved { position, .. } => Input::Pointer(position.x, position.y),
        WindowEvent::MouseInput { state: ElementState::Pressed, button, .. } => match button {
            MouseButton::Left => Input::Press(Button::Left),
            MouseButton::Middle => Input::Press(Button::Middle),
            _ => Input::Press(Button::Right),
        },
        WindowEvent::MouseInput { state: ElementState::Released, .. } => Input::Release,
        WindowEvent::MouseWheel { delta, .. } => Input::Wheel(match delta {
            MouseScrollDelta::LineDelta(_, lines) => lines.into(),
            MouseScrollDelta::PixelDelta(position) => position.y / PIXELS_PER_NOTCH,
        }),
        WindowEvent::ModifiersChanged(held) => {
            Input::Held { shift: held.state().shift_key(), ctrl: held.state().control_key() }
        }
        WindowEvent::KeyboardInput { event, is_synthetic: false, .. } if event.state.is_pressed() => {
            Input::Key(match event.logical_key {
                WindowKey::Character(text) => Key::Char(text.chars().next()?),
                WindowKey::Named(NamedKey::Escape) => Key::Escape,
                WindowKey::Named(NamedKey::ArrowLeft) => Key::Left,
                WindowKey::Named(NamedKey::ArrowRight) => Key::Right,
                WindowKey::Named(NamedKey::ArrowUp) => Key::Up,
                WindowKey::Named(NamedKey::ArrowDown) => Key::Down,
                _ => return None,
            })
        }
        _ => return None,
    })
}
