// The page: what is chosen, what follows from it, and where it is shown.

const DATA = JSON.parse(document.getElementById("data").textContent);
const get = (id) => document.getElementById(id);
const SEGMENT = Math.min(2048, 2 ** Math.floor(Math.log2(DATA.count))), CURVES = ["curve0", "curve1", "curve2", "curve3"], CHECK_AFTER = 400, TOLERANCE = 0.01, MOST_SUBSTEPS = 64;
const EVERY = Math.max(1, Math.round(0.01 / DATA.dt));  // of the instants of a run are shown in motion

const cached = new Map();  // loops of the baseline, which no slider moves

const start = (numbers) => Object.fromEntries(numbers.map((number) => [number.name, [...number.start]]));
const values = { law: start(DATA.law.numbers), vehicle: start(DATA.vehicle.numbers) };
const records = DATA.records.map((record) => ({ ...record, x: unpacked(record.x), v: unpacked(record.v), force: unpacked(record.force) }));
const iso = DATA.road.iso;
const drawnRoads = iso.drawn.map(({ amplitude, phase }) => ({ amplitude: unpacked(amplitude), phase: unpacked(phase) }));
const profile = DATA.road.profile && { ...DATA.road.profile, heights: DATA.road.profile.heights.map(unpacked) };
const charts = Object.fromEntries(["loopVelocity", "loopStroke", "spectrum", "trace"].map((id) => [id, new Chart(get(id))]));
const film = new Film(get("filmBar"));
const sides = {
  law: { program: LAW, states: DATA.law.states, sizes: DATA.law.sizes },
  baseline: { program: BASELINE, states: DATA.baseline.states, sizes: DATA.baseline.sizes },
};
const state = { substeps: DATA.substeps, controls: [], road: null, dropped: null, results: {} };

// The unit in which numbers of an SI unit are shown, and the factor; in drawings and tables mm for m.
function shownIn(unit) {
  const [text, scale] = DATA.shown.units[unit] || [unit, 1];
  return { unit: unitText(text), scale };
}
const drawnIn = (unit) => unit === "m" && shownIn(unit).scale === 1 ? { unit: "mm", scale: 1000 } : shownIn(unit || "-");
const turned = (list) => DATA.shown.turned ? list.map((value) => -value) : list;

// The numbers of a group as the printed functions take them: a scalar, or an array of the entries of a vector.
function numbersOf(numbers, taken) {
  return Object.fromEntries(numbers.map((number) => [number.name, number.scalar ? taken[number.name][0] : taken[number.name]]));
}

function lawNumbers(side) {
  if (side === "law") return numbersOf(DATA.law.numbers, values.law);
  return numbersOf(DATA.baseline.numbers, start(DATA.baseline.numbers));
}

function vehicleNumbers() {
  return numbersOf(DATA.vehicle.numbers, values.vehicle);
}

// Roads -----------------------------------------------------------------------------------------------------------

// The heights under each wheel.
function roadHeights() {
  const { dt, count } = DATA, kind = get("roadKind").value;
  if (kind === "profile") return profile.heights;
  const speed = positive("speed"), most = iso.length / ((count - 1) * dt);
  if (kind !== "bump" && speed > most) throw new Error(`At ${speed} m/s the road of ${iso.length} m repeats within the run: take at most ${readable(most)} m/s.`);
  const [height, length] = kind === "bump" ? [Number(get("bumpHeight").value) / 1000, positive("bumpLength")] : [];
  const under = (behind) => {
    const delay = behind / speed;
    if (kind === "bump") return Float64Array.from({ length: count }, (_, i) => ROAD.bump(i * dt - delay, height, length, speed));
    return isoHeights(iso, drawnRoads[Number(get("seed").value)], 2 ** (kind.charCodeAt(0) - 65), speed, dt, count, delay);
  };
  const behind = DATA.vehicle.behind, axles = new Map([...new Set(behind)].map((each) => [each, under(each)]));
  return behind.map((each) => axles.get(each));
}

function positive(id) {
  const value = Number(get(id).value);
  if (!(value > 0)) throw new Error(`${get(id).getAttribute("aria-label")} must be positive.`);
  return value;
}

