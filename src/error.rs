//! The one error type of the library: what failed, on which file or object, and what to do about it.

use std::path::PathBuf;

/// Result of every fallible operation of the library.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Why an input, an option or a device could not serve.
///
/// Every message is one line that names the file and the object, and the remedy where there is one.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file could not be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// A scene file is broken, or needs something that is not supported.
    #[error("{}: {object}: {problem}", file.display())]
    Scene {
        /// The scene file.
        file: PathBuf,
        /// The object inside it, in glTF terms: `meshes[2].primitives[0].indices`.
        object: String,
        /// What is wrong with it and, where there is one, the remedy.
        problem: String,
    },
    /// An image file is broken or of an unknown format.
    #[error("{}: {problem}", path.display())]
    Image {
        /// The image file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// A name or number given as an option does not fit the scene or the device.
    #[error("{0}")]
    Option(String),
    /// No Vulkan device that can serve was found.
    #[error("{0}")]
    NoDevice(String),
    /// A Vulkan call failed.
    #[error("Vulkan: {call} failed: {problem}")]
    Vulkan {
        /// The call, by its name in the specification, and the object it was for.
        call: String,
        /// The result code, a `VkResult` of the specification.
        code: i32,
        /// What it means and, where there is one, the remedy.
        problem: String,
    },
    /// Memory of the host could not be had.
    #[error("memory for {object}: {:.1} MiB could not be had; {remedy}", *bytes as f64 / f64::from(1 << 20))]
    HostMemory {
        /// What it was for.
        object: String,
        /// How much was needed.
        bytes: u64,
        /// What needs less.
        remedy: &'static str,
    },
    /// Device memory could not be had.
    #[error("device memory for {object}: {problem}")]
    DeviceMemory {
        /// The allocation's name.
        object: String,
        /// What the allocator said.
        problem: String,
    },
    /// Two images cannot be compared.
    #[error("{0}")]
    Compare(String),
    /// A measurement exceeds what is promised of it.
    #[error("{0}")]
    Bound(String),
    /// The user stopped the work.
    #[error("interrupted")]
    Interrupted,
}

/// `text` as one line of a terminal: what files bring along, names above all, begins no line of its own and commands
/// no terminal.
pub fn one_line(text: &str) -> String {
    let shown = |c: char| match c {
        '\n' | '\r' => " ".into(),
        c if c.is_control() => c.escape_default().to_string(),
        c => c.to_string(),
    };
    text.chars().map(shown).collect()
}

impl Error {
    /// An [`Error::Io`] for `path`; made to be handed to `map_err`.
    pub fn io(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { path, source }
    }

    /// The same, with the `remedy` where device memory could not be had.
    #[must_use]
    pub fn with_remedy(self, remedy: &str) -> Self {
        match self {
            Self::DeviceMemory { object, problem } => {
                Self::DeviceMemory { object, problem: format!("{problem}: {remedy}") }
            }
            other => other,
        }
    }

    /// An [`Error::Scene`].
    pub fn scene(file: impl Into<PathBuf>, object: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Scene { file: file.into(), object: object.into(), problem: problem.into() }
    }
}
