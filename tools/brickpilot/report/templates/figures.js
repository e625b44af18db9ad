"use strict";
// Draws the figures of a page by uPlot, from the JSON inside each `.plot`. `report/plot.py` writes this JSON and explains its fields.
// Text from the data is written only to canvases and to `textContent`, so that it cannot become markup.

const root = document.documentElement;
const PAPER_WIDTH = 690; // px: A4 and letter without their margins
const NAMES = ["blue", "orange", "green", "purple", "grey", "ink", "faint", "line", "page", "band", "stretch"];
const palette = {};
const drawn = []; // every chart: {holder, chart, height(width), link}
const zooms = new Map(); // link -> the part of the time that its figures show

function readPalette() {
  const style = getComputedStyle(root);
  for (const name of NAMES) palette[name] = style.getPropertyValue(`--${name}`).trim();
}

function shown(value) {
  return value == null ? "–" : String(+value.toPrecision(4)).replace("-", "−");
}

const shapes = {
  line: uPlot.paths.linear(),
  step: uPlot.paths.stepped({ align: 1 }),
  bars: uPlot.paths.bars({ size: [0.8, 60, 1] }),
  marks: () => null,
};

function seriesOf(curve, panel) {
  const colour = () => palette[curve.colour];
  const marks = curve.shape === "marks";
  return {
    label: curve.name,
    stroke: colour,
    fill: curve.shape === "bars" ? colour : undefined,
    width: curve.width,
    dash: curve.dash ?? undefined,
    paths: shapes[curve.shape],
    points: marks ? { show: true, size: 9, fill: colour, stroke: colour } : { show: curve.shape === "bars" ? false : undefined, size: 4 },
    gaps: (u, i, first, last, found) => found.filter(([from, to]) => u.posToVal(to, "x", true) - u.posToVal(from, "x", true) > curve.gap),
    value: (u, value) => (value != null && panel.rows.length ? panel.rows[value] : shown(value)),
  };
}

function verticalScale(panel) {
  if (panel.rows.length) return { range: [-0.6, panel.rows.length - 0.4] };
  if (panel.log) return { distr: 3, range: (u, low, high) => [0.5, 2 * Math.max(high ?? 1, 1)] };
  return { range: (u, low, high) => verticalRange(low, high, panel.band) };
}

function verticalRange(low, high, band) {
  if (low == null) return [-1, 1];
  if (band) [low, high] = [Math.min(low, band[0]), Math.max(high, band[1])];
  const margin = 0.06 * (high - low) || 0.5 * Math.abs(high) || 1;
  return [low - margin, high + margin];
}

function axesOf(spec, panel, last, width) {
  const plain = { stroke: () => palette.ink, grid: { stroke: () => palette.line, width: 1 }, ticks: { stroke: () => palette.line, width: 1, size: 4 }, font: "12px system-ui, sans-serif" };
  const across = { ...plain, size: last ? 26 : 8, gap: 4, values: (u, all) => all.map((one) => (last && one != null ? shown(one) : "")) };
  if (last) Object.assign(across, { label: spec.x.label, labelSize: 18, labelGap: 0, labelFont: "12px system-ui, sans-serif" });
  const up = { ...plain, size: 52, gap: 4, values: (u, all) => all.map((one) => (one == null ? "" : shown(one))) };
  if (panel.rows.length) {
    const longest = Math.max(...panel.rows.map((one) => one.length));
    up.size = Math.min(14 + 6.8 * longest, 0.42 * width);
    up.splits = () => panel.rows.map((_, row) => row);
    up.values = () => panel.rows.map((one) => shortened(one, up.size));
  }
  if (spec.x.log) across.filter = (u, all) => rounded(all, u.scales.x.max / u.scales.x.min > 12 ? /^[125]/ : /^[12357]/);
  if (panel.log) up.splits = (u, i, low, high) => [...Array(9).keys()].map((power) => 10 ** power).filter((one) => one <= high);
  return [across, up];
}

function rounded(all, digit) { // keeps the ticks of a logarithmic axis that have one digit, if `digit` matches this digit
  return all.map((one) => (digit.test(one.toExponential()) && Math.abs(one.toPrecision(1) - one) < 1e-6 * one ? one : null));
}

function shortened(text, pixels) {
  const most = Math.floor((pixels - 12) / 6.4);
  const head = Math.ceil(most / 3);
  return text.length <= most ? text : `${text.slice(0, head)}…${text.slice(head + 1 - most)}`; // the end stays, because it distinguishes rows
}