function chooseRoad() {
  const kind = get("roadKind").value;
  for (const [id, shown] of [["isoOptions", kind.length === 1], ["bumpOptions", kind === "bump"], ["speedOption", kind !== "profile"]])
    get(id).hidden = !shown;
  attempt("roadError", () => {
    const heights = roadHeights();
    state.road = { heights, rates: heights.map((each) => rates(each, DATA.dt)) };
    firstStep();
    refresh();
  });
}

// Runs ------------------------------------------------------------------------------------------------------------

function drive(side, substeps) {
  const { program, sizes } = sides[side];
  return ride(program, sizes, lawNumbers(side), vehicleNumbers(), state.road, DATA.dt, substeps, DATA.channels, EVERY);
}

function refreshRide() {
  if (!state.road) return;
  state.results.law = drive("law", state.substeps);
  const before = JSON.stringify(values.vehicle);
  if (!state.results.baseline || state.vehicleBefore !== before) state.results.baseline = drive("baseline", state.substeps);
  state.vehicleBefore = before;
  showMetrics();
  showChannel();
  showMotion();
  clearTimeout(state.timer);
  get("stepNote").textContent = "";
  state.timer = setTimeout(checkStep, CHECK_AFTER);
}

function firstStep() {
  state.substeps = DATA.substeps;
  state.results.baseline = null;
}

// The step halved: by how much the metrics differ; halved for good if by more than a percent.
function checkStep() {
  const now = state.results.law.metrics, fine = drive("law", 2 * state.substeps).metrics;
  const shares = now.map((value, k) => DATA.metrics[k].main && fine[k] !== 0 ? Math.abs(value / fine[k] - 1) : 0);
  const worst = shares.reduce((most, share) => (share <= most ? most : share), 0);
  const step = readable(1000 * DATA.dt / state.substeps, 3);
  if (!(worst <= TOLERANCE) && state.substeps < MOST_SUBSTEPS) {
    state.substeps *= 2;
    state.results.baseline = null;
    refreshRide();
  } else if (!now.every(Number.isFinite)) {
    get("stepNote").textContent = `The run diverges with a step of ${step} ms: this law is too steep for it.`;
  } else {
    get("stepNote").textContent = `Step ${step} ms; with half of it the metrics above differ by at most ${readable(100 * worst, 2)} %.`;
  }
}

function refresh() {
  const begin = performance.now();
  attempt("lawError", () => {
    const margins = [], others = [], p = lawNumbers("law");
    LAW.margins(p, margins);
    LAW.others(p, vehicleNumbers(), others);  // of the other laws of the vehicle
    const conditions = [...DATA.law.conditions, ...DATA.vehicle.conditions];
    const broken = conditions.filter((_, k) => !([...margins, ...others][k] > 0));
    if (broken.length) throw new Error(broken.join(" "));
  });
  attempt("loopError", showLoops);
  attempt("roadError", refreshRide);
  state.milliseconds = performance.now() - begin;
  get("timing").textContent = `${readable(state.milliseconds, 2)} ms`;
}

// At the next frame, once for all changes before it. The step is not checked until then: that would compare a run
// of the old numbers with one of the new.
function schedule() {
  clearTimeout(state.timer);
  if (state.waiting) return;
  state.waiting = true;
  requestAnimationFrame(() => { state.waiting = false; refresh(); });
}

function attempt(id, action) {
  try {
    get(id).textContent = "";
    action();
  } catch (error) {
    get(id).textContent = error.message;
  }
}

// Loops -----------------------------------------------------------------------------------------------------------

function frequencies() {
  const words = get("frequencies").value.split(/[\s,;]+/).filter(Boolean), numbers = words.map(Number);
  if (!numbers.length || numbers.some((f) => !(f > 0)) || numbers.length > CURVES.length)
    throw new Error(`Frequencies must be one to ${CURVES.length} positive numbers, for example "1.5, 5, 12".`);
  return numbers;
}

function loop(side, key, motion, more) {
  if (side === "baseline" && cached.has(key)) return cached.get(key);
  const force = respond(sides[side].program, sides[side].states, { ...lawNumbers(side), ...more }, motion);
  const made = { force: force.subarray(motion.first), x: motion.x.subarray(motion.first), v: motion.v.subarray(motion.first), all: force };
  if (side === "baseline") cached.set(key, made);
  return made;
}

