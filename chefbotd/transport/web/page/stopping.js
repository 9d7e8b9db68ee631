// Sends stops, and says so in the largest type where one did not reach the robot.

import { onContact, keepInSight } from "./stops.js";
import { $, text } from "./dom.js";
import { t } from "./language.js";
import { full, me, refusal } from "./words.js";

const ANSWER_MS = 800;
const LOST = new Set(["not_connected", "connection_ended"]);

export class Stopping {
  #wanted = ""; // what did not reach the robot yet
  #timer = null;
  #atBoard = false; // what is shown is that the board did not get it

  // ``isInDoubt`` tells whether it is unknown what the motors do though the daemon answers.
  constructor(connection, driver, say, isInDoubt) {
    Object.assign(this, { connection, say, isInDoubt });
    for (const name of ["estop", "stop"]) {
      driver.addEventListener(name, () => this.#press(name));
      onContact($(name), () => { this.#press(name); driver.dead(); });
    }
    $("unreached-hide").addEventListener("click", () => this.#hide());
    keepInSight($("stops"), "bottom");
    keepInSight($("unreached"), "top");
  }

  // The daemon has let this page in: what did not reach it is sent now. A plain stop that is late is none that is wanted.
  begin() {
    if (this.#wanted === "estop") this.#send("estop");
    else if (this.#wanted) this.#hide();
  }

  // The board is connected and obeys, or stops by itself; the daemon's first line to it was a stop.
  settled() {
    if (this.#atBoard) this.#hide();
  }

  #press(name) {
    if (this.#wanted !== "estop") this.#wanted = name;
    this.#send(name);
  }

  async #send(name) {
    if (this.connection.open) this.#timer ??= setTimeout(() => this.#warn(name, t("stop.no_answer")), ANSWER_MS);
    try {
      await this.connection.request(name, name === "estop" ? { reason: `by ${me}` } : {});
      this.say("");
      if (name === "estop" || this.#wanted !== "estop") this.#hide();
      if (this.isInDoubt()) this.#warn(name, t("stop.no_board"), { atBoard: true });
    } catch (error) {
      this.#forgetTimer();
      const isLost = LOST.has(error.kind);
      if (!isLost || $("login").open) this.#wanted = "";
      this.say(refusal(error));
      this.#warn(name, $("login").open ? t("refused.unauthenticated") : isLost ? t("stop.not_connected") : full(refusal(error)));
    }
  }

  #warn(name, why, { atBoard = false } = {}) {
    this.#atBoard = atBoard;
    text("unreached-words", t(`stop.unreached_${name}`));
    text("unreached-why", [why, t("stop.hold"), this.#wanted === "estop" ? t("stop.again") : ""].filter(Boolean).join(" "));
    $("unreached").hidden = false;
  }

  #forgetTimer() {
    clearTimeout(this.#timer);
    this.#timer = null;
  }

  #hide() {
    this.#forgetTimer();
    [this.#wanted, this.#atBoard] = ["", false];
    $("unreached").hidden = true;
    text("unreached-words", "");
    text("unreached-why", "");
  }
}
