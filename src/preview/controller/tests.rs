use std::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use super::*;
use crate::adaptive::Sampling;
use crate::filter::{DEFAULT, Denoiser, UNFILTERED, find, prpf, rpf};
use crate::geometry::Accel;
use crate::preview::camera_move::CameraMove;
use crate::preview::command::Command;
use crate::preview::configuration::SavedImage;
use crate::preview::history::HistoryStep;
use crate::preview::settings_change::SettingsChange;
use crate::preview::view::View;
use crate::preview::viewer::Viewer;
use crate::progressive::{Budget, Progress};
use crate::render::Renderer;
use crate::scene::pbrt;

mod after_the_end;
mod denoisers;
mod movements;
mod saved_images;

const SIDE: u64 = 48;

const SPP: u32 = 8;

/// A reaction to a step; takes the progress, the hub and the flag that interrupts the render.
type AfterStep<'a> = dyn Fn(&Progress, &Arc<Hub>, &Arc<AtomicBool>) + 'a;

/// Reactions to the events of a render.
struct Reactions<'a> {
    stepped: &'a AfterStep<'a>,
    checkpoint: &'a dyn Fn(&Settings, Checkpoint, &Hub),
    saved: &'a dyn Fn(&SavedImage),
}

/// A host that reacts, with a disk that may be full.
struct TestHost<'a> {
    reactions: Reactions<'a>,
    disk: &'a dyn Fn() -> Result<(), String>,
    hub: Arc<Hub>,
    interrupt: Arc<AtomicBool>,
}

impl Host for TestHost<'_> {
    fn listen(&mut self, progress: &Progress) {
        (self.reactions.stepped)(progress, &self.hub, &self.interrupt);
    }

    fn is_interrupted(&self) -> bool {
        self.interrupt.load(Ordering::Relaxed)
    }

    fn checkpoint_interval(&self) -> Option<f64> {
        Some(0.0)
    }

    fn save(&mut self, settings: &Settings, checkpoint: Checkpoint) {
        (self.reactions.checkpoint)(settings, checkpoint, &self.hub);
    }
}

impl PreviewHost for TestHost<'_> {
    fn write_image(&mut self, image: &SavedImage) -> Result<Vec<PathBuf>, String> {
        (self.reactions.saved)(image);
        (self.disk)().map(|()| Vec::new())
    }

    fn checkpoint_problem(&mut self) -> Option<String> {
        (self.disk)().err()
    }

    fn wait_for_checkpoint(&mut self) -> Result<(), String> {
        (self.disk)()
    }
}

/// Renders a small scene to its budget, with as many checkpoints as possible.
fn render(reactions: Reactions) -> Outcome {
    let settings = Settings { sampling: Sampling::Uniform, ..with_spp(SPP) };
    render_with(&settings, false, reactions).expect("it ends by its budget")
}

fn with_spp(spp: u32) -> Settings {
    Settings { budget: Budget { spp: Some(spp), ..Budget::default() }, ..Settings::default() }
}

/// As [`render`]; a preview that `stays` has no outcome.
fn render_with(settings: &Settings, stays: bool, reactions: Reactions) -> Option<Outcome> {
    render_on(&|| Ok(()), settings, stays, reactions).outcome
}

/// How a render has ended.
struct Ended {
    outcome: Option<Outcome>,
    /// The last status.
    status: Arc<str>,
    /// Why images were not saved in the end.
    unsaved: Vec<String>,
}

/// As [`render_with`], with a disk that may be full.
fn render_on(
    disk: &dyn Fn() -> Result<(), String>,
    settings: &Settings,
    stays: bool,
    reactions: Reactions,
) -> Ended {
    let text = include_str!("../../../experiments/stability/cases/noisy.pbrt");
    let scene = pbrt::read_str(text, Path::new(".")).unwrap();
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, settings.seed);
    let hub = Arc::new(Hub::default());
    let interrupt = Arc::new(AtomicBool::new(false));
    let mut host = TestHost { reactions, disk, hub: hub.clone(), interrupt };
    let configuration = Configuration {
        scene: &scene,
        renderer: &renderer,
        settings: settings.clone(),
        outputs: BlockSet::NONE,
        reference: None,
        checkpoint: None,
        session: None,
        notice: None,
        start: Instant::now(),
        stays,
        host: &mut host,
    };
    let (end, unsaved) = Controller::new(hub.clone(), configuration).run();
    let outcome = match end {
        ControllerEnd::Finished(outcome, _) => Some(*outcome),
        ControllerEnd::Closed | ControllerEnd::Opens(..) => None,
    };
    let status = hub.status().borrow().clone();
    Ended { outcome, status, unsaved }
}

/// Chooses a method, or a method and a preset.
fn choose(denoiser: &dyn Denoiser) -> Command {
    let name = denoiser.name();
    Command::ChangeSettings(SettingsChange {
        denoiser: Some(name.method.to_owned()),
        quality: name.preset.map(str::to_owned),
        ..SettingsChange::default()
    })
}

