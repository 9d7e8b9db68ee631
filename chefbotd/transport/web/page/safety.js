// The card at the top: whether the robot may move, why not, and who drives. It says "stopped" only where that is known.

import { $, text } from "./dom.js";
import { ready, t } from "./language.js";
import { doubt, driverName, full, limit, mode, plain, sentence, unplugged } from "./words.js";

const NOT_HEARD = new Set(["down", "silent", "wrong_baud", "wrong_device", "echo_stuck"]); // conditions in which a board may not obey
const SAME_TIME_S = 0.1;

export class SafetyCard {
  #safety = null;
  #latch = null; // what the person who presses "arm" has seen
  #link = null;
  #connection = "begins"; // "works", "stalled", "closed"
  #deadman_ms = null; // of a board that stops by itself, as it was while it was connected
  #before = { deadman_ms: null, until_s: -Infinity };
  #mayArm = true;

  // ``told`` is called with whether it is unknown what the motors do.
  constructor(connection, ask, driver, told) {
    Object.assign(this, { driver, told });
    connection.addEventListener("closed", () => { this.#safety = this.#link = null; this.#connection = "closed"; this.#show(); });
    connection.addEventListener("stalled", ({ detail }) => this.#heard(!detail));
    connection.on("link", (link, { stamp_s }) => this.#takeLink(link, stamp_s));
    connection.on("firmware", ({ deadman_ms }, { stamp_s }) => this.#takeFirmware(deadman_ms ?? null, stamp_s));
    connection.on("safety", (safety) => this.#take(safety));
    ready.then(() => this.#show());
    $("arm").addEventListener("click", () => ask("arm", this.#latch === null ? {} : { latch: this.#latch }));
  }

  begin(can) {
    $("arm").hidden = !(this.#mayArm = can.has("method.arm"));
  }

  // Whether it is unknown what the motors do.
  get isInDoubt() {
    return this.#doubt() !== null;
  }

  #heard(isHeard) {
    if (isHeard && this.#connection === "closed") this.#deadman_ms = null; // another board may be there now
    this.#connection = isHeard ? "works" : "stalled";
    this.#show();
  }

  #take(safety) {
    if (this.#safety?.armed && !safety.armed) this.driver.dead(); // what is still pressed is no wish to go on once it is armed
    [this.#safety, this.#latch] = [safety, safety.latch ?? null];
    $("arm").disabled = safety.armed;
    $("arm").classList.toggle("wanted", !safety.armed && safety.mode !== "no_board");
    this.#show();
  }

  // A board that is gone says last that it does not stop by itself any more: what counts is what it said before.
  #takeFirmware(deadman_ms, stamp_s) {
    if (this.#link?.state === "down") return;
    this.#before = { deadman_ms: this.#deadman_ms, until_s: stamp_s };
    this.#deadman_ms = deadman_ms;
    this.#show();
  }

  #takeLink(link, stamp_s) {
    const isLost = link.state === "down" && this.#link?.state === "up";
    if (isLost && stamp_s - this.#before.until_s < SAME_TIME_S) this.#deadman_ms ??= this.#before.deadman_ms;
    if (link.state === "up" && this.#link?.state === "down") this.#deadman_ms = null;
    this.#link = link;
    this.#show();
  }

  // Why it is unknown what the motors do; null where it is known.
  #doubt() {
    if (this.#connection === "closed") return $("login").open ? t("refused.unauthenticated") : t("connection.trying");
    if (this.#connection === "stalled" && this.#safety) return t("connection.old");
    if (!this.#safety || this.#safety.mode === "no_board") return null;
    if (this.#safety.fault === "board_unresponsive") return full(sentence(plain(this.#safety.reason)));
    const isHeard = !this.#link || (this.#link.state === "up" && !NOT_HEARD.has(this.#link.condition));
    if (isHeard || this.#deadman_ms !== null) return null;
    return this.#link.state === "down" ? unplugged(this.#link.reason) : full(sentence(plain(this.#link.reason)));
  }

  #show() {
    if (this.#safety) text("drivers", this.#drivers(this.#safety));
    const why = this.#doubt();
    if (why !== null) this.#write(doubt(why, this.#connection === "works" ? null : this.#deadman_ms));
    else if (this.#safety) this.#write(this.#known(this.#safety));
    else this.#write(["warn", t("mode.unknown"), t("mode.unknown_why")]);
    document.body.classList.toggle("old", why !== null || !this.#safety);
    this.told(why !== null);
  }

  #drivers({ control, source: inForce }) {
    const drivers = Object.entries(control).map(([source, client]) => (driverName(client) === driverName(source) ? driverName(source) : `${plain(client)} (${driverName(source)})`));
    return drivers.join(", ") || (inForce ? driverName(inForce) : t("driver.nobody"));
  }

  #known(safety) {
    const [kind, word] = mode(safety.mode);
    if (safety.armed && safety.guard_warning) return ["warn", word, full(sentence(plain(safety.guard_warning)))];
    if (safety.armed) return [kind, word, safety.limited_by ? t("mode.slower", { why: limit(safety.limited_by) }) : ""];
    return [kind, word, this.#why(safety)];
  }

  #why({ mode, reason }) {
    if (mode === "no_board") return `${full(plain(reason))} ${t("mode.no_board_why")}`;
    const isItself = this.#link?.state === "down" && this.#deadman_ms !== null;
    const itself = isItself ? ` ${t("mode.itself", { deadman_ms: this.#deadman_ms })}` : "";
    return `${full(plain(reason))}${itself} ${t(this.#mayArm ? "mode.arm" : "mode.ask_to_arm")}`;
  }

  // A fault interrupts a screen reader; everything else waits for its turn.
  #write([kind, word, reason]) {
    $("mode-told").setAttribute("aria-live", kind === "bad" ? "assertive" : "polite");
    if ($("mode").className !== `mode ${kind}`) $("mode").className = `mode ${kind}`;
    text("mode-word", word);
    text("mode-reason", reason ? `– ${reason}` : "");
  }
}
