//! `vtrace devices`: what Vulkan devices this machine has.

use std::fmt::Write;

use clap::Args;

use super::terminal;
use crate::{
    error::{Error, Result},
    gpu::{self, DeviceKind},
};

/// List the Vulkan devices of this machine and whether they can serve
#[derive(Debug, Args)]
pub struct DevicesArgs {}

pub(super) fn run(_: &DevicesArgs) -> Result<()> {
    let mut lines = String::new();
    for device in gpu::devices()? {
        let [major, minor, patch] = device.api_version;
        let kind = match device.kind {
            DeviceKind::Discrete => "discrete GPU",
            DeviceKind::Integrated => "integrated GPU",
            DeviceKind::Virtual => "virtual GPU",
            DeviceKind::Cpu => "software",
            DeviceKind::Other => "other",
        };
        let verdict =
            device.usable.map_or_else(|why| format!("cannot serve: {why}"), |()| "can serve".into());
        // Writing to a string does not fail.
        let _ = writeln!(
            lines,
            "{}  {} ({kind}, Vulkan {major}.{minor}.{patch}, {}): {verdict}",
            device.index, device.name, device.driver
        );
    }
    if lines.is_empty() {
        let remedy = "install a software one: apt-get install mesa-vulkan-drivers";
        return Err(Error::NoDevice(format!("no Vulkan device; {remedy}")));
    }
    terminal::print(&lines)
}
