// Sliders with number boxes for the parameters of the law and of the vehicle.

const SLIDER_STEPS = 1000, DIGITS = 4, OPEN_AT_MOST = 24;

function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value !== false && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children.filter((child) => child !== null));
  return made;
}

// One number of a parameter: entry k of its values.
class Control {
  constructor(number, k, values, changed) {
    Object.assign(this, { number, k, values, changed, ...shownIn(number.unit) });
    this.start = number.start[k];
    [this.low, this.high] = number.ranges[k];
    this.log = this.low > 0 && this.high / this.low > 2 || this.high < 0 && this.low / this.high > 2;
    const label = number.path + (number.scalar ? "" : `[${k}]`), said = label.replaceAll("_", " "), dot = said.lastIndexOf(".") + 1;
    const name = element("span", { class: "name" }, element("small", {}, said.slice(0, dot).replaceAll(".", " ")), said.slice(dot));
    name.append(element("small", {}, this.unit ? ` [${this.unit}]` : ""));
    this.box = element("input", { type: "number", step: "any", "aria-label": label, "data-path": label });
    this.slider = element("input", { type: "range", min: 0, max: SLIDER_STEPS, step: 1, "aria-label": `${label}, slider`, "data-slider": label });
    this.undo = element("button", { type: "button", title: `back to ${readable(this.scale * this.start)}`, "aria-label": `reset ${label}`, "data-reset": label }, "↺");
    this.error = element("div", { class: "error", role: "alert" });
    this.row = element("div", { class: "control", title: `${number.meaning}\n${number.domain}` },
      name, this.slider, this.box, this.undo, this.error);
    this.box.addEventListener("input", () => this.take(this.box.value === "" ? NaN : Number(this.box.value) / this.scale, "box"));
    this.slider.addEventListener("input", () => this.take(this.at(this.slider.value / SLIDER_STEPS), "slider"));
    this.undo.addEventListener("click", () => this.reset());
    this.show("both");
  }

  at(share) {
    const { low, high } = this, value = this.log ? low * (high / low) ** share : low + share * (high - low);
    return Math.min(high, Math.max(low, Number(value.toPrecision(DIGITS))));
  }

  share(value) {
    const { low, high } = this;
    return this.log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
  }

  // What is wrong with a value, in words; nothing if it is allowed.
  fault(value) {
    const { lower, upper, lowerOpen, upperOpen, ordered, domain } = this.number;
    if (!Number.isFinite(value)) return "It must be a number.";
    if (value < lower || value > upper || (lowerOpen && value <= lower) || (upperOpen && value >= upper)) return `It must be ${domain}.`;
    const [before, after] = [this.values[this.k - 1], this.values[this.k + 1]];
    if (ordered && (value <= before || value >= after)) return `It must lie between its neighbours, ${[before, after].map((end) => this.scale === 1 ? end : readable(this.scale * end)).join(" and ")}.`;
    return "";
  }

  take(value, from) {
    const fault = this.fault(value);
    this.error.textContent = fault;
    if (fault) return;
    this.values[this.k] = value;
    this.show(from === "box" ? "slider" : "both");
    this.changed();
  }

  show(what) {
    const value = this.values[this.k];
    this.box.dataset.value = value;
    if (what === "both") this.box.value = String(Number((this.scale * value).toPrecision(DIGITS)));  // counted as it is
    if (value < this.low || value > this.high) {
      [this.low, this.high] = [Math.min(value, this.low), Math.max(value, this.high)];
      this.log = this.log && this.low * this.high > 0;
    }
    this.slider.value = Math.round(SLIDER_STEPS * this.share(value));
    this.row.classList.toggle("moved", value !== this.start);
  }

  reset(quietly) {
    this.error.textContent = "";
    this.values[this.k] = this.start;
    this.show("both");
    if (!quietly) this.changed();
  }
}

// A foldable group of numbers; the controls of one that is closed are made when it is opened.
function group(title, numbers, values, changed, open) {
  const controls = [], body = element("div", {});
  const count = numbers.reduce((sum, number) => sum + number.start.length, 0);
  const fill = () => {
    if (controls.length) return;
    for (const number of numbers)
      number.start.forEach((_, k) => controls.push(new Control(number, k, values[number.name], changed)));
    body.append(...controls.map((control) => control.row));
  };
  const details = element("details", { open: open && count <= OPEN_AT_MOST ? "" : false },
    element("summary", {}, title, element("small", {}, ` ${count}`)), body);
  if (details.open) fill();
  details.addEventListener("toggle", () => details.open && fill());
  return { details, controls };
}
