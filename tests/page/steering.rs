//! Keys, pointer and touch.

use super::*;
use crate::browser::chromium;

#[test]
fn the_page_shows_and_steers_a_render() {
    let Some(program) = chromium() else { return };
    let (_render, address, folder) = preview(&["--spp", "0", "--max-spp", "100000"]);
    let mut page = Page::open(program, &address, [1600, 1000]);

    // The page loads, and an image is on it, raw first, then filtered.
    page.wait("window.prpf && window.prpf.viewport.frames.size > 0");
    page.wait("window.prpf.viewport.frames.has('filtered')");
    page.wait("window.prpf.viewport.shown.right === 'filtered'");
    page.wait("window.prpf.viewport.drawn > 0");
    assert!(brightness(&mut page) > 1.0, "the graphics card shows something");

    // The image changes as samples come.
    page.key("2");
    page.wait("window.prpf.viewport.shown.right === 'raw' && window.prpf.viewport.frames.has('raw')");
    let before = page.value("window.prpf.viewport.frames.get('raw').sequence");
    let samples = page.value(SAMPLES);
    page.wait(&format!("window.prpf.viewport.frames.get('raw').sequence > {before}"));
    page.wait(&format!("{SAMPLES} > {samples}"));

    // Another view: sample counts, with a legend in their unit.
    page.click("input[value=samples]");
    page.wait("window.prpf.viewport.frames.has('samples')");
    page.wait("!document.getElementById('legend').hidden");
    let unit = page.value("document.querySelector('#legend p').textContent");
    assert_eq!(unit, "samples per pixel");

    for view in ["error", "variance", "residual", "failure", "albedo", "normal"] {
        page.click(&format!("input[name=view][value={view}]"));
        page.wait(&format!("window.prpf.viewport.shown.right === '{view}'"));
        page.wait(&format!("window.prpf.viewport.frames.has('{view}')"));
    }
    page.click("input[value=samples]");
    page.wait("window.prpf.viewport.shown.right === 'samples'");

    // Statistics, and the forecast of the error.
    page.wait("window.prpf.state.status.curve.length > 0 && window.prpf.state.status.forecast");
    page.wait("document.getElementById('forecast').textContent.startsWith('Halving the error takes')");
    page.wait("[...document.querySelectorAll('[data-value]')].every((dd) => dd.textContent !== '–')");

    // Values under the cursor.
    let middle = on_image(&mut page, [0.0, 0.0]);
    page.hover(middle);
    page.wait("window.prpf.state.values && window.prpf.state.values.samples > 0");
    page.wait("document.getElementById('values').textContent.includes('unfiltered')");

    // The exposure brightens what is shown without a new image.
    page.key("2");
    page.key(" ");
    page.wait(&format!("{PHASE} === 'paused'"));
    page.wait("window.prpf.viewport.shown.right === 'raw'");
    let dark = brightness(&mut page);
    page.key("e");
    assert!(brightness(&mut page) > dark * 1.02);

    // A pause: no more samples. Then it goes on.
    let samples = page.value(SAMPLES);
    std::thread::sleep(std::time::Duration::from_millis(600));
    assert_eq!(page.value(SAMPLES), samples);
    page.key(" ");
    page.wait(&format!("{SAMPLES} > {samples}"));

    // The camera follows the pointer, and a new image appears.
    let generation = page.value("window.prpf.state.status.generation");
    page.key("c");
    let (from, to) = (on_image(&mut page, [0.0, 0.0]), on_image(&mut page, [0.2, 0.1]));
    page.drag(&[from, [(from[0] + to[0]) / 2.0, from[1]], to]);
    page.wait(&format!("window.prpf.viewport.frames.get('raw').generation > {generation}"));

    // A click sets the focus: the sphere is nearer than the floor behind it.
    page.key("f");
    page.click("#aperture");
    page.value("document.getElementById('aperture').value = '0.1'; document.getElementById('aperture').dispatchEvent(new Event('change'))");
    page.wait("window.prpf.state.status.camera.aperture > 0.09");
    let at = on_image(&mut page, [0.0, 0.0]);
    page.drag(&[at]);
    page.wait("window.prpf.state.status.camera.focus < 3.6");
    let near = page.value("window.prpf.state.status.camera.focus").as_f64().unwrap();
    let behind = on_image(&mut page, [0.45, -0.05]);
    page.drag(&[behind]);
    page.wait(&format!("window.prpf.state.status.camera.focus > {}", near + 0.5));

    // A priority region is rendered first.
    page.key("r");
    let (from, to) = (on_image(&mut page, [-0.2, -0.2]), on_image(&mut page, [0.0, 0.0]));
    page.drag(&[from, to]);
    page.wait("window.prpf.state.status.region");
    page.wait("window.prpf.state.status.statistics.max > 4 * window.prpf.state.status.statistics.min");
    page.key("Escape");
    page.wait("!window.prpf.state.status.region");

    // Settings: denoiser off and on again.
    page.click("input[name=denoiser][value=none]");
    page.wait("window.prpf.state.status.settings.denoiser === 'none'");
    page.click("input[value=uniform]");
    page.wait("window.prpf.state.status.settings.sampling === 'uniform'");

    // A save.
    page.click("#save");
    page.wait("window.prpf.state.status.notices.some((n) => n.text.startsWith('saved'))");
    for name in ["named-0001.exr", "named-0001.png"] {
        assert!(folder.path().join(name).metadata().unwrap().len() > 100, "{name}");
    }

    // A restart forgets all samples.
    let generation = page.value("window.prpf.state.status.generation");
    page.click("#restart");
    page.wait(&format!("window.prpf.state.status.generation > {generation}"));

    // A budget that is spent ends it.
    page.value("document.getElementById('spp').value = '4'; document.getElementById('spp').dispatchEvent(new Event('change'))");
    page.wait(&format!("{PHASE} === 'finished'"));
    save_screenshot(&mut page, "wide.png");
    page.resize([420, 900]);
    page.wait("window.prpf.viewport.canvas.clientWidth <= 420");
    let overflow = page.value("document.documentElement.scrollWidth");
    assert!(overflow.as_f64().unwrap() <= 420.0, "{overflow}");
    save_screenshot(&mut page, "narrow.png");
}

