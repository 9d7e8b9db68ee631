// Making and choosing maps, and what is known of where the robot is.

import { Grid, inflate } from "./grid.js";

const $ = (id) => document.getElementById(id);
const NO_MAP = "No map is in use. Start one and drive through the rooms, then finish it; or choose one that is stored.";
const LOCATED = {
  unknown: "It is not known where the robot is.",
  searching: "Looking for where the robot is; drive a bit.",
  localized: "The robot knows where it is.",
  uncertain: "The robot is not sure where it is.",
  lost: "The robot is lost; drive a bit, or say where it is.",
};

export class Maps {
  #queue = Promise.resolve();
  #shown = null;
  #mapping = "idle";

  constructor(connection, view, say) {
    Object.assign(this, { connection, view, say, can: new Set() });
    const on = (topic, take) => connection.addEventListener(`topic:${topic}`, ({ detail }) => take(detail.data));
    on("map", (part) => { this.#queue = this.#queue.then(() => this.#take(part)).catch((error) => say(String(error))); });
    on("mapping", (mapping) => this.#show(mapping));
    on("localization", (found) => this.#located(found));
    connection.addEventListener("closed", () => { this.#shown = null; });
    $("map-start").addEventListener("click", () => this.#ask("start_mapping"));
    $("map-finish").addEventListener("click", () => this.#finish());
    $("map-localize").addEventListener("click", () => this.#ask("localize"));
    $("map-localize-turn").addEventListener("click", async () => {
      const found = await this.#ask("localize", { turn: true });
      if (found) this.say(`${found.state}: ${found.reason}`);
    });
    $("maps").addEventListener("change", () => this.#ask("load_map", { name: $("maps").value }));
  }

  begin(can) {
    this.can = can;
    const has = (method) => can.has(`method.${method}`);
    $("map-part").hidden = !has("list_maps");
    $("map-start").hidden = !has("start_mapping");
    $("map-localize").hidden = $("map-localize-turn").hidden = true; // until a map is in use
    $("maps").disabled = !has("load_map");
    if (has("list_maps")) this.#list();
  }

  async #ask(method, params = {}) {
    try {
      const answer = await this.connection.request(method, params);
      this.say("");
      return answer;
    } catch (error) {
      this.say(error.message);
      return null;
    }
  }

  async #list() {
    const stored = await this.#ask("list_maps");
    if (!stored) return;
    const options = stored.maps.map(({ name, in_use }) => new Option(name, name, in_use, in_use));
    if (!stored.in_use) options.unshift(new Option("none", "", true, true));
    $("maps").replaceChildren(...options);
    $("maps-label").hidden = stored.maps.length === 0;
    if (stored.in_use && this.#mapping === "idle" && this.#shown !== stored.in_use) this.#fetch(stored.in_use);
  }

  // A stored map by its name; without one, the map that is being made.
  async #fetch(name = null) {
    this.#shown = name;
    const texts = [];
    let map = null;
    do {
      const next = await this.#ask("get_map", { ...(name ? { name } : {}), part: texts.length });
      if (!next) return;
      if (map && next.version !== map.version) texts.length = 0; // it has grown meanwhile
      else texts.push(next.data);
      map = texts.length ? next : null;
    } while (map === null || texts.length < map.parts);
    const grid = new Grid(map);
    grid.put(await inflate(texts.join("")), 0, 0, map.rows, map.columns, this.view.rgb);
    grid.revision = name ? 0 : map.version;
    this.view.grid = grid;
    $("legend-map").hidden = false;
    this.view.draw();
  }

  async #take(part) {
    const cells = await inflate(part.cells);
    let { grid } = this.view;
    if (part.whole) {
      this.view.grid = new Grid(part);
      this.#shown = null;
      $("legend-map").hidden = false;
    }
    else if (!grid || this.#shown !== null || part.revision > grid.revision + 1) await this.#fetch(); // parts were missed
    ({ grid } = this.view);
    if (!grid || (!part.whole && part.revision <= grid.revision)) return;
    grid.put(cells, part.row, part.column, part.part_rows, part.part_columns, this.view.rgb);
    grid.revision = part.revision;
    this.view.draw();
  }

  #show(mapping) {
    const was = this.#mapping;
    this.#mapping = mapping.state;
    const making = mapping.state === "mapping" || mapping.state === "paused";
    $("map-start").hidden = mapping.state === "mapping" || mapping.state === "finishing" || !this.can.has("method.start_mapping");
    $("map-finish").hidden = $("map-name-label").hidden = !making || !this.can.has("method.finish_mapping");
    $("maps").disabled = making || !this.can.has("method.load_map");
    if (mapping.name && !$("map-name").value) $("map-name").value = mapping.name;
    if (mapping.state !== "idle") $("map-told").textContent = `${mapping.state}: ${mapping.path_m.toFixed(1)} m driven, ${mapping.loops} loops ${mapping.reason ?? ""}`;
    else if (was !== "idle") this.#list();
  }

  async #finish() {
    const name = $("map-name").value.trim();
    if (!name) {
      this.say("Give the map a name first.");
      $("map-name").focus();
      return;
    }
    const saved = await this.#ask("finish_mapping", { name });
    if (saved) $("map-told").textContent = `Saved as ${saved.name}.`;
  }

  #located(found) {
    $("map-localize").hidden = $("map-localize-turn").hidden = !found.map || !this.can.has("method.localize");
    if (this.#mapping !== "idle") return;
    $("map-told").textContent = found.map ? `${LOCATED[found.state] ?? found.state} Fit ${((found.fit ?? 0) * 100).toFixed(0)} %. ${found.reason ?? ""}` : NO_MAP;
    if (found.map && found.map !== this.#shown) this.#list();
  }
}
