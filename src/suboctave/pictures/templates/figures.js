// Figures: drawn by Plotly when they come into view; a click on a point chooses it, everywhere.
const figures = [];

async function unpackPlotly() {
  const packed = document.getElementById("plotly-packed");
  if (!packed || typeof DecompressionStream === "undefined") { return false; }
  const stream = new Blob([numbers(packed.textContent.trim(), Uint8Array)]).stream()
    .pipeThrough(new DecompressionStream("gzip"));
  const script = document.createElement("script");
  script.textContent = await new Response(stream).text();
  document.head.appendChild(script);
  return typeof Plotly !== "undefined";
}

const chosenMark = { name: "chosen point", showlegend: false, hoverinfo: "skip", mode: "markers" };

// Where the chosen point stands in a figure: one trace, empty where it is not there.
function chosenTrace(figure, choice) {
  const at = { x: [], y: [], z: [] };
  if (choice) {
    for (const trace of figure.traces) {
      if (!trace.meta || trace.meta.curve !== choice.curve || !trace.customdata || trace.meta.role === "floor") { continue; }
      const i = trace.customdata.indexOf(choice.vertex);
      if (i >= 0) { for (const letter of "xyz") { if (trace[letter]) { at[letter] = [trace[letter][i]]; } } break; }
    }
  }
  const ring = dark() ? "#ffd166" : "#d00000";
  if (figure.drawing.space) {
    return { ...chosenMark, type: "scatter3d", ...at, marker: { size: 6, color: ring, symbol: "circle-open", line: { width: 3 } } };
  }
  return { ...chosenMark, type: "scatter", x: at.x, y: at.y,
    marker: { size: 17, color: "rgba(0,0,0,0)", line: { color: ring, width: 3 } } };
}

// Colours of cells stay, and so do those of what is drawn upon them.
function tracesOf(figure) {
  const cells = figure.traces.some((trace) => trace.type === "heatmap");
  return [...(cells ? figure.traces : figure.traces.map(traceOn)), chosenTrace(figure, chosen)];
}

// A legend of many entries stands below the frame and must not eat it up.
function makeRoom(figure) {
  const entries = figure.drawing.data.filter((trace) => trace.showlegend !== false && trace.name).length;
  const rows = Math.ceil(entries / Math.max(1, Math.floor(figure.plot.clientWidth / 220)));
  figure.plot.style.height = rows > 3 ? `calc(var(--plot) + ${1.25 * (rows - 3)}rem)` : "";
}

function drawFigure(figure) {
  const { drawing, plot } = figure;
  makeRoom(figure);
  const config = { responsive: true, displaylogo: false, plotlyServerURL: "",
    modeBarButtons: drawing.space
      ? [["orbitRotation", "tableRotation", "zoom3d", "pan3d"], ["resetCameraDefault3d"]]
      : [["zoom2d", "pan2d"], ["zoomIn2d", "zoomOut2d", "resetScale2d"]] };
  figure.traces = drawing.data.map((trace) => viewed(trace, figure));
  const inView = layoutInView(figure, figure.traces), layout = layoutOn(inView), seen = JSON.stringify(view);
  if (figure.done && figure.seen === seen) { keepView(layout, plot.layout); }
  figure.seen = seen;
  figure.layout = inView;
  Plotly.react(plot, tracesOf(figure), layout, config);
  if (!figure.done) {
    figure.done = true;
    performance.mark("figure drawn");
    plot.on("plotly_click", (event) => { figure.hit = performance.now(); clicked(event.points[0], figure); });
  }
}

// A click on a place where nothing is drawn: in a plane of parameters what is near it, else a word that nothing is.
function watchClicks(figure) {
  let down = null;
  figure.plot.addEventListener("pointerdown", (event) => { down = { x: event.clientX, y: event.clientY, hit: figure.hit }; }, true);
  document.addEventListener("pointerup", (event) => {
    const from = down;
    down = null;
    if (!from || !figure.done || figure.drawing.space || Math.hypot(event.clientX - from.x, event.clientY - from.y) > 5) { return; }
    setTimeout(() => { if (figure.hit === from.hit) { clickedBeside(figure, from); } }, 350);
  }, true);
}

function clickedBeside(figure, { x, y }) {
  const { xaxis, yaxis } = figure.plot._fullLayout, box = figure.plot.getBoundingClientRect();
  const [across, upwards] = [x - box.x - xaxis._offset, y - box.y - yaxis._offset], [first, second] = figure.drawing.axes;
  if (across < 0 || across > xaxis._length || upwards < 0 || upwards > yaxis._length) { return; }
  const ofPlane = first && second && first !== "quantity" && second !== "quantity";
  if (!ofPlane) { say(figure, "Nothing is drawn there: click on a line or a marker."); return; }
  const real = (axis, pixels) => (axis.type === "log" ? 10 ** axis.p2l(pixels) : axis.p2l(pixels));
  const value = (name, shownValue) => (name === "omega" && view.cycles ? 2 * Math.PI * shownValue : shownValue);
  choosePlace({ [first]: value(first, real(xaxis, across)), [second]: value(second, real(yaxis, upwards)) }, "");
}

// A word below a figure, gone after a while.
function say(figure, words) {
  figure.words.textContent = words;
  clearTimeout(figure.saying);
  figure.saying = setTimeout(() => { figure.words.textContent = ""; }, 6000);
}

