// SPDX-License-Identifier: MIT
"use strict";
// Recordings: read in pieces with their checksums, decoded (docs/developer/protocol.md), and the frames around a stop on a time axis.

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
    progress(piece.size ? Math.round((100 * offset) / piece.size) : 100);
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
function parseLog(text) {
  const frames = [];
  for (const line of text.split("\n")) {
    const found = /^\((\d+)\.(\d{6})\) \S+ ([0-9A-F]{3})#([0-9A-Fa-f]*)( [RT])?/.exec(line);
    if (found) {
      const data = found[4].match(/../g)?.map((byte) => parseInt(byte, 16)) ?? [];
      frames.push({ t_us: Number(found[1]) * 1e6 + Number(found[2]), id: parseInt(found[3], 16), data, own: found[5] === " T" });
    }
  }
  return frames;
}

function signed16(data, at) {
  const value = (data[at] << 8) | data[at + 1];
  return value >= 0x8000 ? value - 0x10000 : value;
}

// Series in seconds from the stop, and the events of the .jsonl. null if there are no frames.
function decodeRecording(files) {
  const frames = parseLog(files.log ?? ""), conf = parseConf(files.conf ?? "");
  const told = (files.jsonl ?? "").split("\n").flatMap((line) => { try { return [JSON.parse(line)]; } catch { return []; } });
  const head = told.find((one) => one.type === "blackbox"), why = told.find((one) => one.type === "why");
  if (!frames.length) return null;
  // The log may have wall time, as candump's. The black box contains the difference of the two clocks.
  const wall = frames[0].t_us > 1e15 ? head?.wall_minus_monotonic_us ?? 0 : 0;
  const stop_us = (why?.at_us ?? frames.at(-1).t_us - wall) + wall;
  const per_rpm = (2 * Math.PI * conf.radius_mm) / 60 / (conf.rotor ? conf.gear : 1);
  const wheels = [0, 1].map(() => ({ speed: new Series(4), force: new Series(4), wanted: null, told: null, measured: null }));
  const seconds = (t_us) => (t_us - stop_us) / 1e6;
  const asked = told.filter((one) => one.type === "drive" || one.type === "state").map((one) => ({ ...one, t: seconds(one.t_us + wall) }));
  let next = 0;
  for (const { t_us, id, data } of frames) {
    const t = seconds(t_us), side = SETPOINTS[id] ?? SPEEDS[id] ?? FORCES[id];
    for (; next < asked.length && asked[next].t <= t; next++) take(wheels, asked[next]);
    if (side === undefined || data.length < 2) continue;
    const wheel = wheels[side], sign = conf.invert[side];
    if (id in FORCES) {
      wheel.force.add([t, signed16(data, 0) * conf.newton[side], null, null]);
      continue;
    }
    if (id in SETPOINTS && data.length >= 3) wheel.told = signed16(data, 1) * sign;
    if (id in SPEEDS) wheel.measured = signed16(data, 0) * per_rpm * sign;
    wheel.speed.add([t, wheel.wanted, wheel.told, wheel.measured]);
  }
  const happened = told.filter((one) => one.t_us !== undefined && ((one.type === "state" && one.state !== one.before) || ["arm", "stopped", "died"].includes(one.type)))
    .map((one) => ({ t: seconds(one.t_us + wall), text: [one.type, one.state, one.cause].filter(Boolean).join(" "), state: one.state ?? one.type, cause: one.cause }));
  return { wheels, happened, why, states: asked.filter((one) => one.type === "state"), first: seconds(frames[0].t_us), last: seconds(frames.at(-1).t_us) };
}

// One line for each value that changed, in the order of time.
function recordingCsv({ wheels }) {
  const lines = [];
  ["left", "right"].forEach((side, i) => {
    const { speed, force } = wheels[i], cell = (value) => (value === null ? "" : Number(value.toFixed(3)));
    speed.data[0].forEach((t, n) => lines.push([t, side, ...speed.data.slice(1).map((column) => cell(column[n])), ""]));
    force.data[0].forEach((t, n) => lines.push([t, side, "", "", "", cell(force.data[1][n])]));
  });
  lines.sort((a, b) => a[0] - b[0]);
  return ["t_s,wheel,requested_mm_s,commanded_mm_s,measured_mm_s,force_raw_N", ...lines.map(([t, ...rest]) => [t.toFixed(6), ...rest].join(","))].join("\n") + "\n";
}

// Sets the command of the client from this time on, while it may drive.
function take(wheels, one) {
  if (one.type === "drive" && one.refused === null) [wheels[0].wanted, wheels[1].wanted] = [one.left_mm_s, one.right_mm_s];
  if (one.type === "state" && one.state !== "armed") wheels[0].wanted = wheels[1].wanted = null;
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
