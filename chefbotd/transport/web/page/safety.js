// The card at the top: whether the robot may move, why not, and who drives.

const $ = (id) => document.getElementById(id);
const MODES = {
  armed: ["good", "Ready to drive"],
  disarmed: ["bad", "Stopped by a fault"],
  estopped: ["bad", "Emergency stop"],
  no_board: ["warn", "Waiting for the board"],
};
const UNKNOWN = ["warn", "Waiting for the robot", "it has not said yet how it is"];
const STALLED = ["warn", "The robot does not answer", "what is shown may be old; it brakes by itself when nobody drives it"];
const LOST = ["warn", "Not connected", "trying again; the robot brakes by itself when nobody drives it"];

export class SafetyCard {
  #state = UNKNOWN;

  constructor(connection, me) {
    this.me = me;
    this.mayArm = true;
    connection.addEventListener("closed", () => { this.#state = UNKNOWN; this.#show(LOST); });
    connection.addEventListener("stalled", ({ detail }) => this.#show(detail ? STALLED : this.#state));
    connection.addEventListener("topic:safety", ({ detail }) => this.#take(detail.data));
  }

  #take(safety) {
    const [kind, word] = MODES[safety.mode] ?? ["warn", safety.mode];
    this.#state = [kind, word, safety.armed ? limited(safety) : this.#why(safety)];
    this.#show(this.#state);
    const drivers = Object.entries(safety.control).map(([source, client]) => `${this.#named(client)} (${source})`);
    text("drivers", drivers.join(", ") || (safety.source ?? "nobody"));
    $("arm").disabled = safety.armed;
    $("arm").classList.toggle("wanted", !safety.armed && safety.mode !== "no_board");
  }

  #why({ mode, reason }) {
    const arm = this.mayArm ? "When it is safe, press Arm." : "Somebody who may drive has to arm it.";
    return `${reason.replace(this.me, "this page")}. ${mode === "no_board" ? "" : arm}`;
  }

  #named(client) {
    return client.startsWith(this.me) ? "this page" : client;
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
  return by ? `held back by ${by}` : "";
}

function text(id, words) {
  if ($(id).textContent !== words) $(id).textContent = words;
}
