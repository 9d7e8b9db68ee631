// Where the robot is going, how far that is, and how it ended.

import { $, text } from "../../dom.js";
import { figure, knows, t } from "../../language.js";
import { because } from "../../words.js";
import { goal as nameOf, HAS_FINGERS } from "./words.js";

export const GOING = ["planning", "driving", "recovering", "paused"];
const QUEUE_SHOWN_MS = 2000; // how often it is looked whether others have added goals
const NEAR_M = 0.01; // a goal that is so near to a place is that place
const POSITION = ".drives_to"; // the end of the id of what says nothing to whoever knows the place by its name
const NO_GOAL = t(HAS_FINGERS ? "navigation.no_goal_tap" : "navigation.no_goal_click");
const NO_MAP = t(HAS_FINGERS ? "navigation.no_map_tap" : "navigation.no_map_click");

export class Goal {
  #map; // undefined until it is told
  #last = { state: "idle", reason: "" };
  #can = new Set();
  #named = { goal: null, place: "" }; // where the last goal is, or was
  #key = "";

  constructor(connection, ask, view, marks, places) {
    Object.assign(this, { connection, marks, places });
    const layer = view.addLayer("path", t("navigation.layer.path"), () => view.line(this.path, view.colour("robot"), 3), { order: 70 });
    this.path = [];
    connection.on("navigation", (navigation) => { this.#last = navigation; this.#show(); this.#look(); });
    connection.addEventListener("closed", () => { this.#key = ""; this.#take([]); });
    setInterval(() => { if (!document.hidden && this.#isGoing) this.#list(); }, QUEUE_SHOWN_MS);
    connection.on("localization", ({ map }) => { this.#map = map; this.#show(); });
    connection.on("path", ({ x_m, y_m }) => {
      this.path = x_m.map((x, index) => [x, y_m[index]]);
      if (this.path.length) layer.setKnown(true);
      view.draw();
    });
    for (const name of ["cancel", "pause", "resume"]) $(`goal-${name}`).addEventListener("click", () => ask(`${name}_navigation`));
    this.#show();
  }

  begin(can) {
    this.#can = can;
    this.#show();
  }

  get #isGoing() {
    return GOING.includes(this.#last.state);
  }

  // The robot's goals, where they may have changed.
  #look() {
    const key = `${this.#last.goal} ${this.#isGoing}`;
    if (key === this.#key) return;
    this.#key = key;
    if (this.#isGoing) this.#list();
    else this.#take([]);
  }

  async #list() {
    if (!this.#can.has("method.list_goals")) return;
    const told = await this.connection.request("list_goals").catch(() => null);
    if (told) this.#take(this.#isGoing ? told.goals : []);
  }

  #take(goals) {
    this.marks.show({ goals });
    if (!goals.length) return;
    const [{ goal, x_m, y_m }] = goals;
    const place = this.places.all.find((each) => Math.hypot(each.x_m - x_m, each.y_m - y_m) < NEAR_M);
    this.#named = { goal, place: place?.name ?? "" };
    this.#show();
  }

  // What a screen reader says has no distance in it, which changes all the time.
  #show() {
    const { state, reason, said, distance_m } = this.#last;
    const going = GOING.includes(state);
    const place = this.#named.goal === this.#last.goal && knows(`navigation.to.${state}`) && this.#named.place;
    const why = place && said?.reason?.id.endsWith(POSITION) ? "" : because(state, reason);
    const what = place ? t(`navigation.to.${state}`, { place }) : nameOf(state);
    const isFar = going && typeof distance_m === "number";
    const left = isFar ? t("navigation.left", { what, distance_m: figure(distance_m, 1) }) : what;
    const words = (begun) => `${begun}${why ? `: ${why}` : ""}`;
    const idle = this.#map === null ? NO_MAP : NO_GOAL;
    text("goal", state === "idle" ? idle : words(left));
    text("goal-told", state === "idle" ? "" : words(what));
    $("goal-cancel").hidden = !going;
    $("goal-pause").hidden = !going || state === "paused" || !this.#can.has("method.pause_navigation");
    $("goal-resume").hidden = state !== "paused" || !this.#can.has("method.resume_navigation");
  }
}