#[test]
fn the_interpolation_map_is_made_for_a_viewer_whatever_the_denoiser() {
    let Some(program) = chromium() else { return };
    let (_render, address, _folder) = preview(&["--spp", "8", "--denoiser", "none", "--sampling", "uniform"]);
    let mut page = Page::open(program, &address, [900, 600]);
    page.wait("window.prpf && window.prpf.state.status?.phase === 'finished'");
    page.click("input[name=view][value=residual]");
    page.wait(
        "window.prpf.viewport.frames.has('residual') && window.prpf.viewport.shown.right === 'residual'",
    );
    page.click("input[name=view][value=failure]");
    page.wait("window.prpf.viewport.frames.has('failure') && window.prpf.viewport.shown.right === 'failure'");
    page.wait("window.prpf.state.status.phase === 'finished'");
}

#[test]
fn a_map_of_the_old_camera_is_not_shown_after_a_movement() {
    let Some(program) = chromium() else { return };
    let (_render, address, _folder) = preview(&["--spp", "0", "--max-spp", "100000"]);
    let mut page = Page::open(program, &address, [900, 600]);
    page.wait("window.prpf && window.prpf.state.status");
    page.click("input[name=view][value=error]");
    page.wait("window.prpf.viewport.frames.has('error') && window.prpf.viewport.shown.right === 'error'");
    // While paused without a denoiser, nothing makes such a map of the new image.
    page.click("input[name=denoiser][value=none]");
    page.wait("window.prpf.state.status.settings.denoiser === 'none'");
    page.click("#pause");
    page.wait(&format!("{PHASE} === 'paused'"));
    let generation = page.value(GENERATION);
    page.key("c");
    let (from, to) = (on_image(&mut page, [0.0, 0.0]), on_image(&mut page, [0.1, 0.0]));
    page.drag(&[from, to]);
    page.wait(&format!("{GENERATION} > {generation} && {PHASE} === 'paused'"));
    page.wait("window.prpf.viewport.shown.right === 'raw' && window.prpf.viewport.frames.has('raw')");
}

