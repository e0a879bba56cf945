// The panel: everything that is known of the chosen point of a curve.
let chosen = null;
const panel = document.getElementById("panel");

function element(tag, text, attributes = {}) {
  const made = document.createElement(tag);
  if (text) { made.textContent = text; }
  for (const [name, value] of Object.entries(attributes)) { made.setAttribute(name, value); }
  return made;
}

function button(words, act, label) {
  const made = element("button", words, { type: "button", ...(label ? { "aria-label": label } : {}) });
  made.addEventListener("click", act);
  return made;
}

function choose(number, vertex, figure) {
  const curve = curveOf(number);
  if (!curve) { return; }
  chosen = { curve: number, vertex };
  const place = placeOf(curve, vertex);
  open(vertex < 0 ? eventHeading(curve, -1 - vertex) : `Point ${vertex} of ${curve.points.count}`, curve.name);
  const facts = factsOf(curve, vertex, place);
  panel.append(movesOf(curve), listOf(facts));
  const signal = Math.max(0, signalOf(curve)), c = coefficients(place, signal);
  if (c) {
    panel.append(...displacementsOf(curve, place, signal));
    motionPictures(curve, place, c, signal);
    forcesOf(curve, place);
  } else {
    panel.append(element("p", "The motions are not on this page: it was made from a dataset without them.", { class: "soft" }));
  }
  if (place.multipliers.length) { multiplierPicture(place); }
  linksTo(neighbours(place.values, number));
  markFigures();
  markRows();
  if (figure !== null) { keepInSight(figure || figureOf(number)); }
  document.getElementById("spoken").textContent = `${curve.name}, ${facts.slice(0, 4).map((f) => f.join(" ")).join(", ")}`;
}

// The figure on the screen that shows the chosen point of a curve.
function figureOf(number) {
  const visible = figures.filter((figure) => {
    const box = figure.plot.getBoundingClientRect();
    return figure.done && box.bottom > 0 && box.top < window.innerHeight;
  });
  return visible.find((figure) => figure.traces.some((trace) => trace.meta && trace.meta.curve === number));
}

// A place in a plane of parameters that is on no curve: what is known there, and the curves near it.
function choosePlace(values, words) {
  chosen = null;
  open(words || "A place in the plane", "");
  panel.append(listOf(Object.entries(values).map(([name, value]) => valueWords(curves[0] ? curveOf(0) : { units: {} }, name, value, 6))));
  const known = (name) => name === "omega" || curves.some((curve) => name in curve.fixed || name in curve.points.values);
  const near = Object.keys(values).every(known) ? neighbours(values, -1) : [];
  linksTo(near);
  if (!near.length) { panel.append(element("p", "No curve was computed near it.", { class: "soft" })); }
  markFigures();
  markRows();
}

function open(heading, name) {
  panel.replaceChildren(button("×", close, "Close the panel"), element("h2", heading), element("p", name, { class: "soft" }));
  panel.firstChild.className = "close";
  const before = panel.hidden;
  panel.hidden = false;
  document.body.classList.add("chosen-point");
  if (before) { window.dispatchEvent(new Event("resize")); }
}

function close() {
  chosen = null;
  panel.hidden = true;
  document.body.classList.remove("chosen-point");
  markFigures();
  markRows();
  window.dispatchEvent(new Event("resize"));
}

function eventHeading(curve, event) {
  const { kind, words, criticality } = curve.events;
  return [kind[event] === words[event] ? words[event] : `${kind[event]}: ${words[event]}`, criticality[event]].filter(Boolean).join(", ");
}

