// Draws the corners of a zone in the view: each click or tap there is one, and nothing is sent to the robot before "Done".
// A click on a corner picks it up, and the next one puts it down.

import { $, element, text } from "../../dom.js";
import { t, translate } from "../../language.js";

const HTML = `
  <p id="zone-told" role="status"></p>
  <label><span data-t="zones.name"></span> <input id="zone-name" maxlength="100" autocomplete="off"></label>
  <label id="zone-speed-label"><span data-t="zones.speed"></span> <input id="zone-speed" type="number" min="0.01" max="10" step="any" required> m/s</label>
  <button type="submit" class="wanted" id="zone-done" data-t="zones.done"></button>
  <button type="button" id="zone-back" data-t="zones.corner_back"></button>
  <button type="button" id="zone-no" data-t="zones.no"></button>`;
const PICKED_PX = 24;
const LEAST = { keep_out: 3, slow: 3, wall: 2 };

export class Drawing {
  #kind = null;
  #points = [];
  #id; // of the zone that is changed; undefined: a new one
  #enabled = true;
  #picked = null; // the corner that goes where the next click is
  #held = null; // what the view did before

  constructor(view, panels, use) {
    Object.assign(this, { view, panels });
    this.form = element("form", "", { id: "zone-drawing", className: "overlay drawing row", hidden: true, innerHTML: HTML });
    translate(this.form);
    view.addOverlay(this.form);
    $("zone-back").addEventListener("click", () => { this.#points = this.#points.slice(0, -1); this.#picked = null; this.#show(); });
    $("zone-no").addEventListener("click", () => this.end());
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      const zone = { kind: this.#kind, name: $("zone-name").value.trim(), enabled: this.#enabled, points_m: this.#points };
      if (this.#id !== undefined) zone.id = this.#id;
      if (this.#kind === "slow") zone.max_speed_m_s = Number($("zone-speed").value);
      this.end();
      use(zone);
    });
  }

  // What is being drawn, as a list of none or one.
  get drafts() {
    return this.#kind === null ? [] : [{ kind: this.#kind, points_m: this.#points, isDraft: true, picked: this.#picked }];
  }

  // The id of the zone that is being changed.
  get changes() {
    return this.#kind === null ? undefined : this.#id;
  }

  // A new zone of this kind, or one that is to be changed.
  begin(kind, { id, name = "", enabled = true, points_m = [], max_speed_m_s = 0.1 } = {}) {
    this.end();
    const { view } = this;
    const { onPose, onProposal, gesture } = view;
    view.gestures.cancel();
    this.#held = { onPose, onProposal, gesture };
    this.#kind = kind;
    [this.#id, this.#enabled, this.#points, this.#picked] = [id, enabled, points_m, null];
    view.gesture = "corner";
    view.onPose = (pose) => this.#add(pose);
    view.onProposal = (pose) => {
      if (!pose) return;
      view.gestures.cancel();
      this.#add(pose);
    };
    $("zone-name").value = name;
    $("zone-speed").value = max_speed_m_s ?? 0.1;
    $("zone-speed-label").hidden = kind !== "slow";
    this.form.hidden = false;
    this.panels.fold(true);
    this.#show();
  }

  end() {
    if (this.#held === null) return;
    const { onPose, onProposal, gesture } = this.#held;
    this.view.gestures.cancel();
    Object.assign(this.view, { onPose, onProposal }, this.view.gesture === "corner" ? { gesture } : {});
    this.#held = this.#kind = null;
    this.form.hidden = true;
    this.panels.fold(false);
    this.view.draw();
  }

  #add({ x_m, y_m }) {
    const point = [round(x_m), round(y_m)];
    const near = this.#points.findIndex(([x, y]) => Math.hypot(x - x_m, y - y_m) * this.view.scale < PICKED_PX);
    if (this.#picked !== null) {
      this.#points = this.#points.map((old, index) => (index === this.#picked ? point : old));
      this.#picked = null;
    } else if (near >= 0) this.#picked = near;
    else this.#points = [...this.#points, point];
    this.#show();
  }

  #show() {
    const count = this.#points.length;
    const missing = LEAST[this.#kind] - count;
    const what = { what: t(`zones.touch.${this.#kind}`), count, missing };
    const told = t(missing > 0 ? "zones.so_far_missing" : "zones.so_far", what);
    text("zone-told", this.#picked === null ? told : t("zones.put_down"));
    $("zone-done").disabled = missing > 0;
    $("zone-back").disabled = count === 0;
    this.view.draw();
  }
}

const round = (metres) => Math.round(metres * 1000) / 1000;
