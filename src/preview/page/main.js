// Puts the page together: what is looked at, and what follows from a key, a button or a report.

import { Hand } from "./hand.js";
import { Link } from "./link.js";
import { Panel, showValues } from "./panel.js";
import { Picture } from "./picture.js";
import { drawLegend } from "./scale.js";

const $ = (id) => document.getElementById(id);
const NOTICE_MILLISECONDS = 6000;
const INSPECT_MILLISECONDS = 100;
const FILTERED = ["filtered", "error", "residual", "failure"];

const picture = new Picture($("picture"));
const state = { view: "filtered", wiping: false, wipe: 0.5, status: null, pixel: null, values: null, kept: false, notice: null };

const link = new Link({
  // It may be another program than before.
  open: () => { picture.frames.clear(); state.looks = ""; look(); },
  lost: () => {
    $("phase").textContent = "connection lost, trying again";
    $("phase").className = "lost";
  },
  frame: (frame) => {
    if (frame.view) picture.take(frame.view, frame);
    arrange();
    inspect();
    picture.redraw().then(() => link.ready());
  },
  status: (status) => {
    state.status = status;
    picture.scales = Object.fromEntries(status.views.map(({ view, scale }) => [view, scale]));
    picture.measure(status.width, status.height);
    panel.tell(status);
    if (!status.views.some(({ view }) => view === state.view)) state.view = "filtered";
    panel.choose(state.view);
    // What was said before somebody looked is no news.
    const newest = status.notices.at(-1)?.number ?? 0;
    if (state.notice !== null) {
      status.notices.filter(({ number }) => number > state.notice).forEach((n) => tell(n.text, n.is_problem));
    }
    state.notice = newest;
    arrange();
    place();
  },
  values: (values) => {
    state.values = values;
    inspect(false);
  },
  refused: ({ reason }) => tell(`refused: ${reason}`, true),
});

const panel = new Panel((type, content) => command(type, content), choose);

const hand = new Hand($("picture"), picture, {
  camera: (move) => command("camera", move),
  focus: (pixel) => command("camera", { focus_at: pixel }),
  region: (region, done) => {
    const isArea = region.every(([a, b]) => b - a > 1e-4);
    state.region = isArea ? region : null;
    place();
    if (!done) return;
    state.region = null;
    if (isArea) command("priority-region", { region });
  },
  inspect: (pixel) => {
    if (state.kept) return;
    state.pixel = picture.contains(pixel) ? pixel : null;
    inspect();
  },
  keep: (pixel) => {
    // A second click on the same pixel lets go of it.
    state.kept = !(state.kept && state.pixel?.join() === pixel.join());
    state.pixel = pixel;
    inspect();
    place();
  },
});

function command(type, content) {
  // The next images will be raw ones of another generation.
  if (type === "camera" || type === "restart") { state.moved = state.status?.generation ?? 0; look(); }
  link.send(type, content);
}

function tell(text, isProblem) {
  const line = document.createElement("p");
  line.textContent = text;
  line.classList.toggle("problem", isProblem);
  $("notices").append(line);
  setTimeout(() => line.remove(), NOTICE_MILLISECONDS);
}

function choose(view) {
  state.view = view;
  panel.choose(view);
  arrange();
}

// The generation that is newest as far as the page knows.
const generation = () => Math.max(state.status?.generation ?? 0, ...[...picture.frames.values()].map((f) => f.generation));
const fresh = (view) => {
  const frame = picture.frames.get(view);
  return frame && frame.generation === generation() ? view : null;
};

// Decides what stands left and right of the wipe: what a filter pass makes as soon as there is one, else raw.
function arrange() {
  const right = state.wiping && state.view === "raw" ? "filtered" : state.view;
  const stands = fresh(right) ?? (FILTERED.includes(right) ? fresh("raw") ?? right : right);
  picture.shown = { left: state.wiping ? "raw" : null, right: stands };
  picture.wipe = state.wiping ? state.wipe : null;
  const badge = $("badge");
  const missing = !fresh(right) && state.status;
  badge.hidden = !missing || right === "raw" || !picture.frames.size;
  badge.textContent = right === "filtered"
    ? state.status?.settings.denoiser === "none" ? "denoiser off" : "unfiltered so far"
    : "comes with the next filter pass";
  drawLegend($("legend"), picture.scales[stands] ?? null);
  look();
  picture.redraw();
}

// Asks for the views that are needed, and only for those.
function look() {
  const wanted = new Set([state.wiping && state.view === "raw" ? "filtered" : state.view]);
  if (state.wiping) wanted.add("raw");
  const moving = state.moved !== undefined && state.moved >= generation();
  if (FILTERED.some((view) => wanted.has(view) && (moving || !fresh(view)))) wanted.add("raw");
  const looks = [...wanted].join();
  if (looks === state.looks) return;
  state.looks = looks;
  link.send("views", { views: [...wanted] });
}

let asked = 0;
function inspect(ask = true) {
  const { pixel } = state;
  showValues(pixel, picture.shown.right, pixel && picture.read(picture.shown.right, ...pixel), state.values);
  if (!ask || !pixel) return;
  const wait = asked + INSPECT_MILLISECONDS - performance.now();
  clearTimeout(state.asking);
  state.asking = setTimeout(() => {
    asked = performance.now();
    link.send("inspect", { x: pixel[0], y: pixel[1] });
  }, Math.max(0, wait));
}

