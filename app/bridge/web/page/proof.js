// SPDX-License-Identifier: MIT
"use strict";
// Proves to the bridge that this page has the token. The page never sends the token: another program may have the port for a moment.

const proof = { token: "", key: null, session: null };

// The token is behind the # of the address, which no browser sends. The browser stores it until a person removes it, or the machine has another one.
function takeToken() {
  const found = /[#&]token=([0-9a-f]{32})\b/.exec(location.hash);
  if (found) {
    localStorage.setItem("token", found[1]);
    history.replaceState(null, "", location.pathname); // Neither the history nor the screen then shows it.
  }
  setToken(localStorage.getItem("token") ?? "");
}

function setToken(token) {
  localStorage.setItem("token", token);
  Object.assign(proof, { token, key: null, session: null });
}

function hex(bytes) {
  return [...new Uint8Array(bytes)].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

async function beginSession(signal) {
  const utf8 = new TextEncoder().encode(proof.token);
  proof.key ??= await crypto.subtle.importKey("raw", utf8, { name: "HMAC", hash: "SHA-256" }, false, ["sign"]);
  const answer = await fetch("/api/challenge", { cache: "no-store", credentials: "omit", signal: signal ?? AbortSignal.timeout(2000) });
  const { nonce, boot } = await answer.json();
  return { id: hex(crypto.getRandomValues(new Uint8Array(16))), nonce, boot, sequence: 0 };
}

async function authorization(method, target, signal) {
  proof.session ??= beginSession(signal).catch((error) => { proof.session = null; throw error; });
  const session = await proof.session, sequence = ++session.sequence;
  const text = new TextEncoder().encode([method, target, session.id, session.nonce, sequence].join("\n"));
  return `IWheel ${session.id} ${session.nonce} ${sequence} ${hex(await crypto.subtle.sign("HMAC", proof.key, text))}`;
}

// The run of the bridge that an arm or a reset quotes.
async function bootOf() {
  proof.session ??= beginSession().catch((error) => { proof.session = null; throw error; });
  return (await proof.session).boot;
}

// One request with its proof. A restarted bridge does not know the session: the request is then sent once more, in a new session.
async function askProved(method, target, options = {}) {
  for (let again = false; ; again = true) {
    const answer = await fetch(target, { ...options, method, headers: { Authorization: await authorization(method, target, options.signal) }, cache: "no-store", credentials: "omit" });
    if (answer.status !== 401 || again) return answer;
    if ((await answer.clone().json()).error !== "bad_session") return answer;
    proof.session = null;
  }
}