function showLoops() {
  const chosen = get("motion").value, isRecord = chosen !== "sines", drawn = [];
  get("sineOptions").hidden = isRecord;
  let note = "";
  const fits = {};
  if (isRecord) {
    const record = chosen === "dropped" ? state.dropped : records[Number(chosen)];
    drawn.push({ points: true, colour: "measured", alpha: 0.6, loop: record });
    const untimed = !record.dt && (DATA.law.states || DATA.baseline.states);
    if (untimed) note = `${record.name} has no time column, without which a law with states cannot follow it: only the measured loop is shown.`;
    else if (record.beyond) note = `Only the measured loop is shown: the page does not follow ${record.beyond} of ${record.name}.`;
    for (const side of note ? [] : ["baseline", "law"]) {
      const command = DATA[side].command, more = command && record.command !== null && record.command !== undefined ? { [command]: record.command } : {};
      const first = firstCounted(record, sides[side].states), result = loop(side, chosen, { ...record, first: 0 }, more);
      fits[side] = misfit(record.force, result.all, first);
      const counted = Object.fromEntries(["x", "v", "force"].map((key) => [key, result[key].subarray(first)]));
      drawn.push({ colour: side === "law" ? "law" : "baseline", width: side === "law" ? 1.8 : 1.3, dash: side === "law" ? [] : [5, 4], loop: counted });
    }
    note ||= `${record.note}${sides.law.states ? "; the first cycle, in which the states settle, does not count" : ""}.`;
  } else {
    const amplitude = positive("amplitude") / 1000;
    frequencies().forEach((frequency, k) => {
      for (const side of ["baseline", "law"]) {
        const own = { colour: CURVES[k], width: side === "law" ? 2 : 1.2, dash: side === "law" ? [] : [5, 4], alpha: side === "law" ? 1 : 0.7 };
        drawn.push({ ...own, loop: loop(side, `${amplitude} ${frequency}`, sine(amplitude, frequency, sides[side].states)) });
      }
    });
  }
  state.loops = drawn;
  state.fits = fits;
  legend(isRecord);
  get("fitNote").textContent = note;
  showFits(fits);
  const over = (key) => drawn.map(({ loop, ...own }) => ({ ...own, x: turned(loop[key]), y: turned(loop.force) }));
  const force = { label: "force", ...drawnIn("N") };
  charts.loopVelocity.show({ x: { label: "velocity", ...drawnIn("m/s") }, y: force }, over("v"));
  charts.loopStroke.show({ x: { label: "stroke", ...drawnIn("m") }, y: force }, over("x"));
}

function legend(isRecord) {
  const item = (name, text, dashed) => element("span", { class: dashed ? "dashed" : "" }, element("i", { style: `border-color: var(--${name})` }), text);
  const items = isRecord ? [item("measured", "measured"), item("law", "law"), item("baseline", DATA.baseline.title, true)]
    : [...frequencies().map((f, k) => item(CURVES[k], `${f} Hz`)), item("quiet", DATA.baseline.title, true)];
  get("legend").replaceChildren(...items);
}

function showFits(fits) {
  const cell = (side, key, { unit, scale }) => element("td", { "data-value": String(fits[side][key]) }, `${readable(scale * fits[side][key])} ${unit}`);
  const row = (title, key, unit) => element("tr", {}, element("th", {}, title), cell("law", key, unit), cell("baseline", key, unit));
  const head = element("tr", {}, element("th", {}), element("th", {}, "law"), element("th", {}, DATA.baseline.title));
  get("fits").replaceChildren(...(fits.law ? [head, row("RMSE", "rmse", drawnIn("N")), row("fit", "fit", drawnIn("%"))] : []));
}

// Ride ------------------------------------------------------------------------------------------------------------

