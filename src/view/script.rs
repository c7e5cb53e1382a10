//! Scripted input, for tests and measurements: the same inputs as a user's, one line each.

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use super::{
    keys::Key,
    output,
    pointer::CLICK,
    viewer::{Button, Input, Viewer},
};
use crate::{
    error::{Error, Result},
    gpu::Fault,
};

/// A line of a script.
#[derive(Debug, Clone, PartialEq)]
enum Line {
    /// Inputs, all at once.
    Inputs(Vec<Input>),
    /// So many drags by so many pixels, each once the frame before it is seen.
    Turn {
        left: u32,
        by: (f64, f64),
    },
    /// Asks the window system for another size, and waits until the window has it.
    Resize(u32, u32),
    Minimise(bool),
    Fail(&'static str, Fault),
    /// Waits until the window shows the complete picture.
    WaitFull,
    /// Waits until the window shows what was wanted last, if only as a preview.
    WaitFrame,
    Sleep(Duration),
    Screenshot(PathBuf),
    Report,
}

/// What a script asks of the window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ask {
    /// This size.
    Resize(u32, u32),
    /// To be minimised or restored.
    Minimise(bool),
    /// To let this call to its device fail once.
    Fail(&'static str, Fault),
}

/// A script and how far it is.
#[derive(Debug, Default)]
pub struct Script {
    lines: std::collections::VecDeque<Line>,
    /// When a sleep ends.
    until: Option<Instant>,
    asked: bool,
}

/// Where drags start: off the divider.
const START: (f64, f64) = (10.0, 10.0);

impl Script {
    /// Reads a script: see docs/viewer.md for its lines.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Option`] that names the line that is not understood.
    pub fn read(file: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(file).map_err(Error::io(file))?;
        let mut lines = std::collections::VecDeque::new();
        for (number, line) in text.lines().enumerate() {
            let line = line.split('#').next().unwrap_or_default().trim();
            if !line.is_empty() {
                lines.push_back(parse(line).ok_or_else(|| {
                    let place = format!("{}:{}", file.display(), number + 1);
                    Error::Option(format!("--script {place}: {line:?} is not understood; see docs/viewer.md"))
                })?);
            }
        }
        Ok(Self { lines, ..Self::default() })
    }

