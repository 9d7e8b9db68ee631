// Calibration: what to prepare, how far a step is, what it asks, what came of it with its plots, and writing it.

import { confirmed } from "../../confirm.js";
import { $, element, text } from "../../dom.js";
import { knows, t, translate } from "../../language.js";
import { full, parameter, plain, sentence } from "../../words.js";

const named = (step) => (knows(`calibration.step.${step}`) ? t(`calibration.step.${step}`) : sentence(step));
const [WIDTH, HEIGHT, EDGE] = [320, 170, 12];
const COLOURS = ["--accent", "--scan", "--good", "--warn"];

const HTML = `
  <h2 id="calibration-title" data-t="calibration.title"></h2>
  <p id="calibration" role="status"></p>
  <progress id="calibration-done" max="1" aria-labelledby="calibration-title" hidden></progress>
  <form id="calibration-question" class="row" hidden>
    <label for="calibration-value" id="calibration-asked"></label>
    <input id="calibration-value" type="number" step="any" required>
    <button type="submit" data-t="calibration.answer"></button>
  </form>
  <ul id="calibration-steps"></ul>
  <div class="buttons">
    <button type="button" id="calibration-end" data-t="calibration.end" hidden></button>
    <button type="button" id="calibration-apply" data-t="calibration.apply" hidden></button>
  </div>
  <p id="calibration-told" role="status"></p>
  <pre id="calibration-difference" class="small" tabindex="0" hidden></pre>`;

export default class Calibration {
  #can = new Set();
  #ask;
  #steps = [];
  #results = new Map(); // by the step
  #running = "";
  #question = null;

