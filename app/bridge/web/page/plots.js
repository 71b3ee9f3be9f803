// SPDX-License-Identifier: MIT
"use strict";
// Series over time by uPlot: they follow the newest 60 s, can be moved, zoomed and frozen, and saved as PNG and CSV.

const WINDOW_S = 60;
const KEPT_S = 600; // What can still be looked at by moving back; memory stays the same for hours.

function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "class") made.className = value;
    else if (key === "text") made.textContent = value;
    else made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

function save(blob, name) {
  const link = element("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

class Series {
  // Columns of numbers (null: unknown), the first of them seconds. Old rows go in blocks, so that a row costs the same for ever.
  constructor(columns) {
    this.data = Array.from({ length: columns }, () => []);
  }
  add(row) {
    row.forEach((value, i) => this.data[i].push(value));
    const times = this.data[0];
    if (times.length > 64 && times[times.length - 1] - times[0] > KEPT_S * 1.1) {
      const first = this.from(times[times.length - 1] - KEPT_S);
      this.data = this.data.map((column) => column.slice(first));
    }
  }
  get last() {
    return this.data[0].length ? this.data[0][this.data[0].length - 1] : null;
  }
  // The first row that is not before this time.
  from(time) {
    let low = 0, high = this.data[0].length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.data[0][middle] < time) low = middle + 1; else high = middle;
    }
    return low;
  }
  between(first, last) {
    const a = Math.max(0, this.from(first) - 1), b = Math.min(this.data[0].length, this.from(last) + 1);
    return this.data.map((column) => column.slice(a, b));
  }
}

class Plot {
  // lines: [{ name, label, dash }]; their colours are the page's of that name.
  constructor(place, title, label, lines, file) {
    this.lines = lines;
    this.file = file;
    this.live = new Series(lines.length + 1);
    this.series = this.live;
    this.range = null; // [first, last] if somebody has moved or zoomed.
    this.frozen = false;
    this.dirty = true;
    this.host = element("div", { tabindex: "0", role: "img", "aria-label": `${label} ${STRINGS.plot_keys}` });
    const saves = element("div", { class: "row" },
      this.button("save_png", title, () => this.savePng()), this.button("save_csv", title, () => this.saveCsv()));
    const legend = element("ul", { class: "legend" }, ...lines.map((line) =>
      element("li", { class: line.name }, element("i"), line.label)));
    place.append(element("div", { class: "plot" }, element("h3", { text: title }), this.host, legend, saves));
    this.host.addEventListener("keydown", (event) => this.key(event));
    this.host.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.visible = true;
    new IntersectionObserver((entries) => { this.visible = entries.at(-1).isIntersecting; this.dirty = true; }).observe(this.host);
    new ResizeObserver(() => this.size()).observe(this.host);
    this.build();
  }
  button(name, title, action) {
    const made = element("button", { type: "button", class: "small", text: STRINGS[name], "aria-label": say(`${name}_of`, { what: title }) });
    made.addEventListener("click", action);
    return made;
  }
  build() {
    this.uplot?.destroy();
    const axis = { stroke: colour("quiet"), grid: { stroke: colour("line"), width: 1 }, ticks: { stroke: colour("line"), width: 1 }, font: "12px system-ui" };
    const seconds = (u, ticks) => ticks.map((tick) => `${Math.round((tick - this.zero()) * 1000) / 1000} s`);
    this.uplot = new uPlot({
      width: Math.max(this.host.clientWidth, 200), height: 180, legend: { show: false }, padding: [8, 12, 0, 0],
      cursor: { drag: { x: true, y: false, setScale: false }, y: false },
      scales: { x: { time: false, range: () => this.window() }, y: { range: (u, low, high) => spread(low, high) } },
      axes: [{ ...axis, splits: (u, i, low, high) => this.ticks(u.width, low, high), values: seconds, size: 30 }, { ...axis, size: 56 }],
      series: [{}, ...this.lines.map((line) => ({ stroke: colour(line.name), width: 2, dash: line.dash, points: { show: false }, spanGaps: false }))],
      hooks: { setSelect: [(u) => this.select(u)] },
    }, this.series.data.map(() => []), this.host);
    this.dirty = true;
  }
  // Time 0 of the axis: now, or the stop of a recording.
  zero() {
    return this.series === this.live ? this.live.last ?? 0 : 0;
  }
  // Round seconds from time 0, no closer than they can be read.
  ticks(width, low, high) {
    const step = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 60].find((s) => ((high - low) / s) * 64 < width) ?? 120;
    const found = [];
    for (let k = Math.ceil((low - this.zero()) / step); k * step <= high - this.zero(); k++) found.push(this.zero() + k * step);
    return found;
  }
  window() {
    if (this.range) return this.range;
    if (this.series !== this.live) return [this.series.data[0][0] ?? -1, this.series.last ?? 1];
    const last = this.live.last ?? 0;
    return [last - WINDOW_S, last];
  }
  add(row) {
    this.live.add(row);
    this.dirty ||= this.series === this.live;
  }
  show(series) {
    this.series = series ?? this.live;
    this.range = null;
    this.dirty = true;
  }
  size() {
    const width = Math.max(this.host.clientWidth, 200);
    if (width !== this.uplot.width) this.uplot.setSize({ width, height: 180 });
  }
  draw() {
    if (!this.dirty || !this.visible || (this.frozen && this.series === this.live && this.drawn)) return;
    this.dirty = false;
    this.drawn = true;
    const [first, last] = this.window();
    this.uplot.setData(this.series.between(first, last), false);
    this.uplot.setScale("x", { min: first, max: last });
  }
  freeze(frozen) {
    this.frozen = frozen;
    this.range = frozen ? this.window() : null;
    this.dirty = true;
    this.drawn = false;
  }
  move(by, zoom, around = 0.5) {
    const [first, last] = this.window(), span = last - first;
    const middle = first + span * around, wide = Math.min(Math.max(span * zoom, 0.05), KEPT_S);
    this.range = [middle - wide * around + span * by, middle + wide * (1 - around) + span * by];
    this.dirty = true;
    this.drawn = false;
  }
  key(event) {
    const moves = { ArrowLeft: [-0.2, 1], ArrowRight: [0.2, 1], "+": [0, 0.5], "-": [0, 2] };
    if (event.key === "0") this.show(this.series === this.live ? null : this.series);
    else if (moves[event.key]) this.move(...moves[event.key]);
    else return;
    event.preventDefault();
    event.stopPropagation();
    this.drawn = false;
  }
  // With Ctrl or a pinch it zooms, sideways it moves; else the page scrolls.
  wheel(event) {
    if (event.ctrlKey) this.move(0, event.deltaY > 0 ? 1.25 : 0.8, event.offsetX / Math.max(this.host.clientWidth, 1));
    else if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) this.move(event.deltaX / Math.max(this.host.clientWidth, 1), 1);
    else return;
    event.preventDefault();
  }
  select(u) {
    if (u.select.width < 8) return;
    this.range = [u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")];
    u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
    this.dirty = true;
    this.drawn = false;
  }
  savePng() {
    const from = this.uplot.ctx.canvas, to = element("canvas");
    to.width = from.width;
    to.height = from.height;
    const context = to.getContext("2d");
    context.fillStyle = colour("card");
    context.fillRect(0, 0, to.width, to.height);
    context.drawImage(from, 0, 0);
    to.toBlob((blob) => save(blob, `${this.file}.png`));
  }
  csv() {
    const [first, last] = this.window();
    const rows = this.series.between(first, last);
    const lines = [["t_s", ...this.lines.map((line) => line.column)].join(",")];
    rows[0].forEach((_, i) => lines.push(rows.map((column) => column[i] ?? "").join(",")));
    return lines.join("\n") + "\n";
  }
  saveCsv() {
    save(new Blob([this.csv()], { type: "text/csv" }), `${this.file}.csv`);
  }
}

