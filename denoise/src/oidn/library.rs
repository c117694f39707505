//! The library of Open Image Denoise behind its C API, version 2 (`oidn.h`): only what one filter
//! on the CPU needs.
//!
//! All calls into it are here. Every handle is released where it was made;
//! nothing of the library outlives [`Library`], which is never unloaded while its functions are
//! held.

#![allow(
    unsafe_code,
    reason = "functions of a C library loaded at run time cannot be called otherwise"
)]

use crate::error::{DenoiseError, Result};
use eagpt_scene::Image;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::{Path, PathBuf};
use std::ptr;

/// `OIDN_DEVICE_TYPE_CPU`: the results of GPUs differ from one to the next.
const DEVICE_TYPE_CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`.
const FORMAT_FLOAT3: c_int = 3;
/// `OIDN_ERROR_NONE`.
const ERROR_NONE: c_int = 0;

/// An `OIDNDevice`: a pointer to a type that only the library knows.
type Device = *mut c_void;
/// An `OIDNFilter`.
type Filter = *mut c_void;

/// The functions, as `oidn.h` of 2.0 declares them; later versions 2 keep them.
#[derive(Debug, Clone, Copy)]
struct Functions {
    new_device: unsafe extern "C" fn(c_int) -> Device,
    commit_device: unsafe extern "C" fn(Device),
    release_device: unsafe extern "C" fn(Device),
    set_device_int: unsafe extern "C" fn(Device, *const c_char, c_int),
    set_device_bool: unsafe extern "C" fn(Device, *const c_char, bool),
    get_device_int: unsafe extern "C" fn(Device, *const c_char) -> c_int,
    get_device_error: unsafe extern "C" fn(Device, *mut *const c_char) -> c_int,
    new_filter: unsafe extern "C" fn(Device, *const c_char) -> Filter,
    commit_filter: unsafe extern "C" fn(Filter),
    execute_filter: unsafe extern "C" fn(Filter),
    release_filter: unsafe extern "C" fn(Filter),
    set_filter_bool: unsafe extern "C" fn(Filter, *const c_char, bool),
    #[allow(clippy::type_complexity, reason = "as the library declares it")]
    set_shared_filter_image: unsafe extern "C" fn(
        Filter,
        *const c_char,
        *mut c_void,
        c_int,
        usize,
        usize,
        usize,
        usize,
        usize,
    ),
}

/// The loaded library.
#[derive(Debug)]
pub(super) struct Library {
    functions: Functions,
    /// Keeps the functions' code in memory.
    _library: libloading::Library,
    /// Dependencies of what the library loads later on its own.
    _beside: Vec<libloading::Library>,
}

impl Library {
    /// Loads the library from a file, or by a name that the dynamic loader looks up.
    ///
    /// # Errors
    /// [`DenoiseError::Unusable`] if it cannot be loaded or is not a version 2.
    pub(super) fn load(path: &Path) -> Result<Self> {
        let unusable = |problem: String| DenoiseError::Unusable {
            path: path.to_owned(),
            problem,
        };
        let beside = preload(path);
        // SAFETY: loading runs the library's initialisers; those of Open Image Denoise only set up
        // its own state. A file of that name that holds something else is the choice of whoever put
        // it into a place searched for libraries.
        let library = unsafe { libloading::Library::new(path) }
            .map_err(|error| unusable(one_line(&error.to_string())))?;
        let functions = Functions::of(&library).map_err(|name| {
            unusable(format!(
                "has no function `{name}`: older than Open Image Denoise 2, or another library"
            ))
        })?;
        Ok(Self {
            functions,
            _library: library,
            _beside: beside,
        })
    }

    /// Opens a device of this machine's processor with `threads` threads.
    ///
    /// # Errors
    /// [`DenoiseError::Failed`] if the library cannot run here.
    pub(super) fn open(&self, threads: usize) -> Result<OpenDevice<'_>> {
        let f = &self.functions;
        // SAFETY: takes a constant of the API, returns a handle or null.
        let device = unsafe { (f.new_device)(DEVICE_TYPE_CPU) };
        if device.is_null() {
            // SAFETY: null asks for the error of this thread, which is where a device that was not
            // made leaves it.
            return Err(unsafe { f.error(ptr::null_mut()) });
        }
        let open = OpenDevice {
            functions: f,
            device,
        };
        let threads = c_int::try_from(threads).unwrap_or(c_int::MAX);
        // SAFETY: the handle is valid, the names are strings that end in 0 and keys of a CPU
        // device.
        unsafe {
            (f.set_device_int)(device, c"numThreads".as_ptr(), threads);
            // Otherwise it pins threads to cores, and whatever else runs there waits.
            (f.set_device_bool)(device, c"setAffinity".as_ptr(), false);
            (f.commit_device)(device);
        }
        open.check()?;
        Ok(open)
    }
}

/// A device, released when dropped.
pub(super) struct OpenDevice<'a> {
    functions: &'a Functions,
    device: Device,
}

/// Auxiliary images of the network besides the colour.
pub(super) struct GuideImages<'a> {
    pub(super) albedo: &'a Image<3>,
    pub(super) normal: &'a Image<3>,
}

impl OpenDevice<'_> {
    /// Version of the library: `20501` is 2.5.1.
    pub(super) fn version(&self) -> i32 {
        // SAFETY: the handle is valid and "version" a key of every device.
        unsafe { (self.functions.get_device_int)(self.device, c"version".as_ptr()) }
    }

    /// Denoises an HDR colour image with guides free of noise; all images have the size of `color`.
    ///
    /// # Errors
    /// [`DenoiseError::Failed`] with the library's message.
    pub(super) fn denoise(&self, color: &Image<3>, guides: &GuideImages<'_>) -> Result<Image<3>> {
        let f = self.functions;
        let (width, height) = color.size();
        let mut output = Image::filled(width, height, [0.0; 3]);
        let to = output.pixels_mut().as_mut_ptr().cast::<c_void>();
        let inputs = [
            (c"color", color),
            (c"albedo", guides.albedo),
            (c"normal", guides.normal),
        ];
        for (_, image) in &inputs {
            assert_eq!(image.size(), color.size(), "guides have the colour's size");
        }
        // SAFETY: the device is valid and "RT" a filter of every version 2; null is checked for.
        let filter = unsafe { (f.new_filter)(self.device, c"RT".as_ptr()) };
        if filter.is_null() {
            self.check()?;
            return Err(DenoiseError::Failed {
                problem: "made no filter".to_owned(),
            });
        }
        // SAFETY: the handles are valid until released at the end. Every image is `width · height`
        // triples of f32 without gaps (`[f32; 3]` in a `Vec`), stays borrowed until the filter has
        // run, and is declared with that very size; inputs are only read, and `output` is not
        // touched otherwise meanwhile. `execute` returns when all is written.
        unsafe {
            let image = |name: &CStr, data: *mut c_void| {
                let (width, height) = (width as usize, height as usize);
                (f.set_shared_filter_image)(
                    filter,
                    name.as_ptr(),
                    data,
                    FORMAT_FLOAT3,
                    width,
                    height,
                    0,
                    0,
                    0,
                );
            };
            for (name, input) in inputs {
                image(name, input.pixels().as_ptr().cast_mut().cast());
            }
            image(c"output", to);
            (f.set_filter_bool)(filter, c"hdr".as_ptr(), true);
            (f.set_filter_bool)(filter, c"cleanAux".as_ptr(), true);
            (f.commit_filter)(filter);
            (f.execute_filter)(filter);
            (f.release_filter)(filter);
        }
        self.check()?;
        Ok(output)
    }

    fn check(&self) -> Result<()> {
        let mut message = ptr::null();
        // SAFETY: the handle is valid; the message is read at once.
        let code = unsafe { (self.functions.get_device_error)(self.device, &raw mut message) };
        if code == ERROR_NONE {
            return Ok(());
        }
        // SAFETY: a message of the library ends in 0 and lives until its next call on this thread.
        Err(unsafe { failure(code, message) })
    }
}

impl Drop for OpenDevice<'_> {
    fn drop(&mut self) {
        // SAFETY: made by this library, released once; filters of it are gone.
        unsafe { (self.functions.release_device)(self.device) };
    }
}

impl Functions {
    /// All functions, or the name of one that is missing.
    fn of(library: &libloading::Library) -> Result<Self, &'static str> {
        macro_rules! function {
            ($name:literal) => {
                // SAFETY: the field's type is the declaration of `oidn.h` for this name; the
                // pointer is used only while `Library` is alive.
                unsafe { *library.get($name).map_err(|_| $name)? }
            };
        }
        Ok(Self {
            new_device: function!("oidnNewDevice"),
            commit_device: function!("oidnCommitDevice"),
            release_device: function!("oidnReleaseDevice"),
            set_device_int: function!("oidnSetDeviceInt"),
            set_device_bool: function!("oidnSetDeviceBool"),
            get_device_int: function!("oidnGetDeviceInt"),
            get_device_error: function!("oidnGetDeviceError"),
            new_filter: function!("oidnNewFilter"),
            commit_filter: function!("oidnCommitFilter"),
            execute_filter: function!("oidnExecuteFilter"),
            release_filter: function!("oidnReleaseFilter"),
            set_filter_bool: function!("oidnSetFilterBool"),
            set_shared_filter_image: function!("oidnSetSharedFilterImage"),
        })
    }

    /// The error that waits on `device`.
    ///
    /// # Safety
    /// `device` is valid or null.
    unsafe fn error(&self, device: Device) -> DenoiseError {
        let mut message = ptr::null();
        // SAFETY: as the caller promises; a message of the library lives until its next call on
        // this thread.
        unsafe {
            let code = (self.get_device_error)(device, &raw mut message);
            failure(code, message)
        }
    }
}

/// # Safety
/// `message` is null or ends in 0.
unsafe fn failure(code: c_int, message: *const c_char) -> DenoiseError {
    let problem = if message.is_null() {
        format!("error {code}")
    } else {
        // SAFETY: not null, and ends in 0 as the caller promises.
        one_line(&unsafe { CStr::from_ptr(message) }.to_string_lossy())
    };
    DenoiseError::Failed { problem }
}

/// Loads what the library itself needs from its own folder first. Installations find it by a path
/// in the library (`$ORIGIN/../lib`), which fails where the files were put into a folder of another
/// name; the loader takes what is in memory already.
fn preload(path: &Path) -> Vec<libloading::Library> {
    if !cfg!(target_os = "linux") {
        return Vec::new();
    }
    let in_folder: Vec<PathBuf> = path
        .parent()
        .filter(|folder| folder.is_absolute())
        .and_then(|folder| std::fs::read_dir(folder).ok())
        .map(|entries| entries.flatten().map(|entry| entry.path()).collect())
        .unwrap_or_default();
    // One file each: there may be several names, or copies, of the same library.
    ["libtbb.so.", "libOpenImageDenoise_core.so."]
        .into_iter()
        .filter_map(|start| {
            let named = |path: &&PathBuf| {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                name.starts_with(start)
            };
            let file = in_folder.iter().filter(named).min()?;
            // SAFETY: as for the library itself, whose installation these files are part of.
            unsafe { libloading::Library::new(file) }
                .inspect_err(|error| tracing::debug!("{}: {error}", file.display()))
                .ok()
        })
        .collect()
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
