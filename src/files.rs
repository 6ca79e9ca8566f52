//! Files on disk, written so that they appear whole or not at all.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};

/// Named files being written, so that a program that is told to stop can take them away.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Writes what is only kept to save time: not to what is there and is no file.
pub(crate) fn write_cache(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if path.metadata().is_ok_and(|there| !there.is_file()) {
        return Ok(());
    }
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let unfinished = Unfinished::new(path)?;
    unfinished.file().write_all(bytes)?;
    unfinished.put()
}

/// Removes named files that are being written at this moment, for a program about to exit: no more can be named.
pub(crate) fn discard_unfinished() {
    let list = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    for path in list.iter() {
        let _ = fs::remove_file(path);
    }
    std::mem::forget(list);
}

/// A file that is to take the place of another, or of none, once it is [complete](Self::put). Dropped before, it leaves
/// nothing.
///
/// Where the file system can, it has no name until it is complete, so that even a killed program leaves nothing.
/// Elsewhere it has one beside its place, and a lock that says that somebody writes it: the next that writes in this
/// folder removes files of such names that nobody has locked.
pub(crate) struct Unfinished {
    target: PathBuf,
    file: File,
    /// The name beside the target, while it has one.
    name: Option<PathBuf>,
}

impl Unfinished {
    pub(crate) fn new(target: &Path) -> io::Result<Self> {
        clear_stale(folder_of(target));
        match nameless(folder_of(target)) {
            Some(file) => Ok(Self { target: target.into(), file, name: None }),
            None => Self::named(target),
        }
    }

    fn named(target: &Path) -> io::Result<Self> {
        loop {
            let path = next_name(target);
            let mut list = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
            let file = match File::options().read(true).write(true).create_new(true).open(&path) {
                Ok(file) => file,
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => continue,
                Err(error) => return Err(error),
            };
            list.push(path.clone());
            drop(list);
            let unfinished = Self { target: target.into(), file, name: Some(path.clone()) };
            // Where there are no locks nobody removes what is not locked.
            let _ = unfinished.file.try_lock();
            // Another may have taken it for stale before it was locked.
            if path.try_exists()? {
                return Ok(unfinished);
            }
        }
    }

    pub(crate) fn file(&self) -> &File {
        &self.file
    }

    /// Puts it in its place, on disk to its last byte.
    pub(crate) fn put(mut self) -> io::Result<()> {
        self.file.sync_all()?;
        if self.name.is_none() {
            self.name_it()?;
        }
        if let Some(name) = &self.name {
            fs::rename(name, &self.target)?;
        }
        Ok(())
    }

    /// Gives it a name beside its place. A link cannot replace a file: the rename that follows does.
    #[cfg(target_os = "linux")]
    fn name_it(&mut self) -> io::Result<()> {
        use rustix::fs::{AtFlags, CWD, linkat};
        let from = descriptor(&self.file);
        let _ = self.file.try_lock();
        loop {
            let path = next_name(&self.target);
            let mut list = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
            match linkat(CWD, &from, CWD, &path, AtFlags::SYMLINK_FOLLOW) {
                Ok(()) => {
                    list.push(path.clone());
                    self.name = Some(path);
                    return Ok(());
                }
                Err(rustix::io::Errno::EXIST) => {}
                Err(_) => break,
            }
        }
        // What cannot be linked is written again.
        let mut named = Self::named(&self.target)?;
        io::Seek::rewind(&mut self.file)?;
        io::copy(&mut self.file, &mut named.file)?;
        named.file.sync_all()?;
        std::mem::swap(self, &mut named);
        Ok(())
    }

    #[cfg(not(target_os = "linux"))]
    fn name_it(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let Some(name) = &self.name else { return };
        let mut list = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
        // After a rename there is nothing to remove.
        let _ = fs::remove_file(name);
        list.retain(|path| path != name);
    }
}

fn folder_of(target: &Path) -> &Path {
    target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn next_name(target: &Path) -> PathBuf {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    target.with_file_name(format!(".parhelion-{}-{count}.tmp", std::process::id()))
}

/// A file in `folder` that has no name and is gone with its last descriptor; `None` where there are no such files.
#[cfg(target_os = "linux")]
fn nameless(folder: &Path) -> Option<File> {
    use rustix::fs::{Mode, OFlags, open};
    let flags = OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC;
    let file = File::from(open(folder, flags, Mode::from_raw_mode(0o666)).ok()?);
    // Its only way to a name.
    descriptor(&file).symlink_metadata().is_ok().then_some(file)
}

#[cfg(not(target_os = "linux"))]
fn nameless(_: &Path) -> Option<File> {
    None
}

#[cfg(target_os = "linux")]
fn descriptor(file: &File) -> PathBuf {
    use std::os::fd::AsRawFd;
    format!("/proc/self/fd/{}", file.as_raw_fd()).into()
}

/// Removes what killed programs left in `folder`, once in the life of this one.
#[cfg(unix)]
fn clear_stale(folder: &Path) {
    static CLEARED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());
    let Ok(folder) = folder.canonicalize() else { return };
    let mut cleared = CLEARED.lock().unwrap_or_else(PoisonError::into_inner);
    if cleared.contains(&folder) {
        return;
    }
    for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        if name.to_str().is_some_and(is_ours) && entry.file_type().is_ok_and(|kind| kind.is_file()) {
            remove_if_stale(&entry.path());
        }
    }
    cleared.push(folder);
}

