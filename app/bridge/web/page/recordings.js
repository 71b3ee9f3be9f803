// SPDX-License-Identifier: MIT
"use strict";
// Recordings: read in pieces with their checksums, decoded (docs/developer/protocol.md), and the frames around a stop on a time axis.

const OLD_S = 0.5; // A speed without a frame for this time is unknown, as in `iwheelctl export`.
const SETPOINTS = { 266: 0, 298: 1 }, SPEEDS = { 256: 0, 288: 1 }, FORCES = { 512: 0, 544: 1 };

const CRC = Uint32Array.from({ length: 256 }, (_, n) => {
  for (let k = 0; k < 8; k++) n = n & 1 ? 0xedb88320 ^ (n >>> 1) : n >>> 1;
  return n >>> 0;
});

function crc32(bytes, before = 0) {
  let crc = ~before;
  for (const byte of bytes) crc = CRC[(crc ^ byte) & 255] ^ (crc >>> 8);
  return ~crc >>> 0;
}

// The whole file as bytes. `ask(path)` returns the JSON reply to a request to the bridge.
async function readRecording(ask, name, progress) {
  const pieces = [];
  let offset = 0, crc = 0;
  for (;;) {
    const piece = await ask(`/api/recording?name=${encodeURIComponent(name)}&offset=${offset}`);
    const bytes = Uint8Array.from(atob(piece.data), (c) => c.charCodeAt(0));
    crc = crc32(bytes, crc);
    offset += bytes.length;
    if (crc32(bytes) !== piece.crc32 || (piece.file_crc32 !== null && piece.file_crc32 !== crc)) throw new Error(say("recording_broken", { name }));
    pieces.push(bytes);
    progress(piece.size ? offset / piece.size : 1);
    if (offset >= piece.size) return new Blob(pieces);
    if (!bytes.length) throw new Error(say("recording_broken", { name }));
  }
}

function parseConf(text) {
  const values = { radius_mm: 192, gear: 1, rotor: false, invert: [1, 1], newton: [0.01, 0.1] };
  let section = "";
  for (const line of text.split("\n")) {
    const head = /^\s*\[(\w+)\]/.exec(line), pair = /^\s*(\w+)\s*=\s*([^;]*?)\s*(;.*)?$/.exec(line);
    if (head) section = head[1];
    else if (pair) {
      const side = { left: 0, right: 1 }[section];
      if (pair[1] === "radius_mm") values.radius_mm = Number(pair[2]);
      if (pair[1] === "rpm_of") values.rotor = pair[2] === "rotor";
      if (pair[1] === "gear_ratio") values.gear = pair[2].split("/").map(Number).reduce((a, b) => a / b);
      if (pair[1] === "invert" && side !== undefined) values.invert[side] = pair[2] === "yes" ? -1 : 1;
      if (pair[1] === "force_unit" && side !== undefined) values.newton[side] = pair[2] === "cN" ? 0.01 : 0.1;
    }
  }
  return values;
}

// candump's log form: (seconds) interface ID#DATA [R|T]
const FRAME = /^\((\d+)\.(\d{6})\) \S+ ([0-9A-F]{3})#([0-9A-Fa-f]*)/m;
const frameTime = (found) => Number(found[1]) * 1e6 + Number(found[2]);
const byTime = (a, b) => a[0] - b[0];

// The last frame of a log whose last lines may be incomplete.
function lastFrame(log) {
  for (let end = log.length, at; end > 0; end = at - 1) {
    at = log.lastIndexOf("\n", end - 1) + 1;
    const found = FRAME.exec(log.slice(at, end));
    if (found) return found;
  }
}

// The signed value of two bytes.
function signed16(hex, at) {
  const value = parseInt(hex.slice(2 * at, 2 * at + 4), 16);
  return value >= 0x8000 ? value - 0x10000 : value;
}

// Passes each line to `use`.
function* eachLine(text, use) {
  for (let at = 0, n = 1, end; at < text.length; at = end + 1, n++) {
    end = text.indexOf("\n", at);
    if (end < 0) end = text.length;
    use(text.slice(at, end));
    if (n % 64 === 0) yield at / text.length;
  }
}

