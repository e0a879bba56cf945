function redraw() {
  figures.filter((figure) => figure.done).forEach(drawFigure);
  if (chosen) { choose(chosen.curve, chosen.vertex, null); }
}

async function start() {
  startLook(redraw);
  const known = document.getElementById("curves");
  if (known) { curves.push(...JSON.parse(known.textContent)); }
  try {
    if (!await unpackPlotly()) { return; }
    startView();
    startFigures();
    startTables();
    document.addEventListener("keydown", (event) => { if (event.key === "Escape" && !panel.hidden) { close(); } });
    document.documentElement.dataset.ready = "";
  } catch (error) {
    console.error(error);
    document.querySelectorAll(".figure").forEach((figure) => figure.classList.remove("drawn"));
    document.body.classList.remove("live");
  }
}
start();
