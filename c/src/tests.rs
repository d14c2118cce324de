//! The interface, called as C calls it: what it gives is what the library gives, and wrong calls have a status and a message.

mod random_calls;

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::ptr::{null, null_mut};

use prpf::filter::{Denoiser, nlm};
use prpf::stats::{Columns, SampleRectangle, Store};

use crate::allocation::{prpf_filter_priority, prpf_store_allocate};
use crate::denoisers::{prpf_denoiser_name, prpf_use_weights};
use crate::filter::{
    PrpfFilter, prpf_filter_create, prpf_filter_free, prpf_filter_run, prpf_filter_set_progress,
};
use crate::result::{PrpfEstimate, prpf_filter_estimate, prpf_filter_made_by, prpf_filter_read};
use crate::status::{Failure, PrpfStatus, guard, prpf_error_message};
use crate::store::{
    PrpfHalfMoments, PrpfStore, prpf_store_counts, prpf_store_create, prpf_store_create_from_moments,
    prpf_store_free, prpf_store_push, prpf_store_push_pixels, prpf_store_samples,
};
use crate::threads::prpf_set_threads;
use crate::version::prpf_version;

const NAMES: [&CStr; 3] = [c"R", c"G", c"B"];
const WIDTH: usize = 20;
const HEIGHT: usize = 12;

/// Creates a store; checks that one comes with `Ok` alone.
fn create_store(width: usize, names: &[*const c_char], reservoir: usize) -> Result<*mut PrpfStore, String> {
    let mut store = null_mut();
    // SAFETY: all pointers are valid.
    let status = unsafe {
        prpf_store_create(width, HEIGHT, names.as_ptr(), names.len(), reservoir, 0, &raw mut store)
    };
    assert_eq!(store.is_null(), status != PrpfStatus::Ok);
    if status == PrpfStatus::Ok { Ok(store) } else { Err(message()) }
}

fn rgb_store() -> *mut PrpfStore {
    create_store(WIDTH, &NAMES.map(CStr::as_ptr), 0).unwrap()
}

fn create_filter(name: &CStr) -> *mut PrpfFilter {
    let mut filter = null_mut();
    // SAFETY: all pointers are valid.
    assert_eq!(
        unsafe { prpf_filter_create(name.as_ptr(), &raw mut filter) },
        PrpfStatus::Ok,
        "{}",
        message()
    );
    filter
}

/// The message of this thread's last call; empty if there is none.
fn message() -> String {
    let message = prpf_error_message();
    // SAFETY: a message ends with a zero byte, and no call changes it here.
    if message.is_null() {
        String::new()
    } else {
        unsafe { CStr::from_ptr(message) }.to_str().unwrap().to_owned()
    }
}

/// Noisy samples, four of each pixel.
fn samples() -> Vec<f32> {
    (0..WIDTH * HEIGHT * 4 * 3).map(|i| 0.25 + ((i * 7919) % 101) as f32 / 101.0).collect()
}

fn push(store: *mut PrpfStore, values: &[f32]) -> PrpfStatus {
    // SAFETY: all pointers are valid.
    unsafe { prpf_store_push(store, 0, 0, WIDTH, HEIGHT, 4, values.as_ptr(), values.len()) }
}

