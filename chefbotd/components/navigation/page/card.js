// Navigation: what is aimed at in the view, the goal, named places, the list of goals, and what it costs to drive where.

import { said } from "../../lately.js";
import { because, plain } from "../../words.js";
import { Aiming } from "./aiming.js";
import { Costs } from "./costs.js";
import { Goal, GOING } from "./goal.js";
import { Marks } from "./marks.js";
import { Places } from "./places.js";
import { Route } from "./route.js";
import { GOAL } from "./words.js";

const HTML = `
  <h2 id="goal-title">Goal</h2>
  <p id="goal">No goal.</p>
  <p id="goal-told" class="unseen" role="status"></p>
  <div class="buttons">
    <button type="button" id="goal-cancel" hidden>Cancel the goal</button>
    <button type="button" id="goal-pause" hidden>Pause</button>
    <button type="button" id="goal-resume" hidden>Go on</button>
  </div>
  <div id="place-list-part" hidden>
    <h3 id="place-list-title">Go to</h3>
    <ul id="place-list" class="plain buttons" aria-labelledby="place-list-title"></ul>
  </div>
  <form id="place-form" hidden>
    <label for="place">Place <span class="small">or x y in metres, then a heading in degrees</span></label>
    <input id="place" list="places" maxlength="64" autocomplete="off" placeholder="kitchen, or 1.2 3.4 90">
    <datalist id="places"></datalist>
    <div class="buttons">
      <button type="submit" id="place-go">Go there</button>
      <button type="button" id="place-add">Add to the list</button>
      <button type="button" id="place-here">The robot is here</button>
      <button type="button" id="place-save">Save its position</button>
      <button type="button" id="place-delete">Delete</button>
    </div>
  </form>
  <div id="route-part" hidden>
    <h3>List of goals</h3>
    <ol id="route"></ol>
    <div class="buttons">
      <button type="button" id="route-go">Drive to all</button>
      <button type="button" id="route-clear">Clear the list</button>
    </div>
    <p class="small">The robot goes on with the list only while this page is open.</p>
  </div>`;

export default class Navigation {
  #section;
  #parts;

  constructor({ connection, ask, say, view, lately, section }) {
    section.innerHTML = HTML;
    section.setAttribute("aria-labelledby", "goal-title");
    this.#section = section;
    lately.describe("navigation", {
      kind: "way", title: "goals", repeated: GOING, // who waits for people goes to and fro between these
      words: (state, reason) => (state === "idle" ? "" : said(GOAL[state] ?? state, because(state, reason))),
    });
    lately.describe("worker", {
      words: (state, reason) => (["starting", "warming"].includes(state) ? "" : `Maps and navigation: ${[state, plain(reason)].filter(Boolean).join(": ")}`),
    });
    const marks = new Marks(view);
    const route = new Route(connection, ask, say, marks);
    const costs = new Costs(connection, ask, view);
    const places = new Places(connection, ask, say, route, marks);
    this.#parts = [places, costs, new Goal(connection, ask, view, marks, places), new Aiming(ask, view, route, places)];
  }

  begin(can) {
    this.#section.hidden = !can.has("method.navigate_to");
    for (const part of this.#parts) part.begin(can);
  }
}
