// SPDX-License-Identifier: MIT
"use strict";
// Series over time by uPlot: they follow the newest seconds, can be moved, zoomed and frozen together, and saved as PNG and CSV.

const KEPT_S = 600; // Time that is stored. The memory is constant for hours.
const PLOT_PX = 200, LABEL_PX = 14; // Two rows of labels are above the lines.

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

// A long computation is a generator that yields the part that is done. Between its steps the page handles its events: STOP is never late.
const STEP_MS = 8;

async function inSteps(work, progress = () => {}) {
  for (let begun = performance.now(); ;) {
    const { done, value } = work.next();
    if (done) return value;
    if (performance.now() - begun < STEP_MS) continue;
    progress(value);
    if (stopIsOpen()) await new Promise((turn) => setTimeout(turn, 50)); // Until the gateway has answered, STOP needs several turns.
    await new Promise((turn) => {
      const { port1, port2 } = new MessageChannel(); // A timer waits longer, above all in a hidden page.
      port1.onmessage = () => { port1.close(); turn(); };
      port2.postMessage(0);
    });
    begun = performance.now();
  }
}

// The first place in ascending times of which the condition is true.
function firstAt(times, condition) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (condition(times[middle])) high = middle; else low = middle + 1;
  }
  return low;
}

class Series {
  // Columns of numbers (null: unknown), the first of them seconds. Old rows are removed in blocks, so that the cost of a row stays constant.
  constructor(columns) {
    this.data = Array.from({ length: columns }, () => []);
  }
  add(row) {
    for (let i = 0; i < row.length; i++) this.data[i].push(row[i]);
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
    return firstAt(this.data[0], (one) => one >= time);
  }
  // The rows of this time. If they are many more than `pixels`, the lowest and highest value of each half pixel, and the last row.
  between(first, last, pixels = Infinity) {
    const a = Math.max(0, this.from(first) - 1), b = Math.min(this.data[0].length, this.from(last) + 1);
    if (b - a < 8 * pixels) return this.data.map((column) => column.slice(a, b));
    const [times, ...columns] = this.data, shown = this.data.map(() => []), wide = (last - first) / (2 * pixels);
    for (let from = a, to; from < b; from = to) {
      for (to = from + 1; to < b && times[to] < times[from] + wide;) to++;
      shown[0].push(times[from], times[to - 1]);
      columns.forEach((column, i) => {
        let low = from, high = from;
        for (let n = from + 1; n < to; n++) {
          if (column[n] === null) continue;
          if (column[low] === null || column[n] < column[low]) low = n;
          if (column[high] === null || column[n] > column[high]) high = n;
        }
        shown[i + 1].push(column[Math.min(low, high)], column[Math.max(low, high)]);
      });
    }
    shown.forEach((column, i) => column.push(this.data[i][b - 1]));
    return shown;
  }
}

// Common to all plots: the shown time and its events. `range` is set after a move or zoom.
const view = { range: null, span_s: 60, frozen: false, at: null, live_marks: [], marks: null, plots: [], newest_s: 0 };

function redrawAll() {
  for (const plot of view.plots) plot.dirty = plot.forced = true;
}

// Moves by a part of what is shown, and zooms around a place in it (0 left, 1 right).
function moveView(by, zoom, around = 0.5) {
  const [first, last] = view.plots[0].window(), span = last - first;
  const middle = first + span * around, wide = Math.min(Math.max(span * zoom, 0.05), KEPT_S);
  view.range = [middle - wide * around + span * by, middle + wide * (1 - around) + span * by];
  redrawAll();
}

function resetView() {
  view.range = null;
  redrawAll();
}

function freezeView(frozen) {
  view.range = frozen ? view.plots[0].window() : null;
  view.frozen = frozen;
  redrawAll();
}

// One of the same words within a short time is one event.
function addMark(marks, t, words, tone) {
  if (!marks.some((one) => one.words === words && Math.abs(one.t - t) < 0.5)) marks.push({ t, words, tone });
}