#[test]
fn image_error_priority_and_counts_are_those_of_the_library() {
    // The library's
    let columns = Columns::new(&["R", "G", "B"]).unwrap();
    let mut expected = Store::new(WIDTH, HEIGHT, columns.layout().clone(), 0, 0);
    let values = samples();
    let rectangle = SampleRectangle { corner: [0, 0], size: [WIDTH, HEIGHT], samples: 4, values: &values };
    expected.push_rectangle(&columns, &rectangle).unwrap();
    let expected = nlm::DRAFT.filter(&expected, 0);

    // The interface's
    let (store, filter) = (rgb_store(), create_filter(c"nlm draft"));
    let (pixels, mut count, mut rejected) = (WIDTH * HEIGHT, 0, 0);
    let (mut image, mut variance) = (vec![0.0; 3 * pixels], vec![0.0; 3 * pixels]);
    let (mut error, mut priority, mut counts) = (vec![0.0; pixels], vec![0.0; pixels], vec![0; pixels]);
    let mut estimate = PrpfEstimate { relmse: 0.0, low: 0.0, high: 0.0 };
    assert_eq!(push(store, &values), PrpfStatus::Ok);
    // SAFETY: all pointers are valid.
    unsafe {
        for status in [
            prpf_store_samples(store, &raw mut count, &raw mut rejected),
            prpf_filter_run(filter, store),
            prpf_filter_read(filter, 0, image.as_mut_ptr(), image.len()),
            prpf_filter_read(filter, 3, variance.as_mut_ptr(), variance.len()),
            prpf_filter_read(filter, 5, error.as_mut_ptr(), error.len()),
            prpf_filter_estimate(filter, &raw mut estimate),
            prpf_filter_priority(filter, store, priority.as_mut_ptr(), pixels),
            prpf_store_allocate(store, priority.as_ptr(), pixels, 1000, 0, 0, counts.as_mut_ptr(), pixels),
        ] {
            assert_eq!(status, PrpfStatus::Ok, "{}", message());
        }
        assert_eq!(CStr::from_ptr(prpf_filter_made_by(filter)), c"nlm draft");
    }
    assert_eq!((count, rejected), (4 * pixels as u64, 0));
    for (i, channel) in (0..pixels).flat_map(|i| (0..3).map(move |channel| (i, channel))) {
        assert_eq!(image[3 * i + channel], expected.image.plane(channel)[i]);
        assert_eq!(variance[3 * i + channel], expected.variance.plane(channel)[i]);
    }
    assert_eq!(error, expected.error.data());
    assert!(0.0 < estimate.low && estimate.low < estimate.relmse && estimate.relmse < estimate.high);
    assert_eq!(counts.iter().sum::<u32>(), 1000);
    // SAFETY: both live.
    unsafe {
        prpf_filter_free(filter);
        prpf_store_free(store);
    }
}

#[test]
fn samples_in_any_order_and_halves_make_stores() {
    let store = rgb_store();
    let mut counts = vec![0; WIDTH * HEIGHT];
    // SAFETY: all pointers are valid.
    unsafe {
        let (pixels, values) = ([1_u32, 0, 1, 0], [0.5_f32, 0.5, 0.5, f32::NAN, 0.5, 0.5]);
        assert_eq!(prpf_store_push_pixels(store, pixels.as_ptr(), 4, values.as_ptr(), 6), PrpfStatus::Ok);
        assert_eq!(prpf_store_counts(store, counts.as_mut_ptr(), counts.len()), PrpfStatus::Ok);
        prpf_store_free(store);
    }
    assert_eq!((counts[1], counts.iter().sum::<u32>()), (1, 1), "one of the two is rejected");

    let means: [Vec<f32>; 2] = [1.0, 3.0].map(|mean| vec![mean; 3 * WIDTH * HEIGHT]);
    let (ones, variances) = (vec![1; WIDTH * HEIGHT], vec![0.0; 3 * WIDTH * HEIGHT]);
    let halves = means.each_ref().map(|means| PrpfHalfMoments {
        counts: ones.as_ptr(),
        means: means.as_ptr(),
        variances: variances.as_ptr(),
    });
    let (mut store, filter, mut image) = (null_mut(), create_filter(c"none"), vec![0.0; 3 * WIDTH * HEIGHT]);
    // SAFETY: all pointers are valid.
    unsafe {
        let names = NAMES.map(CStr::as_ptr);
        let status = prpf_store_create_from_moments(
            WIDTH,
            HEIGHT,
            names.as_ptr(),
            3,
            halves.as_ptr(),
            0,
            &raw mut store,
        );
        assert_eq!(status, PrpfStatus::Ok, "{}", message());
        assert_eq!(prpf_filter_run(filter, store), PrpfStatus::Ok);
        assert_eq!(prpf_filter_read(filter, 0, image.as_mut_ptr(), image.len()), PrpfStatus::Ok);
        prpf_filter_free(filter);
        prpf_store_free(store);
    }
    assert!(image.iter().all(|&value| value == 2.0));
}

