// Draws the corners of a zone in the view: each click or tap there is one, and nothing is sent to the robot before "Done".
// A click on a corner picks it up, and the next one puts it down.

import { $, element, text } from "../../dom.js";
import { t, translate } from "../../language.js";

const HTML = (prefix) => `
  <p id="${prefix}-told" role="status"></p>
  <label id="${prefix}-name-label"><span data-t="zones.name"></span> <input id="${prefix}-name" maxlength="100" autocomplete="off" data-t-placeholder="zones.name"></label>
  <label id="${prefix}-speed-label"><span data-t="zones.speed"></span> <input id="${prefix}-speed" type="number" min="0.01" max="10" step="any" required data-t-title="zones.speed"> m/s</label>
  <label id="${prefix}-width-label"><span data-t="zones.width"></span> <input id="${prefix}-width" type="number" min="0.01" max="5" step="any" required data-t-title="zones.width"> m</label>
  <span class="ends">
    <button type="submit" class="wanted" id="${prefix}-done" data-t="zones.done"></button>
    <button type="button" id="${prefix}-back" data-t-aria-label="zones.corner_back" data-t-title="zones.corner_back"><svg viewBox="0 0 24 24" aria-hidden="true"><path d="M9 5l-5 5 5 5M4 10h10a6 6 0 0 1 0 12h-3"/></svg></button>
    <button type="button" id="${prefix}-no" data-t-aria-label="zones.leave" data-t-title="zones.leave"><svg viewBox="0 0 24 24" aria-hidden="true"><path d="M6 6l12 12M18 6L6 18"/></svg></button>
  </span>`;
const PICKED_PX = 24;
const ZONES = { keep_out: { least: 3 }, slow: { least: 3, hasSpeed: true }, wall: { least: 2, hasWidth: true } };
const [SPEED_M_S, WIDTH_M] = [0.1, 0.05];

export class Drawing {
  #kind = null;
  #points = [];
  #id; // of the zone that is changed; undefined: a new one
  #enabled = true;
  #picked = null; // the corner that goes where the next click is
  #held = null; // what the view did before
  #back = null; // what had the focus before

  // ``kinds`` say of each how many corners it needs at ``least`` and at ``most``, ``what`` to do, and whether it ``hasSpeed`` or
  // ``hasWidth``. ``prefix`` begins the ids.
  constructor(view, panels, use, { prefix = "zone", kinds = ZONES, isNamed = true } = {}) {
    Object.assign(this, { view, panels, prefix, kinds });
    this.form = element("form", "", { id: `${prefix}-drawing`, className: "drawing", hidden: true, innerHTML: HTML(prefix) });
    translate(this.form);
    view.addBar(this.form);
    this.isNamed = isNamed;
    if (!isNamed) for (const part of ["name-label", "speed-label"]) this.#of(part).remove();
    this.#of("back").addEventListener("click", () => { this.#points = this.#points.slice(0, -1); this.#picked = null; this.#show(); });
    this.#of("width").addEventListener("input", () => view.draw());
    this.#of("no").addEventListener("click", () => this.end());
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      const zone = { kind: this.#kind, name: isNamed ? this.#of("name").value.trim() : "", enabled: this.#enabled, points_m: this.#points };
      if (this.#id !== undefined) zone.id = this.#id;
      if (kinds[this.#kind].hasSpeed) zone.max_speed_m_s = Number(this.#of("speed").value);
      if (kinds[this.#kind].hasWidth) zone.width_m = this.#width();
      this.end();
      use(zone);
    });
  }

  // What is being drawn, as a list of none or one.
  get drafts() {
    return this.#kind === null ? [] : [{ kind: this.#kind, points_m: this.#points, width_m: this.#width(), isDraft: true, picked: this.#picked }];
  }

  // The id of the zone that is being changed.
  get changes() {
    return this.#kind === null ? undefined : this.#id;
  }

  // A new zone of this kind, or one that is to be changed.
  begin(kind, { id, name = "", enabled = true, points_m = [], max_speed_m_s, width_m } = {}) {
    this.end();
    this.#back = document.activeElement;
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
    if (this.isNamed) {
      this.#of("name").value = name;
      this.#offer("speed", this.kinds[kind].hasSpeed, max_speed_m_s ?? SPEED_M_S);
    }
    this.#offer("width", this.kinds[kind].hasWidth, width_m ?? WIDTH_M);
    this.form.hidden = false;
    this.panels.fold(true);
    this.#show();
    this.view.measure(); // a corner may be put at once
    view.canvas.focus({ preventScroll: true }); // for keys that mark corners; "Done" is next to it
  }

  end() {
    if (this.#held === null) return;
    const { onPose, onProposal, gesture } = this.#held;
    this.view.gestures.cancel();
    Object.assign(this.view, { onPose, onProposal }, this.view.gesture === "corner" ? { gesture } : {});
    this.#held = this.#kind = null;
    this.form.hidden = true;
    this.panels.fold(false);
    this.#back?.focus({ preventScroll: true });
    this.view.draw();
  }

  #offer(part, isOffered, value) {
    this.#of(part).value = value;
    this.#of(`${part}-label`).hidden = this.#of(part).disabled = !isOffered;
  }

  // As it is written; while it is no width yet, that of a wall that says nothing of it.
  #width() {
    return this.#of("width").validity.valid ? Number(this.#of("width").value) : WIDTH_M;
  }

  #of(part) {
    return $(`${this.prefix}-${part}`);
  }

  #add({ x_m, y_m }) {
    const point = [round(x_m), round(y_m)];
    const near = this.#points.findIndex(([x, y]) => Math.hypot(x - x_m, y - y_m) * this.view.scale < PICKED_PX);
    if (this.#picked !== null) {
      this.#points = this.#points.map((old, index) => (index === this.#picked ? point : old));
      this.#picked = null;
    } else if (near >= 0) this.#picked = near;
    else if (this.#points.length < (this.kinds[this.#kind].most ?? Infinity)) this.#points = [...this.#points, point];
    this.#show();
  }

  #show() {
    const count = this.#points.length;
    const { least, what = t(`zones.touch.${this.#kind}`) } = this.kinds[this.#kind];
    const missing = least - count;
    const told = t(missing > 0 ? "zones.so_far_missing" : "zones.so_far", { what, count, missing });
    text(`${this.prefix}-told`, this.#picked === null ? told : t("zones.put_down"));
    this.#of("done").disabled = missing > 0;
    this.#of("back").disabled = count === 0;
    this.view.draw();
  }
}

const round = (metres) => Math.round(metres * 1000) / 1000;
