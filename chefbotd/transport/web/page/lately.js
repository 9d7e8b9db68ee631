// What has happened since the page was opened, the newest first: a bounded log, in words.

import { $, element } from "./dom.js";
import { because, device, GOAL, LOCATED, MAPPING, MODES, plain, sentence } from "./words.js";
import { GOING } from "./goal.js";

const MOST_LINES = 50;

export class Lately {
  #last = new Map();

  constructor(connection) {
    const on = (topic, take) => connection.addEventListener(`topic:${topic}`, ({ detail }) => take(detail.data));
    on("safety", ({ mode, reason }) => this.add("safety", said(MODES[mode]?.[1] ?? mode, mode === "armed" ? "" : reason)));
    on("link", ({ state, reason }) => this.add("link", state === "up" ? "The board is connected." : said("The board is not connected", reason)));
    on("navigation", ({ state, reason, goal }) => {
      if (state === "idle" || (GOING.includes(state) && state !== "paused")) this.#last.delete("navigation");
      else this.add("navigation", said(GOAL[state] ?? state, because(state, reason)), goal);
    });
    on("localization", ({ state, map }) => { if (map) this.add("localization", LOCATED[state] ?? state); });
    on("mapping", ({ state }) => this.add("mapping", MAPPING[state] ? `${MAPPING[state]}.` : ""));
    on("lidars", ({ lidars }) => lidars.forEach((each) => this.#device(each.lidar, each)));
    on("depth_cameras", ({ cameras }) => cameras.forEach((each) => this.#device(each.camera, each)));
    on("recording", ({ state, reason, saved }) => {
      if (saved) this.add("saved", `Saved what had just happened: ${saved}`);
      this.add("recording", { recording: "Recording.", failed: said("Recording has ended", reason) }[state] ?? "");
    });
    on("reset", ({ reason }) => this.add("reset", sentence(plain(reason))));
    connection.addEventListener("closed", () => this.add("connection", "The connection was lost."));
    connection.addEventListener("hello", () => this.add("connection", "Connected."));
  }

  // A line, unless it is what was last said about the same; ``which`` tells two that read alike apart.
  add(about, words, which = null) {
    const key = `${words} ${which}`;
    if (this.#last.get(about) === key) return;
    this.#last.set(about, key);
    if (!words) return;
    const line = element("li");
    line.append(element("time", new Date().toLocaleTimeString([], { hour12: false })), ` ${words}`);
    $("lately").prepend(line);
    if ($("lately").children.length > MOST_LINES) $("lately").lastChild.remove();
  }

  #device(name, state) {
    if (state.healthy !== null) this.add(name, `${sentence(name.replaceAll("_", " "))}: ${device(state)}.`);
  }
}

function said(words, reason) {
  return reason ? `${words}: ${plain(reason)}` : `${words}.`;
}
