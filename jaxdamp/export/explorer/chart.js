// Diagrams on a canvas: axes with round numbers, lines and points, and the numbers under the pointer.

const MARGIN = { left: 58, right: 12, top: 10, bottom: 40 };

function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

// A number for reading: at most so many significant digits, without trailing zeros.
function readable(value, digits = 4) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return value.toExponential(digits - 2).replace("-", "−");
  const places = Math.max(0, Math.min(8, digits - 1 - Math.floor(Math.log10(size))));
  return value.toFixed(places).replace(/(\.\d*?)0+$/, "$1").replace(/\.$/, "").replace("-", "−");
}

// A unit with raised exponents: m/s^2 is m/s².
function unitText(unit) {
  return unit.replace(/\^(-?[\d.]+)/g, (_, power) => raised(power));
}

function raised(power) {
  return [...String(power)].map((character) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[character] || { "-": "⁻", ".": "·" }[character]).join("");
}

// The text of a tick; powers of ten of a long axis are written as such.
function tickText(tick, log) {
  const power = Math.log10(tick);
  if (log && (power < -2.5 || power > 3.5) && Math.abs(power - Math.round(power)) < 1e-9) return `10${raised(Math.round(power))}`;
  return readable(Math.abs(tick) < 1e-12 ? 0 : tick);
}

function ticks(low, high, log, wanted) {
  if (log) {
    const found = [];
    for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); ++power)
      for (const digit of Math.log10(high / low) > 2.5 ? [1] : [1, 2, 5]) found.push(digit * 10 ** power);
    return found.filter((tick) => tick >= low * 0.999 && tick <= high * 1.001);
  }
  const rough = (high - low) / wanted, unit = 10 ** Math.floor(Math.log10(rough));
  const step = unit * [1, 2, 5, 10].find((factor) => factor * unit >= 0.7 * rough);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) found.push(k * step);
  return found;
}

