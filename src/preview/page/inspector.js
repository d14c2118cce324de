// The footer: all values of the inspected pixel.

import { short } from "./colour_scale.js";
import { VIEW_NAMES } from "./views.js";

// Shows the values of `pixel` ([x, y]). `own` are those of the view on screen, at once; `all` come from the render.
export function showValues(pixel, view, own, all) {
  if (!pixel) return;
  const three = (v) => v.map((c) => (c === null ? "–" : Number(c).toPrecision(4))).join("  ");
  const entries = [["pixel", pixel.join(", ")]];
  const same = all && all.x === pixel[0] && all.y === pixel[1];
  if (same) {
    if (all.raw) entries.push(["unfiltered", three(all.raw)]);
    if (all.filtered) entries.push(["filtered", three(all.filtered)]);
    entries.push(["samples", all.samples]);
    if (all.variance !== null) entries.push(["variance", short(all.variance)]);
    for (const name of ["error", "residual"]) if (all[name] !== null) entries.push([name, short(all[name])]);
    if (all.failure !== null) entries.push(["interpolation failure", short(all.failure)]);
    if (all.albedo) entries.push(["albedo", three(all.albedo)]);
    if (all.normal) entries.push(["normal", all.normal.map((c) => c.toFixed(3)).join("  ")]);
  } else if (own) {
    entries.push([(VIEW_NAMES[view] ?? "saved").toLowerCase(), own.length === 1 ? short(own[0]) : three(own)]);
  }
  document.getElementById("values").replaceChildren(...entries.map(([name, value]) => {
    const item = document.createElement("span");
    item.append(name, Object.assign(document.createElement("b"), { textContent: String(value) }));
    return item;
  }));
}
