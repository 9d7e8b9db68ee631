// Named places of the map in use, or coordinates instead: go there, say that the robot is there, save, delete.

import { confirmed, dismiss } from "../../confirm.js";
import { $ } from "../../dom.js";

export class Places {
  #map = null;
  #poses = new Map();

  constructor(connection, ask, say, route) {
    Object.assign(this, { ask, say, route });
    connection.on("localization", ({ map }) => this.#show(map));
    $("place-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.#named((name) => this.ask("navigate_to", coordinates(name) ?? { place: name }));
    });
    $("place-add").addEventListener("click", () => this.#named((name) => this.#add(name)));
    $("place-here").addEventListener("click", () => this.#named((name) => this.#isAt(name)));
    $("place-save").addEventListener("click", () => this.#named((name) => this.#change("save_place", name)));
    $("place-delete").addEventListener("click", () => this.#named((name) => this.#delete(name)));
  }

  begin(can) {
    this.there = can.has("method.list_places") && can.has("method.navigate_to");
    for (const [id, method] of [["add", "follow_waypoints"], ["here", "set_pose"], ["save", "save_place"], ["delete", "delete_place"]]) {
      $(`place-${id}`).hidden = !can.has(`method.${method}`);
    }
    this.#map = null;
  }

  // The places belong to a map: read anew when another one is in use.
  #show(map) {
    if (map === this.#map) return;
    this.#map = map;
    $("place-form").hidden = !this.there || !map;
    dismiss();
    if (map) this.#list();
  }

  #named(act) {
    const name = $("place").value.trim();
    if (name) act(name);
    else $("place").focus();
  }

  #isAt(name) {
    const pose = coordinates(name) ?? this.#poses.get(name);
    if (pose) this.ask("set_pose", pose);
    else this.say(`There is no place ${name} on this map.`);
  }

  #add(name) {
    const pose = coordinates(name);
    if (pose || this.#poses.has(name)) this.route.add(name, pose ?? { place: name }, pose ?? this.#poses.get(name));
    else this.say(`There is no place ${name} on this map.`);
  }

  async #delete(name) {
    if (await confirmed(`Delete the place ${name} from the map ${this.#map}?`, "Delete it")) this.#change("delete_place", name);
  }

  async #change(method, name) {
    if (await this.ask(method, { name })) this.#list();
  }

  async #list() {
    const answer = this.there && await this.ask("list_places");
    if (!answer) return;
    this.#poses = new Map(answer.places.map(({ name, x_m, y_m, heading_rad }) => [name, { x_m, y_m, heading_rad }]));
    $("places").replaceChildren(...answer.places.map(({ name }) => new Option(name)));
  }
}

// "1.2 3.4 90": metres of the map, and if given the heading in degrees.
function coordinates(words) {
  const numbers = words.split(/[\s,]+/).map(Number);
  if (![2, 3].includes(numbers.length) || !numbers.every(Number.isFinite)) return null;
  const [x_m, y_m, degrees] = numbers;
  return { x_m, y_m, ...(degrees === undefined ? {} : { heading_rad: (degrees * Math.PI) / 180 }) };
}
