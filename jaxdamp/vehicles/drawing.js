// Vehicles in motion over their road, each on a canvas: a film that plays, slower if wanted, and is set to any time.
// A design has what `Drawing` names, `height` [0.1 mm] of each point, `road` of each wheel, `force` [N] of each damper.

class Film {
  static level(number) { return number ? 0.1 + 0.75 * number : 0.32; }  // m, of bodies above the road
  static RADIUS = 0.3; static THICK = 0.3; static SIDE = [0.28, 0.2];  // m; what lies to the left is drawn higher
  static SHOWN = 0.25;  // m, of the largest motion in the picture
  static FACTORS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];

  static BAR = `<button type="button" id="filmPlay" aria-label="play or pause">Play</button>
    <label>speed <select id="filmSpeed"><option value="1">as it is</option><option value="0.5">1/2</option>
    <option value="0.2" selected>1/5</option><option value="0.1">1/10</option><option value="0.02">1/50</option></select></label>
    <input type="range" id="filmTime" min="0" step="any" value="0" aria-label="time"> <output id="filmNow"></output>`;

  // `bar` holds its buttons and outputs; `drawn` is called after each picture.
  constructor(bar, drawn = () => {}) {
    bar.innerHTML = Film.BAR;
    const [play, speed, time, now] = ["Play", "Speed", "Time", "Now"].map((id) => document.getElementById("film" + id)), controls = { play, speed, time, now };
    Object.assign(this, { controls, drawn, time: 0, playing: false, last: null, designs: [], canvases: [] });
    controls.play.addEventListener("click", () => this.set(!this.playing));
    controls.time.addEventListener("input", (event) => this.set(false, Number(event.target.value)));
    addEventListener("resize", () => this.draw());
    requestAnimationFrame((stamp) => this.frame(stamp));
  }

  // Other designs on their canvases: all at instants `step` apart.
  take(designs, canvases, step) {
    const heights = designs.flatMap((design) => design.points.map((p) => p.height.reduce((most, z) => Math.max(most, Math.abs(z)), 0)));
    const moved = 1e-4 * Math.max(...heights), forces = designs.flatMap((design) => design.dampers.map((damper) => damper.force));
    this.factor = Film.FACTORS.findLast((factor) => factor * moved <= Film.SHOWN) || 1;
    this.largest = forces.reduce((most, force) => force.reduce((of, f) => Math.max(of, Math.abs(f)), most), 1);
    Object.assign(this, { designs, canvases, step, count: designs[0].wheels[0].road.length });
    this.end = (this.count - 1) * step;
    this.controls.time.max = this.end;
    this.time = Math.min(this.time, this.end);
    this.draw();
  }

  set(playing, time = this.time) {
    Object.assign(this, { playing, time });
    this.controls.play.textContent = playing ? "Pause" : "Play";
    this.draw();
  }

  frame(stamp) {
    if (this.playing && this.last !== null) {
      this.time += (stamp - this.last) / 1000 * Number(this.controls.speed.value);
      if (this.time > this.end) this.time = 0;
      if (this.canvases.some(Film.seen)) this.draw();
    }
    this.last = stamp;
    requestAnimationFrame((next) => this.frame(next));
  }

  static seen(canvas) {
    const box = canvas.getBoundingClientRect();
    return box.bottom > 0 && box.top < innerHeight;
  }

  draw() {
    if (!this.designs.length) return;
    this.designs.forEach((design, k) => this.drawVehicle(design, this.canvases[k]));
    this.controls.time.value = this.time;
    this.controls.now.textContent = `${this.time.toFixed(2)} of ${this.end.toFixed(2)} s`;
    this.drawn();
  }

  at(values, when = this.time) {
    const place = Math.min(Math.max(when / this.step, 0), this.count - 1), k = Math.min(Math.floor(place), this.count - 2), rest = place - k;
    return this.count < 2 ? values[0] : values[k] * (1 - rest) + values[k + 1] * rest;
  }

  static colour(name) { return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`); }

  // The pen of a canvas, empty and as fine as the screen, and its size.
  static prepared(canvas) {
    const scale = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight, pen = canvas.getContext("2d");
    const [wide, high] = [width, height].map((size) => Math.round(size * scale));
    if (canvas.width !== wide || canvas.height !== high) [canvas.width, canvas.height] = [wide, high];
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.font = "13px system-ui, sans-serif";
    return { pen, width, height };
  }

  static line(pen, points, style, width, dash = []) {
    pen.strokeStyle = style; pen.lineWidth = width; pen.setLineDash(dash);
    pen.beginPath();
    points.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.stroke(); pen.setLineDash([]);
  }

  drawVehicle(design, canvas) {
    const { level, RADIUS, THICK, SIDE, line } = Film, { pen, width, height } = Film.prepared(canvas);
    const ahead = design.points.map((p) => p.ahead), left = design.points.map((p) => p.left);
    const low = Math.min(...ahead) - 0.6 + Math.min(0, ...left) * SIDE[0], high = Math.max(...ahead) + 0.6 + Math.max(0, ...left) * SIDE[0];
    const top = level(Math.max(0, ...design.bodies.map((b) => b.level))) + THICK + 0.35 + Math.max(0, ...left) * SIDE[1], bottom = -0.35 + Math.min(0, ...left) * SIDE[1];
    const scale = Math.min(width / (high - low), height / (top - bottom)), middle = 0.5 * (low + high);
    const place = (x, side, z) => [width / 2 + (x + SIDE[0] * side - middle) * scale, height - (z + SIDE[1] * side - bottom) * scale];
    const lift = (tenths) => this.factor * tenths * 1e-4;
    const point = (k, raised = 0) => { const p = design.points[k]; return place(p.ahead, p.left, level(p.level) + raised + lift(this.at(p.height))); };
    const foot = (k) => point(k, design.points[k].level ? THICK : 0);  // of what stands on a body
    const text = Film.colour("text"), ink = Film.colour("quiet");
    const sides = new Map();  // the road of each side, under its first wheel
    for (const wheel of design.wheels) { const p = design.points[wheel.point]; if (!sides.has(p.left)) sides.set(p.left, wheel); }
    for (const [side, wheel] of [...sides].sort((a, b) => b[0] - a[0])) {
      const from = design.points[wheel.point].ahead, path = [];
      if (design.driven) {
        const [first, last] = [middle - width / scale, middle + width / scale];
        for (let x = first; x <= last; x += 0.02) path.push(place(x, side, lift(this.at(wheel.road, this.time + (x - from) / design.speed))));
        line(pen, path, ink, 1.5);
      }
    }
    const ordered = [...design.wheels].sort((a, b) => design.points[b.point].left - design.points[a.point].left);
    for (const wheel of ordered) {
      const p = design.points[wheel.point], ground = place(p.ahead, p.left, lift(this.at(wheel.road)));
      if (!design.driven) line(pen, [[ground[0] - 14, ground[1]], [ground[0] + 14, ground[1]], [ground[0], ground[1]], [ground[0], height]], ink, 2);
      const centre = p.level === 0 ? point(wheel.point) : [ground[0], ground[1] - RADIUS * scale];
      wheel.centre = centre;
      pen.beginPath(); pen.arc(centre[0], centre[1], RADIUS * scale * 0.95, 0, 2 * Math.PI);
      pen.fillStyle = Film.colour("page"); pen.fill(); pen.strokeStyle = text; pen.lineWidth = 2.5; pen.stroke();
    }
    for (const beam of design.beams) if (beam.length > 1) line(pen, beam.map((k) => point(k)), text, 5);
    for (const body of [...design.bodies].sort((a, b) => a.level - b.level)) {
      const base = body.corners.map((k) => point(k)), roof = body.corners.map((k) => point(k, THICK));
      const faces = body.corners.length === 4 ? [base, roof, ...[0, 1, 2, 3].map((k) => [base[k], base[(k + 1) % 4], roof[(k + 1) % 4], roof[k]])] : [[...base, ...roof.reverse()]];
      for (const face of faces) {
        pen.beginPath(); face.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y))); pen.closePath();
        pen.fillStyle = Film.colour("body"); pen.globalAlpha = 0.75; pen.fill(); pen.globalAlpha = 1; pen.strokeStyle = text; pen.lineWidth = 1.2; pen.stroke();
      }
    }
    for (const ends of design.springs) Film.drawSpring(pen, point(ends[0]), foot(ends[1]), text);
    for (const damper of design.dampers) {
      const upper = point(damper.ends[0]), lower = damper.ends[1] < 0 ? design.wheels[-1 - damper.ends[1]].centre : foot(damper.ends[1]);
      this.drawDamper(pen, upper, lower, this.at(damper.force), text);
    }
  }

  static drawSpring(pen, [x0, y0], [x1, y1], style) {
    const path = [[x0 - 9, y0]];
    for (let k = 1; k < 12; k++) path.push([x0 - 9 + (x1 - x0) * k / 12 + (k % 2 ? 5 : -5), y0 + (y1 - y0) * k / 12]);
    Film.line(pen, [...path, [x1 - 9, y1]], style, 1.2);
  }

  drawDamper(pen, [x0, y0], [x1, y1], force, style) {
    const x = 0.5 * (x0 + x1) + 9, middle = 0.5 * (y0 + y1), { line } = Film;
    line(pen, [[x, y0], [x, middle]], style, 1.5);
    line(pen, [[x, middle - 4], [x, y1]], style, 7);
    const size = Math.abs(force) / this.largest * 55, pull = force > 0, place = x + 16, ink = Film.colour(pull ? "pull" : "push");
    if (size < 1) return;
    for (const [y, way] of [[y0, pull ? 1 : -1], [y1, pull ? -1 : 1]]) {
      const tip = y + way * size * 0.5, tail = y - way * size * 0.5, head = Math.min(7, size);
      line(pen, [[place, tail], [place, tip]], ink, 2.5);
      line(pen, [[place - 4, tip - way * head], [place, tip], [place + 4, tip - way * head]], ink, 2.5);
    }
  }
}
