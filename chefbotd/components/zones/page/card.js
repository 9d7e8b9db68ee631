// Zones: where the robot must not go, and where it goes slowly. Listed, switched, deleted, undone, and drawn in the view.

import { confirmed, dismiss } from "../../confirm.js";
import { $, element, text } from "../../dom.js";
import { t, translate } from "../../language.js";
import { full, refusal, sentence } from "../../words.js";
import { Drawing } from "./drawing.js";
import { Highlight, sizeOf } from "./shapes.js";

const HTML = `
  <h2 id="zones-title" data-t="zones.title"></h2>
  <p id="zones-none" class="small"></p>
  <ul id="zones" class="plain"></ul>
  <div class="buttons">
    <button type="button" id="zone-keep_out" data-t="zones.draw_keep_out"></button>
    <button type="button" id="zone-slow" data-t="zones.draw_slow"></button>
    <button type="button" id="zone-wall" data-t="zones.draw_wall"></button>
    <button type="button" id="zones-undo" data-t="zones.undo" hidden></button>
  </div>`;
const KINDS = ["keep_out", "slow", "wall"];

export default class Zones {
  #map = null;
  #revision;
  #mayDraw = false;

  constructor({ connection, ask, say, view, panels, section }) {
    Object.assign(this, { connection, ask, say, view, section });
    section.innerHTML = HTML;
    translate(section);
    section.setAttribute("aria-labelledby", "zones-title");
    this.drawing = new Drawing(view, panels, (zone) => this.#save(zone));
    this.zones = [];
    this.layer = view.addLayer("zones", t("zones.layer"), (c) => this.#paint(c, this.#drawn()), { order: 30 });
    const draft = view.addLayer("zone-draft", t("zones.layer_draft"), (c) => this.#paint(c, this.drawing.drafts), { order: 31, isInLegend: false });
    this.highlight = new Highlight(view, "zone-pointed");
    draft.setKnown(true); // also where zones are switched off
    connection.on("localization", ({ map }) => this.#use(map));
    connection.on("zones", ({ map, revision }) => { if (map === this.#map && revision !== this.#revision) this.#list(); });
    connection.addEventListener("closed", () => { this.#revision = undefined; });
    for (const kind of KINDS) $(`zone-${kind}`).addEventListener("click", () => this.drawing.begin(kind));
    $("zones-undo").addEventListener("click", () => this.#change("undo_zones", {}));
  }

  begin(can) {
    this.section.hidden = !can.has("method.list_zones");
    this.#mayDraw = can.has("method.save_zone");
    for (const kind of KINDS) $(`zone-${kind}`).hidden = !this.#mayDraw;
    this.#map = null;
    this.#show({ zones: [], can_undo: false });
  }

  // Zones belong to a map: read anew when another one is in use.
  #use(map) {
    if (map === this.#map) return;
    this.#map = map;
    this.drawing.end();
    dismiss();
    if (map && !this.section.hidden) this.#list();
    else this.#show({ zones: [], can_undo: false });
  }

  async #list() {
    const map = this.#map;
    const listed = await this.ask("list_zones", { map });
    if (listed && map === this.#map) this.#show(listed);
  }

  #show({ zones, revision, can_undo }) {
    this.zones = zones;
    this.#revision = revision;
    this.highlight.keep(zones);
    $("zones").replaceChildren(...zones.map((zone) => this.#row(zone)));
    $("zones-none").hidden = zones.length > 0;
    text("zones-none", t(this.#map ? "zones.none" : "zones.no_map"));
    $("zones-undo").hidden = !can_undo || !this.#mayDraw;
    for (const kind of KINDS) $(`zone-${kind}`).disabled = !this.#map;
    this.layer.setKnown(zones.length > 0);
    this.view.draw();
  }

  #row(zone) {
    const row = element("li", "", { className: "row" });
    const label = element("label");
    const box = element("input", "", { type: "checkbox", checked: zone.enabled, disabled: !this.#mayDraw });
    box.addEventListener("change", () => this.#save({ ...zone, enabled: box.checked }));
    label.append(box, ` ${nameOf(zone)}`);
    const about = t("zones.about", { means: t(`zones.means.${zone.kind}`, zone), size: sizeOf(zone) });
    row.append(label, element("span", about, { className: "small" }));
    row.append(this.highlight.button(zone, t("zones.show_zone", { zone: nameOf(zone) })));
    if (this.#mayDraw) {
      const change = element("button", t("zones.change"), { type: "button" });
      change.setAttribute("aria-label", t("zones.change_zone", { zone: nameOf(zone) }));
      change.addEventListener("click", () => this.drawing.begin(zone.kind, zone));
      row.append(change);
      const remove = element("button", t("zones.delete"), { type: "button" });
      remove.setAttribute("aria-label", t("zones.delete_zone", { zone: nameOf(zone) }));
      remove.addEventListener("click", () => this.#change("delete_zone", { id: zone.id }));
      row.append(remove);
    }
    return row;
  }

  // Where it covers the robot or a place, or cuts one off, the daemon asks, and so does the page.
  async #save(zone) {
    const { width_m, max_speed_m_s, ...rest } = zone;
    const params = { ...rest, ...(zone.kind === "wall" && width_m ? { width_m } : {}), ...(zone.kind === "slow" ? { max_speed_m_s } : {}) };
    try {
      await this.#changed("save_zone", params);
    } catch (error) {
      if (error.kind !== "needs_confirmation") this.say(refusal(error));
      else if (await confirmed(t("zones.all_the_same", { why: full(refusal(error)) }), t("zones.use_it"), t("zones.no"))) {
        return void this.#change("save_zone", { ...params, confirmed: true });
      }
      this.#list(); // a switch goes back to what it is
    }
  }

  async #change(method, params) {
    try {
      await this.#changed(method, params);
    } catch (error) {
      this.say(refusal(error));
      this.#list();
    }
  }

  async #changed(method, params) {
    const saved = await this.connection.request(method, { ...params, map: this.#map, revision: this.#revision });
    this.say(saved.warning ? sentence(saved.warning) : "");
    await this.#list();
  }

  #drawn() {
    return this.zones.filter((each) => each.enabled && each.id !== this.drawing.changes);
  }

  #paint(c, zones) {
    const { scale } = this.view;
    for (const zone of zones) {
      c.strokeStyle = c.fillStyle = this.view.colour(zone.kind === "slow" ? "slow" : "no-go");
      c.lineWidth = zone.kind === "wall" ? Math.max(zone.width_m ?? 0.05, 3 / scale) : 2 / scale;
      c.setLineDash(zone.kind === "slow" ? [8 / scale, 5 / scale] : []);
      c.beginPath();
      for (const [x, y] of zone.points_m) c.lineTo(x, y);
      if (zone.kind !== "wall" && zone.points_m.length > 2) {
        c.closePath();
        c.globalAlpha = 0.18;
        c.fill();
        c.globalAlpha = 1;
      }
      c.stroke();
      c.setLineDash([]);
      if (zone.isDraft) zone.points_m.forEach((point, index) => dot(c, point, (index === zone.picked ? 9 : 5) / scale));
    }
  }
}

function nameOf({ kind, name }) {
  return name || t(`zones.name.${kind}`);
}

function dot(c, [x, y], radius) {
  c.beginPath();
  c.arc(x, y, radius, 0, 2 * Math.PI);
  c.fill();
}