function showMetrics() {
  const [law, baseline] = ["law", "baseline"].map((side) => state.results[side].metrics);
  const row = (metric, k) => {
    const change = 100 * (law[k] / baseline[k] - 1), plain = metric.signed || !Number.isFinite(change), { unit, scale } = metric.unit ? drawnIn(metric.unit) : { unit: "", scale: 1 };
    const shown = (metric.turned ? -1 : 1) * scale;
    const text = plain ? "" : `${change > 0 ? "+" : ""}${Math.abs(change) < 0.005 ? "0" : readable(change, 3)} %`;
    return element("tr", { "data-metric": metric.name },
      element("th", {}, metric.title), element("td", { "data-value": String(law[k]) }, readable(shown * law[k])),
      element("td", { "data-value": String(baseline[k]) }, readable(shown * baseline[k])),
      element("td", { class: "change" }, text), element("td", { class: "unit" }, unit));
  };
  const rows = DATA.metrics.map(row);
  get("metrics").replaceChildren(...rows.filter((_, k) => DATA.metrics[k].main));
  get("moreMetrics").replaceChildren(...rows.filter((_, k) => !DATA.metrics[k].main));
}

function showChannel() {
  const place = Number(get("channel").value), channel = DATA.channels[place], { unit, scale } = drawnIn(channel.unit);
  const drawn = { spectrum: [], trace: [] };
  for (const side of ["baseline", "law"]) {
    const record = state.results[side].records[place], own = side === "law" ? { colour: "law", width: 1.8 } : { colour: "baseline", width: 1.3, dash: [5, 4] };
    const spectra = (state.results[side].spectra ??= []), { frequency, psd } = (spectra[place] ??= density(record, DATA.dt, SEGMENT));
    drawn.spectrum.push({ ...own, x: frequency.subarray(1), y: psd.subarray(1) });
    drawn.trace.push({ ...own, width: 1.2, x: record.map((_, i) => i * DATA.dt), y: channel.signed ? turned(record) : record });
  }
  const squared = /[/ ]/.test(unit) ? `(${unit})²/Hz` : unit === "-" ? "1/Hz" : `${unit}²/Hz`;
  charts.spectrum.show({ x: { label: "frequency", unit: "Hz", log: true, range: [0.4, 50] }, y: { label: "density", unit: squared, log: true, decades: 6, scale: scale ** 2 } }, drawn.spectrum);
  charts.trace.show({ x: { label: "time", unit: "s", tight: true }, y: { label: channel.title, unit, scale } }, drawn.trace);
  get("channelMeaning").textContent = channel.meaning;
}

// In motion -------------------------------------------------------------------------------------------------------

function showMotion() {
  const { drawing, vehicle, dt } = DATA, kind = get("roadKind").value, coordinates = drawing.heights[0].length;
  const way = kind === "profile" ? profile : { speed: positive("speed"), driven: true };
  const roads = state.road.heights.map((heights) => heights.filter((_, i) => i % EVERY === 0).map((z) => 1e4 * z));
  const design = ({ moving }) => ({
    ...drawing, ...way,
    points: drawing.points.map((point, k) => ({ ...point, height: moving[0].map((_, i) => 1e4 * drawing.heights[k].reduce((sum, share, j) => sum + share * moving[j][i], 0)) })),
    dampers: drawing.dampers.map((damper, k) => ({ ...damper, force: moving[coordinates + k] })),
    wheels: drawing.wheels.map((wheel, k) => ({ ...wheel, road: roads[k] })),
  });
  film.take(["baseline", "law"].map((side) => design(state.results[side])), [get("filmBaseline"), get("filmLaw")], EVERY * dt);
  get("filmNote").textContent = `Heights drawn ${film.factor} times as large. Arrows at the dampers: orange pulls the ends together, blue pushes them apart.`
    + (way.known === false ? ` The road is drawn as at ${way.speed} m/s.` : "") + (vehicle.fixed.length ? ` What places the wheels stays as loaded: ${vehicle.fixed.join(", ")}.` : "");
}

// The law as JSON -------------------------------------------------------------------------------------------------

function lawDocument() {
  const result = structuredClone(DATA.law.document);
  for (const number of DATA.law.numbers) {
    const field = number.path.split(".").reduce((inside, part) => inside[part], result.law);
    const nested = (entries, [size, ...inner]) => inner.length ? Array.from({ length: size }, (_, i) => {
      const each = entries.length / size;
      return nested(entries.slice(i * each, (i + 1) * each), inner);
    }) : entries;
    field.value = number.scalar ? values.law[number.name][0] : nested(values.law[number.name], number.shape);
  }
  return JSON.stringify(result, null, 2);
}

