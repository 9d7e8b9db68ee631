// What has happened lately, the newest first, in words: the daemon's log, also from before the page was opened, and the
// page's own lines.

import { $, element } from "./dom.js";
import { knows, ready, t } from "./language.js";
import { driverName, limit, mode, plain, sentence, told } from "./words.js";

const MOST_LINES = 50; // of a kind: many of one do not push out those of another

export class Lately {
  #sources = new Map([
    ["safety", { kind: "stops", words: safety }],
    ["control", { kind: "stops", words: (_, name) => (name ? t("refused.lease_held", { driver: driverName(name) }) : t("driver.nobody_drives")) }],
  ]);
  #last = new Map();
  #states = new Map(); // what each part was last said to do
  #repeated = new Map(); // the lines since a part was last in another state
  #session = null;
  #shown_s = -Infinity;

  // ``loaded`` ends when every card has said how its component's lines read.
  constructor(connection, loaded) {
    connection.on("log", ({ lines }, { age_s, stamp_s }) => {
      const now_ms = Date.now();
      loaded.then(() => {
        for (const line of lines.filter((each) => each.stamp_s > this.#shown_s)) {
          this.#take(line, now_ms - 1000 * (age_s + stamp_s - line.stamp_s));
        }
        this.#shown_s = lines.at(-1).stamp_s;
      });
    });
    connection.on("recording", ({ state, reason, saved }) => {
      if (saved) this.add("saved", t("lately.saved", { file: saved }));
      this.add("recording", { recording: t("lately.recording"), failed: said(t("lately.recording_ended"), reason) }[state] ?? "");
    });
    $("lately-kind").addEventListener("change", () => {
      for (const line of $("lately").children) line.hidden = !isOfKind(line);
    });
    connection.addEventListener("closed", () => ready.then(() => this.add("connection", t("connection.lost"))));
    connection.addEventListener("hello", ({ detail: { session } }) => {
      if (session !== this.#session) this.#shown_s = -Infinity;
      this.#session = session;
      ready.then(() => this.add("connection", t("connection.found")));
    });
  }

  // How the lines of a part of the daemon read: ``words(state, reason)``, empty for none; ``repeated`` are states between
  // which it goes to and fro; ``kind`` is what the list can be filtered by, and ``title`` names a kind of its own.
  describe(source, { kind = "other", title = "", words, repeated = [] }) {
    this.#sources.set(source, { kind, words, repeated });
    if (title && ![...$("lately-kind").options].some((option) => option.value === kind)) $("lately-kind").add(new Option(title, kind), 1);
  }

  // A line of the page, unless it is what was last said about the same; ``which`` tells two that read alike apart.
  add(about, words, which = null) {
    const key = `${words} ${which}`;
    if (this.#last.get(about) === key) return;
    this.#last.set(about, key);
    this.#show(words, Date.now());
  }

  // What is said again between the same states is one line, of the last time, with how often it was said.
  #take({ source, text, level, said }, at_ms) {
    const [state, reason] = parts(text, said?.text);
    const known = this.#sources.get(source);
    const words = known ? known.words(state, reason) : `${nameOf(source)}: ${plain(text)}`;
    if (known && this.#states.get(source) === words) return; // what is new in it is not in the words
    this.#states.set(source, words);
    const isRepeated = known?.repeated?.includes(state) ?? false;
    const key = `${source} ${words}`;
    const before = isRepeated ? this.#repeated.get(key) : undefined;
    if (known?.repeated?.length && !isRepeated) this.#repeated.clear();
    before?.line.remove();
    const times = (before?.times ?? 0) + 1;
    const line = this.#show(times > 1 ? t("lately.times", { words, times }) : words, at_ms, level, known?.kind);
    if (isRepeated && line) this.#repeated.set(key, { line, times });
  }

  // In the order of time: the log may tell of what was before the page's own first lines.
  #show(words, at_ms, level = "info", kind = "other") {
    if (!words) return undefined;
    const line = element("li", "", { className: level });
    const at = new Date(at_ms);
    line.append(element("time", at.toLocaleTimeString([], { hour12: false }), { dateTime: at.toISOString(), title: at.toLocaleString() }), ` ${words}`);
    line.dataset.kind = kind;
    line.hidden = !isOfKind(line);
    const older = [...$("lately").children].find((other) => other.firstChild.dateTime <= line.firstChild.dateTime);
    $("lately").insertBefore(line, older ?? null);
    const alike = $("lately").querySelectorAll(`[data-kind="${kind}"]`);
    if (alike.length > MOST_LINES) alike[alike.length - 1].remove();
    return line;
  }
}

// A line's state and the reason for it; where that is a sentence with an id, the line is one of both.
function parts(text, sentence) {
  const { id, arguments: args } = sentence ?? {};
  if (id === "log.state") return [args.state, told(args.reason)];
  if (id === "log.fault") return parts(args.text.message ?? args.text, args.text); // its name is for programs
  if (id === "log.limited") {
    const [state, reason] = parts(args.text.message ?? args.text, args.text);
    return [state, `${reason} (limited by ${args.by})`];
  }
  const [state, ...reason] = text.split(": ");
  return [state, reason.join(": ")];
}

function isOfKind(line) {
  const wanted = $("lately-kind").value;
  return wanted === "" || wanted === line.dataset.kind || (wanted === "problems" && ["warning", "error"].includes(line.className));
}

function nameOf(source) {
  return knows(`source.${source}`) ? t(`source.${source}`) : sentence(source.replaceAll("_", " "));
}

function safety(state, reason) {
  const [, before, by] = reason.match(/^(.*?) ?\(limited by (.*)\)/) ?? [null, reason, null];
  return by ? t("mode.slower_sentence", { why: limit(by) }) : said(mode(state)[1], state === "armed" ? "" : before);
}

export function said(words, reason) {
  return reason && reason.toLowerCase() !== words.toLowerCase() ? `${words}: ${plain(reason)}` : `${words}.`;
}
