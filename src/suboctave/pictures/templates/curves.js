// Curves: what the page knows of their points and events, and the motions there from Fourier coefficients.
const curves = [];

function numbers(text, Kind) {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) { bytes[i] = raw.charCodeAt(i); }
  return new Kind(bytes.buffer);
}

function unpackPlaces(packed, signals) {
  const places = { ...packed, values: {} };
  for (const name of Object.keys(packed.values)) { places.values[name] = numbers(packed.values[name], Float64Array); }
  for (const name of ["amplitude", "residual", "error", "levels", "peaks", "force_sizes"]) {
    if (packed[name] !== undefined) { places[name] = numbers(packed[name], Float64Array); }
  }
  if (packed.stable) { places.stable = numbers(packed.stable, Uint8Array); }
  if (packed.harmonics) { places.harmonics = numbers(packed.harmonics, Int32Array); }
  if (packed.multipliers) { places.multipliers = numbers(packed.multipliers, Float32Array); }
  if (packed.force) { places.force = numbers(packed.force, Int16Array); }
  if (packed.motion) {
    places.motion = numbers(packed.motion, Float32Array);
    places.begins = [0];
    places.harmonics.forEach((h, i) => places.begins.push(places.begins[i] + signals * (2 * h + 1)));
  }
  return places;
}

// Unpacked when a point of it is first asked for.
function curveOf(number) {
  const curve = curves[number];
  if (curve && !curve.unpacked) {
    curve.points = unpackPlaces(curve.points, curve.signals.length);
    curve.events = { ...curve.events, ...unpackPlaces(curve.events, curve.signals.length) };
    curve.unpacked = true;
  }
  return curve;
}

// Vertex v of a curve: its point v, or for v < 0 its event -1 - v.
function placeOf(curve, vertex) {
  const places = vertex < 0 ? curve.events : curve.points;
  const at = vertex < 0 ? -1 - vertex : vertex;
  const values = { ...curve.fixed };
  for (const name of Object.keys(places.values)) { values[name] = places.values[name][at]; }
  const multipliers = [];
  for (let i = 0; places.multipliers && i < places.of_each; i++) {
    const [re, im] = places.multipliers.subarray(2 * (at * places.of_each + i));
    if (!Number.isNaN(re)) { multipliers.push([re, im]); }
  }
  const one = (name) => (places[name] ? places[name][at] : NaN);
  return { places, at, values, multipliers, omega: values.omega, amplitude: one("amplitude"),
    residual: one("residual"), error: one("error"), harmonics: one("harmonics"),
    stable: places.stable ? Boolean(places.stable[at]) : null };
}

// Coefficients a_0, a_1, b_1, ... of a signal of the motion at a place; null where the page has none.
function coefficients(place, signal) {
  if (!place.places.motion) { return null; }
  const size = 2 * place.harmonics + 1;
  const begin = place.places.begins[place.at] + signal * size;
  return place.places.motion.subarray(begin, begin + size);
}

// The force of an element over one period of the motion at a place, at equal intervals; null where the page has none.
function forceAt(curve, place, element) {
  const { force, force_sizes } = place.places, { count } = curve.instants;
  if (!force) { return null; }
  const at = place.at * curve.elements.length + element;
  return Array.from(force.subarray(at * count, (at + 1) * count), (value) => (value / 32767) * force_sizes[at]);
}

// The motion, or its first or second derivative by t, at the phase tau = omega t / nu.
function motionAt(c, tau, order, rate) {
  let sum = order === 0 ? c[0] : 0;
  for (let k = 1; 2 * k < c.length; k++) {
    const cos = Math.cos(k * tau), sin = Math.sin(k * tau), a = c[2 * k - 1], b = c[2 * k], w = k * rate;
    if (order === 0) { sum += a * cos + b * sin; }
    else if (order === 1) { sum += w * (b * cos - a * sin); }
    else { sum -= w * w * (a * cos + b * sin); }
  }
  return sum;
}

// Samples over one period of the motion, both ends included.
function samples(c, nu, omega) {
  const count = nu * Math.max(240, 8 * Math.ceil(c.length / 2 / nu)), rate = omega / nu;
  const tau = Array.from({ length: count + 1 }, (_, i) => (2 * Math.PI * i) / count);
  return { tau, count, rate, t: tau.map((one) => one / rate),
    x: tau.map((one) => motionAt(c, one, 0, rate)), v: tau.map((one) => motionAt(c, one, 1, rate)) };
}