function download() {
  const link = element("a", { href: URL.createObjectURL(new Blob([lawDocument()], { type: "application/json" })), download: `${DATA.file}_changed.json` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

// Files -----------------------------------------------------------------------------------------------------------

async function dropped(file) {
  state.text = { name: file.name, text: await file.text() };
  takeDropped();
}

function takeDropped() {
  if (!state.text) return;
  get("dropOptions").hidden = false;
  attempt("dropError", () => {
    state.dropped = recordOf(state.text.text, state.text.name, get("dropSign").value === "compression", get("dropForce").value === "opposite");
    cached.delete("dropped");
    get("motion").querySelector('[value="dropped"]')?.remove();
    get("motion").append(element("option", { value: "dropped" }, `record: ${state.dropped.name}`));
    get("motion").value = "dropped";
    schedule();
  });
}

function redraw() {
  [...Object.values(charts), film].forEach((picture) => picture.draw());
}

// Begin -----------------------------------------------------------------------------------------------------------

function begin() {
  document.title = `${DATA.title}: jaxdamp explorer`;
  get("title").textContent = DATA.title;
  get("subtitle").textContent = `in a ${DATA.vehicle.title}, ${readable(DATA.dt * (DATA.count - 1))} s`;
  const kinds = (kind) => DATA.law.numbers.filter((number) => number.kind === kind);
  const vehicleKind = (kind) => DATA.vehicle.numbers.filter((number) => number.kind === kind);
  const groups = [["Command", kinds("command"), values.law, true], ["Law: parameters", kinds("parameter"), values.law, true],
    ["Law: settings", kinds("setting"), values.law, false], ["Vehicle", vehicleKind("parameter"), values.vehicle, true],
    ["Vehicle: settings", [...vehicleKind("setting"), ...vehicleKind("command")], values.vehicle, false]];
  for (const [title, numbers, own, open] of groups) {
    if (!numbers.length) continue;
    const made = group(title, numbers, own, schedule, open);
    state.controls.push(made.controls);
    get("groups").append(made.details);
  }
  records.forEach((record, k) => get("motion").append(element("option", { value: k }, `record: ${record.name}`)));
  if (records.length) get("motion").value = "0";
  for (const letter of "ABCDEFGH") get("roadKind").append(element("option", { value: letter }, `ISO 8608 class ${letter}`));
  get("roadKind").append(element("option", { value: "bump" }, "cosine bump"));
  if (profile) get("roadKind").append(element("option", { value: "profile" }, profile.title));
  get("roadKind").value = profile ? "profile" : DATA.road.class;
  get("speed").value = DATA.road.speed;
  drawnRoads.forEach((_, k) => get("seed").append(element("option", { value: k }, String(iso.seed + k))));
  DATA.channels.forEach((channel, k) => get("channel").append(element("option", { value: k }, channel.title)));
  for (const id of ["baselineHead", "filmHead"]) get(id).textContent = DATA.baseline.title;
  for (const id of ["motion", "amplitude", "frequencies"]) get(id).addEventListener("input", schedule);
  for (const id of ["roadKind", "speed", "seed", "bumpHeight", "bumpLength"]) get(id).addEventListener("input", chooseRoad);
  get("channel").addEventListener("input", () => attempt("roadError", showChannel));
  for (const id of ["dropSign", "dropForce"]) get(id).addEventListener("input", takeDropped);
  get("export").addEventListener("click", download);
  get("reset").addEventListener("click", () => {
    state.controls.flat().forEach((control) => control.reset(true));
    firstStep();
    schedule();
  });
  get("file").addEventListener("change", () => get("file").files[0] && dropped(get("file").files[0]));
  get("theme").addEventListener("click", () => {
    const root = document.documentElement, dark = getComputedStyle(root).colorScheme === "dark";
    root.dataset.theme = dark ? "light" : "dark";
    redraw();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  document.addEventListener("dragover", (event) => { event.preventDefault(); document.body.classList.add("dragging"); });
  document.addEventListener("dragleave", (event) => event.relatedTarget || document.body.classList.remove("dragging"));
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    document.body.classList.remove("dragging");
    if (event.dataTransfer.files[0]) dropped(event.dataTransfer.files[0]);
  });
  chooseRoad();
  film.set(!matchMedia("(prefers-reduced-motion: reduce)").matches);
  document.documentElement.dataset.ready = "";
}

begin();
