// Making and choosing maps, what is known of where the robot is, and what to do first where there is no map.

import { confirmed } from "../../confirm.js";
import { SHOWN_HZ } from "../../connection.js";
import { $, element, text } from "../../dom.js";
import { Grid, inflate } from "./grid.js";
import { figure, t, translate } from "../../language.js";
import { plain, sentence } from "../../words.js";
import { located, mapping as mappingWords } from "./words.js";


const GUIDE_HTML = `
  <h2 id="guide-title"></h2>
  <p id="guide-words"></p>
  <ol id="guide-steps">
    <li><span data-t="maps.press"></span> <b data-t="maps.start"></b>.</li>
    <li data-t="maps.drive_through"></li>
    <li data-t="maps.give_name"></li>
  </ol>
  <div class="buttons">
    <button type="button" id="guide-start" class="wanted" data-t="maps.start" hidden></button>
    <button type="button" id="guide-choose" data-t="maps.choose" hidden></button>
    <button type="button" id="guide-continue" class="wanted" data-t="maps.continue" hidden></button>
    <button type="button" id="guide-discard" data-t="maps.discard_it" hidden></button>
  </div>`;
const MAKING_HTML = `
  <strong id="making-title" data-t="maps.mapping.mapping"></strong>
  <button type="button" id="making-save" data-t="maps.save_it"></button>`;
const HTML = `
  <h2 id="map-title" data-t="maps.title"></h2>
  <p id="map-told" role="status"></p>
  <p id="maps-label" hidden><label><span data-t="maps.in_use"></span> <select id="maps"></select></label></p>
  <p id="map-name-label" hidden><label><span data-t="maps.name"></span> <input id="map-name" maxlength="64" autocomplete="off"></label></p>
  <div class="buttons">
    <button type="button" id="map-start" data-t="maps.start" hidden></button>
    <button type="button" id="map-finish" data-t="maps.finish" hidden></button>
    <button type="button" id="map-discard" data-t="maps.discard" hidden></button>
    <button type="button" id="map-localize" data-t="maps.localize" hidden></button>
    <button type="button" id="map-localize-turn" data-t="maps.localize_turn" hidden></button>
  </div>`;

export default class Maps {
  #queue = Promise.resolve();
  #shown = null;
  #mapping = { state: "idle", unfinished: false };
  #inUse; // undefined until it is told
  #stored = 0;

