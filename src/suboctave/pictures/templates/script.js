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
      var drawing = JSON.parse(figure.querySelector("script").textContent);
      figure.classList.add("drawn");
      document.body.classList.add("live");
      Plotly.newPlot(figure.querySelector(".plot"), drawing.data, drawing.layout, {
        responsive: true, displaylogo: false, plotlyServerURL: "",
        modeBarButtons: drawing.space
          ? [["toImage"], ["orbitRotation", "tableRotation", "zoom3d", "pan3d"], ["resetCameraDefault3d"]]
          : [["toImage"], ["zoom2d", "pan2d"], ["zoomIn2d", "zoomOut2d", "resetScale2d"]],
        toImageButtonOptions: { format: "svg", filename: drawing.name }
      });
    });
  } catch (error) {
    document.querySelectorAll(".figure").forEach(function (figure) { figure.classList.remove("drawn"); });
    document.body.classList.remove("live");
  }
})();