// Series in seconds from the stop, and the events of the .jsonl. null if there are no frames.
function* decodeRecording({ log = "", jsonl = "", conf = "" }) {
  const lines = [], values = parseConf(conf);
  yield* eachLine(jsonl, (line) => { try { lines.push(JSON.parse(line)); } catch { /* An incomplete line. */ } });
  const head = lines.find((one) => one.type === "blackbox"), why = lines.find((one) => one.type === "why"), begin = FRAME.exec(log);
  if (!begin) return null;
  // The log may have wall time, as candump's. The black box contains the difference of the two clocks.
  const wall = frameTime(begin) > 1e15 ? head?.wall_minus_monotonic_us ?? 0 : 0;
  const stop_us = (why?.at_us ?? frameTime(lastFrame(log)) - wall) + wall;
  const per_rpm = (2 * Math.PI * values.radius_mm) / 60 / (values.rotor ? values.gear : 1);
  const wheels = [0, 1].map(() => ({ speed: new Series(4), force: new Series(4), commanded: null, applied: null, measured: null, applied_t: 0, measured_t: 0 }));
  const seconds = (t_us) => (t_us - stop_us) / 1e6;
  const asked = lines.filter((one) => one.type === "drive" || one.type === "state").map((one) => ({ ...one, t: seconds(one.t_us + wall) }));
  let next = 0, last = 0;
  yield* eachLine(log, (line) => {
    const found = FRAME.exec(line);
    if (!found) return;
    const t = last = seconds(frameTime(found)), id = parseInt(found[3], 16), hex = found[4], side = SETPOINTS[id] ?? SPEEDS[id] ?? FORCES[id];
    for (; next < asked.length && asked[next].t <= t; next++) setCommand(wheels, asked[next]);
    if (side === undefined || hex.length < 4) return;
    const wheel = wheels[side], sign = values.invert[side];
    if (id in FORCES) {
      wheel.force.add([t, signed16(hex, 0) * values.newton[side], null, null]);
      return;
    }
    if (id in SETPOINTS && hex.length >= 6) Object.assign(wheel, { applied: signed16(hex, 1) * sign, applied_t: t });
    if (id in SPEEDS) Object.assign(wheel, { measured: signed16(hex, 0) * per_rpm * sign, measured_t: t });
    if (t - wheel.applied_t > OLD_S) wheel.applied = null;
    if (t - wheel.measured_t > OLD_S) wheel.measured = null;
    wheel.speed.add([t, wheel.commanded, wheel.applied, wheel.measured]);
  });
  const happened = lines.filter((one) => one.t_us !== undefined && ((one.type === "state" && one.state !== one.before) || ["arm", "stopped", "died"].includes(one.type)))
    .map((one) => ({ ...one, t: seconds(one.t_us + wall) }));
  return { wheels, happened, why, stop_us, states: asked.filter((one) => one.type === "state"), first: seconds(frameTime(begin)), last };
}

// Each value that changed: seconds, wheel, commanded, applied, measured, force.
function* rowsOf({ wheels }) {
  for (const i of [0, 1]) {
    const [times, ...values] = wheels[i].speed.data, [force_times, forces] = wheels[i].force.data;
    for (let n = 0; n < times.length; n++) yield [times[n], i, values[0][n], values[1][n], values[2][n], null];
    for (let n = 0; n < forces.length; n++) yield [force_times[n], i, null, null, null, forces[n]];
  }
}

// Returns the rows of each second, because sorting all of them is too long for one step. The caller sorts them by time.
function* bySecond(rows) {
  const seconds = new Map();
  let n = 0;
  for (const row of rows) {
    const second = Math.floor(row[0]), found = seconds.get(second);
    if (found) found.push(row); else seconds.set(second, [row]);
    if (++n % 256 === 0) yield 0;
  }
  return [...seconds].sort(byTime).map((one) => one[1]);
}

// Returns the parts of the file: one line for each value that changed, in the order of time.
function* recordingCsv(recording) {
  const parts = ["t_s,wheel,commanded_mm_s,applied_mm_s,measured_mm_s,force_raw_N\n"], cell = (value) => (value === null ? "" : Number(value.toFixed(3)));
  const seconds = yield* bySecond(rowsOf(recording));
  for (const rows of seconds) {
    parts.push(rows.sort(byTime).map(([t, i, ...values]) => `${t.toFixed(6)},${i ? "right" : "left"},${values.map(cell).join(",")}\n`).join(""));
    yield parts.length / seconds.length;
  }
  return parts;
}

// Sets the command of the client from this time on, while it may drive.
function setCommand(wheels, one) {
  if (one.type === "drive" && one.refused === null) [wheels[0].commanded, wheels[1].commanded] = [one.left_mm_s, one.right_mm_s];
  if (one.type === "state" && one.state !== "armed") wheels[0].commanded = wheels[1].commanded = null;
}

const IDS = { 256: "left speed", 288: "right speed", 257: "left status", 289: "right status", 290: "pose", 512: "left force", 544: "right force",
  513: "left offset", 545: "right offset", 266: "left setpoint", 298: "right setpoint" };

// The frames before and after a stop as marks on one time axis, a row for each id.
function drawFrames(stop) {
  const frames = [...(stop.frames_before ?? []), ...(stop.frames_after ?? [])].map((frame) => ({ ...frame, ms: (frame.t_us - stop.at_us) / 1000 }));
  const ids = [...new Set(frames.map((frame) => frame.id))].sort((a, b) => a - b);
  const low = Math.min(...frames.map((frame) => frame.ms), 0), high = Math.max(...frames.map((frame) => frame.ms), 0);
  const width = 720, left = 170, height = 34 + ids.length * 20;
  const x = (ms) => left + ((ms - low) / Math.max(high - low, 1)) * (width - left - 20);
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  const put = (tag, attributes, text) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text !== undefined) made.textContent = text;
    svg.append(made);
  };
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.setAttribute("class", "frames");
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", STRINGS.frames_label);
  ids.forEach((id, row) => {
    const y = 16 + row * 20;
    put("text", { x: 0, y: y + 4 }, `${id} (0x${id.toString(16).toUpperCase()}) ${IDS[id] ?? ""}`);
    put("line", { x1: left, x2: width - 20, y1: y, y2: y, class: "axis" });
    for (const frame of frames) if (frame.id === id) put("line", { x1: x(frame.ms), x2: x(frame.ms), y1: y - 7, y2: y + 7, class: frame.kind === "echo" ? "tx" : "rx" });
  });
  put("line", { x1: x(0), x2: x(0), y1: 4, y2: height - 22, class: "zero" });
  for (const ms of new Set([low, 0, high])) put("text", { x: x(ms) - 12, y: height - 4 }, `${ms.toFixed(1)} ms`);
  return [svg, frames];
}
