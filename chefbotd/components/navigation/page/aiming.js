// What a click in the view means, and the pose that a finger has proposed there: only a second touch, on a button, uses it.

import { $, element, text } from "../../dom.js";
import { figure, t, translate } from "../../language.js";
import { GESTURE, position } from "./words.js";

const GESTURES = ["pan", "navigate_to", "follow_waypoints", "set_pose", "save_place"];
const WORDS = { follow_waypoints: t("navigation.add"), set_pose: t("navigation.is_here"), save_place: t("navigation.save_place") };
const NOT_BEFORE_MS = 400; // a double tap must not confirm what it has proposed itself

const PROPOSAL_HTML = `
  <span id="proposal-words"></span>
  <button type="button" id="proposal-go" class="wanted"></button>
  <button type="button" id="proposal-save" data-t="navigation.save_place"></button>
  <button type="button" id="proposal-cancel" data-t="navigation.no"></button>
  <form id="proposal-form" class="row" hidden>
    <label><span data-t="navigation.name_of_place"></span> <input id="proposal-name" maxlength="64" autocomplete="off" required></label>
    <button type="submit" class="wanted" data-t="navigation.save"></button>
    <button type="button" id="proposal-back" data-t="navigation.no"></button>
  </form>`;
const GESTURE_HTML = '<span id="gesture-words"></span> <select id="gesture"></select>';

export class Aiming {
  #pose = null;
  #shown_ms = 0;
  #isNaming = false;

  constructor(ask, view, route, places) {
    Object.assign(this, { ask, view, route, places });
    const proposal = element("div", "", { id: "proposal", className: "overlay row", role: "group", hidden: true, innerHTML: PROPOSAL_HTML });
    proposal.setAttribute("aria-labelledby", "proposal-words");
    translate(proposal);
    view.addOverlay(proposal);
    view.addTool(element("label", "", { id: "gesture-label", hidden: true, innerHTML: GESTURE_HTML }));
    view.onPose = (pose) => this.#use(pose);
    view.onProposal = (pose) => this.#show(pose);
    $("gesture").addEventListener("change", () => { view.gestures.cancel(); view.gesture = $("gesture").value; });
    for (const id of ["proposal-cancel", "proposal-back"]) $(id).addEventListener("click", () => this.#end());
    $("proposal-save").addEventListener("click", (event) => { if (event.timeStamp - this.#shown_ms >= NOT_BEFORE_MS) this.#askForName(); });
    $("proposal-form").addEventListener("submit", (event) => {
      event.preventDefault();
      const name = $("proposal-name").value.trim();
      const pose = this.#pose && params(this.#pose);
      if (!name || !pose) return;
      this.#end();
      places.save(name, pose);
    });
    $("proposal-go").addEventListener("click", (event) => {
      if (!this.#pose || event.timeStamp - this.#shown_ms < NOT_BEFORE_MS) return;
      const pose = this.#pose;
      if (view.gesture === "save_place") return void this.#askForName();
      view.gestures.cancel();
      this.#use(pose);
    });
  }

  begin(can) {
    const offered = GESTURES.filter((method) => method === "pan" || can.has(`method.${method}`));
    $("gesture-label").hidden = offered.length === 1;
    text("gesture-words", GESTURE);
    $("gesture").replaceChildren(...offered.map((method) => new Option(t(`navigation.means.${method}`), method)));
    this.canSave = can.has("method.save_place");
    this.view.gesture = $("gesture").value = can.has("method.navigate_to") ? "navigate_to" : "pan";
  }

  #use(aimed) {
    const pose = params(aimed);
    const { gesture } = this.view;
    if (gesture === "follow_waypoints") this.route.add(position("navigation.position", pose), pose, pose);
    else if (gesture === "save_place") this.#propose(aimed);
    else this.ask(gesture, pose);
  }

  // What a mouse has aimed at stays marked until it has a name.
  #propose(pose) {
    this.view.aim = markOf(pose);
    this.#show(pose);
    this.#askForName();
  }

  #askForName() {
    this.#setNaming(true);
    text("proposal-words", position("navigation.place_at", this.#pose));
    $("proposal-name").value = "";
    $("proposal-name").focus();
  }

  #end() {
    this.#isNaming = false;
    this.view.gestures.cancel();
  }

  #setNaming(isNaming) {
    this.#isNaming = isNaming;
    $("proposal-form").hidden = !isNaming;
    for (const id of ["proposal-go", "proposal-cancel"]) $(id).hidden = isNaming;
    $("proposal-save").hidden = isNaming || !this.canSave || this.view.gesture === "save_place";
  }

  #show(pose) {
    const { view } = this;
    if (!pose && this.#isNaming) { // a stop ends what would move the robot; a name that is being typed moves nothing
      view.aim = markOf(this.#pose);
      return;
    }
    if (pose && !this.#pose) this.#shown_ms = performance.now();
    this.#pose = pose;
    $("proposal").hidden = pose === null;
    if (!pose) return;
    this.#setNaming(false);
    const degrees = figure((pose.heading_rad * 180) / Math.PI, 0);
    const heading = pose.heading_rad === null ? t("navigation.drag") : t("navigation.heading", { degrees });
    text("proposal-words", position("navigation.proposal", pose, { heading }));
    text("proposal-go", WORDS[view.gesture] ?? t("navigation.go_here"));
  }
}

// As the methods take it: without a heading any will do.
const params = ({ x_m, y_m, heading_rad }) => ({ x_m, y_m, ...(heading_rad === null ? {} : { heading_rad }) });

function markOf({ x_m: x, y_m: y, heading_rad }) {
  const length = heading_rad === null ? 0 : 0.4;
  return { from: [x, y], to: [x + length * Math.cos(heading_rad ?? 0), y + length * Math.sin(heading_rad ?? 0)] };
}
