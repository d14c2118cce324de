// Connects the parts of the page: what is shown, and what follows from a key, a button or a status.

import { drawLegend } from "./colour_scale.js";
import { Comparison } from "./comparison.js";
import { Connection } from "./connection.js";
import { Discarding } from "./discarding.js";
import { showValues, spoken } from "./inspector.js";
import { Panel } from "./panel.js";
import { PointerInput } from "./pointer_input.js";
import { Scenes } from "./scenes.js";
import { Sheet } from "./sheet.js";
import { Viewport } from "./viewport.js";
import { FILTERED, VIEW_NAMES } from "./views.js";

const $ = (id) => document.getElementById(id);
const NOTICE_MILLISECONDS = 6000;
const MOST_LINES = 6; // of notices
const INSPECT_MILLISECONDS = 100;
// A camera that has moved shows in less.
const EXPECTATION_MILLISECONDS = 3000;

const viewport = new Viewport($("viewport"));
const state = {
  view: "filtered",
  wipe: 0.5, // position of the wipe, as a fraction of the width
  status: null,
  awaitsScene: false, // whether no scene is open and none is being loaded
  pixel: null, values: null, isPinned: false, // the inspected pixel
  speaks: false, // whether a screen reader gets its values
  region: null, // the rectangle being dragged
  notice: null, // number of the newest notice
  saving: null, // the line that says that an image is being saved
};

const connection = new Connection({
  // After a reconnection it may be another program.
  open: () => {
    $("save").disabled = $("restart").disabled = false;
    Object.assign(state, { requestedViews: "", notice: null });
    state.saving?.remove();
    forgetScene();
  },
  unanswered: (types) => {
    const commands = new Set(types.filter((type) => type !== "inspect").map((type) => type.replace("-", " ")));
    if (commands.size > 0) notify(`the connection broke: check whether prpf has got ${[...commands].join(", ")}`, true);
  },
  lost: (reason) => {
    $("phase").textContent = $("phase").title = reason;
    $("phase").className = "lost";
    document.title = `not connected · ${$("scene").textContent}`;
    $("save").disabled = $("pause").disabled = $("restart").disabled = true;
    if (state.saving?.isConnected) notify("the connection broke during a save: check whether the image was written", true);
    state.saving?.remove();
  },
  frame: (frame) => {
    if (frame.view) viewport.setFrame(frame.view, frame);
    updateViews();
    inspect();
    viewport.redraw().then(() => connection.ready());
  },
  // With a problem, until another scene is opened.
  loading: ({ scene, problem }) => {
    forgetScene();
    state.awaitsScene = problem !== null;
    state.saving?.remove();
    $("scene").textContent = scene.split("/").pop();
    $("phase").textContent = problem ? "not open" : "loading";
    $("phase").className = problem ? "lost" : "";
    document.title = `${$("phase").textContent} · ${$("scene").textContent}`;
    if (problem) notify(problem, true);
    scenes.show({ scene: problem ? null : scene });
  },
  status: (status) => {
    state.status = status;
    scenes.show(status);
    viewport.scales = Object.fromEntries(status.views.map(({ view, scale }) => [view, scale]));
    viewport.setSize(status.width, status.height);
    panel.show(status);
    comparison.show(status);
    if (!status.views.some(({ view }) => view === state.view)) state.view = "filtered";
    panel.markView(state.view);
    // Of the notices from before the page was opened only problems are shown.
    const isNew = (n) => state.notice === null ? n.is_problem : n.number > state.notice;
    const latest = status.notices.filter(isNew);
    if (latest.some(({ text }) => /^(not )?saved/.test(text))) state.saving?.remove();
    latest.forEach((n) => notify(n.text, n.is_problem));
    state.notice = status.notices.at(-1)?.number ?? 0;
    updateViews();
    placeOverlays();
  },
  values: (values) => {
    state.values = values;
    inspect(false);
    if (!state.speaks || values.x !== state.pixel?.[0] || values.y !== state.pixel?.[1]) return;
    state.speaks = false;
    $("spoken").textContent = spoken();
  },
  refused: ({ reason }, type) => {
    if (type === "save") state.saving?.remove();
    notify(`refused: ${reason}`, true);
  },
});

const comparison = new Comparison(viewport, notify, () => { updateViews(); placeOverlays(); });
const scenes = new Scenes((index) => send("open-scene", { index }), notify);
const panel = new Panel((type, content) => send(type, content), notify, selectView);

