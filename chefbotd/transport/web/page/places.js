// Named places of the map in use: go there, save where the robot stands, delete.

const $ = (id) => document.getElementById(id);

export class Places {
  #map = null;

  constructor(ask) {
    this.ask = ask;
    $("place-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.#with("navigate_to", "place");
    });
    $("place-save").addEventListener("click", () => this.#with("save_place", "name"));
    $("place-delete").addEventListener("click", () => this.#with("delete_place", "name"));
  }

  begin(can) {
    this.there = can.has("method.list_places") && can.has("method.navigate_to");
    this.#map = null;
  }

  // The places belong to a map: read anew when another one is in use.
  show(map) {
    if (map === this.#map) return;
    this.#map = map;
    $("place-form").hidden = !this.there || !map;
    if (map) this.#list();
  }

  async #with(method, key) {
    const name = $("place").value.trim();
    if (!name) return $("place").focus();
    if (await this.ask(method, { [key]: name }) && method !== "navigate_to") this.#list();
    return undefined;
  }

  async #list() {
    const answer = this.there && await this.ask("list_places");
    if (answer) $("places").replaceChildren(...answer.places.map(({ name }) => new Option(name)));
  }
}