#[test]
fn keys_select_views_and_tools() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = recording_page(program, [1024, 768]);

    let views = page.value("window.prpf.state.status.views.map(({ view }) => view)");
    for (i, view) in views.as_array().expect("a list").iter().enumerate().rev() {
        page.key(&(i + 1).to_string());
        assert_eq!(page.value("window.prpf.state.view"), *view);
        assert_eq!(page.value("document.querySelector('input[name=view]:checked').value"), *view);
    }
    for (key, tool) in [("c", "camera"), ("f", "focus"), ("r", "region"), ("q", "inspect")] {
        page.key(key);
        assert_eq!(page.value(TOOL), tool);
        assert_eq!(page.value("document.querySelector('input[name=tool]:checked').value"), tool);
    }

    page.key("w");
    page.wait("!document.getElementById('wipe').hidden && window.prpf.viewport.shown.left === 'raw'");
    page.key(".");
    assert_eq!(page.value("window.prpf.viewport.wipe.toFixed(2)"), "0.55");
    page.key("w");
    page.wait("document.getElementById('wipe').hidden && window.prpf.viewport.wipe === null");
    page.key("e");
    assert_eq!(page.value(STOPS), "+0.3");
    page.shift_key("E");
    assert_eq!(page.value(STOPS), "0.0");

    // With Caps Lock the letters are capitals, but only Shift makes other commands of them.
    page.key("S");
    assert_eq!((sent(&mut page, "save"), sent(&mut page, "restart")), (1, 0));
    page.key("R");
    assert_eq!((page.value(TOOL), sent(&mut page, "restart")), ("region".into(), 0));
    page.key("E");
    assert_eq!(page.value(STOPS), "+0.3");
    page.shift_key("r");
    assert_eq!(sent(&mut page, "restart"), 1);

    // A key that is held down saves once.
    page.value("document.body.dispatchEvent(new KeyboardEvent('keydown', { key: 's', repeat: true, bubbles: true }))");
    assert_eq!(sent(&mut page, "save"), 1);
}

#[test]
fn space_pauses_unless_a_button_has_the_focus() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = recording_page(program, [1024, 768]);
    page.key(" ");
    page.wait("document.getElementById('pause').textContent === 'Resume'");
    page.wait(&format!("{PHASE} === 'paused'"));
    page.value("document.getElementById('pause').focus()");
    page.key(" ");
    page.wait(&format!("{PHASE} !== 'paused'"));
    assert_eq!(sent(&mut page, "pause"), 2, "once each time");
    page.value("document.getElementById('save').focus()");
    page.key(" ");
    assert_eq!((sent(&mut page, "save"), sent(&mut page, "pause")), (1, 2));
}

#[test]
fn the_home_key_resets_the_camera_except_in_a_field() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = recording_page(program, [1024, 768]);
    page.value(
        "const field = document.getElementById('aperture'); field.focus(); \
         field.value = '0.1'; field.dispatchEvent(new Event('change'))",
    );
    page.wait("window.prpf.state.status.camera.aperture > 0.09");
    page.key("Home");
    assert_eq!(sent(&mut page, "camera"), 1, "in a field it moves the caret");
    let generation = page.value(GENERATION);
    page.value("window.prpf.viewport.canvas.focus()");
    page.key("Home");
    page.wait(&format!("{GENERATION} > {generation} && window.prpf.state.status.camera.aperture === 0"));
    // What does not move the camera loses no sample.
    let generation = page.value(GENERATION);
    page.key("Home");
    page.wait("window.prpf.state.status.statistics.mean > 8");
    assert_eq!((page.value(GENERATION), sent(&mut page, "camera")), (generation, 3));
}

#[test]
fn two_fingers_move_the_image_or_the_camera() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = recording_page(program, [812, 375]);
    let [x, y] = on_image(&mut page, [0.0, 0.0]);
    let apart = |half: f64, down: f64| [[x - half, y + down], [x + half, y + down]];
    let double_and_lower = [apart(50.0, 0.0), apart(75.0, 10.0), apart(100.0, 30.0)];

    // The point between the fingers stays between them.
    let zoom = page.value("window.prpf.viewport.zoom").as_f64().expect("a number");
    page.pinch(&double_and_lower);
    let doubled = page.value("window.prpf.viewport.zoom").as_f64().expect("a number");
    assert!((doubled / zoom - 2.0).abs() < 1e-6, "{zoom} {doubled}");
    let [now_x, now_y] = on_image(&mut page, [0.0, 0.0]);
    assert!((now_x - x).abs() < 1e-6 && (now_y - y - 30.0).abs() < 1e-6, "{now_x} {now_y}");

    // Fingers that do not move make neither a click nor a region.
    for tool in ["f", "r"] {
        page.key(tool);
        page.pinch(&[apart(50.0, 0.0)]);
    }
    assert_eq!((sent(&mut page, "camera"), sent(&mut page, "priority-region")), (0, 0));
    assert_eq!(page.value("window.prpf.state.isPinned"), false);
    assert_eq!(page.value("document.getElementById('region').hidden"), true);

    page.key("0");
    page.key("c");
    let (zoom, generation) = (page.value("window.prpf.viewport.zoom"), page.value(GENERATION));
    page.pinch(&double_and_lower);
    page.wait(&format!("{GENERATION} > {generation}"));
    assert_eq!(page.value("window.prpf.viewport.zoom"), zoom);
    page.wait(
        "(() => { const p = window.prpf.viewport, sum = (f) => window.sent.reduce((a, m) => a + f(m), 0); \
         const down = sum((m) => m.pan?.[1] ?? 0) * p.size[1] * p.zoom; \
         return Math.abs(sum((m) => m.dolly ?? 0) - Math.LN2) < 1e-6 && Math.abs(down - 30) < 1e-6; })()",
    );
    save_screenshot(&mut page, "low.png");
}

