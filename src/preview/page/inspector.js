// The footer: all values of the inspected pixel.

import { short } from "./colour_scale.js";
import { VIEW_NAMES } from "./views.js";

// The values that the render sends, by the views that show them.
const SENT = ["raw", "filtered", "samples", "variance", "error", "residual", "failure", "albedo", "normal"];

// Those that a pixel without samples lacks: on screen it has its neighbour's.
const OF_SAMPLES = ["raw", "variance", "albedo", "normal"];

const footer = document.getElementById("values");
// What the footer says as long as no pixel is inspected.
const PLACEHOLDER = footer.firstElementChild;

// Formats a value: a number, or a list of one or three of them.
function format(view, value) {
  if (view === "samples") return String(value);
  if (view === "normal") return value.map((c) => c.toFixed(3)).join("  ");
  const list = [value].flat();
  return list.length === 1 ? short(list[0]) : list.map((c) => (c === null ? "–" : Number(c).toPrecision(4))).join("  ");
}

// Shows the values of `pixel` ([x, y]). `own` are those of the view on screen, at once; `all` come from the render, which does
// not send those of a comparison.
export function showValues(pixel, view, own, all) {
  if (!pixel) return show("", [PLACEHOLDER]);
  const isOfPixel = all && all.x === pixel[0] && all.y === pixel[1];
  const values = isOfPixel ? SENT.filter((name) => all[name] !== null).map((name) => [name, all[name]]) : [];
  const isEmpty = isOfPixel && all.samples === 0 && OF_SAMPLES.includes(view);
  if (own && !isEmpty && !values.some(([name]) => name === view)) values.push([view, own]);
  const entries = values.map(([name, value]) => [(VIEW_NAMES[name] ?? "saved").toLowerCase(), format(name, value)]);
  const shown = [["pixel", pixel.join(", ")], ...entries];
  show(JSON.stringify(shown), shown.map(([name, value]) => {
    const item = document.createElement("span");
    item.append(name, Object.assign(document.createElement("b"), { textContent: value }));
    return item;
  }));
}

// Returns what the footer shows, for a screen reader.
export function spoken() {
  return [...footer.children].map((item) => [...item.childNodes].map((part) => part.textContent).join(" ")).join(", ");
}

// Shows these elements, unless they are there already: values that stay can be selected. `key`: what they say.
function show(key, elements) {
  if (footer.dataset.key === key) return;
  footer.dataset.key = key;
  footer.replaceChildren(...elements);
}
