// SPDX-License-Identifier: MIT
"use strict";
// Proves to the bridge that this page has the token. The page never sends the token: another program may have the port for a moment.

const proof = { token: "", session: null };

// The token is behind the # of the address, which no browser sends. The browser stores it until a person removes it, or the machine has another one.
function takeToken() {
  const found = /[#&]token=([0-9a-f]{32})\b/.exec(location.hash);
  if (found) history.replaceState(null, "", location.pathname); // Neither the history nor the screen then shows it.
  setToken(found?.[1] ?? storage.read("token") ?? "");
}

function setToken(token) {
  Object.assign(proof, { token, session: null });
  storage.write("token", token);
}

function hex(bytes) {
  return [...new Uint8Array(bytes)].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

async function beginSession() {
  const utf8 = new TextEncoder().encode(proof.token);
  const key = await crypto.subtle.importKey("raw", utf8, { name: "HMAC", hash: "SHA-256" }, false, ["sign"]);
  const answer = await fetch("/api/challenge", { cache: "no-store", credentials: "omit", signal: AbortSignal.timeout(2000) });
  const { nonce, boot } = await answer.json();
  return { id: hex(crypto.getRandomValues(new Uint8Array(16))), key, nonce, boot, sequence: 0 };
}

// All requests wait for the same session, so it has a time limit of its own.
function sessionOf() {
  return proof.session ??= beginSession().catch((error) => { proof.session = null; throw error; });
}

async function authorization(method, target) {
  const session = await sessionOf(), sequence = ++session.sequence;
  const text = new TextEncoder().encode([method, target, session.id, session.nonce, sequence].join("\n"));
  return `IWheel ${session.id} ${session.nonce} ${sequence} ${hex(await crypto.subtle.sign("HMAC", session.key, text))}`;
}

// The run of the bridge that an arm or a reset quotes.
async function bootOf() {
  return (await sessionOf()).boot;
}

// One request with its proof. A restarted bridge does not know the session: the request is then sent once more, in a new session.
// Without a token it has no proof, and the bridge refuses it.
async function askProved(method, target, options = {}) {
  for (let again = false; ; again = true) {
    const headers = proof.token ? { Authorization: await authorization(method, target) } : {};
    const answer = await fetch(target, { ...options, method, headers, cache: "no-store", credentials: "omit" });
    if (answer.status !== 401 || again) return answer;
    if ((await answer.clone().json()).error !== "bad_session") return answer;
    proof.session = null;
  }
}
