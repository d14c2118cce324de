// Mouse, touch and keyboard input on the image.

const ORBIT_PER_PIXEL = 0.006; // radians
const ORBIT_STEP = 0.05; // radians
const PAN_STEP = 0.03; // image heights
const LARGE_STEP = 10; // pixels
const DOLLY_PER_WHEEL = 0.0015;
// Two fingers on a trackpad move a wheel with Ctrl, by small steps.
const DOLLY_PER_PINCH = 0.01;
const LARGEST_PINCH = 20;
const DOLLY_STEP = 0.1;
// Of one message, as the render accepts it.
const LARGEST_TURN = 6.28; // radians
const LARGEST_SHIFT = 4; // image heights, or natural logarithm of a distance
const CLICK_DISTANCE = 4; // CSS pixels that a click may move
const NO_REGION = [[0, 0], [0, 0]];

const clampToUnit = (v) => Math.min(1, Math.max(0, v));
const limit = (v, largest) => Math.min(largest, Math.max(-largest, v));

// `act`: callbacks { camera(move), focus(pixel), region(rectangle, isDone), hover(pixel), pin(pixel), click(pixel) }.
export class PointerInput {
  constructor(canvas, viewport, act) {
    Object.assign(this, { canvas, viewport, act, tool: "inspect", pointers: new Map(), cursor: null, corner: null });
    canvas.addEventListener("pointerdown", (e) => this.down(e));
    canvas.addEventListener("pointermove", (e) => this.move(e));
    canvas.addEventListener("pointerup", (e) => this.up(e));
    canvas.addEventListener("pointercancel", (e) => this.up(e));
    canvas.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("keydown", (e) => this.key(e));
    // The sum of all camera moves since the last message.
    this.moves = { orbit: [0, 0], pan: [0, 0], dolly: 0 };
  }

  selectTool(tool) {
    this.tool = tool;
    this.canvas.dataset.tool = tool;
    this.dropCorner();
  }