function factsOf(curve, vertex, place) {
  const facts = [], { cycles } = curve.units;
  const names = [...new Set([...curve.free, "omega", ...Object.keys(place.places.values)])];
  for (const name of names) {
    const value = place.values[name];
    facts.push([spelt(name), withWords(shown(value), name === "omega" ? curve.units.omega : "")]);
    if (name === "omega") { facts.push(["ω/2π", withWords(shown(value / (2 * Math.PI)), cycles)]); }
  }
  facts.push([`max |${curve.signals[0]?.label ?? "x"}|`, withWords(shown(place.amplitude, 7), curve.units.length)]);
  if (place.stable !== null) { facts.push(["stability", place.stable ? "stable" : "unstable"]); }
  if (place.multipliers.length) {
    const [re, im] = place.multipliers.reduce((a, b) => (Math.hypot(...b) > Math.hypot(...a) ? b : a));
    facts.push(["largest multiplier", `${shown(re, 6)}${Math.abs(im) > 1e-7 ? ` ${im < 0 ? "−" : "+"} ${shown(Math.abs(im), 6)}i` : ""}`]);
  }
  facts.push(["residual", small(place.residual)], ["neglected part", small(place.error)]);
  if (Number.isFinite(place.harmonics)) { facts.push(["harmonics", String(place.harmonics)]); }
  const period = ((2 * Math.PI) / place.omega) * curve.nu;
  facts.push(["period", `${curve.nu === 1 ? "T" : `${curve.nu}T`} = ${withWords(shown(period, 6), curve.units.time)}`]);
  if (vertex < 0 && curve.events.uncertainty[-1 - vertex]) { facts.push(["located to", `± ${small(curve.events.uncertainty[-1 - vertex])}`]); }
  if (vertex < 0 && curve.events.contact[-1 - vertex]) { facts.push(["contact", curve.events.contact[-1 - vertex]]); }
  const verified = vertex < 0 ? curve.verified_events[-1 - vertex] : curve.verified[vertex];
  facts.push(["verification", verified || "not verified"]);
  const fixed = Object.entries(curve.fixed).filter(([name]) => !names.includes(name));
  for (const [name, value] of fixed) { facts.push([name, shown(value)]); }
  return facts;
}

function withWords(text, unit) { return unit && text !== "–" ? `${text} ${unit}` : text; }

function listOf(facts) {
  const list = element("dl");
  for (const [name, value] of facts) { list.append(element("dt", name), element("dd", value)); }
  return list;
}

function movesOf(curve) {
  const row = element("div", "", { class: "actions" });
  row.append(button("← previous", () => goAlong(-1)), button("next →", () => goAlong(1)));
  const place = placeOf(curve, chosen.vertex);
  if (coefficients(place, 0)) { row.append(button("CSV", () => saveMotion(curve, place), "Save the motion as CSV")); }
  return row;
}

function goAlong(step) {
  const curve = curveOf(chosen.curve), { count } = curve.points;
  let from = chosen.vertex;
  if (from < 0) { from = curve.events.after[-1 - from] + (step > 0 ? 0 : 1); }
  choose(chosen.curve, Math.max(0, Math.min(count - 1, from + step)));
}

// All displacements and their velocities over one period of the motion.
function saveMotion(curve, place) {
  const { time } = curve.units;
  const own = curve.signals.map((_, i) => samples(coefficients(place, i), curve.nu, place.omega));
  const heads = curve.signals.flatMap(({ label }, i) => {
    const length = lengthOf(curve, i);
    return [withUnit(label, length), withUnit(`d(${label})/dt`, length && `${length}/${time}`)];
  });
  const rows = own[0].t.map((t, i) => [t, ...own.flatMap(({ x, v }) => [x[i], v[i]])]);
  save("motion.csv", csv([[withUnit("t", time), ...heads], ...rows]), "text/csv");
}

// Every displacement of the motion in numbers; a click on one shows it, here and in all figures.
function displacementsOf(curve, place, signal) {
  const lengths = new Set(curve.signals.map((_, i) => lengthOf(curve, i) || "")), unit = lengths.size === 1 ? [...lengths][0] : "";
  const table = element("table", "", { "aria-label": "Displacements" }), head = table.createTHead().insertRow();
  for (const [words, whole] of [["", ""], ["max", "largest |x|"], ["p-p", "peak to peak"], ["mean", "mean"], ["1 ω", "amplitude of harmonic 1"]]) {
    head.append(element("th", words, { scope: "col", title: whole }));
  }
  const body = table.createTBody();
  curve.signals.forEach(({ label }, i) => {
    const row = body.insertRow(), c = coefficients(place, i), name = element("td", "", { class: "text" });
    const own = button("", () => { view.signal = label; showSelectors(); redraw(); }, `Show ${label}`);
    own.innerHTML = lengths.size > 1 ? withUnit(inHtml(label), lengthOf(curve, i)) : inHtml(label);
    name.append(own);
    row.append(name);
    for (const what of ["amplitude", "peak_to_peak", "mean", "harmonic"]) {
      const value = i === 0 && what === "amplitude" ? place.amplitude : quantityOf(c, curve.nu, place.omega, what, 1);
      row.append(element("td", shown(value, 4)));
    }
    row.classList.toggle("chosen", i === signal);
  });
  const whole = element("div", "", { class: curve.signals.length > 8 ? "scroll tall short" : "scroll" });
  whole.append(table);
  const left = curve.left_out ? [element("p", `${curve.left_out} further degrees of freedom are left out.`, { class: "soft" })] : [];
  return [element("h3", withUnit("Displacements", unit)), whole, ...left];
}

