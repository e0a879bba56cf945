// What all figures show: which displacement and quantity, frequencies in rad or in cycles, logarithmic axes.
const view = { signal: "", quantity: "amplitude", harmonic: 1, cycles: false, logx: false, logy: false };

// Quantities of a displacement: what they are called, and what of an axis; `of` says it of a displacement in HTML.
const quantities = {
  amplitude: { words: "amplitude, max |x|", of: (x) => `amplitude max |${x}|` },
  peak_to_peak: { words: "peak to peak", of: (x) => `peak to peak of ${x}` },
  mean: { words: "mean", of: (x) => `mean of ${x}`, signed: true },
  rms: { words: "RMS", of: (x) => `RMS of ${x}` },
  harmonic: { words: "harmonic k", of: (x, k) => `harmonic ${k} of ${x}`, numbered: true },
  phase: { words: "phase of harmonic k", of: (x, k) => `phase of harmonic ${k} of ${x}`, numbered: true, signed: true },
  velocity: { words: "velocity, max |dx/dt|", of: (x) => `velocity max |d${x}/dt|`, order: 1 },
  acceleration: { words: "acceleration, max |d²x/dt²|", of: (x) => `acceleration max |d²${x}/dt²|`, order: 2 },
};
const forceOf = (quantity) => (quantity.startsWith("force:") ? quantity.slice(6) : null);

function usual() { return view.signal === "" && view.quantity === "amplitude"; }

function inHtml(label) {
  const safe = label.replaceAll("&", "&amp;").replaceAll("<", "&lt;");
  return safe.replace(/\bx_(\d+)/g, "x<sub>$1</sub>");
}

// The unit of the quantity that is drawn, of a curve that declares units; empty where it declares none.
function unitOf(curve, quantity = view.quantity) {
  const { force, time } = curve.units, length = lengthOf(curve, Math.max(0, signalOf(curve)));
  if (quantity === "phase") { return "°"; }
  if (!length) { return ""; }
  if (forceOf(quantity) !== null) { return force; }
  return length + ({ velocity: `/${time}`, acceleration: `/${time}²` }[quantity] ?? "");
}

// The unit of a displacement: rad of an angle.
function lengthOf(curve, signal) { return curve.signals[signal]?.length || curve.units.length; }

function withUnit(text, unit) { return unit ? `${text} (${unit})` : text; }

// Units of frequencies that the page knows, in rad and in cycles.
const frequencies = document.getElementById("view")?.dataset ?? {};

function cyclesOf(curve) { return curve?.units.cycles || frequencies.cycles || "cycles per unit time"; }

// Which of a curve's displacements is shown: the observed one, or that of the chosen name; -1 where it has none.
function signalOf(curve) {
  return view.signal === "" ? 0 : curve.signals.findIndex((one) => one.label === view.signal);
}

// ------------------------------------------------------------------------------------------------- values along curves
// The largest and the least value of a motion, or of its derivative, by Newton's method from the best of many samples.
function extremes(c, order, rate, waves) {
  const size = c.length, { count, table } = waves;
  const d = new Float64Array(size), w = (k) => (k * rate) ** order;
  d[0] = order ? 0 : c[0];
  for (let k = 1; 2 * k < size; k++) {
    const a = c[2 * k - 1], b = c[2 * k];
    [d[2 * k - 1], d[2 * k]] = [[a, b], [b * w(k), -a * w(k)], [-a * w(k), -b * w(k)]][order];
  }
  let high = -Infinity, low = Infinity, top = 0, bottom = 0;
  for (let i = 0; i < count; i++) {
    let sum = d[0];
    for (let j = 1, at = i * waves.size + 1; j < size; j++, at++) { sum += d[j] * table[at]; }
    if (sum > high) { high = sum; top = i; }
    if (sum < low) { low = sum; bottom = i; }
  }
  const polished = (i, value, sign) => {
    let at = (2 * Math.PI * i) / count;
    for (let step = 0; step < 3; step++) {
      const slope = motionAt(d, at, 1, 1), bend = motionAt(d, at, 2, 1);
      if (!(sign * bend < 0)) { break; }
      at -= Math.max(-Math.PI / count, Math.min(Math.PI / count, slope / bend));
    }
    const there = motionAt(d, at, 0, 1);
    return sign * there > sign * value ? there : value;
  };
  return [polished(top, high, 1), polished(bottom, low, -1)];
}