  // Returns the position of an event on the canvas, in CSS pixels.
  position(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  down(event) {
    this.canvas.focus({ preventScroll: true });
    this.canvas.setPointerCapture(event.pointerId);
    const at = this.position(event);
    this.pointers.set(event.pointerId, { start: at, last: at, isDrag: false, marksRegion: false, isPinch: false });
    if (this.pointers.size > 1) this.startPinch();
    this.canvas.classList.add("held");
  }

  move(event) {
    const pointer = this.pointers.get(event.pointerId);
    const at = this.position(event);
    if (!pointer) return this.act.hover(this.viewport.pixelAt(...at));
    const delta = at.map((v, k) => v - pointer.last[k]);
    pointer.isDrag ||= Math.hypot(at[0] - pointer.start[0], at[1] - pointer.start[1]) > CLICK_DISTANCE;
    if (!pointer.isDrag) return;
    if (this.pointers.size > 1) this.pinch(event.pointerId, at);
    else if (this.tool === "camera") {
      if (!pointer.isPinch) this.moveCamera(delta, event);
    } else if (this.tool === "region" && event.buttons === 1 && !pointer.isPinch) {
      pointer.marksRegion = true;
      this.act.region(this.rectangle(pointer.start, at), false);
    } else this.viewport.pan(...delta);
    pointer.last = at;
  }

  up(event) {
    const pointer = this.pointers.get(event.pointerId);
    this.pointers.delete(event.pointerId);
    if (!this.pointers.size) this.canvas.classList.remove("held");
    if (!pointer) return;
    if (event.type === "pointercancel") return this.act.region(NO_REGION, true);
    const at = this.position(event);
    const pixel = this.viewport.pixelAt(...at);
    if (pointer.isDrag) {
      if (pointer.marksRegion) this.act.region(this.rectangle(pointer.start, at), true);
    } else if (event.button === 0 && this.viewport.contains(pixel)) {
      if (this.tool === "focus") this.act.focus(pixel);
      this.cursor = pixel;
      this.act.click(pixel);
    }
  }

  // A second finger turns a click or a region into a pinch.
  startPinch() {
    for (const pointer of this.pointers.values()) Object.assign(pointer, { isDrag: true, marksRegion: false, isPinch: true });
    this.act.region(NO_REGION, true);
  }

  pinch(id, at) {
    const [a, b] = [...this.pointers].map(([other, p]) => ({ old: p.last, now: other === id ? at : p.last }));
    const distance = (p, q) => Math.max(1, Math.hypot(p[0] - q[0], p[1] - q[1]));
    const factor = distance(a.now, b.now) / distance(a.old, b.old);
    const middle = [0, 1].map((k) => (a.now[k] + b.now[k]) / 2);
    const delta = middle.map((v, k) => v - (a.old[k] + b.old[k]) / 2);
    if (this.tool === "camera") {
      this.pan(this.toHeights(delta));
      this.moves.dolly += Math.log(factor);
      this.sendMoves();
    } else {
      this.viewport.pan(...delta);
      this.viewport.zoomBy(factor, middle);
    }
  }

  // Converts a vector on the canvas to image heights.
  toHeights(delta) {
    return delta.map((v) => v / (this.viewport.size[1] * this.viewport.zoom));
  }

  pan(heights) {
    this.moves.pan = this.moves.pan.map((v, k) => v + heights[k]);
  }

  moveCamera(delta, event) {
    if (event.ctrlKey || event.buttons === 2) this.moves.dolly -= this.toHeights(delta)[1];
    else if (event.shiftKey || event.buttons === 4) this.pan(this.toHeights(delta));
    else this.moves.orbit = this.moves.orbit.map((v, k) => v + delta[k] * ORBIT_PER_PIXEL);
    this.sendMoves();
  }

  // Sends all moves up to the next screen refresh as one message.
  sendMoves() {
    this.pending ??= requestAnimationFrame(() => {
      this.pending = null;
      const { orbit, pan, dolly } = this.moves;
      this.moves = { orbit: [0, 0], pan: [0, 0], dolly: 0 };
      const move = {};
      if (orbit.some(Boolean)) move.orbit = orbit.map((v) => limit(v, LARGEST_TURN));
      if (pan.some(Boolean)) move.pan = pan.map((v) => limit(v, LARGEST_SHIFT));
      if (dolly) move.dolly = limit(dolly, LARGEST_SHIFT);
      if (Object.keys(move).length) this.act.camera(move);
    });
  }

  wheel(event) {
    event.preventDefault();
    const { deltaY } = event;
    const step = event.ctrlKey ? limit(deltaY, LARGEST_PINCH) * DOLLY_PER_PINCH : deltaY * DOLLY_PER_WHEEL;
    if (this.tool === "camera") {
      this.moves.dolly -= step;
      this.sendMoves();
    } else {
      this.viewport.zoomBy(Math.exp(-step), this.position(event));
    }
  }

  // Returns the rectangle between two points of the canvas, as fractions of the image: [[x0, x1], [y0, y1]].
  rectangle(from, to) {
    const corner = this.viewport.drawnCorner();
    return [0, 1].map((k) => [from[k], to[k]]
      .map((v) => (v - corner[k]) / (this.viewport.zoom * this.viewport.size[k]))
      .map(clampToUnit)
      .sort((a, b) => a - b));
  }

  // Returns the rectangle that has two pixels in its corners, as fractions of the image.
  rectangleOfPixels(from, to) {
    return [0, 1].map((k) => [Math.min(from[k], to[k]), Math.max(from[k], to[k]) + 1].map((v) => v / this.viewport.size[k]));
  }

  clampToImage(pixel) {
    return pixel.map((v, k) => Math.min(this.viewport.size[k] - 1, Math.max(0, v)));
  }

  // Pins the inspector to a pixel, which is also the cursor of the arrow keys and a corner of a region begun with Enter.
  pin(pixel) {
    this.cursor = this.clampToImage(pixel);
    this.viewport.reveal(this.cursor);
    this.act.pin(this.cursor);
    if (this.corner) this.act.region(this.rectangleOfPixels(this.corner, this.cursor), false);
  }

  // Forgets what belongs to another image.
  forget() {
    this.cursor = null;
    this.dropCorner();
  }

  // Gives up a region begun with Enter.
  dropCorner() {
    if (this.corner) this.act.region(NO_REGION, true);
    this.corner = null;
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const arrow = arrows[event.key];
    const cursor = this.clampToImage(this.cursor ?? this.viewport.middle());
    if (arrow && this.tool === "camera") {
      if (event.shiftKey) this.pan(arrow.map((v) => v * PAN_STEP));
      else this.moves.orbit = this.moves.orbit.map((v, k) => v + arrow[k] * ORBIT_STEP);
      this.sendMoves();
    } else if (arrow) {
      this.pin(cursor.map((v, k) => v + arrow[k] * (event.shiftKey ? LARGE_STEP : 1)));
    } else if (event.key === "PageUp" || event.key === "PageDown") {
      this.moves.dolly += event.key === "PageUp" ? DOLLY_STEP : -DOLLY_STEP;
      this.sendMoves();
    } else if (event.key === "Enter" && this.tool === "focus") {
      this.act.focus(cursor);
    } else if (event.key === "Enter" && this.tool === "region" && !this.corner) {
      this.corner = cursor;
      this.pin(cursor);
    } else if (event.key === "Enter" && this.tool === "region") {
      this.act.region(this.rectangleOfPixels(this.corner, cursor), true);
      this.corner = null;
    } else if (event.key === "Escape" && this.corner) {
      this.dropCorner();
    } else {
      return;
    }
    event.preventDefault();
    event.stopPropagation();
  }
}
