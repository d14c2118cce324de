// The colour map of all maps, and the legend of a colour scale.
//
// The colour map is perceptually uniform by construction: a curve through OKLab (Ottosson 2020) from dark violet to
// pale yellow with rising lightness, sampled at equal distances in that space.

const STEPS = 256;
const CURVE_POINTS = 4096;

function oklabToLinear([L, a, b]) {
  const l = (L + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const m = (L - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const s = (L - 0.0894841775 * a - 1.291485548 * b) ** 3;
  return [
    4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
    -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
    -0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s,
  ];
}

const encode = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);

// Returns the OKLab colour at t in [0, 1]: the hue turns from violet through blue and green to yellow.
function colourAt(t) {
  const L = 0.2 + 0.74 * t;
  const hue = ((300 - 195 * t) * Math.PI) / 180;
  let chroma = 0.02 + 0.13 * Math.sin(Math.PI * Math.min(1, 0.18 + 0.75 * t));
  const at = () => [L, chroma * Math.cos(hue), chroma * Math.sin(hue)];
  // Reduce the chroma of colours outside the sRGB gamut.
  while (chroma > 0 && oklabToLinear(at()).some((v) => v < 0 || v > 1)) chroma -= 0.002;
  return at();
}

// 256 colours as RGBA bytes.
export const COLOURS = (() => {
  const points = Array.from({ length: CURVE_POINTS + 1 }, (_, i) => colourAt(i / CURVE_POINTS));
  const lengths = [0];
  for (let i = 1; i <= CURVE_POINTS; i++) {
    lengths.push(lengths[i - 1] + Math.hypot(...points[i].map((v, k) => v - points[i - 1][k])));
  }
  const bytes = new Uint8Array(4 * STEPS);
  let at = 0;
  for (let step = 0; step < STEPS; step++) {
    while (at < CURVE_POINTS && lengths[at] < (lengths[CURVE_POINTS] * step) / (STEPS - 1)) at++;
    const rgb = oklabToLinear(points[at]).map((v) => Math.round(255 * encode(Math.min(1, Math.max(0, v)))));
    bytes.set([...rgb, 255], 4 * step);
  }
  return bytes;
})();

const CURVES = { linear: (v) => v, log2: Math.log2, log10: Math.log10 };

// Returns the position of a value on a scale, in [0, 1].
function position(scale, value) {
  const f = CURVES[scale.curve];
  const t = (f(value) - f(scale.low)) / (f(scale.high) - f(scale.low));
  return Math.min(1, Math.max(0, Number.isNaN(t) ? 0 : t));
}

// Returns the values that the legend labels.
function ticks(scale) {
  if (scale.curve === "linear") return [0, 0.25, 0.5, 0.75, 1].map((t) => scale.low + t * (scale.high - scale.low));
  const base = scale.curve === "log2" ? 2 : 10;
  const f = CURVES[scale.curve];
  const first = Math.round(f(scale.low)), last = Math.round(f(scale.high));
  const stride = Math.max(1, Math.ceil((last - first) / 6));
  const values = [];
  for (let e = first; e <= last; e += stride) values.push(base ** e);
  return values;
}

// Formats a value with at most four digits.
export function short(value) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) return value.toExponential(1).replace(".0e", "e").replace("e-", "e−").replace("e+", "e");
  if (size > 0 && size < 1 && Number.isInteger(Math.log2(size)) && size >= 1 / 64) return `1/${1 / size}`;
  return String(Number(value.toPrecision(4)));
}

// Shows the legend of a scale; hides it without one.
export function drawLegend(legend, scale) {
  legend.hidden = !scale;
  const key = JSON.stringify(scale);
  if (!scale || legend.dataset.key === key) return;
  legend.dataset.key = key;
  const context = legend.querySelector("canvas").getContext("2d");
  context.putImageData(new ImageData(new Uint8ClampedArray(COLOURS), STEPS, 1), 0, 0);
  const line = legend.querySelector(".ticks");
  line.replaceChildren(...ticks(scale).map((value) => {
    const tick = document.createElement("span");
    tick.textContent = short(value);
    tick.style.left = `${100 * position(scale, value)}%`;
    return tick;
  }));
  if (scale.mark !== null) {
    const mark = document.createElement("i");
    mark.title = `set: ${short(scale.mark)}`;
    mark.style.left = `${100 * position(scale, scale.mark)}%`;
    line.append(mark);
  }
  legend.querySelector("p").textContent = scale.unit;
}
