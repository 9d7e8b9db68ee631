// Sends stops, and says so in the largest type where one did not reach the robot.

import { onContact, keepInSight } from "./stops.js";
import { $, text } from "./dom.js";
import { full, me, refusal } from "./words.js";

const ANSWER_MS = 800;
const NAMES = { estop: "The emergency stop", stop: "The stop" };
const HOLD = "The robot may still be driving. Hold it or switch its motors off.";
const AGAIN = "It is sent again when the connection is back.";
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
    if (this.connection.open) this.#timer ??= setTimeout(() => this.#warn(name, "There is no answer yet."), ANSWER_MS);
    try {
      await this.connection.request(name, name === "estop" ? { reason: `by ${me}` } : {});
      this.say("");
      if (name === "estop" || this.#wanted !== "estop") this.#hide();
      if (this.isInDoubt()) this.#warn(name, "The board does not get it.", { atBoard: true });
    } catch (error) {
      this.#forgetTimer();
      const isLost = LOST.has(error.kind);
      if (!isLost || $("login").open) this.#wanted = "";
      this.say(refusal(error));
      this.#warn(name, $("login").open ? "Log in first." : isLost ? "Not connected." : full(refusal(error)));
    }
  }

  #warn(name, why, { atBoard = false } = {}) {
    this.#atBoard = atBoard;
    text("unreached-words", `${NAMES[name]} did not reach the robot`);
    text("unreached-why", [why, HOLD, this.#wanted === "estop" ? AGAIN : ""].filter(Boolean).join(" "));
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
