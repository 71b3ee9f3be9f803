// SPDX-License-Identifier: MIT
"use strict";
// The language of the page: as chosen here; otherwise the first of the browser's (Accept-Language) that exists; otherwise English.

// A browser may forbid the page to store anything, with an exception.
const storage = {
  read(name) { try { return localStorage.getItem(name); } catch { return null; } },
  write(name, value) { try { localStorage.setItem(name, value); } catch { /* It then lasts as long as the page. */ } },
};

const LANGUAGE = [storage.read("language"), ...navigator.languages.map((one) => one.split("-")[0]), "en"].find((one) => Object.hasOwn(LANGUAGES, one));
const STRINGS = LANGUAGES[LANGUAGE];
document.documentElement.lang = LANGUAGE;

function fill(text, values) {
  return text.replace(/\{(\w+)\}/g, (_, key) => values[key] ?? STRINGS.unknown);
}

// Returns the text of that name with its {names} filled in.
function say(name, values = {}) {
  return fill(STRINGS[name], values);
}

const when = (wall_us) => (wall_us === null ? STRINGS.unknown : new Date(wall_us / 1000).toLocaleString(STRINGS.locale));
const clock = (wall_us) => (wall_us === null ? "" : new Date(wall_us / 1000).toLocaleTimeString(STRINGS.locale));

// A select whose options are [value, label].
function choose(select, options, value, changed) {
  select.replaceChildren(...options.map(([key, label]) => new Option(label, key, false, key === value)));
  select.addEventListener("change", () => changed(select.value));
}

function setUpLanguage(select) {
  choose(select, Object.entries(LANGUAGES).map(([key, strings]) => [key, strings.language_name]), LANGUAGE, (key) => {
    storage.write("language", key);
    location.reload();
  });
}

for (const element of document.querySelectorAll("[data-s]")) element.textContent = STRINGS[element.dataset.s];