// Puts what lies over the image where the image is.
function place() {
  const box = (element, [x0, y0], [x1, y1]) => {
    Object.assign(element.style, { left: `${x0}px`, top: `${y0}px`, width: `${x1 - x0}px`, height: `${y1 - y0}px` });
  };
  const region = state.region ?? state.status?.region;
  $("region").hidden = !region;
  if (region) {
    const corner = (k) => picture.placeOf(region[0][k] * picture.size[0], region[1][k] * picture.size[1]);
    box($("region"), corner(0), corner(1));
  }
  $("cursor").hidden = !state.kept;
  if (state.kept) {
    const [x, y] = state.pixel;
    box($("cursor"), picture.placeOf(x, y), picture.placeOf(x + 1, y + 1));
  }
  const wipe = $("wipe");
  wipe.hidden = !state.wiping;
  wipe.style.left = `${picture.placeOf(state.wipe * picture.size[0], 0)[0]}px`;
  wipe.setAttribute("aria-valuenow", Math.round(100 * state.wipe));
  $("factor").textContent = `${Math.round(100 * picture.zoom)} %`;
}
picture.onlayout = place;

function wipeTo(share) {
  state.wipe = Math.min(1, Math.max(0, share));
  arrange();
}

function wiping(on) {
  state.wiping = $("wiping").checked = on;
  arrange();
}

function expose(stops) {
  picture.exposure = Math.min(8, Math.max(-8, Math.round(stops * 100) / 100));
  $("exposure").value = picture.exposure;
  $("stops").textContent = (picture.exposure > 0 ? "+" : "") + picture.exposure.toFixed(1);
  picture.redraw();
}

function use(tool) {
  document.querySelector(`input[name=tool][value=${tool}]`).checked = true;
  hand.use(tool);
}

const actual = () => picture.zoomBy(1 / picture.zoom);
const pause = () => state.status && state.status.phase !== "finished" && command("pause", { paused: state.status.phase !== "paused" });
const save = () => { tell("saving …", false); command("save", {}); };
const help = () => {
  $("help").hidden = !$("help").hidden;
  $("keys").setAttribute("aria-expanded", String(!$("help").hidden));
};

$("pause").onclick = pause;
$("restart").onclick = () => command("restart", {});
$("save").onclick = save;
$("keys").onclick = help;
$("fit").onclick = () => picture.fit();
$("actual").onclick = actual;
$("home").onclick = () => command("camera", { reset: true });
$("everywhere").onclick = () => command("priority-region", { region: null });
$("wiping").onchange = ({ target }) => wiping(target.checked);
$("exposure").oninput = ({ target }) => expose(Number(target.value));
$("exposure").ondblclick = () => expose(0);
$("tools").onchange = ({ target }) => use(target.value);
$("wipe").onpointerdown = (event) => $("wipe").setPointerCapture(event.pointerId);
$("wipe").onpointermove = (event) => {
  if (!$("wipe").hasPointerCapture(event.pointerId)) return;
  wipeTo((hand.at(event)[0] - picture.corner[0]) / (picture.zoom * picture.size[0]));
};
$("wipe").onkeydown = (event) => {
  const step = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
  if (step) { wipeTo(state.wipe + step); event.preventDefault(); }
};

const KEYS = {
  w: () => wiping(!state.wiping), ",": () => wipeTo(state.wipe - 0.05), ".": () => wipeTo(state.wipe + 0.05),
  e: () => expose(picture.exposure + 1 / 3), E: () => expose(picture.exposure - 1 / 3),
  0: () => picture.fit(), z: actual, "+": () => picture.zoomBy(1.25), "-": () => picture.zoomBy(0.8),
  q: () => use("look"), c: () => use("camera"), f: () => use("focus"), r: () => use("region"),
  " ": pause, s: save, R: () => command("restart", {}), Home: () => command("camera", { reset: true }),
  Escape: () => $("help").hidden ? command("priority-region", { region: null }) : help(), "?": help,
};

const FIELD_KEYS = new Set([" ", "Enter", "Home", "End", "PageUp", "PageDown", "ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown"]);

document.addEventListener("keydown", (event) => {
  const field = event.target.closest("input:not([type=radio]), button, [role=slider]");
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  // Keys that fields have a use for are theirs.
  if (field && (event.target.type === "number" || FIELD_KEYS.has(event.key))) return;
  // The shift key decides, whatever the caps lock says.
  const key = event.key.length > 1 ? event.key : event.shiftKey ? event.key.toUpperCase() : event.key.toLowerCase();
  const number = Number(key);
  const view = number >= 1 && number <= 9 ? state.status?.views[number - 1]?.view : null;
  const act = view ? () => choose(view) : KEYS[key];
  if (!act) return;
  act();
  event.preventDefault();
});

if (!picture.gl) tell("This browser has no WebGL 2, so there is no image; numbers and controls work.", true);
use("look");
// For tests and the curious: read only.
window.prpf = { picture, state };
