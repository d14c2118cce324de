// The estimated error over time on logarithmic axes, and its forecast.

const COLOURS = { axis: "#4a4a4a", text: "#8e8e8e", line: "#e0e0e0", forecast: "#a0a0a0" };
const LABEL_DISTANCE = 11; // CSS pixels
const LONGEST_FORECAST = 100; // times the seconds so far: a point beyond lies off the plot
const MARGIN = { left: 46, right: 10, top: 8, bottom: 18 };

// Formats a power of ten.
const powerOfTen = (v) => `10${[...String(v)].map((c) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)]).join("")}`;

// Formats a duration.
export function duration(seconds) {
  const whole = Math.round(seconds);
  if (seconds < 9.95) return `${seconds.toFixed(1)} s`;
  if (whole < 120) return `${whole} s`;
  if (whole < 7200) return `${Math.floor(whole / 60)} min ${whole % 60} s`;
  return `${(seconds / 3600).toFixed(1)} h`;
}

// Draws the curve. `points`: [{ seconds, error }]; `next`: the point that is forecast, or null; `target`: an error or null.
export function drawErrorCurve(canvas, points, next, target) {
  // Size the canvas in device pixels
  const ratio = window.devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const c = canvas.getContext("2d");
  c.scale(ratio, ratio);
  c.font = `11px ${getComputedStyle(document.body).fontFamily}`;

  // Choose the ranges of both axes
  const known = points.filter((p) => p.error > 0 && p.seconds > 0);
  const last = known.at(-1);
  const forecast = last && next ? [{ ...next, seconds: Math.min(next.seconds, LONGEST_FORECAST * last.seconds) }] : [];
  const all = [...known, ...forecast];
  const span = (values, least) => {
    let low = Math.min(...values), high = Math.max(...values);
    const spare = Math.max(0, least - (high - low)) / 2;
    return [low - spare - 0.05, high + spare + 0.05];
  };
  const xs = all.length ? span(all.map((p) => Math.log10(p.seconds)), 1) : [-1, 1];
  const ys = all.length
    ? span([...all.map((p) => Math.log10(p.error)), ...(target ? [Math.log10(target)] : [])], 1) : [-4, 0];
  const x = (seconds) => MARGIN.left + ((Math.log10(seconds) - xs[0]) / (xs[1] - xs[0])) * (width - MARGIN.left - MARGIN.right);
  const y = (error) => height - MARGIN.bottom - ((Math.log10(error) - ys[0]) / (ys[1] - ys[0])) * (height - MARGIN.top - MARGIN.bottom);

  // Draw grid and labels
  c.lineWidth = 1;
  c.textBaseline = "middle";
  c.textAlign = "right";
  let labelled = Infinity;
  for (const { factor, e, value } of gridValues(ys)) {
    rule(c, MARGIN.left, y(value), width - MARGIN.right, y(value), COLOURS.axis);
    // Labels that would touch the one before are left out.
    if (Math.abs(y(value) - labelled) < LABEL_DISTANCE) continue;
    labelled = y(value);
    c.fillStyle = COLOURS.text;
    c.fillText((factor > 1 ? `${factor}·` : "") + powerOfTen(e), MARGIN.left - 6, y(value));
  }
  c.textAlign = "center";
  for (const { value } of gridValues(xs)) {
    rule(c, x(value), MARGIN.top, x(value), height - MARGIN.bottom, COLOURS.axis);
    c.fillStyle = COLOURS.text;
    const label = `${Number(value.toPrecision(1))} s`;
    c.fillText(label, Math.min(x(value), width - c.measureText(label).width / 2), height - 7);
  }
  if (target) {
    c.setLineDash([2, 3]);
    rule(c, MARGIN.left, y(target), width - MARGIN.right, y(target), COLOURS.line);
    c.setLineDash([]);
  }

  // Draw the curve and its forecast
  if (!last) return;
  c.strokeStyle = c.fillStyle = COLOURS.line;
  c.beginPath();
  known.forEach((p) => c.lineTo(x(p.seconds), y(p.error)));
  c.stroke();
  for (const p of known) dot(c, x(p.seconds), y(p.error), 2);
  if (next) {
    c.strokeStyle = COLOURS.forecast;
    c.setLineDash([4, 3]);
    c.beginPath();
    c.moveTo(x(last.seconds), y(last.error));
    c.lineTo(x(next.seconds), y(next.error));
    c.stroke();
    c.setLineDash([]);
    c.beginPath();
    c.arc(x(next.seconds), y(next.error), 3, 0, 7);
    c.stroke();
  }
}

// Returns round values within a range of exponents: powers of ten, and 2 and 5 times these in a short range.
function gridValues([low, high]) {
  const found = [];
  for (let e = Math.floor(low); e <= high; e++) {
    for (const factor of high - low > 2 ? [1] : [1, 2, 5]) {
      const at = e + Math.log10(factor);
      if (at >= low && at <= high) found.push({ factor, e, value: factor * 10 ** e });
    }
  }
  return found;
}

// Draws a line, aligned to pixels.
function rule(c, x0, y0, x1, y1, ink) {
  c.strokeStyle = ink;
  c.beginPath();
  c.moveTo(Math.round(x0) + 0.5, Math.round(y0) + 0.5);
  c.lineTo(Math.round(x1) + 0.5, Math.round(y1) + 0.5);
  c.stroke();
}

function dot(c, x, y, radius) {
  c.beginPath();
  c.arc(x, y, radius, 0, 7);
  c.fill();
}