  constructor({ connection, ask, section }) {
    section.innerHTML = HTML;
    translate(section);
    section.setAttribute("aria-labelledby", "calibration-title");
    this.#ask = ask;
    connection.on("calibration", (now) => this.#take(now));
    $("calibration-end").addEventListener("click", () => ask("stop"));
    $("calibration-apply").addEventListener("click", () => this.#apply());
    $("calibration-question").addEventListener("submit", (event) => {
      event.preventDefault();
      if (this.#question) ask("answer_calibration", { key: this.#question.key, value: Number($("calibration-value").value) });
    });
  }

  begin(can) {
    this.#can = can;
    $("calibration-part").hidden = !can.has("method.get_calibration");
    if (can.has("method.get_calibration")) this.#load();
  }

  async #load() {
    const report = await this.#ask("get_calibration");
    if (!report) return;
    this.#steps = report.steps;
    this.#results = new Map(report.results.map((result) => [result.step, result]));
    this.#show();
  }

  #take({ state, step, text: doing, done, question, results }) {
    this.#running = state === "idle" ? "" : step;
    this.#question = question;
    text("calibration", state === "idle" ? "" : `${named(step)}: ${plain(doing)}`);
    $("calibration-done").hidden = state === "idle";
    $("calibration-done").value = done;
    $("calibration-end").hidden = state === "idle";
    $("calibration-question").hidden = question === null;
    if (question) {
      text("calibration-asked", `${question.text} (${question.unit})`);
      Object.assign($("calibration-value"), { min: question.lowest, max: question.highest });
    }
    const isNew = results.some((result) => JSON.stringify(result) !== JSON.stringify({ ...this.#results.get(result.step), plots: [] }));
    if (isNew) this.#load();
    else this.#show();
  }

  async #calibrate(step) {
    const room = step.space_m ? ` ${t("calibration.room", step)}` : "";
    if (!await confirmed(`${full(sentence(plain(step.preparation)))}${room} ${t("calibration.may_move")}`, t("calibration.begin"), t("calibration.do_not_begin"))) return;
    await this.#ask("calibrate", { step: step.name, ...(step.space_m ? { space_m: step.space_m } : {}) });
  }

  async #apply() {
    if (!await confirmed(t("calibration.write_question"), t("calibration.write"), t("calibration.do_not_write"))) return;
    const applied = await this.#ask("apply_calibration");
    if (!applied) return;
    text("calibration-told", t("calibration.written", applied));
    text("calibration-difference", applied.difference);
    $("calibration-difference").hidden = false;
  }

  #show() {
    $("calibration-steps").replaceChildren(...this.#steps.map((step) => this.#row(step)));
    const passed = [...this.#results.values()].some(({ status }) => status === "passed");
    $("calibration-apply").hidden = !passed || this.#running !== "" || !this.#can.has("method.apply_calibration");
  }

  #row(step) {
    const result = this.#results.get(step.name);
    const row = element("li");
    row.append(element("b", named(step.name)), ` – ${step.purpose}`);
    if (step.missing) row.append(element("p", sentence(plain(step.missing)), { className: "small" }));
    else if (this.#can.has("method.calibrate")) {
      const button = element("button", t(result ? "calibration.again" : "calibration.calibrate"), { type: "button", disabled: this.#running !== "" });
      button.setAttribute("aria-label", t(result ? "calibration.again_step" : "calibration.calibrate_step", { step: named(step.name) }));
      button.addEventListener("click", () => this.#calibrate(step));
      row.append(" ", button);
    }
    if (result) row.append(...shown(result));
    return row;
  }
}

function shown(result) {
  const parts = [element("p", [t(`calibration.status.${result.status}`), plain(result.reason)].filter(Boolean).map((words) => full(sentence(words))).join(" "))];
  if (result.estimates.length) parts.push(table(result.estimates));
  if (result.plots.length) {
    const details = element("details");
    details.append(element("summary", t("calibration.plots")), ...result.plots.map(figure));
    parts.push(details);
  }
  return parts;
}

function table(estimates) {
  const wide = element("div", "", { className: "wide" });
  const whole = element("table");
  const head = element("tr");
  head.append(...[t("calibration.parameter"), t("calibration.before"), t("calibration.after"), "±"].map((name) => element("th", name, { scope: "col" })));
  const rows = estimates.map(({ key, before, after, sigma, unit }) => {
    const row = element("tr");
    row.append(element("th", unit ? `${parameter(key)} (${unit})` : parameter(key), { scope: "row", title: key }),
      ...[number(before), number(after), sigma.toPrecision(2)].map((words) => element("td", words)));
    return row;
  });
  whole.append(head, ...rows);
  wide.append(whole);
  return wide;
}

const number = (value, digits = 5) => String(Number(value.toPrecision(digits)));

const svg = (name, attributes) => {
  const drawn = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) drawn.setAttribute(key, value);
  return drawn;
};

// A plot with its axes' bounds in words below; equal axes have one scale.
function figure({ title, x_label, y_label, series, equal }) {
  const [xs, ys] = ["x", "y"].map((axis) => series.flatMap((line) => line[axis]));
  let [[left, right], [low, high]] = [xs, ys].map((all) => [all.reduce((a, b) => Math.min(a, b), Infinity), all.reduce((a, b) => Math.max(a, b), -Infinity)]);
  const [wide, tall] = [Math.max(right - left, 1e-9), Math.max(high - low, 1e-9)];
  const scale = Math.min((WIDTH - 2 * EDGE) / wide, (HEIGHT - 2 * EDGE) / tall);
  const [across, up] = equal ? [scale, scale] : [(WIDTH - 2 * EDGE) / wide, (HEIGHT - 2 * EDGE) / tall];
  const at = (line, index) => [EDGE + (line.x[index] - left) * across, HEIGHT - EDGE - (line.y[index] - low) * up].map((v) => v.toFixed(1));
  const drawn = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": t("calibration.over", { title, y_label, x_label }) });
  series.forEach((line, index) => {
    const colour = `var(${COLOURS[index % COLOURS.length]})`;
    if (line.points) line.x.forEach((_, k) => { const [cx, cy] = at(line, k); drawn.append(svg("circle", { cx, cy, r: 1.6, fill: colour })); });
    else drawn.append(svg("polyline", { points: line.x.map((_, k) => at(line, k).join(",")).join(" "), fill: "none", stroke: colour, "stroke-width": 1.4 }));
  });
  const whole = element("figure", "", { className: "fit" });
  const bounds = { left: number(left, 3), right: number(right, 3), low: number(low, 3), high: number(high, 3) };
  const caption = element("figcaption", `${t("calibration.caption", { title, x_label, y_label, ...bounds })} `, { className: "small" });
  caption.append(...series.flatMap((line, index) => {
    const name = element("span", `● ${line.name} `);
    name.style.setProperty("color", `var(${COLOURS[index % COLOURS.length]})`);
    return [name];
  }));
  whole.append(drawn, caption);
  return whole;
}
