// A plot of any number that the robot tells, up to four at a time. It has a connection of its own, which is open only
// while the card is seen: so it changes nothing of what other cards have asked for, and costs nothing out of sight.

import { $, element } from "../../dom.js";
import { keep, kept } from "../../kept.js";
import { figure, t, translate } from "../../language.js";
import { OwnConnection } from "../../own_connection.js";
import { draw, short } from "./drawing.js";
import { Line, numbersIn } from "./lines.js";

const HTML = `
  <h2 id="plot-title" data-t="plot.title"></h2>
  <form class="row" id="plot-form">
    <label><span data-t="plot.topic"></span> <select id="plot-topic"></select></label>
    <label><span data-t="plot.number"></span> <select id="plot-number"></select></label>
    <button type="submit" data-t="plot.add"></button>
  </form>
  <p class="small" id="plot-told" role="status"></p>
  <canvas id="plot-lines" role="img" aria-labelledby="plot-title" aria-describedby="plot-described"></canvas>
  <label id="plot-back-part"><span data-t="plot.back"></span> <input type="range" id="plot-back" max="0" value="0"></label>
  <div class="row">
    <label><span data-t="plot.span"></span> <select id="plot-span"></select></label>
    <button type="button" id="plot-pause" aria-pressed="false" data-t="plot.pause"></button>
  </div>
  <div class="wide" id="plot-table" role="group" tabindex="0" aria-labelledby="plot-title" hidden><table>
    <caption class="unseen" id="plot-described" data-t="plot.described"></caption>
    <thead><tr><th scope="col" data-t="plot.line"></th><th scope="col" data-t="plot.latest"></th><th scope="col" id="plot-then"></th>
      <th scope="col"><span class="unseen" data-t="plot.remove"></span></th></tr></thead>
    <tbody id="plot-rows"></tbody>
  </table></div>`;
const [MOST_LINES, LINE_HZ, CHOICE_HZ] = [4, 20, 2];
const [DRAW_MS, TELL_MS] = [100, 500];
const SPANS_S = [10, 30, 60, 300];

export default class Plot {
  #lines = [];
  #span_s = 30;
  #frozen_s = null; // the right edge of a plot that is paused
  #cursor = null; // how long before the right edge is looked at, in seconds; null: nowhere
  #offset = null; // the daemon's clock less the browser's, as the message that was quickest has it
  #told = 0;
  #timer = null;
  #numbers = [];
  #heard = new Set(); // the topics that are listened to; what is subscribed to decides which of them come