const allWaves = new Map();
function wavesFor(size) {
  const harmonics = (size - 1) / 2, count = 2 ** Math.ceil(Math.log2(Math.max(64, 8 * harmonics)));
  if (!allWaves.has(size)) {
    const table = new Float32Array(count * size);
    for (let i = 0; i < count; i++) {
      table[i * size] = 1;
      for (let k = 1; k <= harmonics; k++) {
        const phase = (2 * Math.PI * ((i * k) % count)) / count;
        table[i * size + 2 * k - 1] = Math.cos(phase);
        table[i * size + 2 * k] = Math.sin(phase);
      }
    }
    allWaves.set(size, { count, size, table });
  }
  return allWaves.get(size);
}

// A quantity of one motion with the coefficients c; NaN where there is none of this kind.
function quantityOf(c, nu, omega, quantity, harmonic) {
  const rate = omega / nu, { order = 0 } = quantities[quantity];
  if (quantity === "mean") { return c[0]; }
  if (quantity === "rms") {
    let sum = c[0] ** 2;
    for (let j = 1; j < c.length; j++) { sum += 0.5 * c[j] ** 2; }
    return Math.sqrt(sum);
  }
  if (quantities[quantity].numbered) {
    const k = Math.round(harmonic * nu);
    if (Math.abs(harmonic * nu - k) > 1e-9) { return quantity === "phase" ? NaN : 0; }
    if (k === 0) { return quantity === "phase" ? NaN : Math.abs(c[0]); }
    const a = c[2 * k - 1] ?? 0, b = c[2 * k] ?? 0;
    return quantity === "harmonic" ? Math.hypot(a, b) : a || b ? (180 / Math.PI) * Math.atan2(-b, a) : NaN;
  }
  const [high, low] = extremes(c, order, rate, wavesFor(c.length));
  return quantity === "peak_to_peak" ? high - low : Math.max(Math.abs(high), Math.abs(low));
}

// The drawn quantity at all points, or all events, of a curve.
function valuesOf(curve, places) {
  const signal = signalOf(curve), force = forceOf(view.quantity);
  const key = `${signal} ${view.quantity} ${view.harmonic}`;
  places.known ??= {};
  if (places.known[key]) { return places.known[key]; }
  const values = new Float64Array(places.count).fill(NaN);
  if (force !== null) {
    const element = curve.elements.indexOf(force);
    if (element >= 0 && places.peaks) { values.forEach((_, i) => { values[i] = places.peaks[i * curve.elements.length + element]; }); }
  } else if (signal === 0 && view.quantity === "amplitude") {
    if (places.amplitude) { values.set(places.amplitude); }
  } else if (signal >= 0 && places.motion) {
    const omega = places.values.omega;
    for (let i = 0; i < places.count; i++) {
      const c = coefficients({ places, at: i, harmonics: places.harmonics[i] }, signal);
      values[i] = quantityOf(c, curve.nu, omega ? omega[i] : curve.fixed.omega, view.quantity, view.harmonic);
    }
    if (view.quantity === "phase") { unwrapped(values); }
  }
  places.known[key] = values;
  return values;
}

// Degrees without jumps of whole turns from one point of a curve to the next.
function unwrapped(values) {
  let before = NaN;
  values.forEach((value, i) => {
    if (!Number.isNaN(before) && !Number.isNaN(value)) { values[i] = value - 360 * Math.round((value - before) / 360); }
    if (!Number.isNaN(values[i])) { before = values[i]; }
  });
}

// What an axis shows of a vertex of a curve: omega, a parameter, or the drawn quantity.
function shownAt(curve, vertex, name) {
  const places = vertex < 0 ? curve.events : curve.points, at = vertex < 0 ? -1 - vertex : vertex;
  if (name === "quantity") {
    const value = valuesOf(curve, places)[at];
    if (view.quantity === "phase" && vertex < 0) { // beside the points around it
      const near = valuesOf(curve, curve.points)[curve.events.after[at]];
      return Number.isNaN(near) ? value : value - 360 * Math.round((value - near) / 360);
    }
    return value;
  }
  const value = places.values[name] ? places.values[name][at] : curve.fixed[name];
  return name === "omega" && view.cycles ? value / (2 * Math.PI) : value;
}

// ------------------------------------------------------------------------------------------------------ axes and traces
const letters = ["x", "y", "z"];

