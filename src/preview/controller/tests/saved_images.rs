//! What a viewer saves.

use super::*;

#[test]
fn what_is_asked_for_during_the_last_pass_is_saved() {
    let saved = RefCell::new(Vec::new());
    let outcome = render(Reactions {
        stepped: &|_, _, _| (),
        // The last memory is kept when all samples are there, and the last pass comes next.
        checkpoint: &|_, checkpoint, hub| {
            if checkpoint.store.samples() == u64::from(SPP) * SIDE * SIDE {
                assert!(hub.send(Command::Save));
            }
        },
        saved: &|image| {
            saved.borrow_mut().push((image.store.samples(), image.result.image.clone()));
        },
    });
    assert!(saved.into_inner() == [(outcome.store.samples(), outcome.result.image)]);
}

/// Renders by this denoiser while these commands come at once, when there are 16 samples per pixel, and the program is
/// closed then if it `stays`; returns the samples of then, and samples and denoiser of the images that were saved.
fn saved_images(
    denoiser: &'static dyn Denoiser,
    commands: &[Command],
    stays: bool,
) -> (u64, Vec<(u64, String)>) {
    let (sent, saved) = (Cell::new(0), RefCell::new(Vec::new()));
    let reactions = Reactions {
        stepped: &|progress, hub, interrupt| {
            if progress.spp >= 16.0 && sent.get() == 0 {
                sent.set(progress.samples);
                commands.iter().for_each(|command| assert!(hub.send(command.clone())));
                interrupt.store(stays, Ordering::Relaxed);
            }
        },
        checkpoint: &|_, _, _| (),
        saved: &|image| {
            saved.borrow_mut().push((image.store.samples(), image.result.made_by.to_string()));
        },
    };
    let settings = Settings { sampling: Sampling::Uniform, denoiser, ..with_spp(32) };
    assert_eq!(render_with(&settings, stays, reactions).is_none(), stays);
    (sent.get(), saved.into_inner())
}

#[test]
fn what_is_saved_is_the_image_of_when_that_was_said() {
    const PRPF: &str = "prpf";
    const NLM: &str = "nlm standard";
    const DRAFT: &str = "nlm draft";
    const NONE: &str = "none";
    let nlm = find("nlm", None).unwrap();
    let (unfiltered, better) = (|| choose(UNFILTERED), || choose(&prpf::PRPF));
    let moved = || Command::MoveCamera(CameraMove { orbit: Some([0.3, 0.1]), ..CameraMove::default() });
    let saved = |denoiser, commands: &[Command], stays| {
        let (before, saved) = saved_images(denoiser, commands, stays);
        // The draft filters few samples; other images have some of every pixel.
        let range = |made_by: &str| match made_by {
            DRAFT => SIDE * SIDE / 16..SIDE * SIDE,
            _ => SIDE * SIDE..before,
        };
        let all_new = saved.iter().all(|(samples, made_by)| range(made_by).contains(samples));
        let all_old = saved.iter().all(|&(samples, _)| samples == before);
        assert!(all_new || all_old, "{before} {saved:?}");
        (all_old, saved.into_iter().map(|(_, made_by)| made_by).collect::<Vec<_>>())
    };
    let names = |names: &[&str]| names.iter().map(|name| name.to_string()).collect::<Vec<_>>();
    // Whatever comes after it.
    for next in [Command::Restart, moved(), unfiltered()] {
        assert_eq!(saved(&prpf::PRPF, &[Command::Save, next], false), (true, names(&[PRPF])));
    }
    assert_eq!(saved(&prpf::PRPF, &[Command::Save], true), (true, names(&[PRPF])));
    // After a command that discards the samples, the first image of the new generation, by the denoiser of then.
    assert_eq!(saved(&prpf::PRPF, &[unfiltered(), Command::Save], false), (true, names(&[NONE])));
    for first in [Command::Restart, moved()] {
        assert_eq!(saved(nlm, &[first, Command::Save, unfiltered()], false), (false, names(&[DRAFT])));
    }
    // Each once.
    let several =
        [Command::Save, Command::Save, unfiltered(), Command::Save, choose(UNFILTERED), Command::Save];
    assert_eq!(saved(&prpf::PRPF, &several, false), (true, names(&[PRPF, NONE])));
    let several = [Command::Restart, Command::Save, unfiltered(), Command::Save];
    assert_eq!(
        saved(nlm, &several, false),
        (false, names(&[NLM, NONE])),
        "one waits for the samples of the other"
    );

    // Sample vectors that its denoiser needs are no longer kept.
    let vain = [Command::Restart, Command::Save, unfiltered()];
    assert!(saved(&prpf::PRPF, &vain, false).1.is_empty());
    // A denoiser that needs sample vectors waits for some.
    let (before, saved) = saved_images(nlm, &[better(), Command::Save], false);
    let [(samples, made_by)] = &saved[..] else { panic!("{saved:?}") };
    assert!((SIDE * SIDE..before).contains(samples) && made_by == PRPF, "{saved:?}");
}

/// At the end, too, where an image is there already.
#[test]
fn what_is_saved_of_a_finished_render_is_made_by_the_denoiser_that_is_chosen() {
    let (requested, saved) = (Cell::new(0), RefCell::new(Vec::new()));
    let all = u64::from(SPP) * SIDE * SIDE;
    let reactions = Reactions {
        stepped: &|_, _, _| (),
        checkpoint: &|settings, checkpoint, hub| {
            // Before the last pass of the first render, and of that which the new denoiser begins.
            if checkpoint.store.samples() == all
                && requested.get() < 2
                && requested.get() == usize::from(settings.denoiser.name() == prpf::PRPF.name())
            {
                requested.set(requested.get() + 1);
                assert!(hub.send(Command::Save));
                if requested.get() == 1 {
                    assert!(hub.send(choose(&prpf::PRPF)) && hub.send(Command::Save));
                }
            }
        },
        saved: &|image| saved.borrow_mut().push(image.result.made_by),
    };
    let settings = Settings { sampling: Sampling::Uniform, ..with_spp(SPP) };
    let outcome = render_with(&settings, false, reactions).expect("it ends by its budget");
    assert_eq!(outcome.settings.denoiser.name(), prpf::PRPF.name());
    let saved = saved.into_inner();
    assert_eq!(saved[..2], [DEFAULT.name(), prpf::PRPF.name()], "{saved:?}");
}

#[test]
fn closing_while_an_image_is_saved_keeps_what_there_was() {
    let (asked, had, saved) = (Cell::new(false), Cell::new(0), Cell::new(0));
    let kept = RefCell::new(Vec::new());
    // A filter that takes long enough to be interrupted.
    let settings = Settings { denoiser: &prpf::PRPF, ..with_spp(64) };
    let moments = Reactions {
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
        checkpoint: &|_, checkpoint, _| kept.borrow_mut().push(checkpoint.store.samples()),
        saved: &|image| {
            assert_eq!(image.store.samples(), had.get());
            saved.set(saved.get() + 1);
        },
    };
    assert!(render_with(&settings, true, moments).is_none());
    assert_eq!(saved.get(), 1, "whoever wants it sooner says so again");
    assert!(kept.into_inner().last().is_some_and(|&last| last >= had.get()));
}