#[test]
fn threads_push_into_one_store_and_have_messages_of_their_own() {
    /// A store that threads share, as prpf.h allows.
    struct Shared(*mut PrpfStore);
    // SAFETY: calls on one store wait for each other.
    unsafe impl Sync for Shared {}
    impl Shared {
        fn store(&self) -> *mut PrpfStore {
            self.0
        }
    }
    const THREADS: usize = 4;
    const PUSHES: usize = 5;
    let (shared, values) = (Shared(rgb_store()), samples());
    std::thread::scope(|scope| {
        for _ in 0..THREADS {
            scope.spawn(|| {
                for _ in 0..PUSHES {
                    assert_eq!(push(shared.store(), &values), PrpfStatus::Ok);
                }
                assert_eq!(push(shared.store(), &values[1..]), PrpfStatus::InvalidArgument);
                assert!(message().contains("found 2879 values"), "{}", message());
            });
        }
    });
    assert_eq!(message(), "");
    let (mut valid, mut rejected) = (0, 0);
    // SAFETY: all pointers are valid.
    unsafe {
        assert_eq!(prpf_store_samples(shared.store(), &raw mut valid, &raw mut rejected), PrpfStatus::Ok);
        prpf_store_free(shared.store());
    }
    assert_eq!((valid, rejected), ((THREADS * PUSHES * values.len() / 3) as u64, 0));
}

#[test]
fn wrong_calls_have_a_status_and_a_message() {
    let (store, filter) = (rgb_store(), create_filter(c"prpf"));
    let values = samples();
    let mut room = [0.0_f32; 4];
    let is_invalid = |status, words: &str| {
        assert_eq!(status, PrpfStatus::InvalidArgument, "{words}");
        assert!(message().contains(words), "{}", message());
    };
    let names = |names: &[&CStr]| names.iter().map(|name| name.as_ptr()).collect::<Vec<_>>();
    for (names, words) in [
        (names(&[]), "found no colour"),
        (names(&[c"albedo.r", c"albedo.g", c"albedo.b"]), "found no colour"),
        (names(&[c"R", c"G"]), "found no `B`"),
        (names(&[c"R", c"G", c"B", c"depth"]), "found `depth`"),
        (names(&[c"R", c"G", c"B", c"\xff"]), "not UTF-8"),
        (vec![c"R".as_ptr(), null(), c"B".as_ptr()], "dimensions: found a null pointer"),
    ] {
        let message = create_store(WIDTH, &names, 0).unwrap_err();
        assert!(message.contains(words), "{message}");
    }
    let rgb = names(&NAMES);
    assert!(create_store(0, &rgb, 0).unwrap_err().contains("found 0x12"));
    assert!(create_store(usize::MAX, &rgb, 0).unwrap_err().contains("sides from 1"));
    assert!(create_store(60_000, &rgb, usize::MAX / 2).unwrap_err().contains("GB of memory"));
    // SAFETY: pointers are valid or null.
    unsafe {
        let mut none = null_mut();
        is_invalid(
            prpf_filter_create(c"median".as_ptr(), &raw mut none),
            "found `median`; accepted are learned standard",
        );
        is_invalid(prpf_filter_create(null(), &raw mut none), "denoiser: found a null pointer");
        is_invalid(prpf_filter_create(c"nlm".as_ptr(), null_mut()), "filter: found a null pointer");
        is_invalid(prpf_filter_run(filter, null()), "store: found a null pointer");
        is_invalid(prpf_filter_run(filter, store), "no valid samples");
        is_invalid(prpf_filter_read(filter, 0, room.as_mut_ptr(), 4), "accepted is a filter that has run");
        is_invalid(push(null_mut(), &values), "store: found a null pointer");
        is_invalid(push(store, &values[1..]), "samples: found 2879 values; accepted are 2880");
        is_invalid(push(store, &[]), "found 0 values");
        is_invalid(prpf_store_push(store, 0, 0, 1, 1, 1, null(), 3), "values: found a null pointer");
        let misaligned = values.as_ptr().cast::<u8>().add(1).cast();
        is_invalid(prpf_store_push(store, 0, 0, 1, 1, 1, misaligned, 3), "not aligned");
        is_invalid(prpf_store_push(store, usize::MAX, 0, 1, 1, 1, values.as_ptr(), 3), "within 20x12");
        is_invalid(prpf_store_push(store, 0, 0, 1, 1, usize::MAX, values.as_ptr(), 3), "found 3 values");
        is_invalid(
            prpf_store_push(store, 0, 0, 1, 1, 1, values.as_ptr(), usize::MAX),
            "accepted are at most",
        );
        is_invalid(prpf_store_push_pixels(store, [20, 0].as_ptr(), 2, values.as_ptr(), 3), "found (20, 0)");
        assert_eq!(push(store, &values), PrpfStatus::Ok);
        assert_eq!(message(), "");
        is_invalid(prpf_filter_run(filter, store), "prpf needs 8");
        is_invalid(prpf_store_counts(store, null_mut(), WIDTH * HEIGHT), "counts: found a null pointer");
        is_invalid(
            prpf_store_counts(store, [0; 3].as_mut_ptr(), 3),
            "room for 3 values; accepted is room for 240",
        );
        let (mut valid, mut rejected) = (7_u64, [0_u64; 2]);
        let misaligned = rejected.as_mut_ptr().cast::<u8>().add(1).cast();
        is_invalid(
            prpf_store_samples(store, &raw mut valid, misaligned),
            "rejected: found a pointer that is not",
        );
        assert_eq!(valid, 7, "nothing has changed");
        let mut counts = vec![0; WIDTH * HEIGHT];
        let mut allocate = |priority: &[f32], min, max| {
            let (priority, count) = (priority.as_ptr(), priority.len());
            prpf_store_allocate(store, priority, count, 9, min, max, counts.as_mut_ptr(), counts.len())
        };
        is_invalid(allocate(&[1.0; 5], 0, 0), "priority: found 5 values; accepted are 240");
        is_invalid(allocate(&[f32::NAN; WIDTH * HEIGHT], 0, 0), "priority: found NaN");
        is_invalid(allocate(&[1.0; WIDTH * HEIGHT], 9, 8), "max_spp: found 8");
        prpf_filter_free(filter);
        prpf_store_free(store);
        prpf_filter_free(null_mut());
        prpf_store_free(null_mut());
    }
    is_invalid(prpf_set_threads(2), "accepted is one before");
    is_invalid(prpf_set_threads(usize::MAX), "accepted are at most 4096");
}