const pointer = new PointerInput($("viewport"), viewport, {
  camera: (move) => send("camera", move),
  focus: (pixel) => send("camera", { focus_at: pixel }),
  region: (region, isDone) => {
    const isArea = region.every(([a, b]) => b - a > 1e-4);
    state.region = isArea ? region : null;
    placeOverlays();
    if (!isDone) return;
    state.region = null;
    if (isArea) send("priority-region", { region });
  },
  hover: (pixel) => {
    if (state.isPinned) return;
    state.pixel = viewport.contains(pixel) ? pixel : null;
    inspect();
  },
  pin: (pixel) => {
    pin(pixel, true);
    state.speaks = true;
  },
  // A second click on the same pixel unpins it.
  click: (pixel) => pin(pixel, !(state.isPinned && state.pixel?.join() === pixel.join())),
});

function pin(pixel, isPinned) {
  Object.assign(state, { pixel, isPinned });
  inspect();
  placeOverlays();
}

const discarding = new Discarding($("question"), () => state.status, notify);

// Forgets what belongs to the scene so far.
function forgetScene() {
  Object.assign(state, { status: null, awaitsScene: false, movedGeneration: undefined, isPinned: false, pixel: null, values: null });
  [viewport, comparison, discarding, pointer].forEach((part) => part.forget());
  updateViews();
  placeOverlays();
}

// Sends a message, after a question where it would discard a render that cannot be kept.
function send(type, content) {
  discarding.ask(type, content, () => sendNow(type, content), () => state.status && panel.restore());
}

function sendNow(type, content) {
  if (["camera", "restart", "undo", "redo"].includes(type)) expectGeneration();
  const isTaken = state.status || (state.awaitsScene && type === "open-scene");
  if (isTaken && connection.send(type, content)) return;
  const reason = state.awaitsScene ? "open a scene first" : "the scene is being loaded";
  notify(`${connection.isOpen() ? reason : "not connected to prpf"}: the command was not sent`, true);
  if (state.status) panel.restore();
}

// A new generation begins with unfiltered images: asks for them, until it is there, or a command turns out to change nothing.
function expectGeneration() {
  const forget = () => { state.movedGeneration = undefined; requestViews(); };
  clearTimeout(state.expectation);
  state.expectation = setTimeout(forget, EXPECTATION_MILLISECONDS);
  state.movedGeneration = state.status?.generation ?? 0;
  requestViews();
}

// Shows a line: a problem until the user removes it, another one for some seconds. One that is on show already stays for as
// long again. Returns the line.
function notify(text, isProblem) {
  const line = [...$("notices").children].find((other) => other.dataset.text === text) ?? addLine(text, isProblem);
  clearTimeout(line.timer);
  if (!isProblem) line.timer = setTimeout(() => line.remove(), NOTICE_MILLISECONDS);
  return line;
}

// Shows a line until it is removed; returns it. The oldest makes room for it.
function addLine(text, isProblem) {
  const line = document.createElement("p");
  line.textContent = line.dataset.text = text;
  line.classList.toggle("problem", isProblem);
  if (isProblem) {
    const remove = Object.assign(document.createElement("button"), { textContent: "×", title: "Remove", onclick: () => line.remove() });
    remove.setAttribute("aria-label", "Remove this notice");
    line.append(remove);
  }
  if ($("notices").children.length === MOST_LINES) $("notices").firstElementChild.remove();
  $("notices").append(line);
  return line;
}

function selectView(view) {
  state.view = view;
  panel.markView(view);
  updateViews();
}

// Returns the newest generation that the page knows of.
const generation = () => Math.max(state.status?.generation ?? 0, ...[...viewport.frames.values()].map((f) => f.generation));
// Returns the view if it has a frame that belongs to the newest generation, else null. Saved images belong to any.
const fresh = (view) => {
  const frame = viewport.frames.get(view);
  return frame && (view.startsWith("save:") || frame.generation === generation()) ? view : null;
};

// Returns the view that is compared with another one: an image is not compared with itself.
const compared = () => comparison.isOn() && state.view === comparison.against ? "filtered" : state.view;

// Selects the views left and right of the wipe; the unfiltered image stands in for a view that has no frame yet.
function updateViews() {
  const right = compared();
  const image = fresh(right) ?? fresh("raw") ?? right;
  const shown = comparison.showsOther ? comparison.against : image;
  viewport.shown = { left: comparison.isWiping ? comparison.against : null, right: shown };
  viewport.wipe = comparison.isWiping ? state.wipe : null;
  showBadge(right);
  drawLegend($("legend"), viewport.scales[shown] ?? null);
  inspect(false);
  requestViews();
  // Without a graphics card to draw a large image takes most of a processor core, which the render needs.
  const drawn = JSON.stringify([viewport.shown, viewport.wipe, viewport.scales]);
  if (drawn !== state.drawn) viewport.redraw();
  state.drawn = drawn;
}

