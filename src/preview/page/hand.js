// What the hand does on the image: mouse, touch and keys.

const ORBIT_PER_PIXEL = 0.006; // radians
const ORBIT_STEP = 0.05;
const PAN_STEP = 0.03; // image heights
const DOLLY_PER_WHEEL = 0.0015;
const DOLLY_STEP = 0.1;
const CLICK_DISTANCE = 4; // CSS pixels that a click may slip
const NO_REGION = [[0, 0], [0, 0]];

// `act`: { camera(move), focus(pixel), region(shares), inspect(pixel), keep(pixel) }.
export class Hand {
  constructor(canvas, picture, act) {
    Object.assign(this, { canvas, picture, act, tool: "look", pointers: new Map(), cursor: null });
    canvas.addEventListener("pointerdown", (e) => this.down(e));
    canvas.addEventListener("pointermove", (e) => this.move(e));
    canvas.addEventListener("pointerup", (e) => this.up(e));
    canvas.addEventListener("pointercancel", (e) => this.up(e));
    canvas.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("keydown", (e) => this.key(e));
    // Movements of one refresh go as one command.
    this.moves = { orbit: [0, 0], pan: [0, 0], dolly: 0 };
  }

  use(tool) {
    this.tool = tool;
    this.canvas.dataset.tool = tool;
  }

  at(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  down(event) {
    this.canvas.focus({ preventScroll: true });
    this.canvas.setPointerCapture(event.pointerId);
    const at = this.at(event);
    this.pointers.set(event.pointerId, { start: at, last: at, slipped: false, marks: false, pinched: false });
    if (this.pointers.size > 1) this.join();
    this.canvas.classList.add("held");
  }

  move(event) {
    const held = this.pointers.get(event.pointerId);
    const at = this.at(event);
    if (!held) return this.act.inspect(this.picture.pixelAt(...at));
    const delta = at.map((v, k) => v - held.last[k]);
    held.slipped ||= Math.hypot(at[0] - held.start[0], at[1] - held.start[1]) > CLICK_DISTANCE;
    if (!held.slipped) return;
    if (this.pointers.size > 1) this.pinch(event.pointerId, at);
    else if (this.tool === "camera") this.turn(delta, event);
    else if (this.tool === "region" && event.buttons === 1 && !held.pinched) {
      held.marks = true;
      this.act.region(this.shares(held.start, at), false);
    } else this.picture.pan(...delta);
    held.last = at;
  }

  up(event) {
    const held = this.pointers.get(event.pointerId);
    this.pointers.delete(event.pointerId);
    if (!this.pointers.size) this.canvas.classList.remove("held");
    if (!held) return;
    if (event.type === "pointercancel") return this.act.region(NO_REGION, true);
    const at = this.at(event);
    const pixel = this.picture.pixelAt(...at);
    if (held.slipped) {
      if (held.marks) this.act.region(this.shares(held.start, at), true);
    } else if (this.picture.contains(pixel)) {
      if (this.tool === "focus") this.act.focus(pixel);
      this.put(pixel);
    }
  }

  // A second finger makes a pinch of what was going to be a click or a region.
  join() {
    for (const held of this.pointers.values()) Object.assign(held, { slipped: true, marks: false, pinched: true });
    this.act.region(NO_REGION, true);
  }

  pinch(id, at) {
    const [a, b] = [...this.pointers].map(([other, p]) => ({ old: p.last, now: other === id ? at : p.last }));
    const size = (p, q) => Math.max(1, Math.hypot(p[0] - q[0], p[1] - q[1]));
    const factor = size(a.now, b.now) / size(a.old, b.old);
    const middle = [0, 1].map((k) => (a.now[k] + b.now[k]) / 2);
    const delta = middle.map((v, k) => v - (a.old[k] + b.old[k]) / 2);
    if (this.tool === "camera") {
      this.pan(this.heights(delta));
      this.moves.dolly += Math.log(factor);
      this.flush();
    } else {
      this.picture.pan(...delta);
      this.picture.zoomBy(factor, middle);
    }
  }

  // A way on the canvas, in image heights.
  heights(delta) {
    return delta.map((v) => v / (this.picture.size[1] * this.picture.zoom));
  }

  pan(heights) {
    this.moves.pan = this.moves.pan.map((v, k) => v + heights[k]);
  }

  turn(delta, event) {
    if (event.ctrlKey || event.buttons === 2) this.moves.dolly -= this.heights(delta)[1];
    else if (event.shiftKey || event.buttons === 4) this.pan(this.heights(delta));
    else this.moves.orbit = this.moves.orbit.map((v, k) => v + delta[k] * ORBIT_PER_PIXEL);
    this.flush();
  }

  flush() {
    this.pending ??= requestAnimationFrame(() => {
      this.pending = null;
      const { orbit, pan, dolly } = this.moves;
      this.moves = { orbit: [0, 0], pan: [0, 0], dolly: 0 };
      const move = {};
      if (orbit.some(Boolean)) move.orbit = orbit;
      if (pan.some(Boolean)) move.pan = pan;
      if (dolly) move.dolly = Math.max(-4, Math.min(4, dolly));
      if (Object.keys(move).length) this.act.camera(move);
    });
  }

  wheel(event) {
    event.preventDefault();
    if (this.tool === "camera") {
      this.moves.dolly -= event.deltaY * DOLLY_PER_WHEEL;
      this.flush();
    } else {
      this.picture.zoomBy(Math.exp(-event.deltaY * DOLLY_PER_WHEEL), this.at(event));
    }
  }

  shares(from, to) {
    return [0, 1].map((k) => [from[k], to[k]]
      .map((v) => (v - this.picture.corner[k]) / (this.picture.zoom * this.picture.size[k]))
      .map((v) => Math.min(1, Math.max(0, v)))
      .sort((a, b) => a - b));
  }

  put(pixel) {
    this.cursor = pixel.map((v, k) => Math.min(this.picture.size[k] - 1, Math.max(0, v)));
    this.act.keep(this.cursor);
  }

  key(event) {
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const arrow = arrows[event.key];
    const middle = () => this.cursor ?? this.picture.size.map((v) => v >> 1);
    if (arrow && this.tool === "camera") {
      if (event.shiftKey) this.pan(arrow.map((v) => v * PAN_STEP));
      else this.moves.orbit = this.moves.orbit.map((v, k) => v + arrow[k] * ORBIT_STEP);
      this.flush();
    } else if (arrow) {
      this.put(middle().map((v, k) => v + arrow[k] * (event.shiftKey ? 10 : 1)));
    } else if (event.key === "PageUp" || event.key === "PageDown") {
      this.moves.dolly += event.key === "PageUp" ? DOLLY_STEP : -DOLLY_STEP;
      this.flush();
    } else if (event.key === "Enter" && this.tool === "focus") {
      this.act.focus(middle());
    } else if (event.key === "Enter" && this.tool === "region") {
      const around = middle().map((v, k) => [v - this.picture.size[k] / 8, v + this.picture.size[k] / 8]);
      const shares = around.map((range, k) => range.map((v) => Math.min(1, Math.max(0, v / this.picture.size[k]))));
      this.act.region(shares, true);
    } else {
      return;
    }
    event.preventDefault();
    event.stopPropagation();
  }
}
