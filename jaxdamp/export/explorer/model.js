// The computations of the page: loops on the bench, roads, the ride, spectra. The physics is printed from the library.

const SAMPLES_PER_CYCLE = 400, LONGEST_STEP = 1e-3, CYCLES_WITH_STATES = 2;

function unpacked(text) {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  return new Float64Array(bytes.buffer);
}

// Forces [N] over a motion {dt, x, v}, the law at rest before it, as jaxdamp.respond computes them.
function respond(program, states, p, motion) {
  const { dt, x, v } = motion, force = new Float64Array(x.length), state = new Float64Array(states + 1);
  program.initial(p, x[0], state);
  force[0] = program.force(p, x[0], v[0], state);
  for (let i = 1; i < x.length; ++i) {
    if (states) program.advance(p, x[i - 1], v[i - 1], x[i], v[i], dt, state);
    force[i] = program.force(p, x[i], v[i], state);
  }
  return force;
}

// A sine of the stroke; a law with states runs through some cycles, of which the last one, from `first` on, is shown.
function sine(amplitude, frequency, states) {
  const perCycle = Math.max(SAMPLES_PER_CYCLE, Math.min(20000, Math.ceil(1 / (frequency * LONGEST_STEP))));
  const cycles = states ? CYCLES_WITH_STATES : 1, count = cycles * perCycle + 1, omega = 2 * Math.PI * frequency;
  const dt = 1 / (frequency * perCycle), x = new Float64Array(count), v = new Float64Array(count);
  for (let i = 0; i < count; ++i) {
    const angle = 2 * Math.PI * (i % perCycle) / perCycle;
    x[i] = amplitude * Math.sin(angle);
    v[i] = amplitude * omega * Math.cos(angle);
  }
  return { dt, x, v, first: count - perCycle - 1 };
}

// RMSE [N] and fit [%] of a force over a measured one, from a sample on, as jaxdamp.identify.fit_percent.
function misfit(measured, force, first) {
  let mean = 0, missed = 0, spread = 0;
  const count = measured.length - first;
  for (let i = first; i < measured.length; ++i) mean += measured[i] / count;
  for (let i = first; i < measured.length; ++i) {
    missed += (measured[i] - force[i]) ** 2;
    spread += (measured[i] - mean) ** 2;
  }
  return { rmse: Math.sqrt(missed / count), fit: 100 * (1 - Math.sqrt(missed / spread)) };
}

// The first sample that counts: a law with states forgets its start during a cycle, at most half the record.
function firstCounted(record, states) {
  if (!states) return 0;
  const deviation = (values) => {
    const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
    return Math.sqrt(values.reduce((sum, value) => sum + (value - mean) ** 2, 0) / values.length);
  };
  const period = 2 * Math.PI * deviation(record.x) / deviation(record.v);
  return Math.min(Math.ceil(period / record.dt), Math.floor(record.x.length / 2));
}

// Heights [m] of a sum of cosines z = a cos(2 pi n s + phase), n = k/length, at s = speed (t - delay), faded in.
function isoHeights(road, { amplitude, phase }, scale, speed, dt, count, delay) {
  const heights = new Float64Array(count), again = 256;
  for (let line = 0; line < phase.length; ++line) {
    const cycles = (road.first + line) / road.length * speed * dt, size = scale * amplitude[line];
    const turnCos = Math.cos(2 * Math.PI * cycles), turnSin = Math.sin(2 * Math.PI * cycles);
    for (let begin = 0; begin < count; begin += again) {  // afresh, so that rounding does not add up
      const angle = 2 * Math.PI * ((cycles * (begin - delay / dt)) % 1) + phase[line], end = Math.min(begin + again, count);
      let real = size * Math.cos(angle), imaginary = size * Math.sin(angle);
      for (let i = begin; i < end; ++i) {
        heights[i] += real;
        const next = real * turnCos - imaginary * turnSin;
        imaginary = real * turnSin + imaginary * turnCos;
        real = next;
      }
    }
  }
  const faded = (share) => 0.5 * (1 - Math.cos(Math.PI * Math.max(share, 0)));
  for (let i = 0; i < count && i * dt - delay < road.ramp; ++i) heights[i] *= faded((i * dt - delay) / road.ramp);
  return heights;
}

// Rates of the heights [m/s]: the mean of the slopes before and after an instant.
function rates(heights, dt) {
  const last = heights.length - 1;
  return heights.map((_, i) => {
    const before = Math.max(i - 1, 0), after = Math.min(i + 1, last);
    return (heights[after] - heights[before]) / ((after - before) * dt);
  });
}