// Says which image of a flicker is shown, or why an image is missing.
function showBadge(right) {
  const isMissing = !fresh(right) && state.status && right !== "raw" && viewport.frames.size > 0;
  const frame = viewport.frames.get(right);
  const isCoarse = !isMissing && FILTERED.includes(right) && frame?.side > 1;
  $("badge").hidden = !isMissing && !isCoarse && !comparison.isFlickering;
  if (isCoarse && !comparison.isFlickering) $("badge").textContent = `filtered at ${Math.ceil(frame.width / frame.side)}×${Math.ceil(frame.height / frame.side)} so far`;
  else if (comparison.isFlickering) $("badge").textContent = comparison.showsOther ? comparison.name() : VIEW_NAMES[right];
  else if (!FILTERED.includes(right)) $("badge").textContent = "not available yet";
  else if (right !== "filtered") $("badge").textContent = "available after the next filter pass";
  else $("badge").textContent = state.status?.settings.denoiser === "none" ? "denoiser is off" : "not filtered yet";
}

// Asks for the views that are needed, and only for those.
function requestViews() {
  const wanted = new Set([compared()]);
  if (comparison.wanted()) wanted.add(comparison.wanted());
  const isMoving = state.movedGeneration !== undefined && state.movedGeneration >= generation();
  if (FILTERED.some((view) => wanted.has(view) && (isMoving || !fresh(view)))) wanted.add("raw");
  const list = [...wanted].join();
  if (list === state.requestedViews) return;
  state.requestedViews = list;
  connection.send("views", { views: [...wanted] });
}

let lastInspection = 0;
// Shows the values of the inspected pixel, and requests all of them from the render.
function inspect(requestsAll = true) {
  const { pixel } = state;
  const isLeft = pixel && comparison.isWiping && (pixel[0] + 0.5) / viewport.size[0] < state.wipe;
  const view = isLeft ? viewport.shown.left : viewport.shown.right;
  showValues(pixel, view, pixel && viewport.read(view, ...pixel), state.values);
  if (!requestsAll || !pixel) return;
  const wait = lastInspection + INSPECT_MILLISECONDS - performance.now();
  clearTimeout(state.inspection);
  state.inspection = setTimeout(() => {
    lastInspection = performance.now();
    connection.send("inspect", { x: pixel[0], y: pixel[1] });
  }, Math.max(0, wait));
}

// Moves region, cursor and wipe to where the image is.
function placeOverlays() {
  const setBox = (element, [x0, y0], [x1, y1]) => {
    Object.assign(element.style, { left: `${x0}px`, top: `${y0}px`, width: `${x1 - x0}px`, height: `${y1 - y0}px` });
  };
  const region = state.region ?? state.status?.region;
  $("region").hidden = !region;
  if (region) {
    const corner = (k) => viewport.toCanvas(region[0][k] * viewport.size[0], region[1][k] * viewport.size[1]);
    setBox($("region"), corner(0), corner(1));
  }
  $("cursor").hidden = !state.isPinned;
  if (state.isPinned) {
    const [x, y] = state.pixel;
    setBox($("cursor"), viewport.toCanvas(x, y), viewport.toCanvas(x + 1, y + 1));
  }
  const wipe = $("wipe");
  wipe.hidden = !comparison.isWiping;
  wipe.style.left = `${viewport.toCanvas(state.wipe * viewport.size[0], 0)[0]}px`;
  wipe.setAttribute("aria-valuenow", Math.round(100 * state.wipe));
  $("factor").textContent = `${Math.round(100 * viewport.zoom * viewport.ratio())} %`;
}
viewport.onlayout = placeOverlays;
viewport.onproblem = (text) => notify(text, true);

function setWipe(fraction) {
  state.wipe = Math.min(1, Math.max(0, fraction));
  updateViews();
}

function setExposure(stops) {
  viewport.exposure = Math.min(8, Math.max(-8, Math.round(stops * 100) / 100));
  $("exposure").value = viewport.exposure;
  $("stops").textContent = (viewport.exposure > 0 ? "+" : "") + viewport.exposure.toFixed(1);
  viewport.redraw();
}

function selectTool(tool) {
  document.querySelector(`input[name=tool][value=${tool}]`).checked = true;
  pointer.selectTool(tool);
}

// Selects a tool by its key: the arrow keys use it on the image.
function takeTool(tool) {
  selectTool(tool);
  $("viewport").focus();
}

// A device pixel for each pixel.
const actualSize = () => viewport.zoomBy(1 / (viewport.zoom * viewport.ratio()));
const togglePause = () => state.status && !state.status.stopped_by && send("pause", { paused: !state.status.is_paused });
const restart = () => send("restart", {});
const undo = () => $("undo").disabled || send("undo", {});
const redo = () => $("redo").disabled || send("redo", {});
// These denoisers do not fill the gaps between samples, nor where a region has most of them.
const waitsForSamples = () => {
  const { statistics, settings, region } = state.status;
  return statistics.min === 0 && (region || ["none", "prpf", "rpf"].includes(settings.denoiser));
};
const save = () => {
  if (connection.isOpen() && state.status) {
    state.saving?.remove();
    state.saving = addLine(waitsForSamples() ? "saving when every pixel has samples …" : "saving …", false);
  }
  send("save", {});
};
const clearRegion = () => send("priority-region", { region: null });
const help = new Sheet($("help"), $("keys"));
const toggleHelp = () => help.toggle();

