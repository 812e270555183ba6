// Numbers, units and small parts of the page.

const DASHES = ["solid", "dash", "dashdot", "dot", "longdash", "longdashdot", "solid", "dash"];
const SHAPES = ["circle", "square", "diamond", "triangle-up", "x", "star", "cross", "hexagon"];
const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";
const FONT = { family: 'system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif', size: 12 };

/** A number to six digits; a dash for none. */
function shown(value) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (typeof value !== "number") return String(value);
  return String(Number(value.toPrecision(6)));
}

function superscript(power) {
  return String(power).replace("-", "⁻").replace(/\d/g, (digit) => SUPERSCRIPTS[digit]);
}

/** A unit behind a number: all but the degree with a space. */
function afterNumber(unit) {
  return unit ? (unit === "°" ? unit : ` ${unit}`) : "";
}

function withUnit(value, unit) {
  return !unit || shown(value) === "–" ? shown(value) : shown(value) + afterNumber(unit);
}

/** The unit in which times up to one are shown, and how many of it are a second. */
function unitOfTimes(longest) {
  const units = [["s", 1], ["ms", 1e3], ["µs", 1e6], ["ns", 1e9]];
  const [unit, each] = units.find(([, factor]) => longest * factor >= 1) ?? (longest > 0 ? units.at(-1) : units[0]);
  return { unit, each };
}

function titled(name, unit) {
  return unit ? `${name} [${unit}]` : name;
}

/** Text for labels of plots, which know some tags. */
function escaped(text) {
  return String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
}

function percent(share) {
  return `${Number((100 * share).toPrecision(3))} %`;
}

/** "12 of 20 settled (60 %, 95 % interval 39 % to 78 %)" */
function shareText(share, word = report.words[0]) {
  const interval = share.low === null ? "" : `, 95 % interval ${percent(share.low)} to ${percent(share.high)}`;
  return `${share.good} of ${share.runs} ${word} (${percent(share.good / share.runs)}${interval})`;
}

function byId(id) {
  return document.getElementById(id);
}

/** An element with properties and children; text is never read as HTML. */
function element(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith("aria") || name === "role") made.setAttribute(name.replace("aria", "aria-").toLowerCase(), value);
    else made[name] = value;
  }
  made.append(...children);
  return made;
}

function button(text, action, properties = {}) {
  return element("button", { type: "button", textContent: text, onclick: action, ...properties });
}

/** A labelled choice; options are pairs of value and text. */
function choice(label, options, value, change) {
  const select = element("select", { onchange: () => change(select.value) });
  for (const [key, text] of options) select.append(element("option", { value: key, textContent: text }));
  select.value = value;
  const whole = element("label", {}, label, select);
  whole.select = select;
  return whole;
}

/** Rows of header and cell; a number is at the right. */
function tableOf(rows, heads) {
  const table = element("table");
  if (heads) table.append(element("thead", {}, element("tr", {}, ...heads.map((text, i) => element("th", { scope: "col", textContent: text, className: i ? "number" : "" })))));
  const body = element("tbody");
  for (const [head, ...cells] of rows) {
    body.append(element("tr", {}, element("th", { scope: "row", textContent: head }), ...cells.map((text) => element("td", { textContent: text, className: "number" }))));
  }
  table.append(body);
  return table;
}

function badge(outcome) {
  const symbols = { good: "●", bad: "✕", diverged: "▼" };
  const kind = kindOf(outcome);
  return element("span", { className: `badge ${kind}`, textContent: `${symbols[kind]} ${outcome}` });
}

const isStill = window.matchMedia("(prefers-reduced-motion: reduce)");
