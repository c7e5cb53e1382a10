//! Files that a command reads and writes: no result takes the place of what is read, and a folder made for results
//! that do not come is not left behind.

use std::{
    ffi::OsStr,
    fs,
    io::{self, ErrorKind},
    path::{Path, PathBuf},
};

use crate::{
    error::{Error, Result},
    options::SceneOptions,
    report::output::{leads_to, same_file},
    scene::gltf,
};

/// Files that a command reads, beside those that its scene refers to.
pub struct Inputs<'a> {
    /// The scene file.
    pub scene: &'a Path,
    /// The panorama around it.
    pub environment: Option<&'a Path>,
    /// Images of other programs, by name.
    pub compared: Vec<(&'a str, &'a Path)>,
}

impl<'a> Inputs<'a> {
    /// What rendering `scene` with `options` reads.
    pub fn for_scene(scene: &'a Path, options: &'a SceneOptions) -> Self {
        Self { scene, environment: options.environment.as_deref(), compared: Vec::new() }
    }

    /// Checks that none of these files is among `written`, each with the option that names it. Symbolic links are
    /// followed.
    ///
    /// # Errors
    /// Which one is.
    pub fn check_kept(&self, written: &[(&str, PathBuf)]) -> Result<(), String> {
        // What is not there yet cannot be read, and pipes and devices keep nothing.
        let there = written.iter().filter(|(_, path)| path.is_file());
        let there: Vec<(&str, PathBuf)> =
            there.filter_map(|(option, path)| Some((*option, path.canonicalize().ok()?))).collect();
        if there.is_empty() {
            return Ok(());
        }
        for (path, words) in self.with_words() {
            let Ok(path) = path.canonicalize() else { continue };
            if let Some((option, _)) = there.iter().find(|(_, written)| *written == path) {
                return Err(format!("{option} would overwrite {words}"));
            }
        }
        Ok(())
    }

    fn with_words(&self) -> Vec<(PathBuf, String)> {
        let mut files = vec![(self.scene.to_path_buf(), format!("the scene, {}", self.scene.display()))];
        files.extend(
            self.environment.map(|path| {
                (path.to_path_buf(), format!("the panorama of --environment, {}", path.display()))
            }),
        );
        files.extend(self.compared.iter().map(|(name, path)| {
            (path.to_path_buf(), format!("the image of --compare {name}, {}", path.display()))
        }));
        files.extend(gltf::files_beside(self.scene, &gltf::Limits::default()).into_iter().map(|path| {
            let words = format!("{}, which {} refers to", path.display(), self.scene.display());
            (path, words)
        }));
        files
    }
}

/// What is in `folder` already under names that a command gives to its results.
pub fn entries(folder: &Path, is_result: impl Fn(&OsStr) -> bool) -> impl Iterator<Item = PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter(move |entry| is_result(&entry.file_name())).map(|entry| entry.path())
}

/// Whether `path` leads to a file of such a name in `folder`, there already or not yet.
pub fn is_entry(path: &Path, folder: &Path, is_result: impl Fn(&OsStr) -> bool) -> bool {
    let by_name =
        leads_to(path).is_some_and(|(_, name)| is_result(&name) && same_file(path, &folder.join(name)));
    by_name || entries(folder, is_result).any(|entry| same_file(path, &entry))
}

/// A folder for results. Of what had to be made for it, nothing empty is left once this is dropped.
pub struct Folder {
    /// Those that were absent, the innermost first.
    made: Vec<PathBuf>,
}

impl Folder {
    /// Makes the folder at `path`, and those that it is to be in, where absent.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be.
    pub fn make(path: &Path) -> Result<Self> {
        let absent = path.ancestors().take_while(|folder| !folder.as_os_str().is_empty() && !folder.exists());
        let folder = Self { made: absent.map(Path::to_path_buf).collect() };
        fs::create_dir_all(path).map_err(|error| {
            let is_file = error.kind() == ErrorKind::AlreadyExists;
            Error::io(path)(if is_file { io::Error::new(error.kind(), "is not a folder") } else { error })
        })?;
        Ok(folder)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        for folder in &self.made {
            // Refused where a result is in it.
            let _ = fs::remove_dir(folder);
        }
    }
}
