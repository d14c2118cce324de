//! Another denoiser, chosen while a render goes on.

use super::*;

#[test]
fn a_filter_chosen_while_another_runs_makes_the_image() {
    let outcome = render(Reactions {
        stepped: &|_, _, _| (),
        // All samples are there, and the last pass comes next: it is under way when this is heard.
        checkpoint: &|settings, checkpoint, hub| {
            let all = checkpoint.store.samples() == u64::from(SPP) * SIDE * SIDE;
            if all && settings.denoiser != UNFILTERED {
                assert!(hub.send(choose(UNFILTERED)));
            }
        },
        saved: &|_| unreachable!("nobody asked for it"),
    });
    assert_eq!(outcome.settings.denoiser, UNFILTERED);
    let means = outcome.store.means(crate::stats::Part::Whole, outcome.store.layout().radiance());
    assert!(outcome.result.image == means);
}

#[test]
fn a_filter_that_needs_more_memory_than_there_is_is_refused_and_the_render_goes_on() {
    let asked = Cell::new(false);
    let outcome = render(Reactions {
        stepped: &|_, hub, _| {
            if !asked.replace(true) {
                // Without a budget of samples, random parameter filtering would keep any number of them.
                let change = SettingsChange {
                    denoiser: Some(rpf::RPF.name().method.to_owned()),
                    spp: Some(0),
                    ..SettingsChange::default()
                };
                assert!(hub.send(Command::ChangeSettings(change)));
            }
        },
        checkpoint: &|_, _, _| (),
        saved: &|_| unreachable!("nobody asked for it"),
    });
    assert_eq!(outcome.store.samples(), u64::from(SPP) * SIDE * SIDE);
    assert_eq!(outcome.store.capacity(), 0);
}

#[test]
fn another_filter_chosen_at_a_pause_makes_an_image_and_forgets_the_error_of_the_first() {
    let (paused, rested) = (Cell::new(false), Cell::new(0));
    let settings = with_spp(64);
    let moments = Reactions {
        stepped: &|progress, hub, _| {
            if progress.estimate.is_some() && !paused.replace(true) {
                assert!(hub.send(Command::Pause(true)));
            }
        },
        checkpoint: &|settings, checkpoint, hub| {
            if !paused.get() || rested.get() == 2 {
                return;
            }
            rested.set(rested.get() + 1);
            if rested.get() == 1 {
                assert!(checkpoint.interim.is_some());
                assert!(hub.send(choose(UNFILTERED)));
            } else {
                assert_eq!(settings.denoiser, UNFILTERED);
                assert!(checkpoint.interim.is_none());
                assert!(hub.send(Command::Pause(false)));
            }
        },
        saved: &|_| unreachable!("nobody asked for it"),
    };
    let outcome = render_with(&settings, false, moments).expect("it ends by its budget");
    assert_eq!((rested.get(), outcome.settings.denoiser), (2, UNFILTERED));
    assert_eq!(outcome.store.samples(), 64 * SIDE * SIDE);
}
