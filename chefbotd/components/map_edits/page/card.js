// Changes of the map by hand: a part is erased, a wall drawn, the map cropped, straightened, renamed, kept once more; and
// taken back. They are drawn in the view as zones are.

import { confirmed, dismiss } from "../../confirm.js";
import { $, element, text } from "../../dom.js";
import { figure, t, translate } from "../../language.js";
import { refusal, sentence } from "../../words.js";
import { inflate } from "../maps/grid.js";
import { Drawing } from "../zones/drawing.js";
import { Highlight, sizeOf } from "../zones/shapes.js";
import { findAngle } from "./straighten.js";

const HTML = `
  <h2 id="edits-title" data-t="map_edits.title"></h2>
  <p id="edits-told" class="small" role="status"></p>
  <div class="buttons">
    <button type="button" id="edit-box" data-t="map_edits.erase_box"></button>
    <button type="button" id="edit-area" data-t="map_edits.erase_area"></button>
    <button type="button" id="edit-wall" data-t="map_edits.draw_wall"></button>
    <button type="button" id="edit-crop" data-t="map_edits.crop"></button>
  </div>
  <ul id="edits" class="plain"></ul>
  <p><label><input type="checkbox" id="edit-unknown"> <span data-t="map_edits.to_unknown"></span></label></p>
  <div class="buttons">
    <button type="button" id="edit-undo" data-t="map_edits.undo"></button>
    <button type="button" id="edit-redo" data-t="map_edits.redo"></button>
  </div>
  <p><label><span data-t="map_edits.angle"></span> <input type="range" id="edit-angle" min="-45" max="45" step="0.5"></label>
    <output id="edit-degrees" for="edit-angle"></output></p>
  <div class="buttons"><button type="button" id="edit-straighten" data-t="map_edits.straighten"></button></div>
  <div id="edit-names">
    <p><label><span data-t="map_edits.name"></span> <input id="edit-name" maxlength="64" autocomplete="off"></label></p>
    <div class="buttons">
      <button type="button" id="edit-rename" data-t="map_edits.rename"></button>
      <button type="button" id="edit-copy" data-t="map_edits.copy"></button>
    </div>
    <p id="edit-named" class="small" role="status"></p>
  </div>`;
const KINDS = ["box", "area", "wall", "crop"];
const RECTANGLES = ["box", "crop"];

export default class MapEdits {
  #map = null;
  #revision;
  #angle = 0;
  #mayDraw = false;
  #mayDelete = false;