// The forces of elements over one period, and how long each is in contact.
function forcesOf(curve, place) {
  const unit = curve.units.force || "", { count } = curve.instants, across = Array.from({ length: count + 1 }, (_, i) => (i * curve.nu) / count);
  const drawn = curve.elements.map((_, i) => forceAt(curve, place, i));
  if (drawn.some(Boolean)) {
    picture(withUnit("Forces of elements", unit), "Forces of elements over a period",
      drawn.map((force, i) => ({ x: across, y: [...force, force[0]], mode: "lines", name: curve.elements[i],
        line: { color: tone(i), width: 2, simplify: false }, hovertemplate: "t/T = %{x:.4f}<br>force = %{y:.5g}<extra></extra>" })),
      { xaxis: { title: { text: "t/T" }, range: [0, curve.nu] }, yaxis: { title: { text: withUnit("force", unit) } } });
  }
  const touching = contacts(curve, place);
  curve.elements.forEach((name, i) => {
    const line = element("p", "", { class: "element" }), largest = place.places.peaks?.[place.at * curve.elements.length + i];
    line.append(element("span", "", { class: "tone", style: `background:${tone(i)}` }), `${name}`);
    if (Number.isFinite(largest)) { line.append(`: largest force ${withWords(shown(largest, 5), unit)}`); }
    for (const one of touching.filter((own) => own.name === name)) {
      const state = one.share === 0 ? "never touches" : one.share > 0.9999999 ? "touches always"
        : `touches ${(100 * one.share).toFixed(1)} % of the period, ${one.begun} contact${one.begun === 1 ? "" : "s"} in it`;
      line.append(`; at ${curve.signals[one.signal].label} = ${withWords(shown(one.level, 5), lengthOf(curve, one.signal))} it ${state}`);
    }
    panel.append(line);
  });
}

function tone(i) {
  const light = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8c8c8c", "#1a1a1a"];
  const night = ["#6cc1f5", "#ff8a3d", "#3ecfa5", "#e79ac6", "#E69F00", "#9ad4f7", "#a9adb3", "#e8e8e6"];
  return (dark() ? night : light)[i % light.length];
}

// ------------------------------------------------------------------------------------------------------ its pictures
function picture(heading, words, data, layout, round) {
  panel.append(element("h3", heading));
  const plot = element("div", "", { class: round ? "small round" : "small", role: "img", "aria-label": words });
  panel.append(plot);
  const axis = { showline: true, zeroline: false, ticks: "outside", ticklen: 3, nticks: 6 };
  const whole = layoutOn({ margin: { l: 52, r: 10, t: 6, b: 36 }, showlegend: false, hovermode: "closest",
    font: { size: 11, family: "system-ui, Segoe UI, DejaVu Sans, Arial, sans-serif" }, ...layout,
    xaxis: { ...axis, ...layout.xaxis }, yaxis: { ...axis, ...layout.yaxis } });
  Plotly.newPlot(plot, data, whole, { responsive: true, displaylogo: false, plotlyServerURL: "", displayModeBar: false });
}

