// Where the robot is going, how far that is, and how it ended.

import { $, text } from "../../dom.js";
import { because, GOAL, SEND } from "../../words.js";

export const GOING = ["planning", "driving", "recovering", "paused"];
const NO_GOAL = `No goal. ${SEND} to send the robot there.`;
const NO_MAP = `No map is in use: start one or choose one first. Then: ${SEND.toLowerCase()} to send the robot there.`;

export class Goal {
  #map; // undefined until it is told
  #last = { state: "idle", reason: "" };
  #can = new Set();

  constructor(connection, ask, view) {
    const legend = view.addToLegend("path", "path to the goal");
    connection.on("navigation", (navigation) => { this.#last = navigation; this.#show(); });
    connection.on("localization", ({ map }) => { this.#map = map; this.#show(); });
    connection.on("path", ({ x_m, y_m }) => {
      view.path = x_m.map((x, index) => [x, y_m[index]]);
      legend.hidden = x_m.length === 0;
      view.draw();
    });
    for (const name of ["cancel", "pause", "resume"]) $(`goal-${name}`).addEventListener("click", () => ask(`${name}_navigation`));
    this.#show();
  }

  begin(can) {
    this.#can = can;
    this.#show();
  }

  // What a screen reader says has no distance in it, which changes all the time.
  #show() {
    const { state, reason, distance_m } = this.#last;
    const going = GOING.includes(state);
    const left = going && typeof distance_m === "number" ? `, ${distance_m.toFixed(1)} m left` : "";
    const why = because(state, reason);
    const words = (extra) => `${GOAL[state] ?? state}${extra}${why ? `: ${why}` : ""}`;
    const idle = this.#map === null ? NO_MAP : NO_GOAL;
    text("goal", state === "idle" ? idle : words(left));
    text("goal-told", state === "idle" ? "" : words(""));
    $("goal-cancel").hidden = !going;
    $("goal-pause").hidden = !going || state === "paused" || !this.#can.has("method.pause_navigation");
    $("goal-resume").hidden = state !== "paused" || !this.#can.has("method.resume_navigation");
  }
}
