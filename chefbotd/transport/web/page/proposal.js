// A pose that a finger has proposed in the view. Only a second touch, on this button, makes it a goal.

import { $, text } from "./dom.js";

const WORDS = { navigate_to: "Go here", follow_waypoints: "Add to the list", set_pose: "The robot is here" };
const NOT_BEFORE_MS = 400; // a double tap must not confirm what it has proposed itself

export class Proposal {
  #pose = null;
  #shown_ms = 0;

  constructor(view, take) {
    view.onProposal = (pose) => this.#show(pose, view);
    $("proposal-cancel").addEventListener("click", () => view.gestures.cancel());
    $("proposal-go").addEventListener("click", (event) => {
      if (!this.#pose || event.timeStamp - this.#shown_ms < NOT_BEFORE_MS) return;
      const pose = this.#pose;
      view.gestures.cancel();
      take(pose);
    });
  }

  #show(pose, view) {
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