#[test]
fn a_state_that_could_not_be_kept_is_not_said_to_be() {
    let restarted = Cell::new(false);
    let moments = Reactions {
        stepped: &|progress, hub, _| {
            if progress.spp >= 2.0 && !restarted.replace(true) {
                assert!(hub.send(Command::Restart));
            }
        },
        checkpoint: &|_, _, _| (),
        saved: &|_| unreachable!("nobody asked for it"),
    };
    let told = render_on(&|| Err("the disk is full".to_owned()), &with_spp(SPP), false, moments).status;
    assert!(
        told.contains(r#""text":"the disk is full; the new render is not saved to it","is_problem":true"#),
        "{told}"
    );
    assert!(told.contains(r#""text":"the disk is full","is_problem":true"#), "{told}");
}

/// Whatever begins a render anew leaves the memory as it was then.
#[track_caller]
fn begins_anew_and_keeps_no_more(command: impl Fn() -> Command) {
    let given = Cell::new(false);
    let (before, after) = (Cell::new(0), RefCell::new(Vec::new()));
    let outcome = render(Reactions {
        stepped: &|progress, hub, _| {
            if progress.spp >= 2.0 && !given.replace(true) {
                before.set(progress.samples);
                assert!(hub.send(command()));
            }
        },
        checkpoint: &|_, checkpoint, _| {
            if given.get() {
                after.borrow_mut().push(checkpoint.store.samples());
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
fn samples_that_were_kept_are_not_replaced_by_those_of_another_start() {
    begins_anew_and_keeps_no_more(|| Command::Restart);
    // It needs sample vectors, which so far none were kept of.
    begins_anew_and_keeps_no_more(|| choose(&prpf::PRPF));
}

#[test]
fn a_movement_after_an_interruption_does_not_throw_the_render_away() {
    let had = Cell::new(0);
    let outcome = render(Reactions {
        stepped: &|progress, hub, interrupt| {
            if progress.spp >= f64::from(SPP) && !interrupt.swap(true, Ordering::Relaxed) {
                had.set(progress.samples);
                assert!(hub.send(Command::MoveCamera(CameraMove {
                    orbit: Some([0.3, 0.1]),
                    ..CameraMove::default()
                })));
            }
        },
        checkpoint: &|_, _, _| (),
        saved: &|_| unreachable!("nobody asked for it"),
    });
    assert_eq!((had.get(), outcome.store.samples()), (u64::from(SPP) * SIDE * SIDE, had.get()));
}

#[test]
fn a_pause_keeps_a_memory_and_costs_no_sample() {
    let paused = Cell::new(false);
    let at_rest = RefCell::new(Vec::new());
    let outcome = render(Reactions {
        stepped: &|progress, hub, _| {
            if progress.spp >= 3.0 && !paused.replace(true) {
                assert!(hub.send(Command::Pause(true)));
            }
        },
        checkpoint: &|settings, checkpoint, hub| {
            let during = paused.get() && checkpoint.store.samples() < u64::from(SPP) * SIDE * SIDE;
            if during && at_rest.borrow().is_empty() {
                at_rest.borrow_mut().push((settings.sampling, checkpoint.store.samples()));
                // Settings are followed at rest, an image is saved, and then it goes on.
                let change =
                    SettingsChange { sampling: Some(Sampling::Adaptive), ..SettingsChange::default() };
                assert!(hub.send(Command::ChangeSettings(change)) && hub.send(Command::Save));
            } else if during && at_rest.borrow().len() == 1 {
                at_rest.borrow_mut().push((settings.sampling, checkpoint.store.samples()));
                assert!(hub.send(Command::Pause(false)));
            }
        },
        saved: &|image| assert_eq!(image.store.samples(), at_rest.borrow()[0].1),
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
fn what_a_restart_replaces_comes_back_with_all_its_samples() {
    let (left, at_restart) = (Cell::new(0), Cell::new(0));
    let saved_samples = RefCell::new(Vec::new());
    let all = u64::from(SPP) * SIDE * SIDE;
    let outcome = render(Reactions {
        stepped: &|progress, hub, _| {
            if progress.samples == all && left.get() == 0 {
                // The last pass comes next; the render is worth keeping once it is finished.
                left.set(1);
            } else if left.get() == 2 && progress.spp >= 2.0 {
                left.set(3);
                assert!(hub.send(Command::Return(HistoryStep::Undo)));
            }
        },
        checkpoint: &|_, checkpoint, hub| {
            saved_samples.borrow_mut().push(checkpoint.store.samples());
            if left.get() == 1 && checkpoint.store.samples() == all {
                left.set(2);
                at_restart.set(checkpoint.store.samples());
                assert!(hub.send(Command::Restart));
            }
        },
        saved: &|_| unreachable!("nobody asked for it"),
    });
    assert_eq!(outcome.store.samples(), all);
    assert_eq!(at_restart.get(), all);
}
