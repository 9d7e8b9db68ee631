// How the battery and the delay were lately, as small plots: a bounded number of samples each.

import { $ } from "./dom.js";
import { figure, t } from "./language.js";

const [WIDTH, HEIGHT, EDGE] = [100, 30, 2];

export class History {
  #samples = []; // [seconds, value], the largest value of each span; null where the connection was lost

  constructor(id, { name, unit, digits, span_s, most, least_range }) {
    Object.assign(this, { figure: $(id), name, unit, digits, span_s, most, least_range });
  }

  add(value, now_s = performance.now() / 1000) {
    const last = this.#samples.at(-1);
    if (last && last[1] !== null && now_s - last[0] < this.span_s) last[1] = Math.max(last[1], value);
    else this.#push(now_s, value);
    this.#show(now_s);
  }

  gap(now_s = performance.now() / 1000) {
    if (this.#samples.length && this.#samples.at(-1)[1] !== null) this.#push(now_s, null);
  }

  #push(...sample) {
    this.#samples.push(sample);
    if (this.#samples.length > this.most) this.#samples.shift();
  }

  #show(now_s) {
    const values = this.#samples.map(([, value]) => value).filter((value) => value !== null);
    const [low, high] = [Math.min(...values), Math.max(...values)];
    const [first_s, middle] = [this.#samples[0][0], (low + high) / 2];
    const [length_s, range] = [Math.max(now_s - first_s, this.span_s), Math.max(high - low, this.least_range)];
    const point = ([at_s, value]) => [
      (WIDTH * (at_s - first_s)) / length_s,
      HEIGHT / 2 - ((value - middle) / range) * (HEIGHT - 2 * EDGE),
    ];
    this.figure.hidden = this.#samples.length < 2;
    let pen = "M";
    const path = this.#samples.map((sample) => {
      if (sample[1] === null) return (pen = "M", "");
      const [x, y] = point(sample).map((number) => number.toFixed(2));
      const command = pen === "M" ? `M${x} ${y}h.01` : `L${x} ${y}`; // alone, it is a dot
      pen = "L";
      return command;
    });
    this.figure.querySelector("path").setAttribute("d", path.join(""));
    const number = (value) => figure(value, this.digits);
    const span = length_s < 90 ? t("history.seconds", { count: Number(length_s.toFixed(0)) }) : t("history.minutes", { count: Number((length_s / 60).toFixed(0)) });
    const shown = number(low) === number(high) ? number(low) : t("history.range", { low: number(low), high: number(high) });
    const words = t("history.words", { name: t(this.name), shown, unit: this.unit, span });
    this.figure.querySelector("svg").setAttribute("aria-label", words);
    this.figure.querySelector("figcaption").textContent = words;
  }
}
