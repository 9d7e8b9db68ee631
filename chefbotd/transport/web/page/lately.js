// What has happened lately, the newest first, in words: the daemon's log, also from before the page was opened, and the
// page's own lines.

import { $, element } from "./dom.js";
import { because, GOAL, limit, LOCATED, MAPPING, MODES, plain, sentence } from "./words.js";

const MOST_LINES = 50; // of a kind: many of one do not push out those of another
const KINDS = { navigation: "way", localization: "way", mapping: "way", safety: "stops", control: "stops" };
const REPEATED = { navigation: ["planning", "driving", "recovering", "paused"] }; // who waits for people goes to and fro between these
const SOURCES = { link: "The board's link" };
const STATES = {
  safety: (state, reason) => {
    const [, before, by] = reason.match(/^(.*?) ?\(limited by (.*)\)/) ?? [null, reason, null];
    return by ? `Slower than asked: ${limit(by)}.` : said(MODES[state]?.[1] ?? state, state === "armed" ? "" : before);
  },
  navigation: (state, reason) => (state === "idle" ? "" : said(GOAL[state] ?? state, because(state, reason))),
  localization: (state) => LOCATED[state] ?? state,
  mapping: (state) => (MAPPING[state] ? `${MAPPING[state]}.` : ""),
  worker: (state, reason) => (["starting", "warming"].includes(state) ? "" : `Maps and navigation: ${[state, plain(reason)].filter(Boolean).join(": ")}`),
  control: (_, name) => (name ? `${plain(name)} drives.` : "Nobody drives."), // a name keeps its own letters,
};

export class Lately {
  #last = new Map();
  #states = new Map(); // what each part was last said to do
  #onTheWay = new Map(); // by their words, the lines since the last goal ended
  #session = null;
  #shown_s = -Infinity;

  constructor(connection) {
    connection.on("log", ({ lines }, { age_s, stamp_s }) => {
      const now_ms = Date.now();
      for (const line of lines.filter((each) => each.stamp_s > this.#shown_s)) {
        const words = inWords(line);
        if (line.source in STATES && this.#states.get(line.source) === words) continue; // what is new in it is not in the words
        this.#states.set(line.source, words);
        this.#take(line, words, now_ms - 1000 * (age_s + stamp_s - line.stamp_s));
      }
      this.#shown_s = lines.at(-1).stamp_s;
    });
    connection.on("recording", ({ state, reason, saved }) => {
      if (saved) this.add("saved", `Saved what had just happened: ${saved}`);
      this.add("recording", { recording: "Recording.", failed: said("Recording has ended", reason) }[state] ?? "");
    });
    $("lately-kind").addEventListener("change", () => { $("lately").dataset.kind = $("lately-kind").value; });
    connection.addEventListener("closed", () => this.add("connection", "The connection was lost."));
    connection.addEventListener("hello", ({ detail: { session } }) => {
      if (session !== this.#session) this.#shown_s = -Infinity;
      this.#session = session;
      this.add("connection", "Connected.");
    });
  }

  // A line of the page, unless it is what was last said about the same; ``which`` tells two that read alike apart.
  add(about, words, which = null) {
    const key = `${words} ${which}`;
    if (this.#last.get(about) === key) return;
    this.#last.set(about, key);
    this.#show(words, Date.now());
  }

  // What is said again on the way to a goal is one line, of the last time, with how often it was said.
  #take({ source, text, level }, words, at_ms) {
    const isOnTheWay = REPEATED[source]?.includes(text.split(": ")[0]) ?? false;
    const before = isOnTheWay ? this.#onTheWay.get(words) : undefined;
    if (source in REPEATED && !isOnTheWay) this.#onTheWay.clear();
    before?.line.remove();
    const times = (before?.times ?? 0) + 1;
    const line = this.#show(times > 1 ? `${words} (${times} times)` : words, at_ms, level, KINDS[source]);
    if (isOnTheWay && line) this.#onTheWay.set(words, { line, times });
  }

  // In the order of time: the log may tell of what was before the page's own first lines.
  #show(words, at_ms, level = "info", kind = "other") {
    if (!words) return undefined;
    const line = element("li", "", { className: level });
    const at = new Date(at_ms);
    line.append(element("time", at.toLocaleTimeString([], { hour12: false }), { dateTime: at.toISOString(), title: at.toLocaleString() }), ` ${words}`);
    line.dataset.kind = kind;
    const older = [...$("lately").children].find((other) => other.firstChild.dateTime <= line.firstChild.dateTime);
    $("lately").insertBefore(line, older ?? null);
    const alike = $("lately").querySelectorAll(`[data-kind="${kind}"]`);
    if (alike.length > MOST_LINES) alike[alike.length - 1].remove();
    return line;
  }
}

function inWords({ source, text }) {
  const [state, ...reason] = text.split(": ");
  if (source in STATES) return STATES[source](state, reason.join(": "));
  return `${SOURCES[source] ?? sentence(source.replaceAll("_", " "))}: ${plain(text)}`;
}

function said(words, reason) {
  return reason && reason.toLowerCase() !== words.toLowerCase() ? `${words}: ${plain(reason)}` : `${words}.`;
}