    /// Goes on as far as it can now; returns what the window is to do, or when to come back if by time.
    ///
    /// # Errors
    /// A screenshot cannot be written.
    pub fn advance(&mut self, viewer: &mut Viewer, now: Instant) -> Result<(Option<Ask>, Option<Instant>)> {
        while let Some(line) = self.lines.front_mut() {
            let seen = !viewer.stale;
            match line {
                Line::Inputs(inputs) => inputs.drain(..).for_each(|input| viewer.input(input)),
                Line::Turn { left, by } => {
                    if !(seen && viewer.up_to_date()) {
                        break;
                    }
                    if *left > 0 {
                        *left -= 1;
                        let inputs = drag(Button::Left, *by);
                        inputs.into_iter().for_each(|input| viewer.input(input));
                        break;
                    }
                }
                &mut Line::Resize(width, height) => {
                    if !std::mem::replace(&mut self.asked, true) {
                        return Ok((Some(Ask::Resize(width, height)), None));
                    }
                    if viewer.size != (width, height) {
                        break;
                    }
                    self.asked = false;
                }
                &mut Line::Minimise(yes) => {
                    self.lines.pop_front();
                    return Ok((Some(Ask::Minimise(yes)), None));
                }
                &mut Line::Fail(call, fault) => {
                    self.lines.pop_front();
                    return Ok((Some(Ask::Fail(call, fault)), None));
                }
                Line::WaitFull if !(seen && viewer.complete()) => break,
                Line::WaitFrame if !(seen && viewer.up_to_date()) => break,
                Line::WaitFull | Line::WaitFrame => {}
                Line::Sleep(time) => {
                    let until = *self.until.get_or_insert(now + *time);
                    if now < until {
                        return Ok((None, Some(until)));
                    }
                    self.until = None;
                }
                Line::Screenshot(file) => output::write_screenshot(file, &viewer.compose())?,
                Line::Report => output::tell(&viewer.timing.report()),
            }
            self.lines.pop_front();
        }
        Ok((None, None))
    }
}

fn drag(button: Button, by: (f64, f64)) -> Vec<Input> {
    vec![
        Input::Pointer(START.0, START.1),
        Input::Press(button),
        Input::Pointer(START.0 + by.0, START.1 + by.1),
        Input::Release,
    ]
}

/// A drag that is not taken for a click.
fn turning(by: (f64, f64)) -> Option<(f64, f64)> {
    (by.0.hypot(by.1) >= CLICK).then_some(by)
}

fn parse(line: &str) -> Option<Line> {
    let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
    let rest = rest.trim();
    let numbers: Option<Vec<f64>> = rest.split_whitespace().map(|word| word.parse().ok()).collect();
    let numbers = numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite()));
    let pair = || match numbers.as_deref() {
        Some(&[a, b]) => Some((a, b)),
        _ => None,
    };
    let one = || match numbers.as_deref() {
        Some(&[a]) => Some(a),
        _ => None,
    };
    let bare = rest.is_empty();
    Some(match word {
        "key" => Line::Inputs(vec![Input::Key(Key::named(rest)?)]),
        "orbit" => Line::Inputs(drag(Button::Left, turning(pair()?)?)),
        "pan" => Line::Inputs(drag(Button::Right, pair()?)),
        "look" => Line::Inputs(drag(Button::Middle, pair()?)),
        "narrow" => Line::Inputs(vec![
            Input::Held { shift: false, ctrl: true },
            Input::Wheel(one()?),
            Input::Held { shift: false, ctrl: false },
        ]),
        "light" => {
            let mut inputs = vec![Input::Held { shift: false, ctrl: true }];
            inputs.extend(drag(Button::Left, pair()?));
            inputs.push(Input::Held { shift: false, ctrl: false });
            Line::Inputs(inputs)
        }
        "drag" => match numbers.as_deref() {
            Some(&[x, y, to_x, to_y]) => Line::Inputs(vec![
                Input::Pointer(x, y),
                Input::Press(Button::Left),
                Input::Pointer(to_x, to_y),
                Input::Release,
            ]),
            _ => return None,
        },
        "click" => {
            let (x, y) = pair()?;
            Line::Inputs(vec![Input::Pointer(x, y), Input::Press(Button::Left), Input::Release])
        }
        "zoom" => Line::Inputs(vec![Input::Wheel(one()?)]),
        "drop" if !bare => Line::Inputs(vec![Input::Drop(rest.into())]),
        "quit" if bare => Line::Inputs(vec![Input::Close]),
        "turn" => match numbers.as_deref() {
            Some(&[left, x, y]) if left >= 0.0 => Line::Turn { left: left as u32, by: turning((x, y))? },
            _ => return None,
        },
        "resize" => {
            let (width, height) = pair().filter(|&(width, height)| width >= 1.0 && height >= 1.0)?;
            Line::Resize(width as u32, height as u32)
        }
        "minimise" if bare => Line::Minimise(true),
        "restore" if bare => Line::Minimise(false),
        "lose" if rest == "surface" => Line::Fail("vkAcquireNextImageKHR", Fault::SurfaceLost),
        "lose" if rest == "swapchain" => Line::Fail("vkQueuePresentKHR", Fault::OutOfDate),
        "lose" if rest == "device" => Line::Fail("vkAcquireNextImageKHR", Fault::DeviceLost),
        "wait-full" if bare => Line::WaitFull,
        "wait-frame" if bare => Line::WaitFrame,
        "sleep" => Line::Sleep(Duration::from_millis(one().filter(|&ms| ms >= 0.0)? as u64)),
        "screenshot" if !bare => Line::Screenshot(rest.into()),
        "report" if bare => Line::Report,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_or_refused() {
        assert_eq!(parse("key m"), Some(Line::Inputs(vec![Input::Key(Key::Char('m'))])));
        assert_eq!(parse("resize 1 1"), Some(Line::Resize(1, 1)));
        assert_eq!(parse("screenshot a b.png"), Some(Line::Screenshot("a b.png".into())));
        for wrong in [
            "",
            "jump",
            "key",
            "key mm",
            "orbit 1",
            "orbit 1 1",
            "resize 0 5",
            "turn -1 2 3",
            "sleep nan",
            "quit now",
        ] {
            assert_eq!(parse(wrong), None, "{wrong}");
        }
    }
}