// A trace of a figure in the chosen view; what is no part of a curve stays, or cannot be shown.
function viewed(trace, figure) {
  const { axes } = figure.drawing, own = { ...trace };
  const { curve: number } = trace.meta || {}, curve = number === undefined ? null : curveOf(number);
  if (curve && trace.customdata) { own.text = trace.customdata.map((vertex) => hoverOf(curve, vertex, trace.meta.role)); }
  axes.forEach((name, i) => {
    const letter = letters[i], scaled = name === "omega" && view.cycles;
    if (name === "quantity" && !usual()) {
      if (!curve && trace.type === "scatter" && trace.x.every((value) => value === null)) { return; } // of the legend alone
      if (!curve || !trace.customdata || trace.meta.role === "floor") { own.visible = false; return; }
      own[letter] = trace.customdata.map((vertex) => (vertex === null ? null : finite(shownAt(curve, vertex, name))));
    } else if (scaled && trace[letter]) {
      const divided = (value) => (value === null ? null : value / (2 * Math.PI));
      own[letter] = trace[letter].map((value) => (Array.isArray(value) ? value.map(divided) : divided(value)));
    }
  });
  return own;
}

function finite(value) { return Number.isFinite(value) ? value : null; }

// The layout of a figure in the chosen view: titles, ranges, scales.
function layoutInView(figure, traces) {
  const { axes, layout, space } = figure.drawing, own = { ...layout }, frame = space ? { ...layout.scene } : own;
  axes.forEach((name, i) => {
    const letter = letters[i], key = `${letter}axis`, before = frame[key], scaled = name === "omega" && view.cycles;
    if (!before) { return; }
    const drawn = name === "quantity" && !usual(), log = !space && before.type !== "log" && { x: view.logx, y: view.logy }[letter];
    const axis = { ...before }, curve = curveOf(traces.find((trace) => trace.meta && trace.meta.curve !== undefined)?.meta.curve);
    if (scaled) { axis.title = { ...before.title, text: inCycles(before.title.text, curve) }; }
    if (drawn && curve) { axis.title = { ...before.title, text: quantityTitle(figure, curve) }; }
    if (scaled && before.range) { axis.range = before.range.map((end) => (before.type === "log" ? end - Math.log10(2 * Math.PI) : end / (2 * Math.PI))); }
    if (drawn || log) {
      const range = rangeOf(traces, letter, log, drawn && name === "quantity");
      if (range) { axis.range = range; }
      if (log && range) { axis.type = "log"; }
      if (log && !range) { axis.title = { ...axis.title, text: `${axis.title.text}, not above 0: linear` }; }
    }
    frame[key] = axis;
  });
  if (space) { own.scene = frame; }
  if (own.shapes && axes[0] === "omega" && view.cycles) {
    own.shapes = own.shapes.map((shape) => (shape.xref === "paper" ? shape
      : { ...shape, x0: shape.x0 / (2 * Math.PI), x1: shape.x1 / (2 * Math.PI) }));
  }
  return own;
}

function inCycles(text, curve) { return `${text.replace(/\s*(ω|<i>ω).*$/, "")} (${cyclesOf(curve)})`.trim(); }

function quantityTitle(figure, curve) {
  const force = forceOf(view.quantity), unit = unitOf(curve);
  if (force !== null) { return withUnit(`largest force, ${inHtml(force)}`, unit); }
  const label = view.signal === "" ? curve.signals[0]?.label ?? "x" : view.signal;
  return withUnit(quantities[view.quantity].of(inHtml(label), view.harmonic), unit);
}

