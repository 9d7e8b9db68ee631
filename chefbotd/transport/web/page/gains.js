// The wheels' gains beside their speeds: shown, set and taken back.

const $ = (id) => document.getElementById(id);
const NAMES = ["kp", "ki", "kd"];
const FIRST = 4; // column of the first gain

// A wheel's name for people: "front left" for front_left_wheel.
export const shown = (wheel) => wheel.replace(/_wheel$/, "").replaceAll("_", " ");

export class Gains {
  constructor(ask, row) {
    Object.assign(this, { ask, row });
    $("gains").addEventListener("submit", (event) => {
      event.preventDefault();
      this.#change("set_pid", { wheel: $("gain-wheel").value, [$("gain").value]: $("gain-value").valueAsNumber });
    });
    $("gain-undo").addEventListener("click", () => this.#change("undo_pid"));
  }

  begin(can) {
    $("gains").hidden = !can.has("method.set_pid");
    if (can.has("method.get_pid")) this.#change("get_pid");
  }

  async #change(method, params = {}) {
    const answer = await this.ask(method, params);
    if (!answer) return;
    const wheels = Object.keys(answer.wheels);
    if ($("gain-wheel").length !== wheels.length + 1) $("gain-wheel").append(...wheels.map((name) => new Option(shown(name), name)));
    for (const name of wheels) {
      NAMES.forEach((gain, index) => { this.row(name).children[FIRST + index].textContent = String(answer.wheels[name][gain]); });
    }
  }
}
