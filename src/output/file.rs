use super::Error;
use crate::files::{self, Unfinished};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, BufWriter, Cursor, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// Where contents go.
pub trait Sink: Write + Seek {}

impl<T: Write + Seek> Sink for T {}

/// What [`write_file`] is writing to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Writing {
    /// A file, which takes no longer than the disk does.
    File,
    /// A pipe or a device, which may have to be waited for without end.
    Stream,
}

/// How many of each kind are being written.
static WRITING: [AtomicU32; 2] = [const { AtomicU32::new(0) }; 2];

/// What is being written at this moment, for a program that is told to stop.
#[must_use]
pub fn writing() -> Option<Writing> {
    let at = |what: &Writing| WRITING[*what as usize].load(Ordering::SeqCst) > 0;
    [Writing::Stream, Writing::File].into_iter().find(at)
}

struct Guard(Writing);

impl Guard {
    fn new(what: Writing) -> Self {
        WRITING[what as usize].fetch_add(1, Ordering::SeqCst);
        Self(what)
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        WRITING[self.0 as usize].fetch_sub(1, Ordering::SeqCst);
    }
}

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
    let check = || match place(file)? {
        Place::Stream(target) => check_stream(&target),
        Place::File(target) => Unfinished::new(&target).map(drop),
    };
    check().map_err(|source| Error { file: file.into(), source })
}

/// Whether `file` is a pipe or a device, which keeps all that is written to it and is not replaced.
#[must_use]
pub fn is_stream(file: &Path) -> bool {
    matches!(place(file), Ok(Place::Stream(_)))
}

/// Writes a file whole or not at all; one that exists is replaced. Pipes and devices get all of it at once, a pipe as
/// soon as somebody reads it.
///
/// # Errors
/// What `content` or the system says, with the file's name.
pub fn write_file(file: &Path, content: impl FnOnce(&mut dyn Sink) -> io::Result<()>) -> Result<(), Error> {
    let write = || match place(file)? {
        Place::Stream(target) => {
            let mut memory = Memory::default();
            content(&mut memory)?;
            let _writing = Guard::new(Writing::Stream);
            open_stream(&target)?.write_all(memory.0.get_ref()).map_err(|error| match error.kind() {
                io::ErrorKind::BrokenPipe => io::Error::new(error.kind(), "its reader left before the end"),
                _ => error,
            })
        }
        Place::File(target) => {
            let _writing = Guard::new(Writing::File);
            let unfinished = Unfinished::new(&target)?;
            let mut writer = BufWriter::new(unfinished.file());
            content(&mut writer)?;
            writer.into_inner().map_err(io::IntoInnerError::into_error)?;
            unfinished.put()
        }
    };
    write().map_err(|source| Error { file: file.into(), source })
}

/// Removes files that are being written at this moment, for a program about to exit in the middle of it; nothing is
/// written to a file after.
pub fn discard_unfinished() {
    files::discard_unfinished();
}

enum Place {
    File(PathBuf),
    Stream(PathBuf),
}

fn place(file: &Path) -> io::Result<Place> {
    // A link is followed: the file it names is replaced, not the link.
    let target = fs::canonicalize(file).unwrap_or_else(|_| file.to_owned());
    match fs::metadata(&target) {
        Ok(metadata) if metadata.is_dir() => Err(io::Error::from(io::ErrorKind::IsADirectory)),
        Ok(metadata) if !metadata.is_file() => Ok(Place::Stream(target)),
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ if file.file_name().is_none() => Err(io::Error::from(io::ErrorKind::InvalidFilename)),
        _ => Ok(Place::File(target)),
    }
}

/// Asks without opening: whoever reads a pipe would take its closing for the end.
#[cfg(unix)]
fn check_stream(target: &Path) -> io::Result<()> {
    use std::os::unix::fs::FileTypeExt;
    if fs::metadata(target)?.file_type().is_socket() {
        return Err(io::Error::new(
            io::ErrorKind::Unsupported,
            "is a socket, which no file can be written to",
        ));
    }
    Ok(rustix::fs::access(target, rustix::fs::Access::WRITE_OK)?)
}

#[cfg(unix)]
fn open_stream(target: &Path) -> io::Result<File> {
    use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
    use std::os::unix::fs::OpenOptionsExt;
    let mut options = File::options();
    options.write(true);
    match options.clone().custom_flags(OFlags::NONBLOCK.bits() as i32).open(target) {
        Ok(stream) => {
            fcntl_setfl(&stream, fcntl_getfl(&stream)? - OFlags::NONBLOCK)?;
            Ok(stream)
        }
        Err(error) if error.raw_os_error() == Some(rustix::io::Errno::NXIO.raw_os_error()) => {
            check_stream(target)?;
            tracing::warn!("{}: waiting for somebody to read this pipe", target.display());
            options.open(target)
        }
        Err(error) => Err(error),
    }
}

#[cfg(not(unix))]
fn check_stream(_: &Path) -> io::Result<()> {
    Ok(())
}

#[cfg(not(unix))]
fn open_stream(target: &Path) -> io::Result<File> {
    File::options().write(true).open(target)
}

/// Contents of what cannot be sought in; too little memory is an error.
#[derive(Default)]
struct Memory(Cursor<Vec<u8>>);

impl Write for Memory {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let end = self.0.position().saturating_add(bytes.len() as u64);
        let more = usize::try_from(end).unwrap_or(usize::MAX).saturating_sub(self.0.get_ref().len());
        self.0.get_mut().try_reserve(more).map_err(|_| io::Error::from(io::ErrorKind::OutOfMemory))?;
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Memory {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.0.seek(to)
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
            assert_eq!(fs::read(&file).unwrap(), b"old", "not written over");
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