  constructor({ connection, ask, view, panels, lately, say, section }) {
    Object.assign(this, { ask, view, say, section, can: new Set(), grid: null });
    section.innerHTML = HTML;
    translate(section);
    section.setAttribute("aria-labelledby", "map-title");
    const guide = element("section", "", { id: "guide", className: "guide", hidden: true, innerHTML: GUIDE_HTML });
    guide.setAttribute("aria-labelledby", "guide-title");
    translate(guide);
    const making = element("section", "", { id: "making", className: "guide", hidden: true, innerHTML: MAKING_HTML });
    making.setAttribute("aria-labelledby", "making-title");
    translate(making);
    $("notices").append(guide, making);
    $("making-save").addEventListener("click", () => { panels.show("map"); $("map-name").focus(); });
    lately.describe("localization", { kind: "way", words: located });
    lately.describe("mapping", { kind: "way", words: (state) => (mappingWords(state) ? `${mappingWords(state)}.` : "") });
    this.layer = view.addLayer("map-walls", t("maps.layer"), (c) => this.grid?.draw(c), { order: 10 });
    view.onColours.push(() => this.grid?.repaint(this.#colours()));
    connection.on("map_pose", (pose, { stamp_s }) => view.setPose(pose.state === "ended" ? null : pose, true, stamp_s), SHOWN_HZ);
    connection.on("map", (part) => this.#enqueue(() => this.#take(part)));
    connection.on("mapping", (mapping) => this.#show(mapping));
    connection.on("localization", (found) => this.#located(found));
    connection.addEventListener("closed", () => { this.#shown = null; });
    document.addEventListener("maps-changed", () => { // another card changed one, or which there are
      if (this.#mapping.state === "idle") this.#shown = null;
      if (this.#has("list_maps")) this.#list();
    });
    $("map-start").addEventListener("click", () => this.ask("start_mapping"));
    $("guide-start").addEventListener("click", async () => { if (await this.ask("start_mapping")) panels.show("drive"); });
    $("guide-continue").addEventListener("click", () => this.ask("start_mapping", { unfinished: true }));
    for (const id of ["map-discard", "guide-discard"]) $(id).addEventListener("click", () => this.#discard());
    $("guide-choose").addEventListener("click", () => { panels.show("map"); $("maps").focus(); });
    $("map-finish").addEventListener("click", () => this.#finish());
    $("map-localize").addEventListener("click", () => this.ask("localize"));
    $("map-localize-turn").addEventListener("click", async () => {
      const found = await this.ask("localize", { turn: true });
      if (found) this.say([located(found.state), sentence(plain(found.reason))].filter(Boolean).join(" "));
    });
    $("maps").addEventListener("change", () => this.ask("load_map", { name: $("maps").value }));
  }

  begin(can) {
    this.can = can;
    this.section.hidden = !this.#has("list_maps");
    $("map-start").hidden = !this.#has("start_mapping");
    $("map-localize").hidden = $("map-localize-turn").hidden = true; // until a map is in use
    $("maps").disabled = !this.#has("load_map");
    if (this.#has("list_maps")) this.#list();
  }

  // One after the other: what is loaded must not come between the parts of another map.
  #enqueue(work) {
    this.#queue = this.#queue.then(work).catch((error) => this.say(String(error)));
  }

  #has(method) {
    return this.can.has(`method.${method}`);
  }

  async #list() {
    const stored = await this.ask("list_maps");
    if (!stored) return;
    const options = stored.maps.map(({ name, in_use }) => new Option(name, name, in_use, in_use));
    if (!stored.in_use) options.unshift(new Option(t("maps.none"), "", true, true));
    $("maps").replaceChildren(...options);
    this.#stored = stored.maps.length;
    $("maps-label").hidden = this.#stored === 0;
    if (stored.in_use && this.#mapping.state === "idle" && this.#shown !== stored.in_use) {
      this.#shown = stored.in_use;
      this.#enqueue(() => this.#fetch(stored.in_use));
    }
    this.#guide();
  }

  // What to do first, where there is nothing to drive on yet.
  #guide() {
    const { state, unfinished } = this.#mapping;
    const mayMap = this.#has("start_mapping");
    let first = null;
    if (state === "idle" && unfinished) first = "unfinished";
    else if (state === "idle" && this.#inUse === null) first = this.#stored ? "stored" : "new";
    $("guide").hidden = first === null || (first === "stored" ? !this.#has("load_map") : !mayMap);
    $("map-start").hidden = !mayMap || unfinished || state === "mapping" || state === "finishing";
    $("map-start").textContent = t(state === "paused" ? "maps.go_on" : "maps.start");
    if (first === null) return;
    text("guide-title", t(`maps.first_${first}`));
    text("guide-words", t(`maps.first_${first}_words`));
    $("guide-steps").hidden = first === "unfinished" || !mayMap;
    $("guide-start").hidden = first === "unfinished" || !mayMap;
    $("guide-choose").hidden = first !== "stored";
    $("guide-continue").hidden = $("guide-discard").hidden = first !== "unfinished";
  }

  // A stored map by its name; without one, the map that is being made.
  async #fetch(name = null) {
    const isWanted = () => name === null || (this.#mapping.state === "idle" && this.#shown === name);
    if (!isWanted()) return;
    this.#shown = name;
    const texts = [];
    let map = null;
    do {
      const next = await this.ask("get_map", { ...(name ? { name } : {}), part: texts.length });
      if (!next) return;
      if (map && (next.version !== map.version || next.edits !== map.edits)) texts.length = 0; // it has grown or was edited meanwhile
      else texts.push(next.data);
      map = texts.length ? next : null;
    } while (map === null || texts.length < map.parts);
    const cells = await inflate(texts.join(""));
    if (!isWanted()) return; // a map is being made meanwhile, or another one is in use
    const grid = new Grid(map, name);
    grid.put(cells, 0, 0, map.rows, map.columns, this.#colours());
    grid.revision = name ? 0 : map.version;
    this.#use(grid);
  }

  #colours() {
    return { wall: this.view.rgb("wall"), free: this.view.rgb("free") };
  }

  #use(grid) {
    this.grid = grid;
    this.layer.setKnown(true);
    this.view.setBounds(() => grid.corners());
    this.view.draw();
  }

  async #take(part) {
    const cells = await inflate(part.cells);
    const isPart = () => this.grid?.isOf(part) ?? false;
    if (part.whole) {
      this.#use(new Grid(part));
      this.#shown = null;
    } else if (!isPart() || part.revision > this.grid.revision + 1) {
      if (this.#mapping.state === "idle") return; // of a map that is not made any more
      await this.#fetch(); // parts were missed
    }
    const { grid } = this;
    if (!isPart() || (!part.whole && part.revision <= grid.revision)) return;
    grid.put(cells, part.row, part.column, part.part_rows, part.part_columns, this.#colours());
    grid.revision = part.revision;
    this.view.draw();
  }

  #show(mapping) {
    const was = this.#mapping.state;
    this.#mapping = mapping;
    const { state, name, path_m, loops, reason, warning } = mapping;
    const making = state === "mapping" || state === "paused";
    $("map-finish").hidden = $("map-name-label").hidden = !making || !this.#has("finish_mapping");
    $("map-discard").hidden = !making || !this.#has("discard_mapping");
    $("making").hidden = state !== "mapping" || !this.#has("finish_mapping");
    $("maps").disabled = making || !this.#has("load_map");
    if (name && !$("map-name").value) $("map-name").value = name;
    const so_far = t("maps.driven", { distance_m: figure(path_m, 1), count: loops });
    const advice = state === "mapping" ? t("maps.advice") : "";
    if (state !== "idle") text("map-told", [`${mappingWords(state)}: ${so_far}`, plain(warning), plain(reason), advice].filter(Boolean).join(" "));
    else if (was !== "idle") this.#list();
    this.#guide();
  }

  async #finish() {
    const name = $("map-name").value.trim();
    if (!name) {
      this.say(t("maps.name_first"));
      $("map-name").focus();
      return;
    }
    const saved = await this.ask("finish_mapping", { name });
    if (saved) text("map-told", t("maps.saved", { map: saved.name }));
  }

  async #discard() {
    if (await confirmed(t("maps.discard_question"), t("maps.discard_it"))) this.ask("discard_mapping");
  }

  #located(found) {
    this.#inUse = found.map;
    $("map-localize").hidden = $("map-localize-turn").hidden = !found.map || !this.#has("localize");
    this.#guide();
    if (this.#mapping.state !== "idle") return;
    const fit = t("maps.fit", { percent: figure((found.fit ?? 0) * 100, 0) });
    text("map-told", found.map ? [located(found.state), fit, plain(found.reason)].filter(Boolean).join(" ") : t("maps.none_in_use"));
    if (found.map && found.map !== this.#shown) this.#list();
  }
}