#[cfg(not(unix))]
fn clear_stale(_: &Path) {}

/// Whether [`next_name`] may have made `name`.
#[cfg(unix)]
fn is_ours(name: &str) -> bool {
    let inner = name.strip_prefix(".parhelion-").and_then(|name| name.strip_suffix(".tmp"));
    let number = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    inner.and_then(|inner| inner.split_once('-')).is_some_and(|(id, count)| number(id) && number(count))
}

/// Whoever writes a file holds its lock, in whichever container, and the system takes it from the dead: process
/// numbers say less, which are given out again and mean nothing elsewhere.
#[cfg(unix)]
fn remove_if_stale(path: &Path) {
    let Ok(file) = File::options().write(true).open(path) else { return };
    if file.try_lock().is_ok() && (locks_reach_others(&file) || untouched(&file)) {
        let _ = fs::remove_file(path);
    }
}

/// Whether a lock on `file` is seen by all who can write it: some file systems of several hosts keep locks to each.
#[cfg(target_os = "linux")]
fn locks_reach_others(file: &File) -> bool {
    // 9P, AFS, BeeGFS, Ceph, FUSE, Lustre, NFS, SMB (three generations), VirtualBox (statfs(2), linux/magic.h).
    const NETWORK: [u64; 11] = [
        0x0102_1997,
        0x5346_414f,
        0x1983_0326,
        0x00c3_6400,
        0x6573_5546,
        0x0bd0_0bd0,
        0x6969,
        0x517b,
        0xff53_4d42,
        0xfe53_4d42,
        0x786f_4256,
    ];
    rustix::fs::fstatfs(file).is_ok_and(|about| !NETWORK.contains(&(about.f_type as u64 & 0xffff_ffff)))
}

#[cfg(all(unix, not(target_os = "linux")))]
fn locks_reach_others(_: &File) -> bool {
    false
}

/// Whether nobody has written it for a day.
#[cfg(unix)]
fn untouched(file: &File) -> bool {
    const DAY: std::time::Duration = std::time::Duration::from_secs(86_400);
    let modified = file.metadata().and_then(|metadata| metadata.modified()).ok();
    modified.and_then(|time| time.elapsed().ok()).is_some_and(|age| age > DAY)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<_> = names.collect();
        names.sort();
        names
    }

    #[test]
    fn either_kind_of_file_takes_its_place_whole_or_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a");
        for make in [Unfinished::new, Unfinished::named] {
            for text in ["first", "second"] {
                let before = fs::read(&target).ok();
                let unfinished = make(&target).unwrap();
                unfinished.file().write_all(text.as_bytes()).unwrap();
                assert_eq!(fs::read(&target).ok(), before);
                unfinished.put().unwrap();
                assert_eq!(fs::read(&target).unwrap(), text.as_bytes());
            }
            make(&target).unwrap().file().write_all(b"third").unwrap();
            assert_eq!(
                (fs::read(&target).unwrap(), names(folder.path())),
                (b"second".into(), vec!["a".into()])
            );
            fs::remove_file(&target).unwrap();
        }
    }

    /// As where a system's files have no name in `/proc`.
    #[cfg(target_os = "linux")]
    #[test]
    fn what_cannot_be_linked_is_copied() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a");
        // A named file that has been removed cannot be linked again, either.
        let file = File::options().read(true).write(true).create_new(true).open(&target).unwrap();
        fs::remove_file(&target).unwrap();
        let unfinished = Unfinished { target: target.clone(), file, name: None };
        unfinished.file().write_all(b"text").unwrap();
        unfinished.put().unwrap();
        assert_eq!((fs::read(&target).unwrap(), names(folder.path())), (b"text".into(), vec!["a".into()]));
    }

    #[cfg(unix)]
    #[test]
    fn what_the_dead_left_is_removed_and_all_else_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        // A process that lives and writes nothing: numbers are given out again.
        let dead = [format!(".parhelion-{}-7.tmp", std::process::id()), ".parhelion-4194304-0.tmp".into()];
        let kept = [
            "a.tmp",
            ".parhelion-1-2.tmp.bak",
            ".parhelion-x-2.tmp",
            ".parhelion-1.tmp",
            "parhelion-1-2.tmp",
        ];
        dead.iter().map(String::as_str).chain(kept).for_each(|name| fs::write(path(name), "x").unwrap());
        fs::create_dir(path(".parhelion-1-3.tmp")).unwrap();
        std::os::unix::fs::symlink(path("a.tmp"), path(".parhelion-1-4.tmp")).unwrap();
        let live = File::create(path(".parhelion-1-5.tmp")).unwrap();
        live.try_lock().unwrap();
        drop(Unfinished::new(&path("a")).unwrap());
        let mut expected: Vec<_> = kept.map(String::from).into();
        expected.extend([3, 4, 5].map(|n| format!(".parhelion-1-{n}.tmp")));
        expected.sort();
        assert_eq!(names(folder.path()), expected);
        drop(live);
        clear_stale(folder.path());
        assert_eq!(names(folder.path()), expected, "each folder is looked at once");
        remove_if_stale(&path(".parhelion-1-5.tmp"));
        assert!(!path(".parhelion-1-5.tmp").exists());
    }
}