  constructor({ connection, section }) {
    section.innerHTML = HTML;
    section.setAttribute("aria-labelledby", "plot-title");
    translate(section);
    this.section = section;
    const { lines = [], span_s = this.#span_s } = kept("plot", {});
    this.#lines = lines.slice(0, MOST_LINES).map((line) => new Line(line));
    this.#span_s = SPANS_S.includes(span_s) ? span_s : this.#span_s;
    $("plot-span").append(...SPANS_S.map((span) => new Option(span < 60 ? t("plot.seconds", { count: span }) : t("plot.minutes", { count: span / 60 }), span, false, span === this.#span_s)));
    this.own = new OwnConnection(connection, section, { name: "plot of a page", begin: () => this.#subscribe(), follow: (isSeen) => this.#follow(isSeen) });
    this.own.addEventListener("closed", () => this.#interrupt());
    this.#listen();
    this.#showRows();
    this.#look(null);
  }

  begin(can) {
    const topics = [...can].filter((name) => name.startsWith("topic.")).map((name) => name.slice("topic.".length)).toSorted();
    const chosen = $("plot-topic").value;
    $("plot-topic").replaceChildren(new Option(t("plot.choose"), ""), ...topics.map((topic) => new Option(topic.replaceAll("_", " "), topic, false, topic === chosen)));
    this.topics = new Set(topics);
    this.section.hidden = !can.has("method.subscribe") && !topics.length;
    this.own.allow(!this.section.hidden);
  }

  #listen() {
    $("plot-topic").addEventListener("change", () => {
      this.#offer([]);
      this.#subscribe();
    });
    $("plot-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.#add();
    });
    $("plot-span").addEventListener("change", () => {
      this.#span_s = Number($("plot-span").value);
      this.#look(null);
      this.#keep();
    });
    $("plot-pause").addEventListener("click", () => {
      this.#frozen_s = this.#frozen_s === null ? this.#now_s() : null;
      $("plot-pause").setAttribute("aria-pressed", String(this.#frozen_s !== null));
      this.#paint();
    });
    $("plot-back").addEventListener("input", () => this.#look(-Number($("plot-back").value)));
    $("plot-lines").addEventListener("pointermove", (event) => this.#look(this.#span_s * (1 - event.offsetX / event.target.clientWidth)));
    $("plot-lines").addEventListener("pointerleave", () => this.#look(null));
  }

  // Look at what was so long before the right edge.
  #look(ago_s) {
    this.#cursor = ago_s === null || ago_s <= 0 ? null : Math.min(ago_s, this.#span_s);
    Object.assign($("plot-back"), { min: -this.#span_s, step: this.#span_s / 200, value: -(this.#cursor ?? 0) });
    $("plot-back").setAttribute("aria-valuetext", this.#thenWords());
    this.#paint();
    this.#tell();
  }

  #thenWords() {
    return this.#cursor === null ? t("plot.now") : t("plot.ago", { seconds: figure(this.#cursor, 1) });
  }

  #add() {
    const number = this.#numbers[Number($("plot-number").value)];
    const topic = $("plot-topic").value;
    if (!topic || !number) return this.#say(t("plot.choose_first"));
    const line = new Line({ topic, keys: number.keys, label: `${topic.replaceAll("_", " ")}: ${number.label}` });
    if (this.#lines.some(line.isSame)) return this.#say(t("plot.there_already"));
    if (this.#lines.length >= MOST_LINES) return this.#say(t("plot.full"));
    this.#lines.push(line);
    this.#say("");
    return this.#changed();
  }

  #remove(line) {
    this.#lines = this.#lines.filter((other) => other !== line);
    this.#changed();
    ($("plot-rows").querySelector("button") ?? $("plot-topic")).focus();
  }

  #changed() {
    this.#keep();
    this.#showRows();
    this.#paint();
    this.#subscribe();
  }

  #keep() {
    keep("plot", { span_s: this.#span_s, lines: this.#lines.map(({ topic, keys, label }) => ({ topic, keys, label })) });
  }

  #say(words) {
    $("plot-told").textContent = words;
  }

  // What is plotted comes often, what is only to be chosen from seldom; nothing else comes.
  async #subscribe() {
    if (!this.own.open) return;
    const plotted = [...new Set(this.#lines.map(({ topic }) => topic))].filter((topic) => this.topics.has(topic));
    const chosen = [$("plot-topic").value].filter((topic) => topic && !plotted.includes(topic));
    for (const topic of [...plotted, ...chosen]) {
      if (!this.#heard.has(topic)) this.own.addEventListener(`topic:${topic}`, ({ detail }) => this.#take(detail));
      this.#heard.add(topic);
    }
    try {
      await this.own.request("unsubscribe", {});
      for (const [topics, max_rate_hz] of [[plotted, LINE_HZ], [chosen, CHOICE_HZ]]) if (topics.length) await this.own.request("subscribe", { topics, max_rate_hz });
    } catch (error) {
      if (this.own.open) this.#say(error.message);
    }
  }

  #take({ topic, stamp_s, age_s = 0, data }) {
    const offset = stamp_s + age_s - performance.now() / 1000;
    this.#offset = this.#offset === null || Math.abs(offset - this.#offset) > 5 ? offset : Math.max(this.#offset, offset);
    for (const line of this.#lines) if (line.topic === topic) line.add(stamp_s, data);
    if (topic === $("plot-topic").value && !this.#numbers.length) this.#offer(numbersIn(data));
  }

  #offer(numbers) {
    this.#numbers = numbers;
    $("plot-number").replaceChildren(...numbers.map(({ label }, index) => new Option(label, index)));
  }

  // Nothing is known of the time without a connection.
  #interrupt() {
    for (const line of this.#lines) if (line.stamps.length) line.add(line.stamps.at(-1) + 0.001, null);
  }

  #follow(isSeen) {
    clearInterval(this.#timer);
    if (isSeen) this.#timer = setInterval(() => this.#refresh(), DRAW_MS);
  }

  #refresh() {
    if (this.#frozen_s === null) this.#paint();
    if (performance.now() - this.#told > TELL_MS) this.#tell();
  }

  #now_s() {
    return this.#offset === null ? 0 : performance.now() / 1000 + this.#offset;
  }

  #paint() {
    const to_s = this.#frozen_s ?? this.#now_s();
    const from_s = to_s - this.#span_s;
    const series = this.#lines.map((line) => ({ unit: line.unit, points: line.between(from_s, to_s) }));
    const words = this.#lines.length ? "" : t("plot.empty");
    draw($("plot-lines"), series, [from_s, to_s], this.#cursor === null ? null : to_s - this.#cursor, words);
  }

  // The numbers of the table: those of now, and those of the time that is looked at.
  #tell() {
    this.#told = performance.now();
    $("plot-then").textContent = this.#thenWords();
    const then_s = (this.#frozen_s ?? this.#now_s()) - (this.#cursor ?? 0);
    [...$("plot-rows").children].forEach((row, index) => {
      const line = this.#lines[index];
      const [latest, then] = row.querySelectorAll("td");
      latest.textContent = withUnit(line.values.at(-1) ?? null, line.unit);
      then.textContent = withUnit(line.at(then_s), line.unit);
    });
  }

  #showRows() {
    $("plot-rows").replaceChildren(...this.#lines.map((line) => {
      const row = element("tr");
      const name = element("th", "", { scope: "row" });
      name.append(element("span", "", { className: "swatch" }), line.label);
      const button = element("button", t("plot.remove"), { type: "button" });
      button.setAttribute("aria-label", t("plot.remove_line", { line: line.label }));
      button.addEventListener("click", () => this.#remove(line));
      const last = element("td");
      last.append(button);
      row.append(name, element("td", "–"), element("td", "–"), last);
      return row;
    }));
    $("plot-table").hidden = this.#lines.length === 0;
    this.#tell();
  }
}

function withUnit(value, unit) {
  return value === null ? "–" : `${short(value)} ${unit}`.trim();
}
