// The side panel: statistics of the render, and its settings.

import { short } from "./colour_scale.js";
import { CameraPanel } from "./camera_panel.js";
import { drawErrorCurve, duration } from "./error_curve.js";
import { fillField, numberField } from "./number_field.js";
import { VIEW_NAMES, VIEW_TITLES } from "./views.js";

const $ = (id) => document.getElementById(id);

const PHASES = { rendering: "rendering", filtering: "filtering", paused: "paused", finished: "finished" };
const STOP_REASONS = { spp: "sample budget reached", time: "time budget reached", "target-error": "target error reached", interrupt: "interrupted" };

// Formats a large number with three digits and a unit prefix.
function count(value) {
  for (const [size, letter] of [[1e9, "G"], [1e6, "M"], [1e3, "k"]]) {
    if (value >= size) return `${Number((value / size).toPrecision(3))} ${letter}`;
  }
  return String(Math.round(value));
}

// Returns what it costs to choose a denoiser.
function cost({ denoiser, begins_anew, memory_bytes }, settings) {
  if (denoiser === settings.denoiser) return "";
  if (memory_bytes === null) return "Keeps every sample: enter a number of samples first.";
  if (!begins_anew) return "Uses the samples so far.";
  return `Begins the render anew, in about ${Number((memory_bytes / 1e9).toPrecision(2))} GB of memory.`;
}

export class Panel {
  // `send(type, content)` sends a message, `notify(text, isProblem)` tells the user something, `selectView(view)` changes
  // the view.
  constructor(send, notify, selectView) {
    this.camera = new CameraPanel(send, notify);
    this.selectView = selectView;
    this.viewList = "";
    for (const group of document.querySelectorAll("[data-setting]")) {
      group.addEventListener("change", ({ target }) => send("settings", { [group.dataset.setting]: target.value }));
    }
    for (const [id, name] of [["spp", "Samples"], ["seconds", "Seconds"], ["target_error", "Error"]]) {
      const change = (value) => send("settings", { [id]: value });
      numberField($(id), $("budgets-explanation"), { name, isWhole: id === "spp", change });
    }
    const group = document.querySelector("[data-setting=denoiser]");
    for (const type of ["pointerover", "focusin"]) {
      group.addEventListener(type, ({ target }) => this.showMeaning(target.closest("label")?.querySelector("input")?.value));
    }
    for (const type of ["pointerout", "focusout"]) group.addEventListener(type, () => this.showMeaning());
    new ResizeObserver(() => this.status && this.showCurve()).observe($("curve"));
  }

  // Shows a new status.
  show(status) {
    this.status = status;
    const { settings, statistics } = status;
    $("scene").textContent = status.scene.split("/").pop() || "scene";
    document.title = `${PHASES[status.phase]} · ${$("scene").textContent}`;
    const end = status.stopped_by ? ` · ${STOP_REASONS[status.stopped_by]}` : "";
    $("phase").className = $("phase").title = "";
    const phase = `${PHASES[status.phase]}${end} · ${status.width}×${status.height}`;
    // A screen reader reads each change.
    if ($("phase").textContent !== phase) $("phase").textContent = phase;
    $("progress").firstElementChild.style.transform = `scaleX(${statistics.fraction})`;
    $("pause").textContent = status.is_paused ? "Resume" : "Pause";
    $("pause").classList.toggle("on", status.is_paused);
    $("pause").disabled = Boolean(status.stopped_by);
    for (const [way, keys] of [["undo", "U"], ["redo", "Shift+U"]]) {
      const render = status.history[way];
      $(way).disabled = !render;
      $(way).title = render ? `${way === "undo" ? "Back" : "Forward"} to ${render} (${keys})` : `Nothing to ${way}`;
    }
    $("clear-region").hidden = !status.region;
    this.showViews(status.views);
    this.showDenoisers(status.denoisers, settings.denoiser);
    this.showSettings(settings);
    this.showMeaning(this.considered);
    this.camera.show(status);
    this.showStatistics(status);
    this.showCurve();
  }

  // Shows the render's settings again after a change that did not reach it.
  restore() {
    this.showSettings(this.status.settings);
    this.camera.show(this.status);
    // A refused number is taken back although its field has the focus again
    const { value } = document.activeElement.dataset;
    if (value !== undefined) document.activeElement.value = value;
  }

  showSettings(settings) {
    for (const name of ["sampling", "denoiser", "quality"]) {
      const input = document.querySelector(`input[name=${name}][value=${settings[name]}]`);
      if (input) input.checked = true;
    }
    for (const name of ["spp", "seconds", "target_error"]) fillField($(name), settings.budget[name]);
  }

