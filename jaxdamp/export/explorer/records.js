// A record dropped onto the page: a text of columns whose header names quantities and units.

const UNITS = {
  time: { s: 1, ms: 1e-3, sec: 1 },
  stroke: { m: 1, mm: 1e-3, cm: 1e-2, in: 0.0254, inch: 0.0254 },
  velocity: { "m/s": 1, "mm/s": 1e-3, "cm/s": 1e-2, "in/s": 0.0254, "inch/s": 0.0254 },
  force: { N: 1, kN: 1e3, daN: 10, lbf: 4.4482216152605, lb: 4.4482216152605 },
};
const WORDS = {
  time: /^(time|zeit|t)$/, stroke: /^(stroke|displacement|disp|position|travel|x)$/,
  velocity: /^(velocity|vel|speed|v)$/, force: /^(force|load|f)$/,
};
const EXAMPLE = "time [s],stroke [mm],velocity [mm/s],force [N]";
const FEWEST = 20, UNEVEN = 0.02;

// The quantity and the unit of a header such as "stroke [mm]", "Force (kN)" or "velocity_mm/s"; null for another column.
function columnOf(header) {
  const text = header.trim().replace(/^"|"$/g, "");
  const parts = text.match(/^(.*?)\s*[[(]\s*(.*?)\s*[\])]$/) || text.match(/^([A-Za-z]+)[_ ]+(\S+)$/) || [text, text, ""];
  const quantity = Object.keys(WORDS).find((name) => WORDS[name].test(parts[1].trim().toLowerCase()));
  return quantity ? { quantity, unit: parts[2], header: text } : null;
}

function separator(line) {
  return [";", "\t", ","].find((character) => line.includes(character)) || /\s+/;
}

// A record {name, dt, x, v, force} in SI and the sign of the library, of the text of a file.
// Throws an error that says what to change.
function recordOf(text, name, turned, opposite) {
  const lines = text.split(/\r?\n/), start = lines.findIndex((line) => line.split(separator(line)).some(columnOf));
  if (start < 0) throw new Error(`${name} has no header that names its columns. Its first line should be like: ${EXAMPLE}`);
  const split = separator(lines[start]), columns = lines[start].split(split).map(columnOf), series = {};
  for (const [place, column] of columns.entries()) {
    if (!column || series[column.quantity]) continue;
    const factor = UNITS[column.quantity][column.unit];
    if (factor === undefined) {
      const known = Object.keys(UNITS[column.quantity]).join(", ");
      const told = column.unit ? `the unit "${column.unit}", which is not known` : "no unit";
      throw new Error(`${name}: the column "${column.header}" has ${told}. Write one of ${known}, for example "${column.quantity} [${Object.keys(UNITS[column.quantity])[0]}]".`);
    }
    series[column.quantity] = { place, factor, values: [] };
  }
  const missing = ["stroke", "velocity", "force"].filter((quantity) => !series[quantity]);
  if (missing.length) throw new Error(`${name} has no column of ${missing.join(" and ")}. Its header should be like: ${EXAMPLE}`);
  lines.slice(start + 1).forEach((line, k) => {
    if (!line.trim()) return;
    const cells = line.split(split);
    for (const [quantity, one] of Object.entries(series)) {
      const cell = (cells[one.place] || "").trim(), plain = split === ";" ? cell.replace(",", ".") : cell, value = Number(plain);
      if (!plain || !Number.isFinite(value))
        throw new Error(`${name}, line ${start + k + 2}, ${quantity}: "${cell}" is not a number. Correct or remove the line.`);
      one.values.push(value * one.factor);
    }
  });
  const [sign, forceSign] = [turned ? -1 : 1, turned !== opposite ? -1 : 1];
  const signed = (quantity, factor) => Float64Array.from(series[quantity].values, (value) => factor * value);
  const record = { name, x: signed("stroke", sign), v: signed("velocity", sign), force: signed("force", forceSign) };
  if (record.x.length < FEWEST) throw new Error(`${name} has ${record.x.length} samples; at least ${FEWEST} are needed.`);
  const power = record.force.reduce((sum, force, i) => sum + force * record.v[i], 0);
  if (power < 0) throw new Error(`${name}: force and velocity have opposite signs most of the time, so that this damper would drive the machine. Change "force counts" above.`);
  return { ...record, dt: series.time ? spacing(series.time.values, name) : null, note: "dropped onto the page, every sample" };
}

// The uniform spacing [s] of instants.
function spacing(time, name) {
  const dt = (time[time.length - 1] - time[0]) / (time.length - 1);
  const place = time.findIndex((instant, i) => i > 0 && Math.abs(instant - time[i - 1] - dt) > UNEVEN * dt + 1e-9 * Math.abs(instant));
  if (!(dt > 0) || place > 0 && Math.abs(time[place] - time[0] - place * dt) > 0.5 * dt)
    throw new Error(`${name}: the time column does not rise evenly (sample ${Math.max(place, 1) + 1}). Resample the record, or cut it at the gap.`);
  return dt;
}
