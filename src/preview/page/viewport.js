// Draws the image with WebGL 2. Half floats are uploaded unchanged; the fragment shader applies exposure, the sRGB curve
// and the colour map, so that these react without a new frame.

import { COLOURS } from "./colour_scale.js";
import { fromHalf } from "./half_float.js";
import { kindOf } from "./views.js";

const VERTEX = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID % 2, gl_VertexID / 2) * 4.0 - 1.0, 0.0, 1.0); }`;

const FRAGMENT = `#version 300 es
precision highp float;
uniform highp sampler2D left, right, colours;
uniform vec2 size, canvas, origin;   // image in pixels; canvas and its image's corner in device pixels
uniform float zoom, exposure, wipe;  // device pixels per pixel; factor; fraction of the image
uniform ivec2 kinds;                 // 0 radiance, 1 reflectance, 2 direction, 3 map, -1 nothing
uniform vec4 leftScale, rightScale;  // curve (0 linear, 1 logarithmic), low, high
uniform vec2 leftPart, rightPart;    // part of the texture that is the image: a coarse one's last squares may reach beyond
out vec4 colour;

vec3 encode(vec3 v) {
  v = clamp(v, 0.0, 1.0);
  return mix(1.055 * pow(v, vec3(1.0 / 2.4)) - 0.055, 12.92 * v, lessThanEqual(v, vec3(0.0031308)));
}

vec3 toColour(vec3 v, int kind, vec4 scale) {
  if (kind == 0) return encode(v * exposure);
  if (kind == 1) return encode(v);
  if (kind == 2) return 0.5 + 0.5 * v;
  float t = scale.x > 0.5
    ? (log(max(v.x, 1e-30)) - log(scale.y)) / (log(scale.z) - log(scale.y))
    : (v.x - scale.y) / (scale.z - scale.y);
  return texture(colours, vec2((clamp(t, 0.0, 1.0) * 255.0 + 0.5) / 256.0, 0.5)).rgb;
}