// Closes what is open, else lets go of the pinned pixel or the region: first of that which the tool makes.
function letGo() {
  const open = [help, scenes.sheet, panel.camera.lines].find((sheet) => sheet.isOpen());
  if (open) return open.toggle();
  const isRegionNext = state.status?.region && (pointer.tool === "region" || !state.isPinned);
  if (isRegionNext) return clearRegion();
  state.isPinned = false;
  placeOverlays();
}

$("pause").onclick = togglePause;
$("restart").onclick = restart;
$("undo").onclick = undo;
$("redo").onclick = redo;
$("save").onclick = save;
$("keys").onclick = toggleHelp;
$("fit").onclick = () => viewport.fit();
$("actual").onclick = actualSize;
$("clear-region").onclick = clearRegion;
$("exposure").oninput = ({ target }) => setExposure(Number(target.value));
$("exposure").ondblclick = () => setExposure(0);
$("tools").onchange = ({ target }) => selectTool(target.value);
// After a click of the mouse the image has the keys again, unless the button has passed the focus on.
const returnFocus = ({ detail, target }) => {
  if (detail > 0 && target.contains(document.activeElement)) $("viewport").focus({ preventScroll: true });
};
for (const buttons of [$("tools"), document.querySelector(".actions")]) buttons.addEventListener("click", returnFocus);
$("wipe").onpointerdown = (event) => $("wipe").setPointerCapture(event.pointerId);
$("wipe").onpointermove = (event) => {
  if (!$("wipe").hasPointerCapture(event.pointerId)) return pointer.move(event);
  setWipe((pointer.position(event)[0] - viewport.drawnCorner()[0]) / (viewport.zoom * viewport.size[0]));
};
$("wipe").onwheel = (event) => pointer.wheel(event);
$("wipe").onkeydown = (event) => {
  const step = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
  if (step) { setWipe(state.wipe + step); event.preventDefault(); }
};

const KEYS = {
  w: () => comparison.wipe(!comparison.isWiping), x: () => comparison.flicker(!comparison.isFlickering),
  ",": () => setWipe(state.wipe - 0.05), ".": () => setWipe(state.wipe + 0.05),
  e: () => setExposure(viewport.exposure + 1 / 3), E: () => setExposure(viewport.exposure - 1 / 3),
  0: () => viewport.fit(), z: actualSize, "+": () => viewport.zoomBy(1.25), "-": () => viewport.zoomBy(0.8),
  q: () => takeTool("inspect"), c: () => takeTool("camera"), f: () => takeTool("focus"), r: () => takeTool("region"),
  " ": togglePause, s: save, R: restart, u: undo, U: redo,
  Home: () => panel.camera.reset(), b: () => panel.camera.addBookmark(), l: () => panel.camera.toggleLines(),
  o: () => scenes.toggle(),
  Escape: letGo, "?": toggleHelp,
};

// Keys that act again as long as they are held.
const REPEATING_KEYS = new Set(["e", "E", "+", "-", ",", "."]);
const FIELD_KEYS = new Set([" ", "Enter", "Home", "End", "PageUp", "PageDown", "ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown"]);

document.addEventListener("keydown", (event) => {
  const field = event.target.closest("input:not([type=radio]), button, select, [role=slider]");
  if ($("question").open) return;
  // Where nothing has the focus, the image has the keys.
  if (event.target === document.body) pointer.key(event);
  if (event.defaultPrevented) return;
  if ((event.ctrlKey || event.metaKey) && !event.altKey && event.key.toLowerCase() === "z" && !field?.inputMode) {
    event.preventDefault();
    return event.repeat || (event.shiftKey ? redo() : undo());
  }
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  // Fields keep the keys that they use themselves.
  if (field && (event.target.inputMode || FIELD_KEYS.has(event.key))) return;
  // Shift decides the case, whatever Caps Lock is.
  const key = event.key.length > 1 ? event.key : event.shiftKey ? event.key.toUpperCase() : event.key.toLowerCase();
  const number = Number(key);
  const view = number >= 1 && number <= 9 ? state.status?.views[number - 1]?.view : null;
  const act = view ? () => selectView(view) : KEYS[key];
  if (!act) return;
  if (!event.repeat || REPEATING_KEYS.has(key)) act();
  event.preventDefault();
});

if (!viewport.gl) notify("this browser does not support WebGL 2: statistics and controls work, but no image is shown", true);
selectTool("inspect");
// For tests and the browser's console: read only.
window.prpf = { viewport, state };