// The range of what is drawn, with a margin; null where logarithms do not exist of all of it.
function rangeOf(traces, letter, log, fromZero) {
  let low = Infinity, high = -Infinity;
  const shownOnes = traces.filter((trace) => trace.visible !== false && trace[letter]);
  const own = shownOnes.filter((trace) => trace.meta?.curve !== undefined);
  for (const trace of own.length ? own : shownOnes) {
    for (const value of trace[letter]) {
      if (value === null || Number.isNaN(value) || (log && value === 0)) { continue; }
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  }
  if (!(high >= low)) { return log ? null : [0, 1]; }
  if (log) { return low > 0 ? [Math.log10(low) - 0.05, Math.log10(high) + 0.05] : null; }
  const margin = 0.06 * (high - low || Math.abs(high) || 1);
  return [fromZero && low >= 0 ? 0 : low - margin, high + margin];
}

// What is said of a vertex under the pointer.
function hoverOf(curve, vertex, role) {
  if (vertex === null || vertex === undefined) { return ""; }
  const place = placeOf(curve, vertex), lines = role === "section" ? [inHtml(curve.name)] : [];
  const named = new Set([...curve.free, "omega"]);
  for (const name of named) { if (name in place.values) { lines.push(inHtml(valueWords(curve, name, place.values[name]).join(" = "))); } }
  const unit = unitOf(curve), value = shownAt(curve, vertex, "quantity");
  if (Number.isFinite(value)) {
    const force = forceOf(view.quantity), label = curve.signals[Math.max(0, signalOf(curve))]?.label ?? "x";
    const words = force !== null ? `largest force, ${inHtml(force)}` : quantities[view.quantity].of(inHtml(label), view.harmonic);
    lines.push(`${words} = ${shown(value, 7)} ${unit}`.trim());
  }
  if (place.multipliers.length) {
    const [re, im] = place.multipliers[0], imaginary = Math.abs(im) < 1e-7 ? "" : ` ${im < 0 ? "−" : "+"}${shown(Math.abs(im), 5)}i`;
    lines.push(`${vertex < 0 ? "critical" : "leading"} multiplier = ${shown(re, 5)}${imaginary}, modulus ${shown(Math.hypot(re, im), 5)}`);
  }
  return lines.join("<br>");
}

// A parameter and its value in words, with units and in cycles where these are asked for.
function valueWords(curve, name, value, digits = 9) {
  if (name !== "omega") { return [name, shown(value, digits)]; }
  return view.cycles ? ["ω/2π", `${shown(value / (2 * Math.PI), digits)} ${cyclesOf(curve)}`]
    : ["ω", `${shown(value, digits)} ${curve.units.omega || ""}`.trim()];
}

// --------------------------------------------------------------------------------------------------------- the selectors
function choiceOf(label, options, value, act) {
  const whole = element("label", label), select = element("select");
  for (const [name, words] of options) {
    const option = element("option", words, { value: name });
    option.selected = name === value;
    select.append(option);
  }
  select.addEventListener("change", () => act(select.value));
  whole.append(" ", select);
  return { whole, select };
}

function checkOf(label, act) {
  const whole = element("label", ""), box = element("input", "", { type: "checkbox" });
  box.addEventListener("change", () => act(box.checked));
  whole.append(box, " ", label);
  return whole;
}

const selectors = {};

function startView() {
  const bar = document.getElementById("view");
  if (!bar || (!curves.length && frequencies.rad === undefined)) { return; }
  const labels = [...new Set(curves.flatMap((curve) => curve.signals.map((one) => one.label)))];
  const forces = [...new Set(curves.flatMap((curve) => (curve.points.peaks ? curve.elements : [])))];
  const moved = curves.some((curve) => curve.points.motion);
  const first = curves[0];
  const known = Object.entries(quantities).map(([name, one]) => [name, one.words]);
  const changed = (change) => { Object.assign(view, change); showSelectors(); redraw(); };
  if (labels.length > 1) {
    const observed = new Set(curves.map((curve) => curve.signals[0]?.label)), own = observed.size === 1 ? `, ${[...observed][0]}` : "";
    selectors.signal = choiceOf("displacement", [["", `as observed${own}`], ...labels.map((one) => [one, one])], "", (signal) => changed({ signal }));
    bar.append(selectors.signal.whole);
  }
  if (moved) {
    selectors.quantity = choiceOf("quantity", [...known, ...forces.map((one) => [`force:${one}`, `largest force, ${one}`])], "amplitude",
      (quantity) => changed({ quantity }));
    const nu = Math.max(...curves.map((curve) => curve.nu));
    const multiples = Array.from({ length: 9 * nu + 1 }, (_, i) => [String(i / nu), i % nu ? `${i}/${nu}` : String(i / nu)]);
    selectors.harmonic = choiceOf("k =", multiples, "1", (k) => changed({ harmonic: Number(k) }));
    bar.append(selectors.quantity.whole, selectors.harmonic.whole);
  }
  const rad = first?.units.omega || frequencies.rad || "rad per unit time";
  selectors.cycles = choiceOf("frequency in", [["", rad], ["cycles", cyclesOf(first)]], "", (unit) => changed({ cycles: unit !== "" }));
  if (frequencies.rad !== undefined) { bar.append(selectors.cycles.whole); }
  bar.append(checkOf("log x", (logx) => changed({ logx })), checkOf("log y", (logy) => changed({ logy })));
  bar.hidden = false;
  showSelectors();
}

function showSelectors() {
  if (selectors.signal) {
    selectors.signal.select.value = view.signal;
    selectors.signal.select.disabled = forceOf(view.quantity) !== null;
  }
  if (selectors.harmonic) { selectors.harmonic.whole.hidden = !quantities[view.quantity]?.numbered; }
}
