// What is drawn in the view, in layers: each has a row of the legend, which is its switch, and which is kept over a reload.

import { $, element } from "./dom.js";
import { keep, kept } from "./kept.js";
import { knows } from "./language.js";

export class Layer {
  #row;
  #changed;

  constructor({ name, title, draw, order, isInPixels, isOn, isInLegend, onSwitch }, changed) {
    Object.assign(this, { name, draw, order, isInPixels, isInLegend, onSwitch, isKnown: false });
    this.#changed = changed;
    this.isOn = isInLegend ? kept("layers", {})[name] ?? isOn : true;
    const sign = element("i", "", { className: name });
    this.#row = element("button", "", { type: "button", id: `layer-${name}`, className: "layer", hidden: true });
    this.#row.setAttribute("role", "switch");
    const shown = element("span", title);
    if (knows(`layer.${name}`)) shown.dataset.t = `layer.${name}`; // of the page's own, which are there before its languages
    this.#row.append(sign, shown);
    this.#row.addEventListener("click", () => this.#switch());
    this.#show();
  }

  get row() {
    return this.#row;
  }

  get isDrawn() {
    return this.isKnown && this.isOn;
  }

  // Whether the robot has something of this kind: only then the legend has it.
  setKnown(isKnown) {
    if (this.isKnown === isKnown) return;
    this.isKnown = isKnown;
    this.#row.hidden = !isKnown || !this.isInLegend;
    this.onSwitch(this.isDrawn);
    this.#changed();
  }

  #switch() {
    this.isOn = !this.isOn;
    keep("layers", { ...kept("layers", {}), [this.name]: this.isOn });
    this.#show();
    this.onSwitch(this.isDrawn);
    this.#changed();
  }

  #show() {
    this.#row.setAttribute("aria-checked", String(this.isOn));
  }
}

export class Layers {
  #all = [];
  #draw;

  constructor(draw) {
    this.#draw = draw;
    const isWide = matchMedia("(min-width: 90rem)").matches;
    this.#open(kept("legend", isWide));
    $("layers-show").addEventListener("click", () => {
      keep("legend", $("layers").hidden);
      this.#open($("layers").hidden);
    });
  }

  add(layer) {
    this.#all.push(layer);
    this.#all.sort((one, other) => one.order - other.order);
    $("layers").replaceChildren(...[...this.#all].reverse().map(({ row }) => row));
    return layer;
  }

  // Those that are to be drawn, from below to above.
  drawn(isInPixels) {
    return this.#all.filter((layer) => layer.isDrawn && layer.isInPixels === isInPixels);
  }

  make(description) {
    return this.add(new Layer(description, this.#draw));
  }

  #open(isOpen) {
    $("layers").hidden = !isOpen;
    $("layers-show").setAttribute("aria-expanded", String(isOpen));
  }
}