// Share of the period in contact and contacts begun in it, of each gap; instants at which x crosses it are bisected.
function contacts(curve, place) {
  const { signal, side, label } = curve.gaps, found = [];
  label.forEach((name, gap) => {
    const c = coefficients(place, signal[gap]), level = place.places.levels[place.at * label.length + gap];
    if (!c || Number.isNaN(level)) { return; }
    const { tau, x, rate } = samples(c, curve.nu, place.omega);
    const beyond = (at) => side[gap] * (motionAt(c, at, 0, rate) - level);
    let share = 0, begun = 0;
    for (let i = 0; i + 1 < tau.length; i++) {
      const first = side[gap] * (x[i] - level) > 0, last = side[gap] * (x[i + 1] - level) > 0;
      const width = tau[i + 1] - tau[i];
      if (first === last) { share += first ? width : 0; continue; }
      let low = tau[i], high = tau[i + 1];
      for (let step = 0; step < 30; step++) {
        const middle = 0.5 * (low + high);
        if (beyond(middle) > 0 === first) { low = middle; } else { high = middle; }
      }
      share += first ? low - tau[i] : tau[i + 1] - low;
      begun += last ? 1 : 0;
    }
    found.push({ name, level, signal: signal[gap], share: share / (2 * Math.PI), begun });
  });
  return found;
}

function spelt(name) { return name === "omega" ? "ω" : name; }

function shown(value, digits = 9) {
  return Number.isFinite(value) ? String(Number(value.toPrecision(digits))) : "–";
}

function small(value) { return Number.isFinite(value) ? value.toExponential(1) : "–"; }

// The vertex of a curve nearest to values of its parameters, in units of their ranges.
function nearest(curve, values) {
  const names = Object.keys(curve.points.values).filter((name) => name in values);
  let best = 0, least = Infinity;
  const widths = names.map((name) => {
    const own = curve.points.values[name];
    return own.reduce((a, b) => Math.max(a, b)) - own.reduce((a, b) => Math.min(a, b)) || 1;
  });
  for (let i = 0; i < curve.points.count; i++) {
    let sum = 0;
    names.forEach((name, j) => { sum += ((curve.points.values[name][i] - values[name]) / widths[j]) ** 2; });
    if (sum < least) { least = sum; best = i; }
  }
  return best;
}

// Other curves at or near these values of the parameters, responses first: the number, a vertex, what differs.
function neighbours(values, without) {
  const found = [];
  curves.forEach((_, number) => {
    const curve = curveOf(number), differs = [];
    if (number === without || !curve.points.count) { return; }
    const vertex = nearest(curve, values), there = placeOf(curve, vertex).values;
    let far = 0;
    for (const [name, value] of Object.entries(there)) {
      const off = name in values ? Math.abs(value - values[name]) / Math.max(1e-300, Math.abs(value), Math.abs(values[name])) : 0;
      far += off;
      if (off > 1e-9 && name in curve.fixed) { differs.push(`${spelt(name)} = ${shown(value, 5)}`); }
    }
    if (differs.length < 2) { found.push({ number, curve, vertex, far, differs: differs.filter((words) => !curve.name.includes(words)) }); }
  });
  found.sort((a, b) => a.far - b.far);
  const some = (tracked, most) => found.filter((one) => Boolean(one.curve.tracked) === tracked).slice(0, most);
  return [...some(false, 6), ...some(true, 4)];
}

// ---------------------------------------------------------------------------------------------------------- downloads
function save(name, text, type) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type }));
  link.download = name;
  document.body.appendChild(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

function csv(rows) {
  const cell = (value) => {
    const text = value === null || value === undefined || Number.isNaN(value) ? "" : String(value);
    return /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  };
  return rows.map((row) => row.map(cell).join(",")).join("\n") + "\n";
}

function csvName() {
  const force = forceOf(view.quantity), k = quantities[view.quantity]?.numbered ? ` ${view.harmonic}` : "";
  return force !== null ? `largest force of ${force}` : `${view.quantity}${k} of ${view.signal || "the observed displacement"}`;
}

function csvOfCurves(wanted) {
  const known = wanted.flatMap((n) => [...Object.keys(curveOf(n).points.values), ...Object.keys(curves[n].fixed)]);
  const names = [...new Set(known)], also = usual() ? [] : [csvName()];
  const units = curves[wanted[0]].units, heads = names.flatMap((name) => (name !== "omega" || !units.omega ? [name]
    : [withUnit(name, units.omega), withUnit("frequency", units.cycles)]));
  const rows = [["curve", "point", "event", ...heads, withUnit("amplitude", units.length), ...also, "stable", "multiplier_real", "multiplier_imag",
    "residual", "error"]];
  for (const number of wanted) {
    const curve = curveOf(number);
    const along = [...Array(curve.points.count).keys(), ...Array.from({ length: curve.events.count }, (_, e) => -1 - e)];
    for (const vertex of along) {
      const place = placeOf(curve, vertex), [re, im] = place.multipliers[0] || [NaN, NaN];
      rows.push([curve.name, vertex < 0 ? "" : vertex, vertex < 0 ? curve.events.kind[-1 - vertex] : "",
        ...names.flatMap((name) => (name !== "omega" || !units.omega ? [place.values[name]]
          : [place.values[name], place.values[name] / (2 * Math.PI)])), place.amplitude,
        ...also.map(() => shownAt(curve, vertex, "quantity")), place.stable === null ? "" : place.stable,
        re, im, place.residual, place.error]);
    }
  }
  return csv(rows);
}