function shade(u, spec, panel) {
  const { left, top, width, height } = u.bbox;
  const x = (value) => Math.min(Math.max(u.valToPos(value, "x", true), left), left + width);
  const y = (value) => Math.min(Math.max(u.valToPos(value, "y", true), top), top + height);
  const box = (colour, from, upper, to, lower) => { u.ctx.fillStyle = colour; u.ctx.fillRect(from, upper, Math.max(to - from, 1), Math.max(lower - upper, 1)); };
  if (spec.stretch) box(palette.stretch, x(spec.stretch[0]), top, x(spec.stretch[1]), top + height);
  for (const [row, low, high] of panel.asked) box(palette.band, x(low) - 2 * devicePixelRatio, y(row + 0.42), x(high) + 2 * devicePixelRatio, y(row - 0.42));
  if (panel.band) box(palette.band, left, y(panel.band[1]), left + width, y(panel.band[0]));
}

function markOver(u, spec, panel) { // draws the lines through the panel, and the intervals
  const { left, top, width, height } = u.bbox, half = devicePixelRatio;
  const x = (value) => Math.min(Math.max(u.valToPos(value, "x", true), left), left + width);
  u.ctx.fillStyle = palette.green;
  for (const place of spec.lines) u.ctx.fillRect(x(place) - half, top, 2 * half, height);
  u.ctx.fillStyle = palette.faint;
  for (const [row, low, high] of panel.spans) u.ctx.fillRect(x(low), u.valToPos(row, "y", true) - half, x(high) - x(low), 2 * half);
}

function horizontalRange(u, low, high, spec) {
  if (spec.x.values[0] === spec.x.values.at(-1)) low = high = spec.x.values[0]; // undoes the wider range that uPlot gives a single value
  [low, high] = [Math.min(low, ...spec.x.reach), Math.max(high, ...spec.x.reach)];
  const marks = spec.panels[0].curves[0].shape;
  if (marks === "line" || marks === "step" || spec.link) return low === high ? [low - 0.5, high + 0.5] : [low, high];
  return spec.x.log ? [low / 1.2, high * 1.2] : [low - 0.03 * (high - low || 1), high + 0.03 * (high - low || 1)];
}

function chartOf(holder, spec, panel, last, width) {
  const extra = last ? 46 : 8;
  const height = panel.height + extra + 8;
  const u = new uPlot({
    title: panel.label,
    width,
    height,
    padding: [8, 14, 0, 0],
    scales: { x: { time: false, distr: spec.x.log ? 3 : 1, range: (u, low, high) => horizontalRange(u, low, high, spec) }, y: verticalScale(panel) },
    axes: axesOf(spec, panel, last, width),
    series: [{ label: spec.x.name, value: (u, value) => shown(value) }, ...panel.curves.map((one) => seriesOf(one, panel))],
    cursor: { y: false, sync: { key: spec.link || null }, points: { size: 7, fill: (u, i) => `var(--${panel.curves[i - 1].colour})`, stroke: "transparent" } },
    legend: { markers: { width: 2, stroke: (u, i) => `var(--${panel.curves[i - 1].colour})`, fill: (u, i) => `var(--${panel.curves[i - 1].colour})` } },
    hooks: { drawClear: [(u) => shade(u, spec, panel)], drawAxes: [(u) => markOver(u, spec, panel)], setScale: [(u, key) => keepZoom(u, key, spec.link)] },
  }, [spec.x.values, ...panel.curves.map((one) => one.values)], holder);
  byKeyboard(u);
  if (zooms.has(spec.link)) u.setScale("x", zooms.get(spec.link));
  return { holder, chart: u, height: () => height, link: spec.link };
}

function keepZoom(u, key, link) { // keeps the zoom for the figures of the same link that are drawn later
  if (link && key === "x" && u.status === 1) zooms.set(link, { min: u.scales.x.min, max: u.scales.x.max });
}

function byKeyboard(u) { // lets keys switch signals on and off at their names in the legend
  for (const name of u.root.querySelectorAll(".u-series:has(.u-marker) th")) {
    name.tabIndex = 0;
    name.title = "switch on or off";
    name.addEventListener("keydown", (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); name.click(); } });
  }
}

function widthOf(holder) { // returns px on the screen, or on the paper, which is not laid out yet
  if (!root.classList.contains("paper")) return holder.clientWidth;
  return Math.round(PAPER_WIDTH * holder.clientWidth / root.querySelector("main").clientWidth);
}

function draw(holder) {
  if (holder.dataset.drawn || !holder.clientWidth) return;
  holder.dataset.drawn = "yes";
  const spec = JSON.parse(holder.querySelector("script").textContent);
  if (spec.track) return drawTrack(holder, spec);
  for (const [k, panel] of spec.panels.entries()) {
    drawn.push(chartOf(holder, spec, panel, k === spec.panels.length - 1, widthOf(holder)));
  }
}

function fit() { // gives the charts the width of their holders
  for (const { holder, chart, height } of drawn) {
    const width = widthOf(holder);
    if (width && width !== chart.width) chart.setSize({ width, height: height(width) });
  }
}

function recolour() {
  readPalette();
  for (const one of drawn) one.chart.redraw(false);
}