void main() {
  vec2 at = vec2(gl_FragCoord.x, canvas.y - gl_FragCoord.y) - origin;
  vec2 uv = at / (zoom * size);
  if (any(lessThan(uv, vec2(0.0))) || any(greaterThanEqual(uv, vec2(1.0)))) { colour = vec4(0.0); return; }
  bool isLeft = uv.x < wipe;
  int kind = isLeft ? kinds.x : kinds.y;
  if (kind < 0) { colour = vec4(0.0, 0.0, 0.0, 1.0); return; }
  vec3 v = isLeft ? texture(left, uv * leftPart).rgb : texture(right, uv * rightPart).rgb;
  colour = vec4(toColour(v, kind, isLeft ? leftScale : rightScale), 1.0);
}`;

// Returns a frame, or every k-th of its pixels if a side is longer than `largest`.
function thinned(frame, largest) {
  const k = Math.ceil(Math.max(frame.columns, frame.rows) / largest);
  if (k <= 1) return frame;
  const [columns, rows] = [frame.columns, frame.rows].map((side) => Math.ceil(side / k));
  const { channels } = frame;
  const halves = new Uint16Array(columns * rows * channels);
  for (let y = 0; y < rows; y++) {
    for (let x = 0; x < columns; x++) {
      const first = (y * k * frame.columns + x * k) * channels;
      halves.set(frame.halves.subarray(first, first + channels), (y * columns + x) * channels);
    }
  }
  return { columns, rows, channels, halves };
}

export class Viewport {
  constructor(canvas) {
    this.canvas = canvas;
    this.frames = new Map(); // view → newest frame
    this.size = [1, 1];
    this.zoom = 1; // CSS pixels per pixel
    this.corner = [0, 0]; // of the image, in CSS pixels; it is drawn at the nearest device pixel
    this.isFitted = true;
    this.exposure = 0; // stops
    this.wipe = null; // fraction of the image's width, or null
    this.shown = { left: null, right: "filtered" };
    this.scales = {};
    this.isThinned = false; // whether the user was told that pixels are left out
    this.drawn = 0;
    this.onlayout = () => {};
    this.onproblem = () => null; // returns the notice's element
    const context = { alpha: true, antialias: false, depth: false, preserveDrawingBuffer: true };
    this.gl = canvas.getContext("webgl2", context);
    if (this.gl) this.initialise();
    canvas.addEventListener("webglcontextlost", (event) => this.lose(event));
    canvas.addEventListener("webglcontextrestored", () => this.restore());
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.followRatio();
  }

  // Compiles the shaders and uploads the colour map.
  initialise() {
    const gl = this.gl;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    const names = ["left", "right", "colours", "size", "canvas", "origin", "zoom", "exposure", "wipe", "kinds", "leftScale", "rightScale", "leftPart", "rightPart"];
    this.uniforms = Object.fromEntries(names.map((name) => [name, gl.getUniformLocation(program, name)]));
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    this.textures = new Map();
    this.largest = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    this.colours = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.colours);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, COLOURS.length / 4, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, COLOURS);
    this.setFilter(gl.LINEAR, gl.LINEAR);
  }

  // Asks the browser to restore the graphics context, as after the graphics driver has been restarted.
  lose(event) {
    event.preventDefault();
    this.notice = this.onproblem("the browser has lost the graphics context: the image is shown again when it has restored it");
  }

  // Uploads everything again.
  restore() {
    this.notice?.remove();
    this.initialise();
    for (const [view, frame] of this.frames) this.upload(view, frame);
    this.redraw();
  }

  // Sets how the bound texture is sampled.
  setFilter(smaller, larger) {
    const gl = this.gl;
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, smaller);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, larger);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  }

  // Sets the size of the image, which is known before the first frame.
  setSize(width, height) {
    if (this.size[0] === width && this.size[1] === height) return;
    this.size = [width, height];
    this.fit();
  }

  // Replaces the frame of a view and uploads it.
  setFrame(view, frame) {
    this.frames.set(view, frame);
    this.setSize(frame.width, frame.height);
    if (this.gl) this.upload(view, frame);
    this.redraw();
  }

  // Uploads a frame, thinned out if it is larger than the graphics card takes.
  upload(view, frame) {
    const gl = this.gl;
    const { columns, rows, channels, halves } = thinned(frame, this.largest);
    if (columns < frame.columns && !this.isThinned) {
      this.isThinned = true;
      this.onproblem(`this graphics card takes images of at most ${this.largest} pixels a side: ${columns}×${rows} of this one's are shown`);
    }
    const part = [frame.width / (frame.grid * frame.columns), frame.height / (frame.grid * frame.rows)];
    const [inside, format] = channels === 3 ? [gl.RGB16F, gl.RGB] : [gl.R16F, gl.RED];
    const old = this.textures.get(view);
    gl.activeTexture(gl.TEXTURE0);
    if (old && old.columns === columns && old.rows === rows) {
      gl.bindTexture(gl.TEXTURE_2D, old.texture);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, columns, rows, format, gl.HALF_FLOAT, halves);
    } else {
      if (old) gl.deleteTexture(old.texture);
      const texture = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, inside, columns, rows, 0, format, gl.HALF_FLOAT, halves);
      // The squares of an unfiltered image are shown as they are, between those of a filtered one values are interpolated.
      this.setFilter(gl.LINEAR, frame.grid > 1 && view !== "raw" ? gl.LINEAR : gl.NEAREST);
      this.textures.set(view, { texture, columns, rows, part });
    }
  }

  // Forgets the image of a view.
  forgetView(view) {
    this.frames.delete(view);
    const old = this.textures?.get(view);
    if (!old) return;
    this.gl.deleteTexture(old.texture);
    this.textures.delete(view);
  }

  // Forgets all images.
  forget() {
    this.frames.clear();
    this.isThinned = false;
    this.textures?.forEach(({ texture }) => this.gl.deleteTexture(texture));
    this.textures?.clear();
    this.redraw();
  }

  // Returns the values of a view at a pixel, or null.
  read(view, x, y) {
    const frame = this.frames.get(view);
    if (!frame || x < 0 || y < 0 || x >= frame.width || y >= frame.height) return null;
    const first = (Math.floor(y / frame.grid) * frame.columns + Math.floor(x / frame.grid)) * frame.channels;
    return Array.from(frame.halves.subarray(first, first + frame.channels), fromHalf);
  }

  // Follows the ratio of device pixels to CSS pixels, which another screen or the browser's zoom changes.
  followRatio() {
    const isSame = matchMedia(`(resolution: ${window.devicePixelRatio || 1}dppx)`);
    isSame.addEventListener("change", () => { this.resize(); this.followRatio(); }, { once: true });
  }

  // Follows the size of the element.
  resize() {
    const { canvas } = this;
    const sides = [canvas.clientWidth, canvas.clientHeight];
    const [width, height] = sides.map((side) => Math.max(1, Math.round(side * (window.devicePixelRatio || 1))));
    if (this.isFitted) this.fit();
    if (canvas.width === width && canvas.height === height) return;
    // This clears the canvas, which is shown before the next screen refresh.
    Object.assign(canvas, { width, height });
    this.draw();
    this.onlayout();
  }

  // Returns the ratio of device pixels to CSS pixels.
  ratio() {
    return this.canvas.width / Math.max(1, this.canvas.clientWidth);
  }

  // Returns the zoom by which the whole image is shown.
  fittedZoom() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const [w, h] = this.size;
    const margin = Math.min(width, height) > 500 ? 48 : 8;
    const zoom = Math.max(0.01, Math.min((width - 2 * margin) / w, (height - 2 * margin) / h));
    // Quarters keep the pixels of an enlarged image at nearly one size.
    return zoom > 2 ? Math.floor(zoom * 4) / 4 : zoom;
  }

  // Shows the whole image.
  fit() {
    this.isFitted = true;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const [w, h] = this.size;
    this.zoom = this.fittedZoom();
    this.corner = [(width - w * this.zoom) / 2, (height - h * this.zoom) / 2];
    this.redraw();
  }

  // Zooms by a factor around a point of the canvas.
  zoomBy(factor, [x, y] = [this.canvas.clientWidth / 2, this.canvas.clientHeight / 2]) {
    const fitted = this.fittedZoom();
    const zoom = Math.min(Math.max(64, fitted), Math.max(Math.min(0.05, fitted), this.zoom * factor));
    this.corner = [x, y].map((p, k) => p - ((p - this.corner[k]) * zoom) / this.zoom);
    this.zoom = zoom;
    this.isFitted = false;
    this.redraw();
  }

  pan(dx, dy) {
    this.corner = [this.corner[0] + dx, this.corner[1] + dy];
    this.isFitted = false;
    this.redraw();
  }

  // Moves the image as little as is needed to show a pixel.
  reveal([x, y]) {
    const sides = [this.canvas.clientWidth, this.canvas.clientHeight];
    const shift = (low, k) => (low < 0 ? -low : Math.min(0, sides[k] - low - this.zoom));
    const delta = this.toCanvas(x, y).map(shift);
    if (delta.some(Boolean)) this.pan(...delta);
  }

  // Returns the corner of the image as it is drawn, in CSS pixels.
  drawnCorner() {
    const ratio = this.ratio();
    return this.corner.map((v) => Math.round(v * ratio) / ratio);
  }

  // Returns the pixel under a point of the canvas.
  pixelAt(x, y) {
    const [left, top] = this.drawnCorner();
    return [Math.floor((x - left) / this.zoom), Math.floor((y - top) / this.zoom)];
  }

  // Returns the pixel in the middle of what is shown, or of the image if all of it is.
  middle() {
    if (this.isFitted) return this.size.map((side) => side >> 1);
    return this.pixelAt(this.canvas.clientWidth / 2, this.canvas.clientHeight / 2);
  }

  // Returns the point of the canvas where pixel coordinates are.
  toCanvas(x, y) {
    const [left, top] = this.drawnCorner();
    return [left + x * this.zoom, top + y * this.zoom];
  }

  contains([x, y]) {
    return x >= 0 && y >= 0 && x < this.size[0] && y < this.size[1];
  }

  // Draws at the next screen refresh; the promise resolves when that is done.
  redraw() {
    this.pending ??= new Promise((done) => requestAnimationFrame(() => {
      this.pending = null;
      this.draw();
      this.onlayout();
      done();
    }));
    return this.pending;
  }

  draw() {
    const gl = this.gl;
    if (!gl) return;
    const ratio = this.ratio();
    const { left, right } = this.shown;
    const kind = (view) => (this.textures.has(view) ? kindOf(view) : -1);
    const bind = (unit, texture) => { gl.activeTexture(gl.TEXTURE0 + unit); gl.bindTexture(gl.TEXTURE_2D, texture); };
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    const texture = (view) => this.textures.get(view)?.texture ?? this.colours;
    bind(0, texture(left));
    bind(1, texture(right));
    bind(2, this.colours);
    ["left", "right", "colours"].forEach((name, unit) => gl.uniform1i(this.uniforms[name], unit));
    gl.uniform2f(this.uniforms.size, ...this.size);
    gl.uniform2f(this.uniforms.canvas, this.canvas.width, this.canvas.height);
    gl.uniform2f(this.uniforms.origin, ...this.drawnCorner().map((v) => v * ratio));
    gl.uniform1f(this.uniforms.zoom, this.zoom * ratio);
    gl.uniform1f(this.uniforms.exposure, 2 ** this.exposure);
    gl.uniform1f(this.uniforms.wipe, this.wipe ?? 0);
    gl.uniform2i(this.uniforms.kinds, kind(left), kind(right));
    for (const [name, view] of [["leftScale", left], ["rightScale", right]]) {
      const scale = this.scales[view] ?? { curve: "linear", low: 0, high: 1 };
      gl.uniform4f(this.uniforms[name], scale.curve === "linear" ? 0 : 1, scale.low, scale.high, 0);
    }
    for (const [name, view] of [["leftPart", left], ["rightPart", right]]) {
      gl.uniform2f(this.uniforms[name], ...(this.textures.get(view)?.part ?? [1, 1]));
    }
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    this.drawn++;
  }
}