#[test]
fn results_say_what_they_lack() {
    let (store, filter) = (rgb_store(), create_filter(c"nlm"));
    let mut room = vec![0.0; WIDTH * HEIGHT];
    let mut estimate = PrpfEstimate { relmse: 0.0, low: 0.0, high: 0.0 };
    // SAFETY: all pointers are valid.
    unsafe {
        // Fewer samples than pixels
        assert!(prpf_filter_made_by(filter).is_null());
        assert_eq!(prpf_store_push(store, 0, 0, 1, 1, 1, [0.5; 3].as_ptr(), 3), PrpfStatus::Ok);
        assert_eq!(prpf_filter_run(filter, store), PrpfStatus::Ok);
        assert_eq!(CStr::from_ptr(prpf_filter_made_by(filter)), c"nlm draft");
        assert_eq!(prpf_filter_estimate(filter, &raw mut estimate), PrpfStatus::Ok);
        assert!(estimate.relmse.is_nan() && estimate.low.is_nan() && estimate.high.is_nan());
        for (map, words) in [(7, "accepted is that of prpf"), (8, "found 8; accepted are 0 to 7")] {
            let status = prpf_filter_read(filter, map, room.as_mut_ptr(), room.len());
            assert_eq!(status, PrpfStatus::InvalidArgument);
            assert!(message().contains(words), "{}", message());
        }
        // Another size
        let other = create_store(WIDTH + 1, &NAMES.map(CStr::as_ptr), 0).unwrap();
        let status = prpf_filter_priority(filter, other, room.as_mut_ptr(), room.len());
        assert_eq!(status, PrpfStatus::InvalidArgument);
        assert!(message().contains("found 21x12 pixels"), "{}", message());
        prpf_filter_free(filter);
        prpf_store_free(store);
        prpf_store_free(other);
    }
}