// What the reader zoomed into, or turned, stays.
function keepView(layout, before) {
  for (const name of ["xaxis", "yaxis"]) {
    if (layout[name] && before[name]) { layout[name] = { ...layout[name], range: before[name].range, autorange: before[name].autorange }; }
  }
  if (layout.scene && before.scene) { layout.scene = { ...layout.scene, camera: before.scene.camera }; }
}

function clicked(point, figure) {
  const { meta } = point.data;
  if (meta && meta.cells) {
    const [first, second] = figure.drawing.axes, titles = [point.xaxis.title.text, point.yaxis.title.text];
    const names = [first || plainText(titles[0]), second || plainText(titles[1])];
    const at = names[0] === "omega" && view.cycles ? 2 * Math.PI * point.x : point.x;
    choosePlace({ [names[0]]: at, [names[1]]: point.y }, meta.cells[point.z]);
  } else if (meta && point.customdata !== undefined && point.customdata !== null) {
    choose(meta.curve, point.customdata, figure);
  } else {
    say(figure, "No motion belongs to this place: click on a line or a marker.");
  }
}

function plainText(html) { return html.replace(/<[^>]*>/g, ""); }

function markFigures() {
  for (const figure of figures) {
    if (!figure.done) { continue; }
    const trace = chosenTrace(figure, chosen), last = figure.drawing.data.length;
    const change = { x: [trace.x], y: [trace.y] };
    if (figure.drawing.space) { change.z = [trace.z]; }
    Plotly.restyle(figure.plot, change, [last]);
  }
}

function actionsOf(figure) {
  const row = document.createElement("div"), { name } = figure.drawing;
  row.className = "actions";
  row.append("Save as");
  const picture = (format) => {
    const layout = { ...figure.layout };
    keepView(layout, figure.plot.layout);
    Plotly.downloadImage({ data: figure.traces, layout }, { format, filename: name, width: 960, height: 600, scale: format === "png" ? 2 : 1 });
  };
  const data = () => {
    const own = [...new Set(figure.drawing.data.filter((t) => t.meta && t.meta.curve !== undefined).map((t) => t.meta.curve))];
    save(`${name}.csv`, own.length ? csvOfCurves(own) : csvOfTraces(figure.drawing.data), "text/csv");
  };
  for (const [words, act] of [["SVG", () => picture("svg")], ["PNG", () => picture("png")], ["CSV", data]]) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = words;
    button.setAttribute("aria-label", `Save the ${words === "CSV" ? "data" : "picture"} ${name} as ${words}`);
    button.addEventListener("click", act);
    row.append(button);
  }
  figure.words = element("span", "", { class: "words", role: "status" });
  row.append(figure.words);
  return row;
}

function csvOfTraces(data) {
  const rows = [["what", "x", "y", "value"]];
  for (const trace of data) {
    if (trace.type === "heatmap") {
      trace.z.forEach((line, i) => line.forEach((cell, j) => rows.push([trace.meta.cells[cell], trace.x[j], trace.y[i], cell])));
    } else {
      (trace.x || []).forEach((x, i) => { if (x !== null && typeof x !== "object") { rows.push([trace.name, x, trace.y[i], ""]); } });
    }
  }
  return csv(rows);
}

// Where the chosen point is on the screen in a figure; null where it is not drawn.
function onScreen(figure) {
  const { x, y } = chosenTrace(figure, chosen), { xaxis, yaxis } = figure.plot._fullLayout;
  if (figure.drawing.space || !x.length || x[0] === null) { return null; }
  const box = figure.plot.getBoundingClientRect();
  return { x: box.x + xaxis._offset + xaxis.d2p(x[0]), y: box.y + yaxis._offset + yaxis.d2p(y[0]) };
}

// On a small screen the panel covers the lower part: the chosen point is brought above it.
function keepInSight(figure) {
  const wide = window.matchMedia("(min-width: 70rem)").matches, at = !wide && figure && figure.done ? onScreen(figure) : null;
  if (!at) { return; }
  const top = panel.getBoundingClientRect().top;
  if (at.y > top - 40 || at.y < 40) { window.scrollBy({ top: at.y - 0.6 * top, behavior: "instant" }); }
}

function startFigures() {
  document.querySelectorAll(".figure").forEach((element) => {
    const script = element.querySelector("script");
    if (!script) { return; }
    const figure = { element, plot: element.querySelector(".plot"), done: false,
      get drawing() { return this.read ??= JSON.parse(script.textContent); } };
    element.classList.add("drawn");
    element.appendChild(actionsOf(figure));
    figure.plot.tabIndex = 0;
    figure.plot.addEventListener("keydown", (event) => keyed(event, figure));
    watchClicks(figure);
    figures.push(figure);
  });
  document.body.classList.add("live");
  const seen = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (!entry.isIntersecting) { continue; }
      seen.unobserve(entry.target);
      drawFigure(figures.find((figure) => figure.plot === entry.target));
    }
  }, { rootMargin: "200px" });
  figures.forEach((figure) => seen.observe(figure.plot));
}

// Arrow keys go along the chosen curve; without one, to the first of the figure.
function keyed(event, figure) {
  const step = { ArrowRight: 1, ArrowLeft: -1, PageDown: 10, PageUp: -10 }[event.key];
  if (step === undefined && event.key !== "Enter") { return; }
  event.preventDefault();
  const own = figure.drawing.data.filter((t) => t.meta && t.meta.curve !== undefined).map((t) => t.meta.curve);
  if (chosen && own.includes(chosen.curve)) { goAlong(step || 0); } else if (own.length) { choose(own[0], 0); }
}
