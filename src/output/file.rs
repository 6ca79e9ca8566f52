use super::Error;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};

/// Files being written, so that a program that is told to stop can take them away.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A file name's extension in lower case.
#[must_use]
pub fn extension(file: &Path) -> Option<String> {
    file.extension().and_then(OsStr::to_str).map(str::to_ascii_lowercase)
}

/// Refuses a place no file can be written to: a folder, or one in a folder that is missing or read-only.
///
/// # Errors
/// Names the file and what stands in its way.
pub fn check_writable(file: &Path) -> Result<(), Error> {
    let fail = |source| Error { file: file.into(), source };
    match place(file).map_err(fail)? {
        Place::Device(_) => Ok(()),
        Place::File(target) => Unfinished::create(&target).map(drop).map_err(fail),
    }
}

/// Writes a file whole or not at all; one that exists is replaced. Pipes and devices are written directly.
///
/// # Errors
/// What `content` or the system says, with the file's name.
pub fn write_file(
    file: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), Error> {
    let write = || match place(file)? {
        Place::Device(target) => {
            let mut writer = BufWriter::new(File::options().write(true).open(target)?);
            content(&mut writer)?;
            writer.flush()
        }
        Place::File(target) => {
            let (unfinished, beside) = Unfinished::create(&target)?;
            let mut writer = BufWriter::new(beside);
            content(&mut writer)?;
            writer.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()?;
            fs::rename(&unfinished.0, target)
        }
    };
    write().map_err(|source| Error { file: file.into(), source })
}

/// Removes files that are being written at this moment, for a program about to exit in the middle of it.
pub fn discard_unfinished() {
    for path in UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner).iter() {
        let _ = fs::remove_file(path);
    }
}

enum Place {
    File(PathBuf),
    Device(PathBuf),
}

fn place(file: &Path) -> io::Result<Place> {
    // A link is followed: the file it names is replaced, not the link.
    let target = fs::canonicalize(file).unwrap_or_else(|_| file.to_owned());
    match fs::metadata(&target) {
        Ok(metadata) if metadata.is_dir() => Err(io::Error::from(io::ErrorKind::IsADirectory)),
        Ok(metadata) if !metadata.is_file() => Ok(Place::Device(target)),
        _ if file.file_name().is_none() => Err(io::Error::from(io::ErrorKind::InvalidFilename)),
        _ => Ok(Place::File(target)),
    }
}

/// A file beside its place, removed when dropped (after a rename there is nothing to remove).
struct Unfinished(PathBuf);

impl Unfinished {
    fn create(target: &Path) -> io::Result<(Self, File)> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = format!(".parhelion-{}-{}.tmp", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        let path = target.with_file_name(name);
        let mut list = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
        let file = File::create(&path)?;
        list.push(path.clone());
        Ok((Self(path), file))
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let mut list = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
        let _ = fs::remove_file(&self.0);
        list.retain(|path| *path != self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        names.collect()
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.txt");
        write_file(&file, |w| w.write_all(b"old")).unwrap();
        let error = write_file(&file, |w| {
            w.write_all(&[b'x'; 100_000])?;
            assert_eq!(names(folder.path()).len(), 2, "written beside");
            Err(io::Error::other("disk full"))
        });
        assert!(error.unwrap_err().to_string().ends_with("a.txt: disk full"));
        assert_eq!(fs::read(&file).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["a.txt"]);
        write_file(&file, |w| w.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
    }

    #[test]
    fn places_that_cannot_be_written_are_refused_and_the_rest_left_untouched() {
        let folder = tempfile::tempdir().unwrap();
        assert!(check_writable(folder.path()).is_err(), "a folder");
        assert!(check_writable(&folder.path().join("missing/a.png")).is_err());
        let file = folder.path().join("a.png");
        fs::write(&file, "kept").unwrap();
        assert!(check_writable(&file.join("b.png")).is_err(), "a file is no folder");
        check_writable(&file).unwrap();
        check_writable(&folder.path().join("b.png")).unwrap();
        assert_eq!(names(folder.path()), ["a.png"]);
        assert_eq!(fs::read(&file).unwrap(), b"kept");
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_and_devices_kept() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("a"), folder.path().join("link"));
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write_file(&link, |w| w.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        write_file(Path::new("/dev/null"), |w| w.write_all(b"gone")).unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
    }
}
