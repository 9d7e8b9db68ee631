// What it costs to drive where, and what is not on the map: asked for only while it is shown.

import { t } from "../../language.js";
import { Grid, inflate } from "../maps/grid.js";

export class Costs {
  #queue = Promise.resolve();
  #grid = null;
  #obstacles = null;
  #revision = null;

  constructor(connection, ask, view) {
    Object.assign(this, { ask, view });
    const layer = (name, title, draw, order) => view.addLayer(name, title, draw, {
      order, isOn: false, onSwitch: (isDrawn) => this.#switch(name, isDrawn),
    });
    this.layers = {
      costmap: layer("costmap", t("navigation.layer.costs"), (c) => this.#grid?.draw(c), 20),
      obstacles: layer("obstacles", t("navigation.layer.obstacles"), (c) => this.#paintObstacles(c), 40),
    };
    view.onColours.push(() => this.#grid?.repaint(this.#colours()));
    connection.addEventListener("topic:costmap", ({ detail }) => {
      this.#queue = this.#queue.then(() => this.#take(detail.data));
    });
    connection.addEventListener("topic:obstacles", ({ detail }) => {
      this.#obstacles = detail.data;
      view.draw();
    });
  }

  begin(can) {
    for (const [topic, layer] of Object.entries(this.layers)) {
      if (layer.isDrawn && can.has(`topic.${topic}`)) this.#subscribe(topic); // the connection is a new one
      layer.setKnown(can.has(`topic.${topic}`));
    }
  }

  #switch(topic, isDrawn) {
    if (isDrawn) return void this.#subscribe(topic);
    this.ask("unsubscribe", { topics: [topic] });
    if (topic === "costmap") this.#grid = this.#revision = null;
    else this.#obstacles = null;
  }

  // Of costs no part may be skipped.
  #subscribe(topic) {
    this.ask("subscribe", { topics: [topic], ...(topic === "costmap" ? { policy: "ordered" } : {}) });
  }

  #colours() {
    const cost = this.view.rgb("cost");
    return { wall: cost, free: cost, opacity: (percent) => 1.4 * percent };
  }

  async #take(part) {
    const cells = await inflate(part.cells);
    if (!this.layers.costmap.isDrawn) return;
    if (this.#revision !== part.revision) this.#grid = new Grid(part);
    this.#revision = part.revision;
    this.#grid.put(cells, part.row, part.column, part.part_rows, part.part_columns, this.#colours());
    this.view.draw();
  }

  // Who moves has a line as long as the way of the next second.
  #paintObstacles(c) {
    if (!this.#obstacles) return;
    const { view } = this;
    const { x_m, y_m, dynamic_obstacles } = this.#obstacles;
    c.fillStyle = view.colour("obstacle");
    const dot = Math.max(0.04, 3 / view.scale);
    x_m.forEach((x, index) => c.fillRect(x - dot / 2, y_m[index] - dot / 2, dot, dot));
    for (const { x_m: x, y_m: y, vx_m_s, vy_m_s } of dynamic_obstacles) view.line([[x, y], [x + vx_m_s, y + vy_m_s]], view.colour("obstacle"), 3);
  }
}