function motionPictures(curve, place, c, signal) {
  const { omega } = place, { nu } = curve, sampled = samples(c, nu, omega), { tau, x, v, count } = sampled;
  const ink = tone(0), soft = dark() ? "#a9adb3" : "#8c8c8c", { time } = curve.units, length = lengthOf(curve, signal);
  const line = { color: ink, width: 2, simplify: false };
  const largest = quantityOf(c, nu, omega, "amplitude"), label = inHtml(curve.signals[signal].label);
  const sub = withUnit(label, length);
  const across = tau.map((one) => (one * nu) / (2 * Math.PI));
  const inside = contacts(curve, place).filter((one) => one.signal === signal && Math.abs(one.level) <= 1.3 * largest);
  const rule = (value, upright) => ({ type: "line", line: { color: soft, width: 1, dash: "dot" },
    ...(upright ? { yref: "paper", y0: 0, y1: 1, x0: value, x1: value } : { xref: "paper", x0: 0, x1: 1, y0: value, y1: value }) });
  panel.dataset.peak = String(largest);
  picture("Time history", `Time history: largest |x| ${shown(largest, 7)}`,
    [{ x: across, y: x, mode: "lines", line, hovertemplate: "t/T = %{x:.4f}<br>x = %{y:.6g}<extra></extra>" }],
    { xaxis: { title: { text: "t/T" }, range: [0, nu] }, yaxis: { title: { text: sub } }, shapes: inside.map((one) => rule(one.level)) });
  const strobe = Array.from({ length: nu }, (_, i) => (i * count) / nu);
  picture("Phase portrait", "Phase portrait: velocity over displacement",
    [{ x, y: v, mode: "lines", line, hoverinfo: "skip" },
      { x: strobe.map((i) => x[i]), y: strobe.map((i) => v[i]), mode: "markers", marker: { color: ink, size: 8 },
        hovertemplate: "phase 0: %{x:.6g}, %{y:.6g}<extra></extra>" }],
    { xaxis: { title: { text: sub } }, yaxis: { title: { text: withUnit(`d(${label})/dt`, length && `${length}/${time}`) } }, shapes: inside.map((one) => rule(one.level, true)) }, true);
  const sizes = [Math.abs(c[0])];
  for (let k = 1; 2 * k < c.length; k++) { sizes.push(Math.hypot(c[2 * k - 1], c[2 * k])); }
  const top = Math.max(...sizes), floor = Math.floor(Math.log10(top)) - 8;
  const bars = sizes.map((size) => Math.max(0, Math.log10(size) - floor));
  const whole = sizes.map((_, k) => k % nu === 0), far = Math.min(sizes.length - 1, 24 * nu);
  if (top > 0) { // at rest there is none
    picture("Spectrum", "Amplitudes of the harmonics, logarithmic",
      [{ type: "bar", base: floor, x: sizes.map((_, k) => k / nu), y: bars, width: 0.5 / nu, marker: { color: whole.map((is) => (is ? ink : "#E69F00")) },
        customdata: sizes, hovertemplate: "%{x:.4g} ω: %{customdata:.4g}<extra></extra>" }],
      { xaxis: { title: { text: "frequency / ω" }, range: [-0.6, far / nu + 0.6] },
        yaxis: { title: { text: withUnit("amplitude", length) }, range: [floor, floor + 9], tickvals: [0, 2, 4, 6, 8].map((i) => floor + i),
          ticktext: [0, 2, 4, 6, 8].map((i) => `1e${floor + i}`) } });
  }
}

function multiplierPicture(place) {
  const angles = Array.from({ length: 181 }, (_, i) => (2 * Math.PI * i) / 180), { ink } = looks[dark() ? "dark" : "light"];
  const far = Math.max(1.25, 1.1 * Math.max(...place.multipliers.map((mu) => Math.hypot(...mu))));
  const out = place.multipliers.map((mu) => Math.hypot(...mu) > 1);
  picture("Multipliers", "Floquet multipliers and the unit circle",
    [{ x: angles.map(Math.cos), y: angles.map(Math.sin), mode: "lines", line: { color: ink, width: 1 }, hoverinfo: "skip" },
      { x: place.multipliers.map((mu) => mu[0]), y: place.multipliers.map((mu) => mu[1]), mode: "markers",
        customdata: place.multipliers.map((mu) => Math.hypot(...mu)), marker: { size: 9, color: out.map((is) => (is ? "#D55E00" : "#009E73")) },
        hovertemplate: "%{x:.6g} %{y:+.6g}i<br>modulus %{customdata:.6g}<extra></extra>" }],
    { xaxis: { title: { text: "Re μ" }, range: [-far, far] }, yaxis: { title: { text: "Im μ" }, range: [-far, far], scaleanchor: "x" } }, true);
}

function linksTo(near) {
  if (!near.length) { return; }
  panel.append(element("h3", "Near it"));
  const row = element("div", "", { class: "links" });
  for (const { number, curve, vertex, differs } of near) {
    const kind = curve.tracked ? `${curve.tracked} curve` : "curve";
    const words = differs.length ? `${curve.name} (${differs.join(", ")})` : curve.name;
    row.append(button(words, () => { choose(number, vertex); document.getElementById(`curve-${number}`)?.scrollIntoView(); keepInSight(figureOf(number)); }, `Go to the ${kind} ${words}`));
  }
  panel.append(row);
}
