// What is drawn on a map, for people: how large it is, and where it is, pointed out in the view.

import { element } from "../../dom.js";
import { figure, t } from "../../language.js";

const [HALO_PX, LINE_PX] = [9, 3];
const WALL_WIDTH_M = 0.05;
const SIGN = '<svg viewBox="0 0 24 24" aria-hidden="true"><path d="M4 9V4h5M20 9V4h-5M4 15v5h5M20 15v5h-5M12 13a1 1 0 1 0 0-2 1 1 0 0 0 0 2z"/></svg>';

// "2.4 m" of a wall, along its points; "1.2 m²" of an area.
export function sizeOf({ kind, points_m }) {
  if (kind === "wall") return t("zones.size.length", { length_m: figure(lengthOf(points_m), 1) });
  return t("zones.size.area", { area_m2: figure(areaOf(points_m), 1) });
}

// Points one of several shapes out in the view; each has a button of its own, which is pressed while it is pointed out.
export class Highlight {
  #shape = null;

  constructor(view, name) {
    this.view = view;
    view.addLayer(name, "", (c) => this.#paint(c), { order: 33, isInLegend: false }).setKnown(true);
  }

  // The button of a shape, with an ``id``, in a list; ``label`` says which one it is.
  button(shape, label) {
    const button = element("button", "", { type: "button", className: "point-out", title: label, innerHTML: SIGN });
    button.setAttribute("aria-label", label);
    button.setAttribute("aria-pressed", String(this.#shape?.id === shape.id));
    button.addEventListener("click", () => this.#choose(this.#shape?.id === shape.id ? null : shape, button));
    return button;
  }

  // These are the shapes that there are now: one that is gone is not pointed out any more.
  keep(shapes) {
    this.#shape = shapes.find(({ id }) => id === this.#shape?.id) ?? null;
    this.view.draw();
  }

  #choose(shape, button) {
    this.#shape = shape;
    for (const other of button.closest("ul").querySelectorAll(".point-out")) other.setAttribute("aria-pressed", String(other === button && shape !== null));
    if (shape) this.view.showPoints(shape.points_m);
    else this.view.draw();
  }

  #paint(c) {
    if (!this.#shape) return;
    const { kind, points_m, width_m } = this.#shape;
    const { scale } = this.view;
    c.strokeStyle = this.view.colour("accent");
    c.beginPath();
    for (const [x, y] of points_m) c.lineTo(x, y);
    if (kind !== "wall") c.closePath();
    c.globalAlpha = 0.35;
    c.lineWidth = HALO_PX / scale + (kind === "wall" ? width_m ?? WALL_WIDTH_M : 0);
    c.stroke();
    c.globalAlpha = 1;
    c.lineWidth = LINE_PX / scale;
    c.stroke();
  }
}

function lengthOf(points) {
  return points.slice(1).reduce((sum, [x, y], index) => sum + Math.hypot(x - points[index][0], y - points[index][1]), 0);
}

// By the shoelace formula.
function areaOf(points) {
  const twice = points.reduce((sum, [x, y], index) => {
    const [nextX, nextY] = points[(index + 1) % points.length];
    return sum + x * nextY - nextX * y;
  }, 0);
  return Math.abs(twice) / 2;
}
