// Navigation: what is aimed at in the view, the goal, named places, the list of goals, and what it costs to drive where.

import { said } from "../../lately.js";
import { named, t, translate } from "../../language.js";
import { because, plain } from "../../words.js";
import { Aiming } from "./aiming.js";
import { Costs } from "./costs.js";
import { Goal, GOING } from "./goal.js";
import { Marks } from "./marks.js";
import { Places } from "./places.js";
import { Route } from "./route.js";
import { goal } from "./words.js";

const HTML = `
  <h2 id="goal-title" data-t="navigation.goal"></h2>
  <p id="goal" data-t="navigation.no_goal"></p>
  <p id="goal-told" class="unseen" role="status"></p>
  <div class="buttons">
    <button type="button" id="goal-cancel" data-t="navigation.cancel" hidden></button>
    <button type="button" id="goal-pause" data-t="navigation.pause" hidden></button>
    <button type="button" id="goal-resume" data-t="navigation.resume" hidden></button>
  </div>
  <div id="place-list-part" hidden>
    <h3 id="place-list-title" data-t="navigation.go_to"></h3>
    <ul id="place-list" class="plain buttons" aria-labelledby="place-list-title"></ul>
  </div>
  <form id="place-form" hidden>
    <label for="place"><span data-t="navigation.place"></span> <span class="small" data-t="navigation.place_help"></span></label>
    <input id="place" list="places" maxlength="64" autocomplete="off" data-t-placeholder="navigation.place_example">
    <datalist id="places"></datalist>
    <div class="buttons">
      <button type="submit" id="place-go" data-t="navigation.go_there"></button>
      <button type="button" id="place-add" data-t="navigation.add"></button>
      <button type="button" id="place-here" data-t="navigation.is_here"></button>
      <button type="button" id="place-save" data-t="navigation.save_position"></button>
      <button type="button" id="place-delete" data-t="navigation.delete"></button>
    </div>
  </form>
  <div id="route-part" hidden>
    <h3 data-t="navigation.list"></h3>
    <ol id="route"></ol>
    <div class="buttons">
      <button type="button" id="route-go" data-t="navigation.drive_to_all"></button>
      <button type="button" id="route-clear" data-t="navigation.clear"></button>
    </div>
    <p class="small" data-t="navigation.list_help"></p>
  </div>`;

export default class Navigation {
  #section;
  #parts;

  constructor({ connection, ask, say, view, lately, section }) {
    section.innerHTML = HTML;
    translate(section);
    section.setAttribute("aria-labelledby", "goal-title");
    this.#section = section;
    lately.describe("navigation", {
      kind: "way", title: t("navigation.goals"), repeated: GOING, // who waits for people goes to and fro between these
      words: (state, reason) => (state === "idle" ? "" : said(goal(state), because(state, reason))),
    });
    lately.describe("worker", {
      words: (state, reason) => (["starting", "warming"].includes(state) ? "" : t("navigation.worker", { what: [named("navigation.helper", state), plain(reason)].filter(Boolean).join(": ") })),
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
