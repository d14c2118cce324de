// The panel: what the render tells, and the settings that it follows.

import { drawCurve, duration } from "./curve.js";
import { short } from "./scale.js";

const $ = (id) => document.getElementById(id);

export const NAMES = {
  filtered: "Filtered", raw: "Unfiltered", samples: "Samples", error: "Error", variance: "Variance",
  residual: "Residual", failure: "Interpolation", albedo: "Albedo", normal: "Normal",
};
const TITLES = {
  filtered: "The reconstructed image",
  raw: "The mean of the samples",
  samples: "Samples per pixel",
  error: "Estimated squared error of the filtered pixel, relative",
  variance: "Variance of the unfiltered pixel's mean, relative",
  residual: "How far the filter moved the pixel, over what noise explains: above 1 it blurs",
  failure: "Where interpolation of feature weights failed",
  albedo: "Reflectance of the first hit",
  normal: "Shading normal of the first hit",
};
const PHASES = { rendering: "rendering", filtering: "filtering", paused: "paused", finished: "finished" };
const ENDS = { spp: "samples spent", time: "time spent", "target-error": "target reached", interrupt: "stopped" };

function count(value) {
  for (const [size, letter] of [[1e9, "G"], [1e6, "M"], [1e3, "k"]]) {
    if (value >= size) return `${(value / size).toPrecision(3)} ${letter}`;
  }
  return String(Math.round(value));
}

export class Panel {
  // `send(type, content)` gives a command, `look(view)` changes the view.
  constructor(send, look) {
    this.send = send;
    this.look = look;
    this.names = "";
    for (const group of document.querySelectorAll("[data-setting]")) {
      group.addEventListener("change", ({ target }) => send("settings", { [group.dataset.setting]: target.value }));
    }
    for (const name of ["spp", "seconds", "target_error"]) {
      this.number(name, (value) => send("settings", { [name]: name === "spp" ? Math.round(value) : value }));
    }
    for (const name of ["aperture", "focus"]) this.number(name, (value) => send("camera", { [name]: value }));
    new ResizeObserver(() => this.status && this.curve()).observe($("curve"));
  }

  number(id, change) {
    $(id).addEventListener("change", ({ target }) => {
      const value = target.value === "" ? 0 : Number(target.value);
      if (value >= 0 && value <= 1e9) change(value);
    });
  }

  // Shows a report.
  tell(status) {
    this.status = status;
    const { settings, statistics, camera } = status;
    $("scene").textContent = status.scene.split("/").pop() || "scene";
    $("scene").title = status.scene;
    document.title = `${PHASES[status.phase]} · ${$("scene").textContent}`;
    const end = status.stopped_by ? ` · ${ENDS[status.stopped_by]}` : "";
    $("phase").className = "";
    $("phase").textContent = `${PHASES[status.phase]}${end} · ${status.width}×${status.height}`;
    $("progress").firstElementChild.style.transform = `scaleX(${statistics.fraction})`;
    const paused = status.phase === "paused";
    $("pause").textContent = paused ? "Go on" : "Pause";
    $("pause").setAttribute("aria-pressed", String(paused));
    $("pause").disabled = status.phase === "finished";
    $("everywhere").disabled = !status.region;
    this.views(status.views);

    for (const name of ["sampling", "denoiser", "quality"]) {
      const input = document.querySelector(`input[name=${name}][value=${settings[name]}]`);
      if (input) input.checked = true;
    }
    this.fill("spp", settings.budget.spp);
    this.fill("seconds", settings.budget.seconds);
    this.fill("target_error", settings.budget.target_error);
    this.fill("aperture", camera.aperture);
    this.fill("focus", camera.aperture > 0 ? camera.focus : camera.focus >= 1e6 ? null : camera.focus);

    const { estimate } = statistics;
    const values = {
      seconds: duration(statistics.seconds),
      mean: statistics.mean.toFixed(statistics.mean < 10 ? 2 : 1),
      spread: `${statistics.min}, ${statistics.max}`,
      rate: statistics.samples_per_second > 0 ? count(statistics.samples_per_second) : "–",
      filter: `${(100 * statistics.filter_fraction).toFixed(1)} %`,
      memory: statistics.memory_bytes === null ? "–" : `${(statistics.memory_bytes / 2 ** 20).toFixed(0)} MiB`,
      error: estimate ? (estimate.is_hidden ? "below " : "") + short(estimate.error) : "–",
      judged: estimate ? (estimate.samples / (status.width * status.height)).toFixed(1) : "–",
    };
    for (const [name, text] of Object.entries(values)) {
      document.querySelector(`[data-value=${name}]`).textContent = text;
    }
    this.curve();
  }

  // A field shows what is set, unless somebody is writing in it.
  fill(id, value) {
    const field = $(id);
    if (document.activeElement === field) return;
    const text = value === null || value === undefined ? "" : String(Number(value.toPrecision(6)));
    if (field.value !== text) field.value = text;
  }

  views(views) {
    const names = views.map(({ view }) => view).join();
    if (names === this.names) return;
    this.names = names;
    $("views").replaceChildren(...views.map(({ view }, i) => {
      const label = document.createElement("label");
      const input = Object.assign(document.createElement("input"), { type: "radio", name: "view", value: view });
      input.addEventListener("change", () => this.look(view));
      const text = Object.assign(document.createElement("span"), { textContent: NAMES[view] ?? view });
      label.title = `${TITLES[view] ?? view} (${i + 1})`;
      label.append(input, text);
      return label;
    }));
  }

  choose(view) {
    const input = document.querySelector(`input[name=view][value=${view}]`);
    if (input) input.checked = true;
  }

  curve() {
    const { curve, forecast, settings } = this.status;
    drawCurve($("curve"), curve, forecast, settings.budget.target_error);
    const text = $("forecast");
    if (!forecast) {
      text.textContent = "The error is measured from the second batch on.";
      return;
    }
    const cost = Object.assign(document.createElement("b"), { textContent: duration(forecast.halving_seconds) });
    text.replaceChildren("Halving the error costs ", cost, " more.");
  }
}

// The footer: values at a pixel. `own` are those of the view shown, at once; `all` come from the render.
export function showValues(pixel, view, own, all) {
  const foot = $("values");
  if (!pixel) return;
  const three = (v) => v.map((c) => (c === null ? "–" : Number(c).toPrecision(4))).join("  ");
  const entries = [["pixel", pixel.join(", ")]];
  const same = all && all.x === pixel[0] && all.y === pixel[1];
  if (same) {
    entries.push(["unfiltered", three(all.raw)]);
    if (all.filtered) entries.push(["filtered", three(all.filtered)]);
    entries.push(["samples", all.samples], ["variance", short(all.variance)]);
    for (const name of ["error", "residual"]) if (all[name] !== null) entries.push([name, short(all[name])]);
    if (all.failure !== null) entries.push(["interpolation failed", short(all.failure)]);
    if (all.albedo) entries.push(["albedo", three(all.albedo)]);
    if (all.normal) entries.push(["normal", all.normal.map((c) => c.toFixed(3)).join("  ")]);
  } else if (own) {
    entries.push([NAMES[view].toLowerCase(), own.length === 1 ? short(own[0]) : three(own)]);
  }
  foot.replaceChildren(...entries.map(([name, value]) => {
    const item = document.createElement("span");
    item.append(name, Object.assign(document.createElement("b"), { textContent: String(value) }));
    return item;
  }));
}
