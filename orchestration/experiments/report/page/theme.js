// Light and dark: as the reader's system until a button is used; in print always light.

const root = document.documentElement;
const prefersDark = window.matchMedia("(prefers-color-scheme: dark)");
const PALETTES = {
  light: FIGURES.CYCLE,
  dark: ["#56b4e9", "#ff8a3d", "#2fcc9f", "#f2c14e", "#e8a0c6", "#9ad0f5", "#c9a86a", "#b0b0b0"],
};
const COLORS = [];
const redraws = [];

/** A colour of the style sheet by its name. */
function paint(name) {
  return getComputedStyle(root).getPropertyValue(`--${name}`).trim();
}

function takeScheme(scheme) {
  root.dataset.scheme = scheme;
  COLORS.splice(0, COLORS.length, ...PALETTES[scheme]);
}

function changeScheme(scheme) {
  if (root.dataset.scheme === scheme) return;
  takeScheme(scheme);
  nameScheme();
  for (const redraw of redraws) redraw();
}

function nameScheme() {
  const other = root.dataset.scheme === "dark" ? "light" : "dark";
  byId("scheme").textContent = other === "dark" ? "☾ Dark" : "☀ Light";
  byId("scheme").onclick = () => changeScheme(other);
}

/** Draw a plot in the colours of the page. */
function drawPlot(holder, traces, layout) {
  const themed = { ...layout, paper_bgcolor: paint("paper"), plot_bgcolor: paint("paper") };
  for (const [name, axis] of Object.entries(layout)) {
    if (/^[xy]axis\d*$/.test(name)) themed[name] = { gridcolor: paint("grid"), zerolinecolor: paint("edge"), ...axis };
  }
  return drawTraces(holder, traces, themed);
}

takeScheme(prefersDark.matches ? "dark" : "light");
prefersDark.addEventListener("change", () => changeScheme(prefersDark.matches ? "dark" : "light"));
let beforePaper = "light";
window.addEventListener("beforeprint", () => { beforePaper = root.dataset.scheme; changeScheme("light"); });
window.addEventListener("afterprint", () => changeScheme(beforePaper));