// Room above and below, and never a line of noise over the whole height.
function spread(low, high) {
  if (low === null || high === null || !Number.isFinite(low)) return [-1, 1];
  const room = Math.max((high - low) * 0.1, 1);
  return [low - room, high + room];
}

class Path {
  // Where the machine went, to scale: x forward is up, y left is left.
  constructor(canvas) {
    this.canvas = canvas;
    this.points = [];
    this.dirty = true;
    new ResizeObserver(() => { this.dirty = true; }).observe(canvas);
  }
  add(x_mm, y_mm, psi_mrad) {
    const last = this.points.at(-1);
    this.heading = psi_mrad;
    if (last && Math.hypot(last[0] - x_mm, last[1] - y_mm) < 5) return;
    this.points.push([x_mm, y_mm]);
    if (this.points.length > 4000) this.points = this.points.filter((_, i) => i % 2 === 0);
    this.dirty = true;
  }
  clear() {
    this.points = [];
    this.dirty = true;
  }
  draw() {
    if (!this.dirty) return;
    this.dirty = false;
    const ratio = devicePixelRatio, width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    this.canvas.width = width * ratio;
    this.canvas.height = height * ratio;
    const context = this.canvas.getContext("2d");
    context.scale(ratio, ratio);
    const xs = this.points.map((point) => point[0]), ys = this.points.map((point) => point[1]);
    const low = [Math.min(...xs, 0), Math.min(...ys, 0)], high = [Math.max(...xs, 0), Math.max(...ys, 0)];
    const span = Math.max((high[0] - low[0]) / Math.max(height - 60, 1), (high[1] - low[1]) / Math.max(width - 60, 1), 4);
    const middle = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
    const place = ([x, y]) => [width / 2 - (y - middle[1]) / span, height / 2 - (x - middle[0]) / span];
    this.grid(context, width, height, span, place);
    context.strokeStyle = colour("measured");
    context.lineWidth = 2;
    context.beginPath();
    this.points.forEach((point, i) => context[i ? "lineTo" : "moveTo"](...place(point)));
    context.stroke();
    if (this.points.length) this.arrow(context, ...place(this.points.at(-1)));
  }
  grid(context, width, height, span, place) {
    const step = [100, 200, 500, 1000, 2000, 5000, 10000, 20000, 50000].find((mm) => mm / span > 60) ?? 100000;
    const [left, top] = place([0, 0]);
    context.strokeStyle = colour("line");
    context.lineWidth = 1;
    context.beginPath();
    for (let x = left % (step / span); x < width; x += step / span) { context.moveTo(x, 0); context.lineTo(x, height); }
    for (let y = top % (step / span); y < height; y += step / span) { context.moveTo(0, y); context.lineTo(width, y); }
    context.stroke();
    context.fillStyle = colour("quiet");
    context.font = "12px system-ui";
    context.strokeStyle = colour("quiet");
    context.strokeRect(12, height - 14, step / span, 0);
    context.fillText(say("pose_scale", { m: step / 1000 }), 12, height - 20);
  }
  arrow(context, x, y) {
    const angle = -(this.heading ?? 0) / 1000;
    context.save();
    context.translate(x, y);
    context.rotate(angle);
    context.fillStyle = colour("told");
    context.beginPath();
    context.moveTo(0, -11);
    context.lineTo(7, 8);
    context.lineTo(-7, 8);
    context.fill();
    context.restore();
  }
}
