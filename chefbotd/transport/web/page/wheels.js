// The wheels: their speeds against their targets, plotted and in a table, and their gains, set and taken back.

import { $, element } from "./dom.js";
import { SHOWN_HZ } from "./connection.js";
import { Plot } from "./plot.js";
import { figure, ready, t } from "./language.js";
import { wheelName } from "./words.js";

const NAMES = ["kp", "ki", "kd"];
const COLUMNS = 6;
const FIRST_GAIN = 4;

export class Wheels {
  #plot = new Plot($("plot"));
  #isInDoubt = false;

  constructor(connection, ask) {
    this.ask = ask;
    connection.on("wheels", (wheels, { stamp_s }) => this.#show(wheels, stamp_s), SHOWN_HZ);
    $("gains").addEventListener("submit", (event) => {
      event.preventDefault();
      this.#change("set_pid", { wheel: $("gain-wheel").value, [$("gain").value]: $("gain-value").valueAsNumber });
    });
    $("gain-undo").addEventListener("click", () => this.#change("undo_pid"));
  }

  begin(can) {
    $("wheels-part").hidden = !can.has("topic.wheels");
    $("gains").hidden = !can.has("method.set_pid");
    if (can.has("method.get_pid")) ready.then(() => this.#change("get_pid")); // names of wheels are written once
  }

  // Where nobody knows what the motors do, neither speed nor duty is shown.
  doubt(isInDoubt) {
    this.#isInDoubt = isInDoubt;
    if (isInDoubt) for (const row of $("wheels").children) for (const cell of [...row.children].slice(1, FIRST_GAIN)) cell.textContent = "–";
  }

  #show(wheels, stamp_s) {
    if (this.#isInDoubt) return;
    this.#plot.add(stamp_s, wheels);
    wheels.name.forEach((name, index) => {
      const cells = this.#row(name).children;
      const number = (value, digits) => (value === null || value === undefined ? "–" : figure(value, digits));
      cells[0].textContent = wheels.excluded.includes(name) ? t("wheel.excluded", { name: wheelName(name) }) : wheelName(name);
      [number(wheels.velocity_rad_s[index], 2), number(wheels.target_rad_s[index], 2), number(wheels.duty[index], 0)]
        .forEach((words, column) => { cells[column + 1].textContent = words; });
    });
  }

  #row(name) {
    const there = [...$("wheels").children].find((row) => row.dataset.wheel === name);
    if (there) return there;
    const row = element("tr");
    row.dataset.wheel = name;
    row.append(element("th", wheelName(name), { scope: "row" }), ...Array.from({ length: COLUMNS }, () => element("td")));
    $("wheels").append(row);
    return row;
  }

  async #change(method, params = {}) {
    const answer = await this.ask(method, params);
    if (!answer) return;
    const wheels = Object.keys(answer.wheels);
    if ($("gain-wheel").length !== wheels.length + 1) $("gain-wheel").append(...wheels.map((name) => new Option(wheelName(name), name)));
    for (const name of wheels) {
      NAMES.forEach((gain, index) => { this.#row(name).children[FIRST_GAIN + index].textContent = String(answer.wheels[name][gain]); });
    }
  }
}
