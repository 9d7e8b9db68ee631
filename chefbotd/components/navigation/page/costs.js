// What it costs to drive where, and what is not on the map: asked for only while it is shown.

import { $, element } from "../../dom.js";
import { Grid, inflate } from "../maps/grid.js";

const TOPICS = ["costmap", "obstacles"];

export class Costs {
  #queue = Promise.resolve();

  constructor(connection, ask, view) {
    Object.assign(this, { ask, view, topics: [], revision: null });
    view.addTool(element("label", "", { id: "costs-label", hidden: true, innerHTML: '<input type="checkbox" id="costs"> Costs and obstacles' }));
    connection.addEventListener("topic:costmap", ({ detail }) => {
      this.#queue = this.#queue.then(() => this.#take(detail.data));
    });
    connection.addEventListener("topic:obstacles", ({ detail }) => {
      if (!$("costs").checked) return;
      view.obstacles = detail.data;
      view.draw();
    });
    $("costs").addEventListener("change", () => this.#show());
  }

  begin(can) {
    this.topics = TOPICS.filter((topic) => can.has(`topic.${topic}`));
    $("costs-label").hidden = this.topics.length === 0;
    if (this.topics.length && $("costs").checked) this.#show();
  }

  #show() {
    const { checked } = $("costs");
    for (const topic of this.topics) { // of costs no part may be skipped
      this.ask(checked ? "subscribe" : "unsubscribe", { topics: [topic], ...(checked && topic === "costmap" ? { policy: "ordered" } : {}) });
    }
    if (checked) return;
    this.view.costs = this.view.obstacles = this.revision = null;
    this.view.draw();
  }

  async #take(part) {
    const cells = await inflate(part.cells);
    if (!$("costs").checked) return;
    const { view } = this;
    if (this.revision !== part.revision) view.costs = new Grid(part);
    this.revision = part.revision;
    view.costs.put(cells, part.row, part.column, part.part_rows, part.part_columns, view.rgbOfCosts);
    view.draw();
  }
}