  constructor({ connection, ask, say, view, panels, section }) {
    Object.assign(this, { connection, ask, say, view, section });
    section.innerHTML = HTML;
    section.setAttribute("aria-labelledby", "edits-title");
    translate(section);
    const kinds = {
      box: { least: 2, most: 2, what: t("map_edits.touch_box") },
      area: { least: 3, what: t("map_edits.touch_area") },
      wall: { least: 2, what: t("map_edits.touch_wall"), hasWidth: true },
      crop: { least: 2, most: 2, what: t("map_edits.touch_crop") },
    };
    this.drawing = new Drawing(view, panels, (drawn) => this.#edit(drawn), { prefix: "draft", kinds, isNamed: false });
    const draft = view.addLayer("edit-draft", "", (c) => this.#paint(c), { order: 32, isInLegend: false });
    draft.setKnown(true);
    this.highlight = new Highlight(view, "edit-pointed");
    connection.on("localization", ({ map }) => this.#use(map));
    connection.on("map_edits", ({ map, revision }) => { if (map === this.#map && revision !== this.#revision) this.#list(true); });
    connection.addEventListener("closed", () => { this.#revision = undefined; });
    for (const kind of KINDS) $(`edit-${kind}`).addEventListener("click", () => this.drawing.begin(kind));
    $("edit-undo").addEventListener("click", () => this.#change("undo_map_edit", {}));
    $("edit-redo").addEventListener("click", () => this.#change("redo_map_edit", {}));
    $("edit-angle").addEventListener("input", () => this.#turn(radians($("edit-angle").value)));
    $("edit-angle").addEventListener("change", () => this.#change("turn_map_view", { angle_rad: radians($("edit-angle").value) }));
    $("edit-straighten").addEventListener("click", () => this.#straighten());
    $("edit-rename").addEventListener("click", () => this.#name("rename_map"));
    $("edit-copy").addEventListener("click", () => this.#name("copy_map"));
  }

  begin(can) {
    this.#mayDraw = can.has("method.edit_map");
    this.#mayDelete = can.has("method.delete_map_edit");
    this.section.hidden = !this.#mayDraw || !can.has("method.list_map_edits");
    $("edit-names").hidden = !can.has("method.rename_map");
    this.#map = null;
    this.#show({ edits: [], view_angle_rad: 0, can_undo: false, can_redo: false });
  }

  // Edits belong to a map: read anew when another one is in use.
  #use(map) {
    if (map === this.#map) return;
    this.#map = map;
    this.drawing.end();
    dismiss();
    if (map && !this.section.hidden) this.#list();
    else this.#show({ edits: [], view_angle_rad: 0, can_undo: false, can_redo: false });
  }

  async #list(isChanged = false) {
    const map = this.#map;
    const listed = await this.ask("list_map_edits", { map });
    if (!listed || map !== this.#map) return;
    this.#show(listed);
    if (isChanged) document.dispatchEvent(new Event("maps-changed"));
  }

  #show({ edits, revision, view_angle_rad, can_undo, can_redo }) {
    this.#revision = revision;
    this.highlight.keep(edits);
    $("edits").replaceChildren(...edits.map((edit) => this.#row(edit)).reverse()); // the one that was drawn last is the first
    for (const id of [...KINDS, "angle", "straighten", "rename", "copy"]) $(`edit-${id}`).disabled = !this.#map;
    $("edit-undo").hidden = !can_undo;
    $("edit-redo").hidden = !can_redo;
    text("edits-told", this.#map ? t("map_edits.count", { count: edits.length }) : t("map_edits.no_map"));
    $("edit-angle").value = (view_angle_rad * 180) / Math.PI;
    this.#turn(view_angle_rad);
  }

  // One edit: what it is, a button that points it out, and one that takes it off the map.
  #row(edit) {
    const what = t(`map_edits.about.${edit.kind === "erase" ? edit.to : edit.kind}`, { size: sizeOf(edit) });
    const row = element("li", "", { className: "row" });
    row.append(element("span", what), this.highlight.button(edit, t("map_edits.show_edit", { edit: what })));
    if (this.#mayDelete) {
      const remove = element("button", t("map_edits.delete"), { type: "button" });
      remove.setAttribute("aria-label", t("map_edits.delete_edit", { edit: what }));
      remove.addEventListener("click", () => this.#change("delete_map_edit", { id: edit.id }));
      row.append(remove);
    }
    return row;
  }

  // The map is shown so; it is kept when the slider is let go.
  #turn(angle_rad) {
    this.#angle = angle_rad;
    text("edit-degrees", `${figure((angle_rad * 180) / Math.PI, 1)}°`);
    this.view.setAngle(angle_rad);
  }

  async #edit({ kind, points_m, width_m }) {
    const corners = RECTANGLES.includes(kind) ? this.#rectangle(points_m) : points_m;
    const isErased = kind === "box" || kind === "area";
    const to = $("edit-unknown").checked ? "unknown" : "free";
    await this.#change("edit_map", { kind: isErased ? "erase" : kind, points_m: corners, ...(isErased ? { to } : {}), ...(kind === "wall" ? { width_m } : {}) });
  }

  // The corners of a rectangle that stands straight in the view, by two that lie opposite.
  #rectangle([[x, y], [toX, toY]]) {
    const [cos, sin] = [Math.cos(this.#angle), Math.sin(this.#angle)];
    const right = cos * (toX - x) - sin * (toY - y);
    return [[x, y], [x + right * cos, y - right * sin], [toX, toY], [toX - right * cos, toY + right * sin]];
  }

  // Where it leaves the robot or a place no way, the daemon asks, and so does the page.
  async #change(method, params) {
    try {
      await this.#changed(method, params);
    } catch (error) {
      if (error.kind !== "needs_confirmation") this.say(refusal(error));
      else if (await confirmed(t("map_edits.question", { what: sentence(error.message).replace(/[.]?$/, ".") }), t("map_edits.yes"), t("map_edits.no"))) {
        return void this.#change(method, { ...params, confirmed: true });
      }
      this.#list(); // the slider goes back to what it is
    }
  }

  async #changed(method, params) {
    const saved = await this.connection.request(method, { ...params, map: this.#map, revision: this.#revision });
    this.say(saved.warning ? sentence(saved.warning) : "");
    await this.#list(true);
  }

  // By the walls of the map: the turn that puts most of them along the edges of the view.
  async #straighten() {
    const texts = [];
    let map;
    do {
      map = await this.ask("get_map", { name: this.#map, part: texts.length });
      if (!map) return;
      texts.push(map.data);
    } while (texts.length < map.parts);
    const angle_rad = findAngle(await inflate(texts.join("")), map);
    await this.#change("turn_map_view", { angle_rad });
  }

  async #name(method) {
    const name = $("edit-name").value.trim();
    if (!name) {
      this.say(t("map_edits.name_first"));
      $("edit-name").focus();
      return;
    }
    const map = this.#map;
    if (!(await this.ask(method, { name: map, new_name: name }))) return;
    $("edit-name").value = "";
    text("edit-named", t(`map_edits.done.${method}`, { map, name }));
    document.dispatchEvent(new Event("maps-changed"));
  }

  #paint(c) {
    const { scale } = this.view;
    for (const { kind, points_m, width_m } of this.drawing.drafts) {
      c.strokeStyle = c.fillStyle = this.view.colour("accent");
      c.lineWidth = kind === "wall" ? Math.max(width_m, 2 / scale) : 2 / scale;
      const corners = RECTANGLES.includes(kind) && points_m.length === 2 ? this.#rectangle(points_m) : points_m;
      c.beginPath();
      for (const [x, y] of corners) c.lineTo(x, y);
      if (kind !== "wall" && corners.length > 2) c.closePath();
      c.stroke();
      for (const [x, y] of points_m) {
        c.beginPath();
        c.arc(x, y, 5 / scale, 0, 2 * Math.PI);
        c.fill();
      }
    }
  }
}

function radians(degrees) {
  return (Number(degrees) * Math.PI) / 180;
}
