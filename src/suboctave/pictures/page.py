"""The frame of a report page: its style sheet, the script that draws, and how Plotly travels inside the page."""

from __future__ import annotations

import base64
import functools
import gzip

__all__ = ["POLICY", "SCRIPT", "STYLE", "plotly_source"]

# The page loads nothing and sends nothing, whatever a script or a button in it might wish.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; "
    "base-uri 'none'; form-action 'none'"
)

STYLE = """
:root { --ink: #1a1a1a; --soft: #5a5a5a; --rule: #d9d9d9; --wash: #f6f6f4; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 76rem; padding: 1.5rem 1.5rem 4rem; color: var(--ink); background: #fff;
  font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", Arial, sans-serif; }
h1 { font-size: 1.7rem; margin: 0.4rem 0 0.2rem; overflow-wrap: anywhere; }
h2 { font-size: 1.25rem; margin: 2.4rem 0 0.4rem; padding-top: 0.9rem; border-top: 1px solid var(--rule);
  overflow-wrap: anywhere; }
h3 { font-size: 1rem; margin: 1.1rem 0 0.3rem; }
p { margin: 0.3rem 0; }
.soft { color: var(--soft); }
nav a { margin-right: 1rem; }
a { color: #0072B2; }
.pair { display: grid; grid-template-columns: minmax(0, 3fr) minmax(0, 2fr); gap: 1.6rem; align-items: start; }
.pair.wide { grid-template-columns: minmax(0, 1fr); }
@media (max-width: 62rem) { .pair { grid-template-columns: minmax(0, 1fr); } }
.plot { width: 100%; height: 32rem; display: none; }
.drawn .plot { display: block; }
.drawn .still { display: none; }
.still img { width: 100%; max-width: 46rem; height: auto; }
.hint { display: none; }
.live .hint { display: block; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.86rem; font-variant-numeric: tabular-nums; }
th, td { padding: 0.2rem 0.7rem 0.2rem 0; text-align: right; white-space: nowrap; vertical-align: top; }
th { border-bottom: 1px solid var(--ink); font-weight: 600; }
td { border-bottom: 1px solid var(--rule); }
th.text, td.text { text-align: left; }
td.long { white-space: normal; min-width: 12rem; text-align: left; }
dl { display: grid; grid-template-columns: max-content minmax(0, 1fr); gap: 0.15rem 1.2rem;
  font-size: 0.88rem; margin: 0; }
dt { color: var(--soft); }
dd { margin: 0; overflow-wrap: anywhere; }
pre { background: var(--wash); padding: 0.6rem 0.8rem; font-size: 0.8rem; white-space: pre-wrap;
  overflow-wrap: anywhere; margin: 0.4rem 0; }
.note { border-left: 3px solid #E69F00; padding: 0.15rem 0.8rem; margin: 0.5rem 0; background: #fffaf0;
  overflow-wrap: anywhere; white-space: pre-wrap; }
details summary { cursor: pointer; margin-top: 0.6rem; }
@media print {
  @page { margin: 14mm; }
  body { max-width: none; padding: 0; font-size: 9.5pt; }
  nav, .live .hint { display: none; }
  .plot, .drawn .plot { display: none; }
  .still, .drawn .still { display: block; max-width: 120mm; }
  .pair { display: block; }
  table { font-size: 7.5pt; }
  th, td { padding-right: 0.5rem; }
  .scroll { overflow: visible; }
  dl { font-size: 8pt; }
  h2, h3, .soft { break-after: avoid; }
  .still, tr, .note { break-inside: avoid; }
}
"""

# Plotly is unpacked by the browser itself; where that cannot be, the still pictures stay.
SCRIPT = """
(async function () {
  "use strict";
  var packed = document.getElementById("plotly-packed");
  if (!packed || typeof DecompressionStream === "undefined") { return; }
  try {
    var raw = atob(packed.textContent.trim());
    var bytes = new Uint8Array(raw.length);
    for (var i = 0; i < raw.length; i++) { bytes[i] = raw.charCodeAt(i); }
    var stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    var source = await new Response(stream).text();
    var script = document.createElement("script");
    script.textContent = source;
    document.head.appendChild(script);
    document.querySelectorAll(".figure").forEach(function (figure) {
      var told = JSON.parse(figure.querySelector("script").textContent);
      figure.classList.add("drawn");
      document.body.classList.add("live");
      Plotly.newPlot(figure.querySelector(".plot"), told.data, told.layout, {
        responsive: true, displaylogo: false, plotlyServerURL: "",
        modeBarButtons: told.space
          ? [["toImage"], ["orbitRotation", "tableRotation", "zoom3d", "pan3d"], ["resetCameraDefault3d"]]
          : [["toImage"], ["zoom2d", "pan2d"], ["zoomIn2d", "zoomOut2d", "resetScale2d"]],
        toImageButtonOptions: { format: "svg", filename: told.name }
      });
    });
  } catch (error) {
    document.querySelectorAll(".figure").forEach(function (figure) { figure.classList.remove("drawn"); });
    document.body.classList.remove("live");
  }
})();
"""


@functools.cache
def plotly_source() -> str:
    """Plotly's script for browsers, packed (gzip, base64): a third of its size, and the page needs no network."""
    from plotly.offline import get_plotlyjs

    return base64.b64encode(gzip.compress(get_plotlyjs().encode("utf-8"), 9, mtime=0)).decode("ascii")
