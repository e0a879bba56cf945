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
    for (const trace of figure.drawing.data) {
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
  const { data } = figure.drawing, cells = data.some((trace) => trace.type === "heatmap");
  return [...(cells ? data : data.map(traceOn)), chosenTrace(figure, chosen)];
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
  const layout = layoutOn(drawing.layout);
  if (figure.done) { keepView(layout, plot.layout); }
  Plotly.react(plot, tracesOf(figure), layout, config);
  if (!figure.done) {
    figure.done = true;
    performance.mark("figure drawn");
    plot.on("plotly_click", (event) => clicked(event.points[0]));
  }
}

// What the reader zoomed into, or turned, stays.
function keepView(layout, before) {
  for (const name of ["xaxis", "yaxis"]) {
    if (layout[name] && before[name]) { layout[name] = { ...layout[name], range: before[name].range, autorange: before[name].autorange }; }
  }
  if (layout.scene && before.scene) { layout.scene = { ...layout.scene, camera: before.scene.camera }; }
}

function clicked(point) {
  const { meta } = point.data;
  if (meta && meta.cells) {
    choosePlace(point.x, point.y, meta.cells[point.z], point.xaxis.title.text, point.yaxis.title.text);
  } else if (meta && point.customdata !== undefined && point.customdata !== null) {
    choose(meta.curve, point.customdata);
  }
}

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
    const layout = { ...figure.drawing.layout };
    if (figure.done) { keepView(layout, figure.plot.layout); }
    Plotly.downloadImage({ data: figure.drawing.data, layout }, { format, filename: name, width: 960, height: 600, scale: format === "png" ? 2 : 1 });
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