  // Shows what a denoiser does: the one that the user points at, else the selected one.
  showMeaning(considered = null) {
    if (!this.status) return;
    this.considered = considered;
    const { denoisers, settings } = this.status;
    const shown = considered ?? settings.denoiser;
    const found = denoisers.find(({ denoiser, quality }) => denoiser === shown && (denoiser !== settings.denoiser || quality === settings.quality))
      ?? denoisers.find(({ denoiser }) => denoiser === shown);
    $("meaning").textContent = found ? `${cost(found, settings)} ${found.summary}.`.trim() : "";
  }

  // Builds one radio button per denoiser, and one per preset of the selected denoiser.
  showDenoisers(denoisers, selected) {
    const methods = denoisers.filter(({ denoiser }, i) => i === 0 || denoisers[i - 1].denoiser !== denoiser);
    const presets = denoisers.filter(({ denoiser, quality }) => denoiser === selected && quality);
    this.showChoices("denoiser", methods.map(({ denoiser, summary }) => [denoiser, summary]));
    this.showChoices("quality", presets.map(({ quality, summary }) => [quality, summary]));
    // A row that came and went would move what a user is about to click.
    $("quality-row").style.visibility = presets.length > 0 ? "visible" : "hidden";
  }

  // Builds the radio buttons of a setting from pairs of value and description.
  showChoices(name, choices) {
    const group = document.querySelector(`[data-setting=${name}]`);
    const list = choices.map(([value]) => value).join();
    if (group.dataset.list === list) return;
    group.dataset.list = list;
    group.replaceChildren(...choices.map(([value, description]) => {
      const label = Object.assign(document.createElement("label"), { title: description });
      const input = Object.assign(document.createElement("input"), { type: "radio", name, value });
      label.append(input, Object.assign(document.createElement("span"), { textContent: value }));
      return label;
    }));
  }

  showStatistics({ statistics, width, height, made_by }) {
    const { estimate } = statistics;
    const values = {
      seconds: duration(statistics.seconds),
      mean: statistics.mean.toFixed(statistics.mean < 10 ? 2 : 1),
      spread: `${statistics.min}, ${statistics.max}`,
      rate: statistics.samples_per_second > 0 ? count(statistics.samples_per_second) : "–",
      filter: `${(100 * statistics.filter_fraction).toFixed(1)} %`,
      memory: statistics.memory_bytes === null ? "–" : `${(statistics.memory_bytes / 2 ** 20).toFixed(0)} MiB`,
      error: estimate ? short(estimate.error) : "–",
      made_by: made_by ? [made_by.denoiser, made_by.quality].filter(Boolean).join(" ") : "–",
      true_error: statistics.true_error === null ? "" : `${short(statistics.true_error)}${statistics.flip === null ? "" : ` · FLIP ${short(statistics.flip)}`}`,
      error_interval: estimate ? `${short(estimate.low)} to ${short(estimate.high)}` : "",
    };
    for (const element of document.querySelectorAll(".with-reference")) element.hidden = statistics.true_error === null;
    for (const [name, text] of Object.entries(values)) {
      document.querySelector(`[data-value=${name}]`).textContent = text;
    }
  }

  // Builds one radio button per view.
  showViews(views) {
    const list = views.map(({ view }) => view).join();
    if (list === this.viewList) return;
    this.viewList = list;
    $("views").replaceChildren(...views.map(({ view }, i) => {
      const label = document.createElement("label");
      const input = Object.assign(document.createElement("input"), { type: "radio", name: "view", value: view });
      input.addEventListener("change", () => this.selectView(view));
      const text = Object.assign(document.createElement("span"), { textContent: VIEW_NAMES[view] ?? view });
      label.title = (VIEW_TITLES[view] ?? view) + (i < 9 ? ` (${i + 1})` : "");
      label.append(input, text);
      return label;
    }));
  }

  // Marks a view as the selected one.
  markView(view) {
    const input = document.querySelector(`input[name=view][value=${view}]`);
    if (input) input.checked = true;
  }

  // Shows the error curve and its forecast.
  showCurve() {
    const { curve, forecast, settings } = this.status;
    const { error } = this.status.statistics.estimate ?? {};
    const isOnTheWay = Number.isFinite(forecast?.target?.seconds) && error > settings.budget.target_error;
    const next = isOnTheWay ? forecast.target : forecast?.halved ?? null;
    drawErrorCurve($("curve"), curve, next, settings.budget.target_error);
    const text = $("forecast");
    if (!forecast) {
      text.textContent = "The first filter pass estimates the error.";
      return;
    }
    const { halving_seconds, target_seconds } = forecast;
    const [what, seconds] = isOnTheWay ? ["Reaching the target error takes ", target_seconds] : ["Halving the error takes ", halving_seconds];
    if (seconds === 0) {
      text.textContent = isOnTheWay ? "The next image may reach the target error." : "The next image may have half of this error.";
      return;
    }
    const time = Object.assign(document.createElement("b"), { textContent: seconds < 1 ? "less than a second" : duration(seconds) });
    text.replaceChildren(what, time, " more.");
  }
}
