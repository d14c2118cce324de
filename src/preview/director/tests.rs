use std::cell::{Cell, RefCell};
use std::path::Path;
use std::sync::atomic::AtomicBool;

use super::*;
use crate::adaptive::Sampling;
use crate::geometry::Accel;
use crate::preview::camera_move::CameraMove;
use crate::preview::stage::Keeping;
use crate::progressive::{Budget, Denoiser, Memory, Settings};
use crate::scene::pbrt;

const SIDE: u64 = 48;
const SPP: u32 = 8;

/// What is done at moments of a render that a person looks at.
struct Moments<'a> {
    stepped: &'a dyn Fn(Progress, &Hub, &Arc<AtomicBool>),
    kept: &'a dyn Fn(&Settings, Memory, &Hub),
    saved: &'a dyn Fn(&Picture),
}

/// Renders a small scene to its budget, keeping a memory whenever it can.
fn directed(moments: Moments) -> Outcome {
    let settings = Settings { sampling: Sampling::Uniform, ..of_spp(SPP) };
    directed_by(&settings, false, moments).expect("it ends by its budget")
}

fn of_spp(spp: u32) -> Settings {
    Settings { budget: Budget { spp: Some(spp), ..Budget::default() }, ..Settings::default() }
}

/// As [`directed`]; if it `stays` at the end it has no outcome.
fn directed_by(settings: &Settings, stays: bool, moments: Moments) -> Option<Outcome> {
    directed_on(&|| Ok(()), settings, stays, moments).0
}

/// As [`directed_by`], on a disk that takes what is kept or not; and what was told last.
fn directed_on(
    disk: &dyn Fn() -> Result<(), String>,
    settings: &Settings,
    stays: bool,
    moments: Moments,
) -> (Option<Outcome>, Arc<str>) {
    let text = include_str!("../../../experiments/stability/cases/noisy.pbrt");
    let scene = pbrt::read_str(text, Path::new(".")).unwrap();
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, settings.seed);
    let hub = Arc::new(Hub::default());
    let interrupt = Arc::new(AtomicBool::new(false));
    let keep = |settings: &Settings, memory: Memory| (moments.kept)(settings, memory, &hub);
    let stage = Stage {
        scene: &scene,
        renderer: &renderer,
        settings: settings.clone(),
        reference: None,
        closing: None,
        keeping: Some(Keeping { every: 0.0, keep: &keep, news: &|| disk().err(), settle: disk }),
        resumed: None,
        start: Instant::now(),
        interrupt: &interrupt,
        stays,
        save: Box::new(|picture| {
            (moments.saved)(picture);
            Ok(Vec::new())
        }),
        listen: Box::new(|progress| (moments.stepped)(progress, &hub, &interrupt)),
    };
    let outcome = Director::new(hub.clone(), stage).run();
    let told = hub.status().borrow().clone();
    (outcome, told)
}

#[test]
fn what_is_asked_for_during_the_last_pass_is_saved() {
    let saved = RefCell::new(Vec::new());
    let outcome = directed(Moments {
        stepped: &|_, _, _| (),
        // The last memory is kept when all samples are there, and the last pass comes next.
        kept: &|_, memory, hub| {
            if memory.store.samples() == u64::from(SPP) * SIDE * SIDE {
                assert!(hub.send(Command::Save));
            }
        },
        saved: &|picture| {
            saved.borrow_mut().push((picture.store.samples(), picture.filtered.image.clone()));
        },
    });
    assert!(saved.into_inner() == [(outcome.store.samples(), outcome.filtered.image)]);
}

type Made = (Denoiser, Quality);

/// Renders in this quality while these are said in one breath, once there are 16 samples per pixel, and the program
/// is closed then if it `stays`; samples of then, and samples and filter of what was saved.
fn saved_of(quality: Quality, commands: &[Command], stays: bool) -> (u64, Vec<(u64, Made)>) {
    let (given, saved) = (Cell::new(0), RefCell::new(Vec::new()));
    let moments = Moments {
        stepped: &|progress, hub, interrupt| {
            if progress.spp >= 16.0 && given.get() == 0 {
                given.set(progress.samples);
                commands.iter().for_each(|command| assert!(hub.send(command.clone())));
                interrupt.store(stays, Ordering::Relaxed);
            }
        },
        kept: &|_, _, _| (),
        saved: &|picture| {
            saved.borrow_mut().push((picture.store.samples(), picture.made_by));
        },
    };
    let settings = Settings { sampling: Sampling::Uniform, quality, ..of_spp(32) };
    assert_eq!(directed_by(&settings, stays, moments).is_none(), stays);
    (given.get(), saved.into_inner())
}