// A run of the car: the metrics in their order, the channels over time, and at each `every`th instant what moves.
function ride(program, sizes, p, q, road, dt, substeps, channels, every) {
  const { heights, rates } = road, wheels = heights.length, count = heights[0].length;
  const [m, c, g] = [sizes.m, sizes.c, sizes.g].map((n) => new Float64Array(n));
  const [from, to, fromRate, toRate] = [1, 1, 1, 1].map(() => new Float64Array(wheels));
  const metrics = [], records = channels.map(() => new Float64Array(count)), now = [], moving = [];
  const put = (target, values, i, share) => {  // between the instants i - 1 and i
    for (let w = 0; w < wheels; ++w) {
      const value = values[w], before = share < 1 ? value[i - 1] : 0;
      target[w] = share < 1 ? before + share * (value[i] - before) : value[i];
    }
  };
  const save = (i) => {
    for (let k = 0; k < records.length; ++k) records[k][i] = g[k];
    if (i % every) return;
    program.moving(m, c, to, toRate, now);
    now.forEach((value, k) => (moving[k] ??= []).push(value));
  };
  program.prepare(p, q, dt / substeps, m);
  put(to, heights, 0, 1);
  put(toRate, rates, 0, 1);
  program.start(m, to, toRate, c);
  program.begin(m, c, to, toRate, g);
  save(0);
  for (let i = 1; i < count; ++i) {
    for (let k = 0; k < substeps; ++k) {
      put(from, heights, i, k / substeps);
      put(fromRate, rates, i, k / substeps);
      put(to, heights, i, (k + 1) / substeps);
      put(toRate, rates, i, (k + 1) / substeps);
      program.step(m, c, from, fromRate, to, toRate);
    }
    program.observe(m, c, g, to, toRate);
    save(i);
  }
  program.end(m, g, metrics);
  return { metrics, records, moving };
}

// The discrete Fourier transform of 2^k numbers, in place; `turns` holds cosines and sines of one turn.
function fourier(real, imaginary, turns) {
  const n = real.length;
  for (let i = 1, j = 0; i < n; ++i) {
    let bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) {
      const a = real[i], b = imaginary[i];
      real[i] = real[j]; imaginary[i] = imaginary[j];
      real[j] = a; imaginary[j] = b;
    }
  }
  for (let size = 2; size <= n; size *= 2) {
    const half = size / 2, stride = n / size;
    for (let k = 0; k < half; ++k) {
      const c = turns.cos[k * stride], s = -turns.sin[k * stride];
      for (let i = k; i < n; i += size) {
        const j = i + half, a = c * real[j] - s * imaginary[j], b = s * real[j] + c * imaginary[j];
        real[j] = real[i] - a; imaginary[j] = imaginary[i] - b;
        real[i] += a; imaginary[i] += b;
      }
    }
  }
}

// Power spectral density by Welch's method, Hann windows of `size` = 2^k samples, half overlapping, means removed.
function density(signal, dt, size) {
  const count = size / 2 + 1, frequency = new Float64Array(count), psd = new Float64Array(count);
  const real = new Float64Array(size), imaginary = new Float64Array(size);
  const turns = { cos: new Float64Array(size), sin: new Float64Array(size) };
  let power = 0, segments = 0;
  for (let j = 0; j < size; ++j) {
    turns.cos[j] = Math.cos(2 * Math.PI * j / size);
    turns.sin[j] = Math.sin(2 * Math.PI * j / size);
    power += (0.5 - 0.5 * turns.cos[j]) ** 2;
  }
  for (let begin = 0; begin + size <= signal.length; begin += size / 2, ++segments) {
    let mean = 0;
    for (let j = 0; j < size; ++j) mean += signal[begin + j] / size;
    for (let j = 0; j < size; ++j) real[j] = (signal[begin + j] - mean) * (0.5 - 0.5 * turns.cos[j]);
    imaginary.fill(0);
    fourier(real, imaginary, turns);
    for (let k = 0; k < count; ++k) psd[k] += real[k] ** 2 + imaginary[k] ** 2;
  }
  for (let k = 0; k < count; ++k) {
    frequency[k] = k / (size * dt);
    psd[k] *= (k === 0 || k === size / 2 ? 1 : 2) * dt / power / segments;
  }
  return { frequency, psd };
}
