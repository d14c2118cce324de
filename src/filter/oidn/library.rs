//! Intel Open Image Denoise 2.x, loaded at run time: the few functions of its C interface that are needed.
//!
//! Reference: the header `oidn.h` of version 2 and the documentation at openimagedenoise.org.

use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::PathBuf;
use std::ptr::{NonNull, null};
use std::sync::OnceLock;

use libloading::Library;

use crate::image::Planes;

/// Environment variable with the library's file, or with the folder in which it lies.
const VARIABLE: &str = "PRPF_OIDN";

/// File names of the library in system folders.
#[cfg(target_os = "macos")]
const NAMES: [&str; 1] = ["libOpenImageDenoise.2.dylib"];
#[cfg(target_os = "windows")]
const NAMES: [&str; 1] = ["OpenImageDenoise.dll"];
#[cfg(not(any(target_os = "macos", target_os = "windows")))]
const NAMES: [&str; 2] = ["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"];

/// Folder of the library in the package `pyoidn`, from a folder of Python packages.
const PYTHON_PACKAGE: &str = "pyoidn/oidn/lib";

type Handle = NonNull<c_void>;

/// Functions of the library. They stay valid because the library is never unloaded.
struct Functions {
    new_device: unsafe extern "C" fn(c_int) -> Option<Handle>,
    commit_device: unsafe extern "C" fn(Handle),
    release_device: unsafe extern "C" fn(Handle),
    device_error: unsafe extern "C" fn(Option<Handle>, *mut *const c_char) -> c_int,
    set_device_int: unsafe extern "C" fn(Handle, *const c_char, c_int),
    set_device_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    new_filter: unsafe extern "C" fn(Handle, *const c_char) -> Option<Handle>,
    release_filter: unsafe extern "C" fn(Handle),
    set_image:
        unsafe extern "C" fn(Handle, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize),
    set_filter_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    set_filter_int: unsafe extern "C" fn(Handle, *const c_char, c_int),
    commit_filter: unsafe extern "C" fn(Handle),
    execute_filter: unsafe extern "C" fn(Handle),
}

/// The library's quality setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    Fast,
    High,
}

/// `OIDN_QUALITY_FAST`, since version 2.3.
const FAST: c_int = 4;
/// `OIDN_QUALITY_BALANCED`.
const BALANCED: c_int = 5;
/// `OIDN_QUALITY_HIGH`.
const HIGH: c_int = 6;