// The range of some series along x or y, slightly widened, from the axis where it is fixed.
function extent(series, key, axis) {
  let low = Infinity, high = -Infinity;
  for (const one of series) {
    for (let i = 0; i < one[key].length; ++i) {
      const value = one[key][i];
      if (!Number.isFinite(value) || (axis.log && value <= 0)) continue;
      if (key === "y" && axis.over && (one.x[i] < axis.over[0] || one.x[i] > axis.over[1])) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  if (!(low <= high)) [low, high] = axis.log ? [0.1, 1] : [0, 1];
  if (axis.log) return [Math.max(low, high * (axis.decades ? 10 ** -axis.decades : 0)) * 0.8, high * 1.25];
  if (axis.symmetric) { high = Math.max(Math.abs(low), Math.abs(high)); low = -high; }
  const space = axis.tight ? 0 : 0.05 * (high - low || Math.abs(high) || 1);
  return [low - space, high + space];
}

class Chart {
  constructor(canvas) {
    this.canvas = canvas;
    this.readout = canvas.parentElement.querySelector(".readout");
    canvas.addEventListener("pointermove", (event) => this.point(event));
    canvas.addEventListener("pointerleave", () => { this.readout.textContent = ""; });
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  // axes: {x, y} with label, unit, scale (of the numbers shown), log, symmetric, range; series: x, y, colour, width, ...
  show(axes, series) {
    this.axes = axes;
    this.series = series;
    this.draw();
  }

  draw() {
    if (!this.axes) return;
    const { canvas, axes } = this, ratio = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width) return;
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    this.area = [MARGIN.left, MARGIN.top, width - MARGIN.right, height - MARGIN.bottom];
    this.range = { x: axes.x.range || extent(this.series, "x", axes.x) };
    this.range.y = axes.y.range || extent(this.series, "y", { ...axes.y, over: axes.x.range });
    this.frame(pen);
    pen.save();
    pen.beginPath();
    pen.rect(this.area[0], this.area[1], this.area[2] - this.area[0], this.area[3] - this.area[1]);
    pen.clip();
    for (const one of this.series) (one.points ? this.points : this.line).call(this, pen, one);
    pen.restore();
  }

  place(key, value) {
    const [low, high] = this.range[key], at = key === "x" ? [this.area[0], this.area[2]] : [this.area[3], this.area[1]];
    const log = this.axes[key].log;
    const share = log ? Math.log(Math.max(value, 1e-300) / low) / Math.log(high / low) : (value - low) / (high - low);
    return at[0] + share * (at[1] - at[0]);
  }

  frame(pen) {
    const [left, top, right, bottom] = this.area, { x, y } = this.axes;
    pen.font = "12px system-ui, sans-serif";
    pen.lineWidth = 1;
    for (const [key, axis, wanted] of [["x", x, (right - left) / 80], ["y", y, (bottom - top) / 32]]) {
      const scale = axis.scale || 1, range = this.range[key].map((end) => end * scale);
      for (const tick of ticks(...range, axis.log, Math.max(2, wanted))) {
        const at = Math.round(this.place(key, tick / scale)) + 0.5, text = tickText(tick, axis.log);
        pen.strokeStyle = colour(Math.abs(tick) < 1e-12 ? "axis" : "grid");
        pen.beginPath();
        if (key === "x") { pen.moveTo(at, top); pen.lineTo(at, bottom); } else { pen.moveTo(left, at); pen.lineTo(right, at); }
        pen.stroke();
        pen.fillStyle = colour("quiet");
        pen.textAlign = key === "x" ? "center" : "right";
        pen.textBaseline = key === "x" ? "top" : "middle";
        if (key === "x") pen.fillText(text, at, bottom + 6); else pen.fillText(text, left - 6, at);
      }
    }
    pen.strokeStyle = colour("axis");
    pen.strokeRect(left + 0.5, top + 0.5, right - left - 1, bottom - top - 1);
    pen.fillStyle = colour("text");
    pen.textAlign = "center";
    pen.textBaseline = "bottom";
    pen.fillText(`${x.label} [${x.unit}]`, (left + right) / 2, this.canvas.clientHeight - 2);
    pen.save();
    pen.translate(2, (top + bottom) / 2);
    pen.rotate(-Math.PI / 2);
    pen.textBaseline = "top";
    pen.fillText(`${y.label} [${y.unit}]`, 0, 0);
    pen.restore();
  }

  line(pen, one) {
    pen.strokeStyle = colour(one.colour);
    pen.globalAlpha = one.alpha || 1;
    pen.lineWidth = one.width || 2;
    pen.lineJoin = "round";
    pen.setLineDash(one.dash || []);
    pen.beginPath();
    for (let i = 0; i < one.x.length; ++i) pen.lineTo(this.place("x", one.x[i]), this.place("y", one.y[i]));
    pen.stroke();
    pen.setLineDash([]);
    pen.globalAlpha = 1;
  }

  points(pen, one) {
    pen.fillStyle = colour(one.colour);
    pen.globalAlpha = one.alpha || 1;
    for (let i = 0; i < one.x.length; ++i)
      pen.fillRect(this.place("x", one.x[i]) - 1, this.place("y", one.y[i]) - 1, 2, 2);
    pen.globalAlpha = 1;
  }

  point(event) {
    if (!this.area) return;
    const box = this.canvas.getBoundingClientRect(), [left, top, right, bottom] = this.area;
    const shares = [(event.clientX - box.left - left) / (right - left), (bottom - event.clientY + box.top) / (bottom - top)];
    if (shares.some((share) => share < 0 || share > 1)) { this.readout.textContent = ""; return; }
    const numbers = ["x", "y"].map((key, k) => {
      const [low, high] = this.range[key], { log, scale = 1, unit } = this.axes[key];
      const value = log ? low * (high / low) ** shares[k] : low + shares[k] * (high - low);
      return `${readable(value * scale, 3)} ${unit}`;
    });
    this.readout.textContent = numbers.join(", ");
  }
}
