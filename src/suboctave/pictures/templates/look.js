// Light and dark: as the system has it, until the button says otherwise.
const looks = { light: { ink: "#1a1a1a", paper: "#ffffff", grid: "#d9d9d9" },
  dark: { ink: "#e8e8e6", paper: "#15181c", grid: "#3b4046" } };
// colours of lines and markers that would not be seen on a dark ground
const onDark = { "#1a1a1a": "#e8e8e6", "#000000": "#e8e8e6", "white": "#15181c", "#ffffff": "#15181c",
  "#0072b2": "#4aa3dd", "#d9d9d9": "#3b4046" };
const wishes = window.matchMedia("(prefers-color-scheme: dark)");

function dark() { return document.documentElement.dataset.look === "dark"; }

function coloured(colour) {
  return dark() && typeof colour === "string" ? onDark[colour.toLowerCase()] || colour : colour;
}

function seeThrough(colour) {
  const [r, g, b] = [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16));
  return `rgba(${r},${g},${b},0.22)`;
}

// A trace, or a layout, as it looks on this ground.
function traceOn(trace) {
  if (!dark()) { return trace; }
  const own = { ...trace };
  if (own.line) { own.line = { ...own.line, color: coloured(own.line.color) }; }
  if (own.marker) {
    own.marker = { ...own.marker, color: coloured(own.marker.color),
      line: { ...own.marker.line, color: coloured(own.marker.line && own.marker.line.color) } };
  }
  if (own.fill === "toself" && /^#[0-9a-f]{6}$/i.test(own.fillcolor)) { own.fillcolor = seeThrough(own.fillcolor); }
  return own;
}

function layoutOn(layout) {
  const { ink, paper, grid } = looks[dark() ? "dark" : "light"];
  const own = { ...layout, font: { ...layout.font, color: ink }, paper_bgcolor: paper, plot_bgcolor: paper,
    hoverlabel: { ...layout.hoverlabel, bgcolor: paper, bordercolor: ink, font: { color: ink } } };
  if (dark() && own.shapes) { own.shapes = own.shapes.map((shape) => ({ ...shape, opacity: shape.type === "rect" ? 0.3 : 1 })); }
  const axis = (one) => ({ ...one, linecolor: ink, gridcolor: grid, tickcolor: ink });
  for (const name of ["xaxis", "yaxis"]) { if (own[name]) { own[name] = axis(own[name]); } }
  if (own.scene) {
    own.scene = { ...own.scene };
    for (const name of ["xaxis", "yaxis", "zaxis"]) { own.scene[name] = axis(own.scene[name]); }
  }
  return own;
}

function setLook(name) {
  document.documentElement.dataset.look = name;
  const button = document.querySelector(".look");
  if (button) {
    button.textContent = name === "dark" ? "Light" : "Dark";
    button.setAttribute("aria-label", name === "dark" ? "Light colours" : "Dark colours");
  }
}

function startLook(redraw) {
  setLook(wishes.matches ? "dark" : "light");
  const button = document.createElement("button");
  button.className = "look";
  button.type = "button";
  document.querySelector("header").appendChild(button);
  setLook(dark() ? "dark" : "light");
  button.addEventListener("click", () => { setLook(dark() ? "light" : "dark"); redraw(); });
  wishes.addEventListener("change", () => { setLook(wishes.matches ? "dark" : "light"); redraw(); });
}