#[test]
fn what_is_saved_is_the_image_of_when_that_was_said() {
    const PAPER: Made = (Denoiser::Prpf, Quality::Paper);
    const STANDARD: Made = (Denoiser::Prpf, Quality::Standard);
    let unfiltered = || {
        Command::ChangeSettings(SettingsChange {
            denoiser: Some(Denoiser::None),
            ..SettingsChange::default()
        })
    };
    let better = || {
        Command::ChangeSettings(SettingsChange { quality: Some(Quality::Paper), ..SettingsChange::default() })
    };
    let moved = || Command::MoveCamera(CameraMove { orbit: Some([0.3, 0.1]), ..CameraMove::default() });
    let of = |quality, commands: &[Command], stays| {
        let (before, saved) = saved_of(quality, commands, stays);
        let all_new = saved.iter().all(|(samples, _)| (SIDE * SIDE..before).contains(samples));
        let all_old = saved.iter().all(|&(samples, _)| samples == before);
        assert!(all_new || all_old, "{before} {saved:?}");
        (all_old, saved.into_iter().map(|(_, made_by)| made_by).collect::<Vec<_>>())
    };
    // Whatever comes after it.
    for next in [Command::Restart, moved(), unfiltered()] {
        assert_eq!(of(Quality::Paper, &[Command::Save, next], false), (true, vec![PAPER]));
    }
    assert_eq!(of(Quality::Paper, &[Command::Save], true), (true, vec![PAPER]));
    // And after what makes it another, the first that is of it, as it was to be filtered then.
    let none = (Denoiser::None, Quality::Paper);
    assert_eq!(of(Quality::Paper, &[unfiltered(), Command::Save], false), (true, vec![none]));
    for first in [Command::Restart, moved()] {
        assert_eq!(
            of(Quality::Standard, &[first, Command::Save, unfiltered()], false),
            (false, vec![STANDARD])
        );
    }
    // Each once.
    let several = [Command::Save, Command::Save, unfiltered(), Command::Save, better(), Command::Save];
    assert_eq!(of(Quality::Paper, &several, false), (true, vec![PAPER, none]));
    let several = [Command::Restart, Command::Save, unfiltered(), Command::Save];
    let none = (Denoiser::None, Quality::Standard);
    assert_eq!(of(Quality::Standard, &several, false), (false, vec![STANDARD, none]));

    // Sample vectors that its filter needs are kept no more.
    let vain = [Command::Restart, Command::Save, unfiltered()];
    assert_eq!(of(Quality::Paper, &vain, false).1, []);
    // A filter that needs sample vectors waits for some.
    let (before, saved) = saved_of(Quality::Standard, &[better(), Command::Save], false);
    let [(samples, PAPER)] = saved[..] else { panic!("{saved:?}") };
    assert!((SIDE * SIDE..before).contains(&samples), "{samples}");
}

/// At the end, too, where an image is there already.
#[test]
fn what_is_saved_of_a_finished_render_is_made_by_the_filter_that_is_chosen() {
    let (asked, saved) = (Cell::new(0), RefCell::new(Vec::new()));
    let all = u64::from(SPP) * SIDE * SIDE;
    let moments = Moments {
        stepped: &|_, _, _| (),
        kept: &|settings, memory, hub| {
            // Before the last pass of the first render, and of that which the new filter begins.
            if memory.store.samples() == all
                && asked.get() < 2
                && asked.get() == usize::from(settings.quality == Quality::Paper)
            {
                asked.set(asked.get() + 1);
                assert!(hub.send(Command::Save));
                if asked.get() == 1 {
                    let change =
                        SettingsChange { quality: Some(Quality::Paper), ..SettingsChange::default() };
                    assert!(hub.send(Command::ChangeSettings(change)) && hub.send(Command::Save));
                }
            }
        },
        saved: &|picture| saved.borrow_mut().push(picture.made_by.1),
    };
    let settings = Settings { sampling: Sampling::Uniform, ..of_spp(SPP) };
    let outcome = directed_by(&settings, false, moments).expect("it ends by its budget");
    assert_eq!(outcome.settings.quality, Quality::Paper);
    let saved = saved.into_inner();
    assert_eq!(saved[..2], [Quality::Standard, Quality::Paper], "{saved:?}");
}