#[test]
fn a_callback_hears_of_progress_and_cancels_a_pass() {
    /// What the callback has heard and does.
    struct Heard {
        filter: *mut PrpfFilter,
        calls: usize,
        answer: c_int,
    }
    extern "C" fn hear(user: *mut c_void, fraction: f64) -> c_int {
        assert!((0.0..1.0).contains(&fraction));
        // SAFETY: the test passes a `Heard` that it does not use meanwhile.
        let heard = unsafe { &mut *user.cast::<Heard>() };
        heard.calls += 1;
        // SAFETY: the filter lives; it is in use.
        assert_eq!(unsafe { prpf_filter_run(heard.filter, null()) }, PrpfStatus::InvalidArgument);
        heard.answer
    }
    // A second of the learned filter, if nobody cancels it
    const SIDE: usize = 192;
    let (names, mut store, filter) = (NAMES.map(CStr::as_ptr), null_mut(), create_filter(c"learned"));
    let values: Vec<f32> = samples().into_iter().cycle().take(SIDE * SIDE * 2 * 3).collect();
    let mut heard = Heard { filter, calls: 0, answer: 1 };
    let user = (&raw mut heard).cast();
    // SAFETY: all pointers are valid.
    unsafe {
        assert_eq!(prpf_store_create(SIDE, SIDE, names.as_ptr(), 3, 0, 0, &raw mut store), PrpfStatus::Ok);
        let status = prpf_store_push(store, 0, 0, SIDE, SIDE, 2, values.as_ptr(), values.len());
        assert_eq!(status, PrpfStatus::Ok);
        assert_eq!(prpf_filter_set_progress(filter, Some(hear), user), PrpfStatus::Ok);
        assert_eq!(prpf_filter_run(filter, store), PrpfStatus::Cancelled);
        assert!(message().contains("cancelled"));
        assert!(prpf_filter_made_by(filter).is_null(), "there is no half-finished result");
        (*user.cast::<Heard>()).answer = 0;
        assert_eq!(prpf_filter_run(filter, store), PrpfStatus::Ok, "{}", message());
        assert!((*user.cast::<Heard>()).calls >= 2);
        prpf_filter_free(filter);
        prpf_store_free(store);
    }
}

#[test]
fn panics_become_a_status() {
    let status = guard(|| panic!("a \0 fault"));
    assert_eq!(
        (status, message().as_str()),
        (PrpfStatus::InternalError, "the library is at fault: a   fault")
    );
    let status = guard(|| std::panic::panic_any(7));
    assert_eq!(
        (status, message().as_str()),
        (PrpfStatus::InternalError, "the library is at fault: no message")
    );
    assert_eq!(guard(|| Ok::<(), Failure>(())), PrpfStatus::Ok);
    assert_eq!(message(), "");
}

#[test]
fn messages_are_one_line() {
    let mut none = null_mut();
    // SAFETY: all pointers are valid.
    let status = unsafe { prpf_filter_create(c"nlm\ndraft".as_ptr(), &raw mut none) };
    assert_eq!(status, PrpfStatus::InvalidArgument);
    assert!(message().contains("found `nlm draft`"), "{}", message());
    assert_eq!(guard(|| panic!("one line\r\nand another")), PrpfStatus::InternalError);
    assert_eq!(message(), "the library is at fault: one line  and another");
}

#[test]
fn the_header_has_the_version_of_the_library() {
    // SAFETY: it ends with a zero byte and lives as long as the program.
    let version = unsafe { CStr::from_ptr(prpf_version()) }.to_str().unwrap();
    assert_eq!(version, env!("CARGO_PKG_VERSION"));
    assert!(include_str!("../prpf.h").contains(&format!("\n#define PRPF_VERSION \"{version}\"\n")));
}

#[test]
fn the_names_of_denoisers_can_be_listed() {
    let names = (0..).map(|index| prpf_denoiser_name(index)).take_while(|name| !name.is_null());
    // SAFETY: names end with a zero byte and live as long as the program.
    let names: Vec<CString> = names.map(|name| unsafe { CStr::from_ptr(name) }.to_owned()).collect();
    assert_eq!(names.len(), prpf::filter::DENOISERS.len());
    assert_eq!(names[0].as_c_str(), c"learned standard");
}

#[test]
fn files_of_weights_are_taken_or_refused() {
    // SAFETY: all texts end with a zero byte.
    let use_weights = |path: &CStr| (unsafe { prpf_use_weights(path.as_ptr()) }, message());
    let own = concat!(env!("CARGO_MANIFEST_DIR"), "/../src/filter/learned/weights.safetensors");
    assert_eq!(use_weights(&CString::new(own).unwrap()), (PrpfStatus::Ok, String::new()));
    for (path, words) in [
        (c"none", "none: no such file or folder"),
        (c"Cargo.toml", "Cargo.toml: not a file of weights"),
        (c"/", "/: it is a folder"),
        (c"\xc3", "path: found bytes that are not UTF-8"),
    ] {
        let (status, message) = use_weights(path);
        assert_eq!(status, PrpfStatus::InvalidArgument);
        assert!(message.contains(words), "{message}");
    }
    // SAFETY: a null pointer is checked.
    assert_eq!(unsafe { prpf_use_weights(null()) }, PrpfStatus::InvalidArgument);
}
