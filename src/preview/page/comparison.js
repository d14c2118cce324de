// What the image is compared with: a view of the render, the reference or a saved image; by a wipe or by flicker.

import { decodeFrame } from "./frame.js";
import { VIEW_NAMES } from "./views.js";

const FLICKER_MILLISECONDS = 500;
const $ = (id) => document.getElementById(id);

export class Comparison {
  // `viewport` gets the saved images; `update()` is called when another image has to be shown.
  constructor(viewport, notify, update) {
    Object.assign(this, { viewport, notify, update, against: "raw", isWiping: false, isFlickering: false, showsOther: false });
    this.forget();
    $("against").onchange = ({ target }) => this.compareWith(target.value);
    $("wiping").onchange = ({ target }) => this.wipe(target.checked);
    $("flickering").onchange = ({ target }) => this.flicker(target.checked);
  }

  isOn() {
    return this.isWiping || this.isFlickering;
  }

  // Returns the view that the render has to send for the comparison, or null.
  wanted() {
    return this.isOn() && !this.against.startsWith("save:") ? this.against : null;
  }

  // Returns the name of what the image is compared with.
  name() {
    return $("against").selectedOptions[0]?.textContent ?? this.against;
  }

  wipe(isOn) {
    this.isWiping = $("wiping").checked = isOn;
    if (isOn) this.flicker(false);
    this.start();
  }

  // Shows the two images in turn, twice a second.
  flicker(isOn) {
    this.isFlickering = $("flickering").checked = isOn;
    clearInterval(this.timer);
    this.showsOther = false;
    if (isOn) {
      this.isWiping = $("wiping").checked = false;
      this.timer = setInterval(() => { this.showsOther = !this.showsOther; this.update(); }, FLICKER_MILLISECONDS);
    }
    this.start();
  }

  compareWith(against) {
    this.against = $("against").value = against;
    this.start();
  }

  // Lets the next list load the saved image again; one that is being loaded is not shown.
  forget() {
    Object.assign(this, { list: "", loading: new Set() });
  }

  // Shows the comparison, and loads its saved image if that is not there. Other saved images are forgotten.
  start() {
    const { against, viewport, loading } = this;
    const others = [...viewport.frames.keys()].filter((view) => view.startsWith("save:") && view !== against);
    others.forEach((view) => viewport.forgetView(view));
    this.update();
    const isMissing = against.startsWith("save:") && !viewport.frames.has(against);
    if (!this.isOn() || !isMissing || loading.has(against)) return;
    loading.add(against);
    this.load(against, loading)
      .catch(({ message }) => {
        if (this.loading !== loading) return;
        this.notify(`cannot compare with the saved image: ${message}`, true);
        if (this.against === against) this.compareWith("raw");
      })
      .finally(() => loading.delete(against));
  }

  // Loads a saved image; throws why it cannot.
  async load(against, loading) {
    const answer = await fetch(`/saves/${against.slice("save:".length)}${location.search}`).catch(() => null);
    if (!answer) throw new Error("no answer from prpf");
    if (!answer.ok) throw new Error(await answer.text() || `prpf answered with status ${answer.status}`);
    const frame = decodeFrame(await answer.arrayBuffer());
    if (!frame) throw new Error("it is no frame");
    if (this.loading !== loading || this.against !== against) return;
    const [width, height] = this.viewport.size;
    if (frame.width !== width || frame.height !== height) {
      throw new Error(`it has ${frame.width}×${frame.height} pixels, the render ${width}×${height}`);
    }
    this.viewport.setFrame(against, frame);
    this.update();
  }

  // Fills the list of what there is to compare with.
  show({ views, saves }) {
    const own = views.filter(({ view }) => view === "raw" || view === "reference");
    const entries = [
      ...own.map(({ view }) => [view, VIEW_NAMES[view]]),
      ...saves.map(({ number, name, spp }) => [`save:${number}`, spp === null ? name : `${name} · ${spp.toFixed(spp < 1 ? 2 : 1)} spp`]),
    ];
    const list = JSON.stringify(entries);
    if (list === this.list) return;
    this.list = list;
    $("against").replaceChildren(...entries.map(([value, textContent]) => Object.assign(document.createElement("option"), { value, textContent })));
    const isThere = entries.some(([value]) => value === this.against);
    if (!isThere) this.against = "raw";
    $("against").value = this.against;
    this.start();
  }
}
