//! Open Image Denoise's C interface, as `oidn.h` of versions 2.0 to 2.5 declares it.

use super::{Error, Input};
use crate::layer::Layer;
use libloading::Library;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::{Path, PathBuf};
use std::ptr;

/// The library's file, by the system's search path.
#[cfg(target_os = "windows")]
const FILE: &str = "OpenImageDenoise.dll";
#[cfg(target_os = "macos")]
const FILE: &str = "libOpenImageDenoise.2.dylib";
#[cfg(not(any(target_os = "windows", target_os = "macos")))]
const FILE: &str = "libOpenImageDenoise.so.2";

/// `OIDN_DEVICE_TYPE_CPU`
const CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`
const FLOAT3: c_int = 3;

/// `OIDNDevice` or `OIDNFilter`.
type Handle = *mut c_void;

/// The functions that are called; valid while the library is loaded.
#[derive(Debug)]
struct Api {
    new_device: unsafe extern "C" fn(c_int) -> Handle,
    commit_device: unsafe extern "C" fn(Handle),
    release_device: unsafe extern "C" fn(Handle),
    get_device_int: unsafe extern "C" fn(Handle, *const c_char) -> c_int,
    get_device_error: unsafe extern "C" fn(Handle, *mut *const c_char) -> c_int,
    new_filter: unsafe extern "C" fn(Handle, *const c_char) -> Handle,
    release_filter: unsafe extern "C" fn(Handle),
    set_shared_filter_image:
        unsafe extern "C" fn(Handle, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize),
    set_filter_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    commit_filter: unsafe extern "C" fn(Handle),
    execute_filter: unsafe extern "C" fn(Handle),
}

impl Api {
    fn of(library: &Library) -> Result<Self, libloading::Error> {
        macro_rules! function {
            ($name:literal) => {
                // SAFETY: the field's type is the function's in `oidn.h` (an enumeration is an `int`, `bool` is C's).
                *unsafe { library.get(concat!($name, "\0").as_bytes()) }?
            };
        }
        Ok(Self {
            new_device: function!("oidnNewDevice"),
            commit_device: function!("oidnCommitDevice"),
            release_device: function!("oidnReleaseDevice"),
            get_device_int: function!("oidnGetDeviceInt"),
            get_device_error: function!("oidnGetDeviceError"),
            new_filter: function!("oidnNewFilter"),
            release_filter: function!("oidnReleaseFilter"),
            set_shared_filter_image: function!("oidnSetSharedFilterImage"),
            // Not in version 1, whose other functions mean the same.
            set_filter_bool: function!("oidnSetFilterBool"),
            commit_filter: function!("oidnCommitFilter"),
            execute_filter: function!("oidnExecuteFilter"),
        })
    }
}

impl Input<'_> {
    /// All layers have one shape.
    fn check(&self) -> Result<(), Error> {
        let Layer { width, height, .. } = *self.radiance;
        let layers = [("radiance", self.radiance), ("albedo", self.albedo), ("normal", self.normal)];
        let fits = |layer: &Layer| {
            let shape = (layer.width, layer.height, layer.channels);
            shape == (width, height, 3) && layer.data.len() == 3 * width as usize * height as usize
        };
        match layers.into_iter().find(|(_, layer)| !fits(layer)) {
            Some((name, _)) => Err(Error::Shape(name)),
            None => Ok(()),
        }
    }
}

/// Open Image Denoise, loaded and ready on the CPU.
#[derive(Debug)]
pub struct Denoiser {
    device: Handle,
    api: Api,
    // Outlives the functions and the device, which `drop` gives back before fields go.
    _library: Library,
}

impl Denoiser {
    /// Loads the library: `path` is its file or the folder it is in; without one the system's search path counts.
    ///
    /// # Errors
    /// [`Error::Absent`] if it is not there or not of version 2, [`Error::Library`] if it does not run on this CPU.
    pub fn load(path: Option<&Path>) -> Result<Self, Error> {
        let file = match path {
            Some(folder) if folder.is_dir() => folder.join(FILE),
            Some(file) => file.into(),
            None => PathBuf::from(FILE),
        };
        let absent = |error: libloading::Error| Error::Absent { reason: error.to_string() };
        // SAFETY: the library's initialisers have no preconditions; the name is Open Image Denoise's, or one that the
        // user vouches for.
        let library = unsafe { Library::new(&file) }.map_err(absent)?;
        let api = Api::of(&library).map_err(absent)?;
        // SAFETY: takes no pointers.
        let device = unsafe { (api.new_device)(CPU) };
        let denoiser = Self { device, api, _library: library };
        denoiser.check()?;
        // SAFETY: the device exists.
        unsafe { (denoiser.api.commit_device)(device) };
        denoiser.check()?;
        Ok(denoiser)
    }

    /// The library's name and version.
    #[must_use]
    pub fn name(&self) -> String {
        // SAFETY: the device exists, the name ends with a zero.
        let version = unsafe { (self.api.get_device_int)(self.device, c"version".as_ptr()) };
        format!("Open Image Denoise {}.{}.{}", version / 10_000, version / 100 % 100, version % 100)
    }

    /// The picture without noise: radiance, with three channels.
    ///
    /// # Errors
    /// Layers of different shapes, or the library's failure.
    pub fn denoise(&self, input: &Input<'_>) -> Result<Layer, Error> {
        input.check()?;
        let Layer { width, height, .. } = *input.radiance;
        let mut output = vec![0.0_f32; input.radiance.data.len()];
        let images = [
            (c"color", input.radiance.data.as_ptr().cast_mut()),
            (c"albedo", input.albedo.data.as_ptr().cast_mut()),
            (c"normal", input.normal.data.as_ptr().cast_mut()),
            (c"output", output.as_mut_ptr()),
        ];
        // SAFETY: the device exists, the name ends with a zero.
        let filter = unsafe { (self.api.new_filter)(self.device, c"RT".as_ptr()) };
        if filter.is_null() {
            return Err(self.check().err().unwrap_or_else(|| Error::Library("it makes no filter".into())));
        }
        for (name, data) in images {
            // SAFETY: each image has 3 floats for each of width · height pixels, as checked, lies packed in memory that
            // outlives the filter, and is written to only if it is the output.
            unsafe {
                (self.api.set_shared_filter_image)(
                    filter,
                    name.as_ptr(),
                    data.cast(),
                    FLOAT3,
                    width as usize,
                    height as usize,
                    0,
                    0,
                    0,
                );
            }
        }
        // SAFETY: the filter exists until it is released here; executing it returns when the output is complete.
        unsafe {
            (self.api.set_filter_bool)(filter, c"hdr".as_ptr(), true);
            (self.api.commit_filter)(filter);
            (self.api.execute_filter)(filter);
            (self.api.release_filter)(filter);
        }
        self.check()?;
        Ok(Layer { data: output, ..*input.radiance })
    }

    /// The device's first error since the last call; with no device, why there is none.
    fn check(&self) -> Result<(), Error> {
        let mut message = ptr::null();
        // SAFETY: a null device asks for the thread's own error; the message lives until the next call.
        let code = unsafe { (self.api.get_device_error)(self.device, &raw mut message) };
        if code == 0 && !self.device.is_null() {
            return Ok(());
        }
        if message.is_null() {
            return Err(Error::Library(format!("error {code}")));
        }
        // SAFETY: not null, so a string that ends with a zero; copied before the next call.
        let text = unsafe { CStr::from_ptr(message) };
        Err(Error::Library(text.to_string_lossy().into_owned()))
    }
}

impl Drop for Denoiser {
    fn drop(&mut self) {
        if !self.device.is_null() {
            // SAFETY: the device exists, and no filter does.
            unsafe { (self.api.release_device)(self.device) };
        }
    }
}