/// `OIDN_DEVICE_TYPE_CPU`: results do not depend on the graphics card.
const CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`.
const FLOAT3: c_int = 3;

/// Returns the functions, or why there are none.
fn functions() -> Result<&'static Functions, &'static str> {
    static FUNCTIONS: OnceLock<Result<Functions, String>> = OnceLock::new();
    FUNCTIONS.get_or_init(load).as_ref().map_err(String::as_str)
}

/// Returns why the library cannot be used; `None` if it can.
pub fn missing() -> Option<&'static str> {
    functions().err()
}

/// Finds the library by the environment variable, or in the system's folders, or in Python's. One of another version does not hide
/// the next.
fn load() -> Result<Functions, String> {
    let candidates: Vec<PathBuf> = match std::env::var_os(VARIABLE).map(PathBuf::from) {
        Some(folder) if folder.is_dir() => NAMES.iter().map(|name| folder.join(name)).collect(),
        Some(file) => vec![file],
        None => NAMES.iter().map(PathBuf::from).chain(in_python_packages()).collect(),
    };
    let mut reason = None;
    for candidate in &candidates {
        // SAFETY: the library's initialisers are those of a well-known library that the user has installed.
        let Ok(library) = (unsafe { Library::new(candidate) }) else { continue };
        match Functions::from_library(library) {
            Ok(functions) => return Ok(functions),
            Err(other) => reason = Some(other),
        }
    }
    Err(match (reason, std::env::var_os(VARIABLE)) {
        (Some(reason), _) => reason,
        (None, Some(value)) => {
            format!("{VARIABLE}: no library of Open Image Denoise 2 can be loaded from {}", value.display())
        }
        (None, None) => format!(
            "Open Image Denoise 2 is not installed: get it from openimagedenoise.org or by `pip install pyoidn`, and set \
             {VARIABLE} to its library unless the system finds it"
        ),
    })
}

/// Paths of the library in the packages of an active virtual environment and of the user's Python.
fn in_python_packages() -> Vec<PathBuf> {
    let homes = [("VIRTUAL_ENV", "lib"), ("HOME", ".local/lib")];
    let roots = homes
        .iter()
        .filter_map(|(variable, folder)| Some(PathBuf::from(std::env::var_os(variable)?).join(folder)));
    let versions = roots.filter_map(|root| std::fs::read_dir(root).ok()).flatten().flatten();
    let folders = versions.map(|version| version.path().join("site-packages").join(PYTHON_PACKAGE));
    folders.flat_map(|folder| NAMES.map(|name| folder.join(name))).filter(|path| path.is_file()).collect()
}

impl Functions {
    fn from_library(library: Library) -> Result<Self, String> {
        /// Returns a function by its name.
        fn get<T: Copy>(library: &Library, name: &str) -> Result<T, String> {
            // SAFETY: the types of `Functions` are those of `oidn.h` of version 2, of which all these functions are.
            let symbol = unsafe { library.get::<T>(name.as_bytes()) };
            symbol
                .map(|symbol| *symbol)
                .map_err(|_| format!("Open Image Denoise lacks {name}: version 2 is needed"))
        }
        let functions = Self {
            new_device: get(&library, "oidnNewDevice")?,
            commit_device: get(&library, "oidnCommitDevice")?,
            release_device: get(&library, "oidnReleaseDevice")?,
            device_error: get(&library, "oidnGetDeviceError")?,
            set_device_int: get(&library, "oidnSetDeviceInt")?,
            set_device_bool: get(&library, "oidnSetDeviceBool")?,
            new_filter: get(&library, "oidnNewFilter")?,
            release_filter: get(&library, "oidnReleaseFilter")?,
            set_image: get(&library, "oidnSetSharedFilterImage")?,
            set_filter_bool: get(&library, "oidnSetFilterBool")?,
            set_filter_int: get(&library, "oidnSetFilterInt")?,
            commit_filter: get(&library, "oidnCommitFilter")?,
            execute_filter: get(&library, "oidnExecuteFilter")?,
        };
        // Its threads may outlive any borrower: it is never unloaded.
        std::mem::forget(library);
        Ok(functions)
    }
}

/// An image of three interleaved channels.
pub struct Interleaved {
    values: Vec<f32>,
    width: usize,
    height: usize,
}

impl Interleaved {
    /// Takes 3 planes; values that are not finite become 0, others are clamped.
    pub fn new(planes: &Planes, low: f32, high: f32) -> Self {
        let mut values = vec![0.0; 3 * planes.pixels()];
        for c in 0..3 {
            for (value, &v) in values.iter_mut().skip(c).step_by(3).zip(planes.plane(c)) {
                *value = if v.is_finite() { v.clamp(low, high) } else { 0.0 };
            }
        }
        Self { values, width: planes.width(), height: planes.height() }
    }

    /// Returns 3 planes.
    pub fn to_planes(&self) -> Planes {
        let mut planes = Planes::new(self.width, self.height, 3);
        for (c, plane) in planes.planes_mut().enumerate() {
            plane.iter_mut().zip(self.values.iter().skip(c).step_by(3)).for_each(|(plane, &v)| *plane = v);
        }
        planes
    }
}

/// The processor as the library sees it.
pub struct Device {
    functions: &'static Functions,
    handle: Handle,
}

impl Device {
    /// Uses as many threads as the current thread pool has.
    ///
    /// # Errors
    /// Why there is no library, or what it reports.
    pub fn new() -> Result<Self, String> {
        let functions = functions()?;
        let threads = c_int::try_from(rayon::current_num_threads()).unwrap_or(c_int::MAX);
        // SAFETY: a new device is committed before it is used, and its parameters are known to version 2.
        let handle = unsafe {
            let handle = (functions.new_device)(CPU).ok_or("Open Image Denoise finds no device")?;
            (functions.set_device_int)(handle, c"numThreads".as_ptr(), threads);
            // Pinned threads would hinder those of the renderer.
            (functions.set_device_bool)(handle, c"setAffinity".as_ptr(), false);
            (functions.commit_device)(handle);
            handle
        };
        let device = Self { functions, handle };
        device.take_error().map_or(Ok(device), Err)
    }

    /// Returns the error that the library has reported since the last call, if there is one.
    fn take_error(&self) -> Option<String> {
        let mut message = null::<c_char>();
        // SAFETY: the device exists, and a message is a text that stays until the next call of the library.
        unsafe {
            if (self.functions.device_error)(Some(self.handle), &raw mut message) == 0 {
                return None;
            }
            let message = if message.is_null() { c"an error" } else { CStr::from_ptr(message) };
            Some(format!("Open Image Denoise reports: {}", message.to_string_lossy()))
        }
    }

    /// Filters a colour, or a guide, with guides.
    ///
    /// `name` is what the library calls it: `color`, `albedo` or `normal`. Guides have the same size.
    ///
    /// # Errors
    /// What the library reports.
    pub fn filter(
        &self,
        name: &CStr,
        image: &Interleaved,
        guides: &[(&CStr, &Interleaved)],
        quality: Quality,
        are_guides_clean: bool,
    ) -> Result<Interleaved, String> {
        // Provide the output
        let (width, height) = (image.width, image.height);
        if width * height == 0 {
            return Ok(Interleaved { values: Vec::new(), width, height });
        }
        let mut output = vec![0.0_f32; image.values.len()];
        let functions = self.functions;

        // SAFETY: all images have width × height pixels of three floats and outlive the filter, which only writes to
        // the output.
        unsafe {
            // Set the images
            let filter = (functions.new_filter)(self.handle, c"RT".as_ptr())
                .ok_or_else(|| self.take_error().unwrap_or_default())?;
            let set = |name: &CStr, data: *mut f32| {
                (functions.set_image)(filter, name.as_ptr(), data.cast(), FLOAT3, width, height, 0, 0, 0);
            };
            set(name, image.values.as_ptr().cast_mut());
            for (name, guide) in guides {
                assert_eq!(guide.values.len(), output.len(), "guides have the size of the image");
                set(name, guide.values.as_ptr().cast_mut());
            }
            set(c"output", output.as_mut_ptr());

            // Set the parameters
            if name == c"color" {
                (functions.set_filter_bool)(filter, c"hdr".as_ptr(), true);
                (functions.set_filter_bool)(filter, c"cleanAux".as_ptr(), are_guides_clean);
            }
            let set_quality = |quality| (functions.set_filter_int)(filter, c"quality".as_ptr(), quality);
            match quality {
                Quality::High => set_quality(HIGH),
                Quality::Fast => {
                    set_quality(FAST);
                    // A version that has no fast quality reports an error
                    if self.take_error().is_some() {
                        set_quality(BALANCED);
                    }
                }
            }

            // Filter, and ask for errors
            (functions.commit_filter)(filter);
            (functions.execute_filter)(filter);
            (functions.release_filter)(filter);
        }
        self.take_error().map_or(Ok(Interleaved { values: output, width, height }), Err)
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: all filters of the device are released.
        unsafe { (self.functions.release_device)(self.handle) }
    }
}
