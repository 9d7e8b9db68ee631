// Named places of the map in use, on the map and as buttons, or coordinates instead: go there, say that the robot is there, save, delete.

import { confirmed, dismiss } from "../../confirm.js";
import { $, element } from "../../dom.js";
import { t } from "../../language.js";

export class Places {
  #map = null;
  #poses = new Map();

  constructor(connection, ask, say, route, marks) {
    Object.assign(this, { ask, say, route, marks, all: [] });
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
    this.canList = can.has("method.list_places");
    this.there = this.canList && can.has("method.navigate_to");
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
    else this.#draw([]);
  }

  // At a pose of the map; a name that is there already is asked about.
  async save(name, pose) {
    if (this.#poses.has(name) && !(await confirmed(t("navigation.move_place", { place: name, map: this.#map }), t("navigation.move_it")))) return;
    if (await this.ask("save_place", { name, ...pose })) this.#list();
  }

  #named(act) {
    const name = $("place").value.trim();
    if (name) act(name);
    else $("place").focus();
  }

  #isAt(name) {
    const pose = coordinates(name) ?? this.#poses.get(name);
    if (pose) this.ask("set_pose", pose);
    else this.say(t("navigation.no_such_place", { place: name }));
  }

  #add(name) {
    const pose = coordinates(name);
    if (pose || this.#poses.has(name)) this.route.add(name, pose ?? { place: name }, pose ?? this.#poses.get(name));
    else this.say(t("navigation.no_such_place", { place: name }));
  }

  async #delete(name) {
    if (await confirmed(t("navigation.delete_place", { place: name, map: this.#map }), t("navigation.delete_it"))) this.#change("delete_place", name);
  }

  async #change(method, name) {
    if (await this.ask(method, { name })) this.#list();
  }

  async #list() {
    const answer = this.canList && await this.ask("list_places");
    if (answer) this.#draw(answer.places);
  }

  #draw(places) {
    this.all = places;
    this.#poses = new Map(places.map(({ name, x_m, y_m, heading_rad }) => [name, { x_m, y_m, heading_rad }]));
    $("places").replaceChildren(...places.map(({ name }) => new Option(name)));
    $("place-list").replaceChildren(...places.map(({ name }) => this.#item(name)));
    $("place-list-part").hidden = !this.there || !places.length;
    this.marks.show({ places });
  }

  #item(name) {
    const go = element("button", name, { type: "button", ariaLabel: t("navigation.go_to_place", { place: name }) });
    go.addEventListener("click", () => this.ask("navigate_to", { place: name }));
    const item = element("li");
    item.append(go);
    return item;
  }
}

// "1.2 3.4 90": metres of the map, and if given the heading in degrees.
function coordinates(words) {
  const numbers = words.split(/[\s,]+/).map(Number);
  if (![2, 3].includes(numbers.length) || !numbers.every(Number.isFinite)) return null;
  const [x_m, y_m, degrees] = numbers;
  return { x_m, y_m, ...(degrees === undefined ? {} : { heading_rad: (degrees * Math.PI) / 180 }) };
}