function markLive(t, words, tone) {
  addMark(view.live_marks, t, words, tone);
  if (view.live_marks.length > 200) view.live_marks.shift();
  redrawAll();
}

class Plot {
  // lines: [{ name, label, column, dash, more }]; their colours are the page's of that name; `more`: shown on request only. Plots of one `kind` have
  // one axis.
  constructor(place, title, label, lines, file) {
    Object.assign(this, { lines, file, kind: title, all: false, dirty: true, forced: true, visible: true, low: null, high: null });
    this.live = new Series(lines.length + 1);
    this.series = this.live;
    this.host = element("div", { tabindex: "0", role: "img", class: "canvas", "aria-label": `${label} ${STRINGS.plot_keys}` });
    const saves = element("div", { class: "row" },
      this.button("save_png", title, () => this.savePng()), this.button("save_csv", title, () => this.saveCsv()));
    this.values = lines.map(() => element("b"));
    this.legend = lines.map((line, n) => element("li", { class: line.name }, element("i"), line.label, this.values[n]));
    place.append(element("div", { class: "plot" }, element("h3", { text: title }), element("ul", { class: "legend" }, ...this.legend), this.host, saves));
    this.host.addEventListener("keydown", (event) => this.key(event));
    this.host.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.followFingers();
    new IntersectionObserver((entries) => { this.visible = entries.at(-1).isIntersecting; this.dirty = true; }).observe(this.host);
    new ResizeObserver(() => this.size()).observe(this.host);
    view.plots.push(this);
    this.build();
  }
  button(name, title, action) {
    const made = element("button", { type: "button", class: "small", text: STRINGS[name], "aria-label": say(`${name}_of`, { what: title }) });
    made.addEventListener("click", action);
    return made;
  }
  shows(line) {
    return this.all || !line.more;
  }
  build() {
    this.uplot?.destroy();
    const axis = { stroke: colour("quiet"), grid: { stroke: colour("line"), width: 1 }, ticks: { stroke: colour("line"), width: 1 }, font: "12px system-ui" };
    const seconds = (u, ticks) => ticks.map((tick) => `${Math.round((tick - this.zero()) * 1000) / 1000} s`);
    this.uplot = new uPlot({
      width: Math.max(this.host.clientWidth, 200), height: PLOT_PX, legend: { show: false }, padding: [2 * LABEL_PX + 4, 12, 0, 0],
      cursor: { drag: { x: true, y: false, setScale: false }, y: false, sync: { key: "time" } },
      scales: { x: { time: false, range: () => this.window() }, y: { range: () => this.span() } },
      axes: [{ ...axis, splits: (u, i, low, high) => this.ticks(u.width, low, high), values: seconds, size: 30 }, { ...axis, size: 56 }],
      series: [{}, ...this.lines.map((line) => ({ show: this.shows(line), stroke: colour(line.name), width: 2, dash: line.dash, points: { show: false }, spanGaps: false }))],
      hooks: { setSelect: [(u) => this.select(u)], draw: [(u) => this.drawMarks(u)], setCursor: [() => this.showValues()] },
    }, this.series.data.map(() => []), this.host);
    this.cursor = element("i", { class: "at" });
    this.uplot.over.append(this.cursor);
    this.legend.forEach((item, n) => { item.hidden = !this.shows(this.lines[n]); });
    this.dirty = this.forced = true;
  }
  // Time 0 of the axis: now, or the stop of a recording.
  zero() {
    return this.series === this.live ? view.newest_s : 0;
  }
  // Round seconds from time 0, no closer than they can be read.
  ticks(width, low, high) {
    const step = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 60].find((s) => ((high - low) / s) * 64 < width) ?? 120;
    const found = [];
    for (let k = Math.ceil((low - this.zero()) / step); k * step <= high - this.zero(); k++) found.push(this.zero() + k * step);
    return found;
  }
  window() {
    if (view.range) return view.range;
    if (this.series !== this.live) return [this.series.data[0][0] ?? -1, this.series.last ?? 1];
    return [view.newest_s - view.span_s, view.newest_s];
  }
  add(row) {
    this.live.add(row);
    view.newest_s = row[0];
    this.dirty ||= this.series === this.live;
  }
  show(series) {
    this.series = series ?? this.live;
    resetView();
  }
  showAll(all) {
    this.all = all;
    this.build();
  }
  size() {
    const width = Math.max(this.host.clientWidth, 200);
    if (width !== this.uplot.width) this.uplot.setSize({ width, height: PLOT_PX });
  }
  // The vertical axis is that of all plots of this kind: left and right can be compared.
  span() {
    const alike = view.plots.filter((plot) => plot.kind === this.kind && plot.low !== null);
    return spread(Math.min(...alike.map((plot) => plot.low)), Math.max(...alike.map((plot) => plot.high)));
  }
  measure(columns) {
    const before = [this.low, this.high];
    [this.low, this.high] = [null, null];
    this.lines.forEach((line, n) => {
      if (!this.shows(line)) return;
      for (const value of columns[n + 1]) {
        if (value === null) continue;
        if (this.low === null || value < this.low) this.low = value;
        if (this.high === null || value > this.high) this.high = value;
      }
    });
    if (before[0] === this.low && before[1] === this.high) return;
    for (const plot of view.plots) if (plot !== this && plot.kind === this.kind) plot.dirty = true;
  }
  draw() {
    if (!this.dirty || (!this.visible && !this.forced) || (view.frozen && this.series === this.live && !this.forced)) return;
    this.dirty = this.forced = false;
    const [first, last] = this.window();
    const columns = this.series.between(first, last, this.uplot.width);
    this.measure(columns);
    this.uplot.setData(columns, false);
    this.uplot.setScale("x", { min: first, max: last });
    this.showAt();
  }
  // Present time of the recording that is played, and its values.
  showAt() {
    const { min, max } = this.uplot.scales.x, shown = view.at !== null && view.at >= min && view.at <= max;
    this.cursor.hidden = !shown;
    if (shown) this.cursor.style.left = `${this.uplot.valToPos(view.at, "x")}px`;
    this.showValues();
  }
  // Values at the mouse; otherwise at the time of the recording; otherwise the newest.
  showValues() {
    const data = view.at === null ? this.uplot.data : this.series.data;
    const index = view.at === null ? this.uplot.cursor.idx ?? data[0].length - 1 : Math.max(0, firstAt(data[0], (time) => time > view.at) - 1);
    this.values.forEach((place, n) => {
      const value = data[n + 1]?.[index] ?? null, words = value === null ? "–" : plain(value.toFixed(this.lines[n].digits ?? 0));
      if (place.textContent !== words) place.textContent = words;
    });
  }
  // Events as vertical lines. A label is right or left of its line, in the first row in which it touches no other; serious events come first.
  drawMarks(u) {
    const { ctx } = u, { left, width } = u.bbox, ratio = devicePixelRatio, row = LABEL_PX * ratio, top = u.bbox.top - 2 * row, labels = [];
    const marks = (this.series === this.live ? view.live_marks : view.marks ?? []).filter((one) => one.t >= u.scales.x.min && one.t <= u.scales.x.max);
    const placed = marks.map((one) => ({ ...one, x: u.valToPos(one.t, "x", true) }));
    ctx.save();
    ctx.font = `${11 * ratio}px system-ui`;
    ctx.textAlign = "left";
    ctx.textBaseline = "middle";
    ctx.lineWidth = ratio;
    for (const { x, tone } of placed) {
      ctx.strokeStyle = colour(tone);
      ctx.beginPath();
      ctx.moveTo(x, top);
      ctx.lineTo(x, u.bbox.top + u.bbox.height);
      ctx.stroke();
    }
    const rank = { bad: 0, care: 1 };
    for (const { words, tone, x } of placed.sort((a, b) => (rank[a.tone] ?? 2) - (rank[b.tone] ?? 2))) {
      const wide = ctx.measureText(words).width + 6 * ratio;
      const places = [0, 1].flatMap((n) => [[x + ratio, n], [x - ratio - wide, n]]);
      const place = places.find(([at, n]) => at >= left && at + wide <= left + width && labels.every((one) => one.n !== n || at >= one.to || at + wide <= one.at));
      if (!place) continue;
      const [at, n] = place;
      labels.push({ at, to: at + wide, n });
      ctx.fillStyle = colour("card");
      ctx.fillRect(at, top + n * row, wide, row);
      ctx.fillStyle = colour("ink");
      ctx.fillText(words, at + 3 * ratio, top + (n + 0.5) * row);
    }
    ctx.restore();
  }
  key(event) {
    const moves = { ArrowLeft: [-0.2, 1], ArrowRight: [0.2, 1], "+": [0, 0.5], "-": [0, 2] };
    if (event.key === "0") resetView();
    else if (moves[event.key]) moveView(...moves[event.key]);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }
  // With Ctrl or a pinch it zooms, sideways it moves; else the page scrolls.
  wheel(event) {
    if (event.ctrlKey) moveView(0, event.deltaY > 0 ? 1.25 : 0.8, this.partOf(event.clientX));
    else if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) moveView(event.deltaX / this.uplot.over.clientWidth, 1);
    else return;
    event.preventDefault();
  }
  partOf(x) {
    const box = this.uplot.over.getBoundingClientRect();
    return Math.min(1, Math.max(0, (x - box.left) / Math.max(box.width, 1)));
  }
  // One finger drags, two zoom around their middle; up and down the page scrolls.
  followFingers() {
    const fingers = new Map(), places = () => [...fingers.values()];
    const gap = () => Math.max(20, Math.abs(places()[0] - places()[1]));
    this.host.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "touch") fingers.set(event.pointerId, event.clientX);
    });
    this.host.addEventListener("pointermove", (event) => {
      if (!fingers.has(event.pointerId)) return;
      const before = event.clientX - fingers.get(event.pointerId), wide = fingers.size === 2 ? gap() : 0;
      fingers.set(event.pointerId, event.clientX);
      if (fingers.size === 1) moveView(-before / this.uplot.over.clientWidth, 1);
      if (fingers.size === 2) moveView(-before / 2 / this.uplot.over.clientWidth, wide / gap(), this.partOf((places()[0] + places()[1]) / 2));
    });
    for (const name of ["pointerup", "pointercancel"]) addEventListener(name, (event) => fingers.delete(event.pointerId));
  }
  select(u) {
    if (u.select.width < 8) return;
    view.range = [u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")];
    u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
    redrawAll();
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
  * csv() {
    const rows = this.series.between(...this.window()), parts = [["t_s", ...this.lines.map((line) => line.column)].join(",") + "\n"];
    for (let i = 0; i < rows[0].length; i += 64) {
      parts.push(rows[0].slice(i, i + 64).map((_, n) => rows.map((column) => column[i + n] ?? "").join(",") + "\n").join(""));
      yield;
    }
    return parts;
  }
  async saveCsv() {
    save(new Blob(await inSteps(this.csv()), { type: "text/csv" }), `${this.file}.csv`);
  }
}

// Margin above and below. Small noise does not fill the whole height.
function spread(low, high) {
  if (!Number.isFinite(low) || !Number.isFinite(high)) return [-1, 1];
  const margin = Math.max((high - low) * 0.1, 1);
  return [low - margin, high + margin];
}

class Path {
  // Path of the machine, to scale: x forward is up, y left is left.
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
    context.fillStyle = colour("applied");
    context.beginPath();
    context.moveTo(0, -11);
    context.lineTo(7, 8);
    context.lineTo(-7, 8);
    context.fill();
    context.restore();
  }
}