#[test]
fn the_mouse_pans_and_dollies_the_camera_or_moves_the_image() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = recording_page(program, [1024, 768]);
    let middle = on_image(&mut page, [0.0, 0.0]);
    let to = [middle[0] + 40.0, middle[1] - 30.0];
    // In image heights.
    let sums = |page: &mut Page| {
        let sums = page.value(
            "(() => { const p = window.prpf.viewport, h = p.size[1] * p.zoom; \
             const sum = (f) => window.sent.reduce((a, m) => a + f(m), 0); \
             return [sum((m) => m.pan?.[0] ?? 0) * h, sum((m) => m.pan?.[1] ?? 0) * h, \
               sum((m) => m.dolly ?? 0) * h, sum((m) => m.orbit ? 1 : 0)]; })()",
        );
        [0, 1, 2, 3].map(|k| sums[k].as_f64().expect("a sum").round() as i32)
    };
    let moved = |page: &mut Page, sums_expected: [i32; 4]| {
        let started = std::time::Instant::now();
        while sums(page) != sums_expected {
            assert!(started.elapsed().as_secs() < 20, "{:?} for {sums_expected:?}", sums(page));
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
    };
    page.key("c");
    page.drag_with("left", 8, &[middle, to]);
    moved(&mut page, [40, -30, 0, 0]);
    page.drag_with("left", 2, &[middle, to]);
    moved(&mut page, [40, -30, 30, 0]);
    let generation = page.value(GENERATION);
    page.wheel(middle, -100.0);
    page.wait("window.sent.filter((m) => m.dolly).length === 2");
    page.wait(&format!("{GENERATION} > {generation}"));

    page.key("q");
    let zoom = page.value("window.prpf.viewport.zoom").as_f64().expect("a number");
    // The point of the image under the pointer, before and after the page handles the event.
    page.value(
        "(() => { window.under = []; const note = (e) => { const p = window.prpf.viewport, \
         b = p.canvas.getBoundingClientRect(); window.under.push([(e.clientX - b.x - p.corner[0]) / p.zoom, \
         (e.clientY - b.y - p.corner[1]) / p.zoom]); }; \
         addEventListener('wheel', note, { capture: true }); addEventListener('wheel', note); return 0; })()",
    );
    page.wheel(middle, -100.0);
    page.wait(&format!("window.prpf.viewport.zoom > {zoom} && window.under.length === 2"));
    page.wait("[0, 1].every((k) => Math.abs(window.under[0][k] - window.under[1][k]) < 1e-6)");
    assert_eq!(page.value("window.sent.filter((m) => m.dolly).length"), 2);
}

/// The image of a method that is chosen comes with its first pass, not when the samples have grown.
#[test]
fn a_chosen_denoiser_shows_its_own_image_soon() {
    let Some(program) = chromium() else { return };
    let (_render, address, _folder) =
        preview(&["--resolution", "640x360", "--spp", "0", "--max-spp", "100000"]);
    let mut page = Page::open(program, &address, [1280, 800]);
    let made_by = |method: &str| {
        format!("document.querySelector('[data-value=made_by]')?.textContent.startsWith('{method}')")
    };
    page.wait(&made_by("learned"));
    page.click("input[name=denoiser][value=nlm]");
    page.wait(&made_by("nlm"));
    let before = page.value(SAMPLES).as_f64().expect("a number");
    page.click("input[name=denoiser][value=learned]");
    page.wait("window.prpf.state.status.settings.denoiser === 'learned'");
    page.wait(&made_by("learned"));
    let after = page.value(SAMPLES).as_f64().expect("a number");
    assert!(after < 1.35 * before, "{before} {after}");
}
