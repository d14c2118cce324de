// Draws the image: half floats go to the graphics card as they are; exposure, the sRGB curve and false
// colours are applied there, so they answer at once.

import { fromHalf } from "./link.js";
import { COLOURS } from "./scale.js";

const VERTEX = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID % 2, gl_VertexID / 2) * 4.0 - 1.0, 0.0, 1.0); }`;

const FRAGMENT = `#version 300 es
precision highp float;
uniform highp sampler2D left, right, colours;
uniform vec2 size, canvas, origin;   // image in pixels; canvas and its image's corner in device pixels
uniform float zoom, exposure, wipe;  // device pixels per pixel; factor; share of the image
uniform ivec2 kinds;                 // 0 light, 1 reflectance, 2 direction, 3 map, -1 nothing
uniform vec4 leftScale, rightScale;  // curve (0 linear, 1 logarithm), low, high
out vec4 colour;

vec3 encode(vec3 v) {
  v = clamp(v, 0.0, 1.0);
  return mix(1.055 * pow(v, vec3(1.0 / 2.4)) - 0.055, 12.92 * v, lessThanEqual(v, vec3(0.0031308)));
}

vec3 show(vec3 v, int kind, vec4 scale) {
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
  vec3 v = isLeft ? texture(left, uv).rgb : texture(right, uv).rgb;
  colour = vec4(show(v, kind, isLeft ? leftScale : rightScale), 1.0);
}`;

const KINDS = { filtered: 0, raw: 0, albedo: 1, normal: 2 };
const MAP = 3;

export class Picture {
  constructor(canvas) {
    this.canvas = canvas;
    this.frames = new Map(); // view → newest frame
    this.size = [1, 1];
    this.zoom = 1; // CSS pixels per pixel
    this.corner = [0, 0]; // of the image, in CSS pixels
    this.fitted = true;
    this.exposure = 0;
    this.wipe = null; // share of the image, or null
    this.shown = { left: null, right: "filtered" };
    this.scales = {};
    this.drawn = 0;
    this.onlayout = () => {};
    const context = { alpha: true, antialias: false, depth: false, preserveDrawingBuffer: true };
    this.gl = canvas.getContext("webgl2", context);
    if (this.gl) this.prepare();
    new ResizeObserver(() => this.resize()).observe(canvas);
  }

  prepare() {
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
    const names = ["left", "right", "colours", "size", "canvas", "origin", "zoom", "exposure", "wipe", "kinds", "leftScale", "rightScale"];
    this.at = Object.fromEntries(names.map((name) => [name, gl.getUniformLocation(program, name)]));
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    this.textures = new Map();
    this.colours = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.colours);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, COLOURS.length / 4, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, COLOURS);
    this.filter(gl.LINEAR, gl.LINEAR);
  }

  filter(smaller, larger) {
    const gl = this.gl;
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, smaller);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, larger);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  }

  // Takes the image's size, which is known before the first frame comes.
  measure(width, height) {
    if (this.size[0] === width && this.size[1] === height) return;
    this.size = [width, height];
    if (this.fitted) this.fit();
  }

  // Takes a view's new frame.
  take(view, frame) {
    this.frames.set(view, frame);
    const { width, height, channels } = frame;
    this.measure(width, height);
    const gl = this.gl;
    if (!gl) return;
    const [inside, format] = channels === 3 ? [gl.RGB16F, gl.RGB] : [gl.R16F, gl.RED];
    const old = this.textures.get(view);
    gl.activeTexture(gl.TEXTURE0);
    if (old && old.width === width && old.height === height) {
      gl.bindTexture(gl.TEXTURE_2D, old.texture);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, height, format, gl.HALF_FLOAT, frame.halves);
    } else {
      if (old) gl.deleteTexture(old.texture);
      const texture = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, inside, width, height, 0, format, gl.HALF_FLOAT, frame.halves);
      this.filter(gl.LINEAR, gl.NEAREST);
      this.textures.set(view, { texture, width, height });
    }
    this.redraw();
  }

  // The values of a view at a pixel, or null.
  read(view, x, y) {
    const frame = this.frames.get(view);
    if (!frame || x < 0 || y < 0 || x >= frame.width || y >= frame.height) return null;
    const first = (y * frame.width + x) * frame.channels;
    return Array.from(frame.halves.subarray(first, first + frame.channels), fromHalf);
  }

  resize() {
    const ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.max(1, Math.round(this.canvas.clientWidth * ratio));
    this.canvas.height = Math.max(1, Math.round(this.canvas.clientHeight * ratio));
    if (this.fitted) this.fit();
    this.redraw();
  }

  fit() {
    this.fitted = true;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const [w, h] = this.size;
    const margin = Math.min(width, height) > 500 ? 48 : 8;
    this.zoom = Math.max(0.01, Math.min((width - 2 * margin) / w, (height - 2 * margin) / h));
    // Whole factors keep pixels of one size.
    if (this.zoom > 2) this.zoom = Math.floor(this.zoom * 4) / 4;
    this.corner = [(width - w * this.zoom) / 2, (height - h * this.zoom) / 2];
    this.redraw();
  }

  // Zooms by a factor around a point of the canvas.
  zoomBy(factor, [x, y] = [this.canvas.clientWidth / 2, this.canvas.clientHeight / 2]) {
    const zoom = Math.min(64, Math.max(0.05, this.zoom * factor));
    this.corner = [x, y].map((p, k) => p - ((p - this.corner[k]) * zoom) / this.zoom);
    this.zoom = zoom;
    this.fitted = false;
    this.redraw();
  }

  pan(dx, dy) {
    this.corner = [this.corner[0] + dx, this.corner[1] + dy];
    this.fitted = false;
    this.redraw();
  }

  // The pixel under a point of the canvas, and the other way round.
  pixelAt(x, y) {
    return [Math.floor((x - this.corner[0]) / this.zoom), Math.floor((y - this.corner[1]) / this.zoom)];
  }
  placeOf(x, y) {
    return [this.corner[0] + x * this.zoom, this.corner[1] + y * this.zoom];
  }
  contains([x, y]) {
    return x >= 0 && y >= 0 && x < this.size[0] && y < this.size[1];
  }

  // Draws with the screen's next refresh; returns when it is done.
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
    const ratio = this.canvas.width / Math.max(1, this.canvas.clientWidth);
    const { left, right } = this.shown;
    const kind = (view) => (this.textures.has(view) ? KINDS[view] ?? MAP : -1);
    const bind = (unit, texture) => { gl.activeTexture(gl.TEXTURE0 + unit); gl.bindTexture(gl.TEXTURE_2D, texture); };
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    const texture = (view) => this.textures.get(view)?.texture ?? this.colours;
    bind(0, texture(left));
    bind(1, texture(right));
    bind(2, this.colours);
    ["left", "right", "colours"].forEach((name, unit) => gl.uniform1i(this.at[name], unit));
    gl.uniform2f(this.at.size, ...this.size);
    gl.uniform2f(this.at.canvas, this.canvas.width, this.canvas.height);
    gl.uniform2f(this.at.origin, ...this.corner.map((v) => Math.round(v * ratio)));
    gl.uniform1f(this.at.zoom, this.zoom * ratio);
    gl.uniform1f(this.at.exposure, 2 ** this.exposure);
    gl.uniform1f(this.at.wipe, this.wipe ?? 0);
    gl.uniform2i(this.at.kinds, kind(left), kind(right));
    for (const [name, view] of [["leftScale", left], ["rightScale", right]]) {
      const scale = this.scales[view] ?? { curve: "linear", low: 0, high: 1 };
      gl.uniform4f(this.at[name], scale.curve === "linear" ? 0 : 1, scale.low, scale.high, 0);
    }
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    this.drawn++;
  }
}
