// A list of goals, one after the other. The daemon has the list while the robot drives (follow_waypoints), and its request
// waits for the end: so a stop ends the list, and so does the end of this page or of its connection.

import { $, element } from "../../dom.js";
import { t } from "../../language.js";
import { GOING } from "./goal.js";

const MOST_GOALS = 20;
const MOST_WAITING = 4; // requests; then all are sent anew as one

export class Route {
  #goals = [];
  #waiting = 0; // requests that the daemon has not answered: while there are any, the robot drives the list
  #run = 0;
  #first = null; // the daemon's number of the list's first goal, once it is told
  #newest = 0;

  constructor(connection, ask, say, marks) {
    Object.assign(this, { ask, say, marks });
    connection.on("navigation", (navigation) => this.#take(navigation));
    connection.addEventListener("closed", () => { this.#newest = 0; this.#ended(); });
    $("route-go").addEventListener("click", () => this.#drive());
    $("route-clear").addEventListener("click", () => { this.#goals = []; this.#cancel(); });
    this.#show();
  }

  add(label, target, pose) {
    if (this.#goals.length >= MOST_GOALS) return this.say(t("navigation.list_full", { count: MOST_GOALS }));
    this.say("");
    this.#goals.push({ label, target, pose });
    this.#show();
    if (this.#waiting === 0) return undefined;
    return this.#waiting < MOST_WAITING ? this.#ask("navigate_to", { ...target, queue: true }) : this.#drive();
  }

  #remove(goal) {
    const driven = this.#waiting > 0;
    this.#goals = this.#goals.filter((other) => other !== goal);
    if (!driven) this.#show();
    else if (this.#goals.length) this.#drive();
    else this.#cancel();
  }

  // All that are left, in place of what the robot was at.
  #drive() {
    this.#ended();
    this.#ask("follow_waypoints", { waypoints: this.#goals.map(({ target }) => target) });
  }

  #cancel() {
    if (this.#waiting > 0) this.ask("cancel_navigation");
    this.#ended();
  }

  async #ask(method, params) {
    const run = this.#run;
    this.#waiting += 1;
    this.#show();
    const answer = await this.ask(method, { ...params, wait: true });
    if (run !== this.#run) return;
    this.#waiting -= 1;
    if (answer?.end !== "reached") this.#ended(); // what is left stays on the list, and is not driven
    else if (this.#waiting === 0) this.#goals = [], this.#ended();
  }

  #ended() {
    this.#run += 1;
    this.#waiting = 0;
    this.#first = null;
    this.#show();
  }

  // The daemon counts its goals: what is before the one that it is at has been reached.
  #take({ state, goal }) {
    if (goal === null) return;
    if (this.#waiting > 0 && GOING.includes(state)) {
      if (this.#first === null && goal > this.#newest) this.#first = goal;
      const reached = this.#first === null ? 0 : goal - this.#first;
      if (reached > 0) {
        this.#goals.splice(0, reached);
        this.#first = goal;
        this.#show();
      }
    }
    this.#newest = Math.max(this.#newest, goal);
  }

  #show() {
    const driven = this.#waiting > 0;
    $("route-part").hidden = this.#goals.length === 0;
    $("route-go").hidden = driven;
    $("route").replaceChildren(...this.#goals.map((goal, index) => this.#item(goal, driven && index === 0)));
    this.marks.show({ route: this.#goals.map(({ pose }) => pose) });
  }

  #item(goal, isNext) {
    const remove = element("button", t("navigation.remove"), { type: "button", ariaLabel: t("navigation.remove_goal", { goal: goal.label }) });
    remove.addEventListener("click", () => this.#remove(goal));
    const item = element("li");
    item.append(element("span", isNext ? t("navigation.on_the_way", { goal: goal.label }) : goal.label), remove);
    return item;
  }
}
