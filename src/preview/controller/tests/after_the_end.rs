//! Commands that come when a render has ended, and several at once.

use super::*;

/// A command after the end, and time for it, before the program is closed.
fn command_after_the_end(hub: Arc<Hub>, interrupt: Arc<AtomicBool>, command: Command) {
    std::thread::spawn(move || {
        let mut viewer = Viewer::new(hub.clone());
        viewer.select(&[View::Filtered]);
        viewer.set_ready(true);
        while !hub.status().borrow().contains(r#""phase":"finished""#) {
            std::thread::sleep(Duration::from_millis(5));
        }
        assert!(hub.send(Command::Save) && hub.send(command));
        std::thread::sleep(Duration::from_millis(600));
        assert!(hub.send(Command::Save));
        interrupt.store(true, Ordering::Relaxed);
    });
}

#[test]
fn a_region_of_a_finished_render_leaves_its_image_as_it_is() {
    let (begun, saved) = (Cell::new(false), RefCell::new(Vec::new()));
    let reactions = Reactions {
        stepped: &|_, hub, interrupt| {
            if !begun.replace(true) {
                let region = Command::SetRegion(Some([[0.2, 0.7], [0.2, 0.7]]));
                command_after_the_end(hub.clone(), interrupt.clone(), region);
            }
        },
        checkpoint: &|_, _, _| (),
        saved: &|image| saved.borrow_mut().push(image.result.image.clone()),
    };
    assert!(render_with(&with_spp(SPP), true, reactions).is_none());
    let saved = saved.into_inner();
    assert!(saved.len() == 2 && saved[0] == saved[1], "{} images", saved.len());
}

#[test]
fn the_command_learns_of_an_image_that_was_not_saved_when_the_preview_was_closed() {
    let reactions = Reactions {
        stepped: &|progress, hub, interrupt| {
            if progress.spp >= 4.0 && !interrupt.swap(true, Ordering::Relaxed) {
                assert!(hub.send(Command::Save));
            }
        },
        checkpoint: &|_, _, _| (),
        saved: &|_| (),
    };
    let closed = render_on(&|| Err("the disk is full".to_owned()), &with_spp(SPP), true, reactions);
    assert!(closed.outcome.is_none());
    assert_eq!(closed.unsaved, ["not saved: the disk is full"]);
}

/// Waits until the status is as it should be, for some seconds at most.
fn wait_for(hub: &Hub, is_right: impl Fn(&serde_json::Value) -> bool) {
    let started = Instant::now();
    let is_there = || {
        serde_json::from_str::<serde_json::Value>(&hub.status().borrow())
            .is_ok_and(|status| is_right(&status))
    };
    while !is_there() && started.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Finishes a render and two that restarts begin; then gives commands at once. Returns the last status.
fn after_two_restarts(commands: &[Command]) -> serde_json::Value {
    let (begun, commands) = (Cell::new(false), commands.to_vec());
    let script = |hub: Arc<Hub>, interrupt: Arc<AtomicBool>| {
        let commands = commands.clone();
        std::thread::spawn(move || {
            let finishes = |generation: u64| {
                wait_for(&hub, |status| status["phase"] == "finished" && status["generation"] == generation);
            };
            for generation in 1..=2 {
                finishes(generation);
                assert!(hub.send(Command::Restart));
            }
            finishes(3);
            commands.into_iter().for_each(|command| assert!(hub.send(command)));
            // Each command begins a generation.
            finishes(5);
            interrupt.store(true, Ordering::Relaxed);
        });
    };
    let reactions = Reactions {
        stepped: &|_, hub, interrupt| {
            if !begun.replace(true) {
                script(hub.clone(), interrupt.clone());
            }
        },
        checkpoint: &|_, _, _| (),
        saved: &|_| unreachable!("nobody asked for it"),
    };
    let ended = render_on(&|| Ok(()), &with_spp(SPP), true, reactions);
    serde_json::from_str(&ended.status).unwrap()
}

#[test]
fn commands_that_come_at_once_are_carried_out_one_after_the_other() {
    let undo = || Command::Return(HistoryStep::Undo);
    let moved = Command::MoveCamera(CameraMove { orbit: Some([0.3, 0.1]), ..CameraMove::default() });
    let twice = after_two_restarts(&[undo(), undo()]);
    assert!(twice["generation"] == 5 && twice["history"]["undo"].is_null(), "{twice}");
    // The first render is before the one that the undo brings back, and that one before the moved one.
    let after = after_two_restarts(&[undo(), moved.clone()]);
    assert!(after["generation"] == 5 && after["history"]["redo"].is_null(), "{after}");
    let before = after_two_restarts(&[moved, undo()]);
    assert!(before["generation"] == 5 && before["history"]["undo"].is_string(), "{before}");
}
