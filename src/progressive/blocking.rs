//! The driver of the command line: performs one action after the other on the calling thread.

use super::action::Action;
use super::host::Host;
use super::record::Outcome;
use super::render_loop::RenderLoop;
use super::situation::Conditions;

/// Runs a render to its end.
pub fn run(mut render_loop: RenderLoop, host: &mut dyn Host) -> Outcome {
    loop {
        let conditions = Conditions {
            is_interrupted: host.is_interrupted(),
            is_watched: false,
            longest_step: None,
            checkpoint_interval: host.checkpoint_interval(),
        };
        match render_loop.next_action(&conditions) {
            Action::Filter(denoiser) => {
                let pass = render_loop.interim_pass(denoiser);
                let filtered = render_loop.run_pass(pass);
                host.complete_pass(&filtered, render_loop.store());
                render_loop.complete_interim(filtered);
            }
            Action::Finish(stopped_by) => {
                render_loop.save(host);
                let pass = render_loop.final_pass(&conditions, stopped_by);
                let filtered = render_loop.run_pass(pass);
                host.complete_pass(&filtered, render_loop.store());
                return render_loop.finish(filtered, stopped_by);
            }
            action => {
                let renders = matches!(action, Action::Render { .. });
                render_loop.perform(action, host);
                if renders {
                    host.listen(&render_loop.progress());
                }
            }
        }
    }
}