#[test]
fn a_state_that_could_not_be_kept_is_not_said_to_be() {
    let restarted = Cell::new(false);
    let moments = Moments {
        stepped: &|progress, hub, _| {
            if progress.spp >= 2.0 && !restarted.replace(true) {
                assert!(hub.send(Command::Restart));
            }
        },
        kept: &|_, _, _| (),
        saved: &|_| unreachable!("nobody asked for it"),
    };
    let (_, told) = directed_on(&|| Err("the disk is full".to_owned()), &of_spp(SPP), false, moments);
    assert!(
        told.contains(r#""text":"the disk is full; of what begins now none is kept","is_problem":true"#),
        "{told}"
    );
    assert!(told.contains(r#""text":"the disk is full","is_problem":true"#), "{told}");
}

/// Whatever begins a render anew leaves the memory as it was then.
#[track_caller]
fn begins_anew_and_keeps_no_more(command: impl Fn() -> Command) {
    let given = Cell::new(false);
    let (before, after) = (Cell::new(0), RefCell::new(Vec::new()));
    let outcome = directed(Moments {
        stepped: &|progress, hub, _| {
            if progress.spp >= 2.0 && !given.replace(true) {
                before.set(progress.samples);
                assert!(hub.send(command()));
            }
        },
        kept: &|_, memory, _| {
            if given.get() {
                after.borrow_mut().push(memory.store.samples());
            }
        },
        saved: &|_| unreachable!("nobody asked for it"),
    });
    assert!(given.get());
    // The last one is of the scene's own view, as far as it came.
    assert_eq!(after.into_inner(), [before.get()]);
    assert!(before.get() < outcome.store.samples());
    assert_eq!(outcome.store.samples(), u64::from(SPP) * SIDE * SIDE);
}

#[test]
fn once_the_camera_is_moved_no_memory_is_kept_of_what_it_sees() {
    let step = CameraMove { orbit: Some([0.3, 0.1]), ..CameraMove::default() };
    begins_anew_and_keeps_no_more(|| Command::MoveCamera(step.clone()));
}

#[test]
fn a_filter_chosen_while_another_runs_makes_the_image() {
    let outcome = directed(Moments {
        stepped: &|_, _, _| (),
        // All samples are there, and the last pass comes next: it is under way when this is heard.
        kept: &|settings, memory, hub| {
            let all = memory.store.samples() == u64::from(SPP) * SIDE * SIDE;
            if all && settings.denoiser == Denoiser::Prpf {
                let change = SettingsChange { denoiser: Some(Denoiser::None), ..SettingsChange::default() };
                assert!(hub.send(Command::ChangeSettings(change)));
            }
        },
        saved: &|_| unreachable!("nobody asked for it"),
    });
    assert_eq!(outcome.settings.denoiser, Denoiser::None);
    let means = outcome.store.means(crate::stats::Part::Whole, outcome.store.layout().radiance());
    assert!(outcome.filtered.image == means);
}

#[test]
fn samples_that_were_kept_are_not_replaced_by_those_of_another_start() {
    begins_anew_and_keeps_no_more(|| Command::Restart);
    // It needs sample vectors, which so far none were kept of.
    let paper = || SettingsChange { quality: Some(Quality::Paper), ..SettingsChange::default() };
    begins_anew_and_keeps_no_more(|| Command::ChangeSettings(paper()));
}

#[test]
fn a_filter_that_needs_more_memory_than_there_is_is_refused_and_the_render_goes_on() {
    let asked = Cell::new(false);
    let outcome = directed(Moments {
        stepped: &|_, hub, _| {
            if !asked.replace(true) {
                // Without a budget of samples, random parameter filtering would keep any number of them.
                let change = SettingsChange {
                    denoiser: Some(Denoiser::Rpf),
                    spp: Some(0),
                    ..SettingsChange::default()
                };
                assert!(hub.send(Command::ChangeSettings(change)));
            }
        },
        kept: &|_, _, _| (),
        saved: &|_| unreachable!("nobody asked for it"),
    });
    assert_eq!(outcome.store.samples(), u64::from(SPP) * SIDE * SIDE);
    assert_eq!(outcome.store.capacity(), 0);
}

#[test]
fn a_movement_after_an_interruption_does_not_throw_the_render_away() {
    let had = Cell::new(0);
    let outcome = directed(Moments {
        stepped: &|progress, hub, interrupt| {
            if progress.spp >= f64::from(SPP) && !interrupt.swap(true, Ordering::Relaxed) {
                had.set(progress.samples);
                assert!(hub.send(Command::MoveCamera(CameraMove {
                    orbit: Some([0.3, 0.1]),
                    ..CameraMove::default()
                })));
            }
        },
        kept: &|_, _, _| (),
        saved: &|_| unreachable!("nobody asked for it"),
    });
    assert_eq!((had.get(), outcome.store.samples()), (u64::from(SPP) * SIDE * SIDE, had.get()));
}

#[test]
fn a_pause_keeps_a_memory_and_costs_no_sample() {
    let paused = Cell::new(false);
    let at_rest = RefCell::new(Vec::new());
    let outcome = directed(Moments {
        stepped: &|progress, hub, _| {
            if progress.spp >= 3.0 && !paused.replace(true) {
                assert!(hub.send(Command::Pause(true)));
            }
        },
        kept: &|settings, memory, hub| {
            let during = paused.get() && memory.store.samples() < u64::from(SPP) * SIDE * SIDE;
            if during && at_rest.borrow().is_empty() {
                at_rest.borrow_mut().push((settings.sampling, memory.store.samples()));
                // Settings are followed at rest, an image is saved, and then it goes on.
                let change =
                    SettingsChange { sampling: Some(Sampling::Adaptive), ..SettingsChange::default() };
                assert!(hub.send(Command::ChangeSettings(change)) && hub.send(Command::Save));
            } else if during && at_rest.borrow().len() == 1 {
                at_rest.borrow_mut().push((settings.sampling, memory.store.samples()));
                assert!(hub.send(Command::Pause(false)));
            }
        },
        saved: &|picture| assert_eq!(picture.store.samples(), at_rest.borrow()[0].1),
    });
    let at_rest = at_rest.into_inner();
    assert_eq!(
        at_rest.iter().map(|rest| rest.0).collect::<Vec<_>>(),
        [Sampling::Uniform, Sampling::Adaptive]
    );
    assert_eq!(at_rest[0].1, at_rest[1].1, "no sample while it rests");
    assert_eq!(outcome.store.samples(), u64::from(SPP) * SIDE * SIDE);
    assert_eq!(outcome.settings.sampling, Sampling::Adaptive, "what was steered is what is reported");
}

#[test]
fn closing_while_an_image_is_saved_keeps_what_there_was() {
    let (asked, had, saved) = (Cell::new(false), Cell::new(0), Cell::new(0));
    let kept = RefCell::new(Vec::new());
    // A filter that takes long enough to be interrupted.
    let settings = Settings { quality: Quality::Paper, ..of_spp(64) };
    let moments = Moments {
        stepped: &|progress, hub, interrupt| {
            if progress.spp >= 9.0 && !asked.replace(true) {
                had.set(progress.samples);
                assert!(hub.send(Command::Save));
                let interrupt = interrupt.clone();
                std::thread::spawn(move || {
                    std::thread::sleep(Duration::from_millis(20));
                    interrupt.store(true, Ordering::Relaxed);
                });
            }
        },
        kept: &|_, memory, _| kept.borrow_mut().push(memory.store.samples()),
        saved: &|picture| {
            assert_eq!(picture.store.samples(), had.get());
            saved.set(saved.get() + 1);
        },
    };
    assert!(directed_by(&settings, true, moments).is_none());
    assert_eq!(saved.get(), 1, "whoever wants it sooner says so again");
    assert!(kept.into_inner().last().is_some_and(|&last| last >= had.get()));
}

#[test]
fn another_filter_chosen_at_a_pause_makes_an_image_and_forgets_the_error_of_the_first() {
    let (paused, rested) = (Cell::new(false), Cell::new(0));
    let settings = of_spp(64);
    let moments = Moments {
        stepped: &|progress, hub, _| {
            if progress.estimate.is_some() && !paused.replace(true) {
                assert!(hub.send(Command::Pause(true)));
            }
        },
        kept: &|settings, memory, hub| {
            if !paused.get() || rested.get() == 2 {
                return;
            }
            rested.set(rested.get() + 1);
            if rested.get() == 1 {
                assert!(memory.estimate.is_some() && memory.rerun.is_some());
                let change = SettingsChange { denoiser: Some(Denoiser::None), ..SettingsChange::default() };
                assert!(hub.send(Command::ChangeSettings(change)));
            } else {
                assert_eq!(settings.denoiser, Denoiser::None);
                assert!(memory.estimate.is_none() && memory.rerun.is_none());
                assert!(hub.send(Command::Pause(false)));
            }
        },
        saved: &|_| unreachable!("nobody asked for it"),
    };
    let outcome = directed_by(&settings, false, moments).expect("it ends by its budget");
    assert_eq!((rested.get(), outcome.settings.denoiser), (2, Denoiser::None));
    assert_eq!(outcome.store.samples(), 64 * SIDE * SIDE);
}
