//! Whether the files of the scene have changed on disk.

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant, SystemTime},
};

/// How often the files are looked at.
const POLL: Duration = Duration::from_millis(500);

/// The files of a scene with the time at which each was written, when last seen.
#[derive(Debug, Clone)]
pub struct Watch {
    files: Vec<(PathBuf, Option<SystemTime>)>,
    /// When to look again.
    due: Instant,
}

impl Watch {
    /// Watches `scene` alone, as it is now.
    pub fn new(scene: &Path, now: Instant) -> Self {
        Self { files: vec![(scene.to_path_buf(), modified(scene))], due: now + POLL }
    }

    /// Watches `beside` too, in place of what was watched beside the scene.
    pub fn beside(&mut self, beside: &[PathBuf]) {
        self.files.truncate(1);
        self.files.extend(beside.iter().map(|file| (file.clone(), modified(file))));
    }

    /// Looks if it is time to at `now`: whether any file has changed, and when to look again.
    pub fn look(&mut self, now: Instant) -> (bool, Instant) {
        let mut changed = false;
        if now >= self.due {
            self.due = now + POLL;
            for (file, seen) in &mut self.files {
                let found = modified(file);
                // A file that is being written is there again at one of the next looks.
                if found.is_some() && found != *seen {
                    *seen = found;
                    changed = true;
                }
            }
        }
        (changed, self.due)
    }
}

fn modified(file: &Path) -> Option<SystemTime> {
    file.metadata().and_then(|data| data.modified()).ok()
}

#[cfg(test)]
mod tests {
    use std::fs::{self, File};

    use super::*;

    #[test]
    fn a_change_is_seen_once_and_a_missing_file_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let [scene, texture] = ["s.gltf", "t.png"].map(|name| folder.path().join(name));
        fs::write(&scene, "a").unwrap();
        fs::write(&texture, "b").unwrap();
        let start = Instant::now();
        let mut watch = Watch::new(&scene, start);
        watch.beside(std::slice::from_ref(&texture));
        let later = SystemTime::now() + Duration::from_secs(9);
        File::options().write(true).open(&texture).unwrap().set_modified(later).unwrap();
        assert_eq!(watch.look(start), (false, start + POLL), "not yet");
        let mut now = start + POLL;
        assert_eq!(watch.look(now), (true, now + POLL));
        now += POLL;
        assert!(!watch.look(now).0);
        fs::remove_file(&texture).unwrap();
        now += POLL;
        assert!(!watch.look(now).0);
    }
}
