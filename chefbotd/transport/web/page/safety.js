// The card at the top: whether the robot may move, why not, and who drives; and the buttons that stop and arm it.

import { $, text } from "./dom.js";
import { limit, me, MODES, plain } from "./words.js";

const UNKNOWN = ["warn", "Waiting for the robot", "it has not said yet how it is"];
const STALLED = ["warn", "The robot does not answer", "what is shown may be old; it brakes by itself when nobody drives it"];
const LOST = ["warn", "Not connected", "trying again; the robot brakes by itself when nobody drives it"];

export class SafetyCard {
  #state = UNKNOWN;
  #latch = null; // what the person who presses "arm" has seen
  #armed = false;

  constructor(connection, ask, driver) {
    Object.assign(this, { driver, mayArm: true });
    connection.addEventListener("closed", () => { this.#state = UNKNOWN; this.#show(LOST); });
    connection.addEventListener("stalled", ({ detail }) => this.#show(detail ? STALLED : this.#state));
    connection.on("safety", (safety) => this.#take(safety));
    const estop = () => ask("estop", { reason: `by ${me}` });
    const stop = () => ask("stop");
    driver.addEventListener("estop", estop);
    driver.addEventListener("stop", stop);
    $("estop").addEventListener("click", () => { estop(); driver.dead(); });
    $("stop").addEventListener("click", () => { stop(); driver.dead(); });
    $("arm").addEventListener("click", () => ask("arm", this.#latch === null ? {} : { latch: this.#latch }));
  }

  begin(can) {
    $("arm").hidden = !(this.mayArm = can.has("method.arm"));
  }

  #take(safety) {
    if (this.#armed && !safety.armed) this.driver.dead(); // what is still pressed is no wish to go on once it is armed
    [this.#latch, this.#armed] = [safety.latch ?? null, safety.armed];
    const [kind, word] = MODES[safety.mode] ?? ["warn", safety.mode];
    this.#state = [kind, word, safety.armed ? limited(safety) : this.#why(safety)];
    this.#show(this.#state);
    const drivers = Object.entries(safety.control).map(([source, client]) => `${plain(client)} (${source})`);
    text("drivers", drivers.join(", ") || (safety.source ?? "nobody"));
    $("arm").disabled = safety.armed;
    $("arm").classList.toggle("wanted", !safety.armed && safety.mode !== "no_board");
  }

  #why({ mode, reason }) {
    const arm = this.mayArm ? "When it is safe, press Arm." : "Somebody who may drive has to arm it.";
    return `${plain(reason)}. ${mode === "no_board" ? "" : arm}`;
  }

  // A fault interrupts a screen reader; everything else waits for its turn.
  #show([kind, word, reason]) {
    $("mode-told").setAttribute("aria-live", kind === "bad" ? "assertive" : "polite");
    if ($("mode").className !== `mode ${kind}`) $("mode").className = `mode ${kind}`;
    text("mode-word", word);
    text("mode-reason", reason ? `– ${reason}` : "");
    document.body.classList.toggle("old", this.#state === UNKNOWN || [STALLED[1], LOST[1]].includes(word));
  }
}

function limited({ limited_by: by }) {
  return by ? `slower than asked: ${limit(by)}` : "";
}
