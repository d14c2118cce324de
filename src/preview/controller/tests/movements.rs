//! Movements of the camera that keep coming.

use super::*;

/// Moves the camera after each of some steps, and returns how many images a viewer could have had meanwhile.
fn images_while_moving(step: &CameraMove) -> usize {
    const STEPS: usize = 12;
    let (steps, viewer, newest) = (Cell::new(0), RefCell::new(None), RefCell::new(Vec::new()));
    let stepped = |_: &Progress, hub: &Arc<Hub>, interrupt: &Arc<AtomicBool>| {
        let mut viewer = viewer.borrow_mut();
        viewer.get_or_insert_with(|| {
            let mut viewer = Viewer::new(hub.clone());
            viewer.select(&[View::Raw]);
            viewer.set_ready(true);
            viewer
        });
        newest.borrow_mut().extend(hub.newest(View::Raw));
        steps.set(steps.get() + 1);
        match steps.get() {
            STEPS => interrupt.store(true, Ordering::Relaxed),
            _ => assert!(hub.send(Command::MoveCamera(step.clone()))),
        }
    };
    let reactions = Reactions { stepped: &stepped, checkpoint: &|_, _, _| {}, saved: &|_| {} };
    render_with(&with_spp(1 << 16), true, reactions);
    newest.borrow_mut().dedup();
    newest.take().len()
}

#[test]
fn images_are_shown_of_each_view_that_a_moving_camera_passes() {
    let turn = CameraMove { orbit: Some([0.05, 0.0]), ..CameraMove::default() };
    let images = images_while_moving(&turn);
    assert!(images >= 8, "{images} of 11");
}

#[test]
fn a_movement_that_changes_nothing_leaves_the_image_on_show() {
    assert!(images_while_moving(&CameraMove::default()) >= 1);
}
