// What a click in the view means, and the pose that a finger has proposed there: only a second touch, on a button, uses it.

import { $, element, text } from "../../dom.js";
import { GESTURE } from "../../words.js";

const GESTURES = [["pan", "moves the view"], ["navigate_to", "sends the robot there"], ["follow_waypoints", "adds a goal to the list"],
  ["set_pose", "says where the robot is"]];
const WORDS = { navigate_to: "Go here", follow_waypoints: "Add to the list", set_pose: "The robot is here" };
const NOT_BEFORE_MS = 400; // a double tap must not confirm what it has proposed itself

const PROPOSAL_HTML = `
  <span id="proposal-words"></span>
  <button type="button" id="proposal-go" class="wanted"></button>
  <button type="button" id="proposal-cancel">No</button>`;
const GESTURE_HTML = '<span id="gesture-words">Click and drag</span> <select id="gesture"></select>';

export class Aiming {
  #pose = null;
  #shown_ms = 0;

  constructor(ask, view, route) {
    Object.assign(this, { ask, view, route });
    const proposal = element("div", "", { id: "proposal", className: "proposal", role: "group", hidden: true, innerHTML: PROPOSAL_HTML });
    proposal.setAttribute("aria-labelledby", "proposal-words");
    view.canvas.after(proposal);
    view.addTool(element("label", "", { id: "gesture-label", hidden: true, innerHTML: GESTURE_HTML }));
    view.onPose = (pose) => this.#use(pose);
    view.onProposal = (pose) => this.#show(pose);
    $("gesture").addEventListener("change", () => { view.gestures.cancel(); view.gesture = $("gesture").value; });
    $("proposal-cancel").addEventListener("click", () => view.gestures.cancel());
    $("proposal-go").addEventListener("click", (event) => {
      if (!this.#pose || event.timeStamp - this.#shown_ms < NOT_BEFORE_MS) return;
      const pose = this.#pose;
      view.gestures.cancel();
      this.#use(pose);
    });
  }

  begin(can) {
    const offered = GESTURES.filter(([method]) => method === "pan" || can.has(`method.${method}`));
    $("gesture-label").hidden = offered.length === 1;
    text("gesture-words", GESTURE);
    $("gesture").replaceChildren(...offered.map(([value, words]) => new Option(words, value)));
    this.view.gesture = $("gesture").value = can.has("method.navigate_to") ? "navigate_to" : "pan";
  }

  #use({ x_m, y_m, heading_rad }) {
    const pose = { x_m, y_m, ...(heading_rad === null ? {} : { heading_rad }) };
    const { gesture } = this.view;
    if (gesture === "follow_waypoints") this.route.add(`x ${x_m.toFixed(2)} m, y ${y_m.toFixed(2)} m`, pose, pose);
    else this.ask(gesture, pose);
  }

  #show(pose) {
    const { view } = this;
    if (pose && !this.#pose) this.#shown_ms = performance.now();
    this.#pose = pose;
    $("proposal").hidden = pose === null;
    if (!pose) return;
    $("proposal").classList.toggle("low", pose.y_m > view.centre[1]); // not over what it is about
    const heading = pose.heading_rad === null ? "drag the dot for a heading" : `heading ${((pose.heading_rad * 180) / Math.PI).toFixed(0)}°`;
    text("proposal-words", `x ${pose.x_m.toFixed(2)} m, y ${pose.y_m.toFixed(2)} m, ${heading}`);
    text("proposal-go", WORDS[view.gesture] ?? "Go here");
  }
}
