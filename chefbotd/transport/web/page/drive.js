// Keys, joystick and gamepad to drive commands: repeated while something is held, ended when it is let go.

import { $ } from "./dom.js";
import { isText } from "./stops.js";

const REPEAT_MS = 80;
const MOST_UNANSWERED = 6;
const STOOD_MS = 500;
const AHEAD = new Map([["KeyW", [1, 0]], ["ArrowUp", [1, 0]], ["KeyS", [-1, 0]], ["ArrowDown", [-1, 0]],
  ["KeyA", [0, 1]], ["ArrowLeft", [0, 1]], ["KeyD", [0, -1]], ["ArrowRight", [0, -1]]]);
const [PAD_STOP, PAD_ESTOP, PAD_ENABLE, DEAD_ZONE] = [2, 1, 4, 0.12];

export class Driver extends EventTarget {
  #held = new Set();
  #stick = null;
  #pad = null;
  #pressed = new Set();
  #pads = ""; // what is known of gamepads
  #moving = false;
  #blocked = false; // until everything was let go
  #ticked = Date.now();

  constructor(connection, speeds) {
    super();
    this.connection = connection;
    this.speeds = speeds;
    this.allowed = true;
    // Before everybody else: no part of the page may keep a stop to itself.
    addEventListener("keydown", (event) => { if (!this.#stops(event)) this.#down(event); }, { capture: true });
    addEventListener("keyup", (event) => {
      if (isSpace(event) && !isText(event.target)) event.preventDefault(); // some browsers press a button only now
      this.#held.delete(event.code);
      this.#tick();
    }, { capture: true });
    addEventListener("blur", () => this.dead());
    addEventListener("pagehide", () => this.dead());
    // After these the browser may keep what is let go to itself.
    for (const name of ["contextmenu", "dragstart"]) addEventListener(name, () => this.dead());
    document.addEventListener("visibilitychange", () => { if (document.hidden) this.dead(); });
    connection.addEventListener("closed", () => this.dead());
    connection.addEventListener("stalled", (event) => { if (event.detail) this.dead(); });
    setInterval(() => this.#tick(), REPEAT_MS);
  }

  // Everything counts as let go; what is still pressed drives only when it is pressed anew.
  dead() {
    this.#held.clear();
    this.#stick = null;
    this.#blocked = this.#pad !== null;
    this.#pad = null;
    this.#release();
    this.dispatchEvent(new Event("dead"));
  }

  stick(forward, left) {
    this.#stick = [forward, left];
    this.#tick();
  }

  stickReleased() {
    this.#stick = null;
    this.#tick();
  }

  // Esc and Space, wherever the focus is: Space presses no button, but where it types it is typed.
  #stops(event) {
    const isEstop = event.code === "Escape" || event.key === "Escape";
    if (!isEstop && (!isSpace(event) || isText(event.target))) return false;
    event.preventDefault();
    if (event.repeat) return true;
    this.#ask(isEstop ? "estop" : "stop");
    if (!isEstop && event.target === $("estop")) this.#ask("estop");
    return true;
  }

  #down(event) {
    if (event.target.closest?.("input:not([type=range], [type=checkbox]), select, textarea, dialog")) return undefined;
    if (event.shiftKey && event.target === $("view") && event.code.startsWith("Arrow")) return undefined; // they move the map
    if (event.ctrlKey || event.metaKey || event.altKey) return this.dead(); // a shortcut, which may keep the key's end to itself
    if (!AHEAD.has(event.code) || (event.target.type === "range" && event.code.startsWith("Arrow"))) return undefined;
    event.preventDefault();
    if (!event.repeat) this.#held.add(event.code), this.#tick();
    return undefined;
  }

  #ask(name) {
    this.dispatchEvent(new Event(name));
    this.dead();
  }

  #wanted() {
    if (!this.allowed) return null;
    if (this.#stick) return this.#stick;
    if (this.#pad) return this.#pad;
    if (!this.#held.size) return null;
    const sum = [0, 0];
    for (const code of this.#held) AHEAD.get(code).forEach((value, index) => { sum[index] += value; });
    return sum.map((value) => Math.max(-1, Math.min(1, value)));
  }

  #readPad() {
    const connected = gamepads();
    const known = connected?.filter((each) => each.mapping === "standard") ?? [];
    this.#tellOfPads(connected, known);
    const on = (index, pads = known) => pads.some((each) => each.buttons[index]?.pressed);
    for (const [index, name] of [[PAD_ESTOP, "estop"], [PAD_STOP, "stop"]]) {
      if (on(index) && !this.#pressed.has(index)) this.#ask(name);
      if (on(index)) this.#pressed.add(index);
      else this.#pressed.delete(index);
    }
    if (!on(PAD_ENABLE)) this.#blocked = false;
    const pad = known.find((each) => on(PAD_ENABLE, [each]));
    const usable = pad && !this.#blocked && document.hasFocus() && !document.hidden;
    const value = (axis) => (Math.abs(axis) < DEAD_ZONE ? 0 : -axis);
    this.#pad = usable ? [value(pad.axes[1]), value(pad.axes[0])] : null;
  }

  // A page promises nothing of a gamepad that it cannot read.
  #tellOfPads(connected, known) {
    const state = connected === null ? "unavailable" : known.length ? "standard" : connected.length ? "unknown" : "none";
    if (state !== this.#pads) this.dispatchEvent(new CustomEvent("gamepad", { detail: this.#pads = state }));
  }

  #tick() {
    // A frozen tab, or a computer that slept, does not know what was let go meanwhile.
    const stood = Date.now() - this.#ticked > STOOD_MS;
    this.#ticked = Date.now();
    if (stood) return this.dead();
    this.#readPad();
    const wanted = this.#wanted();
    if (wanted === null) return this.#release();
    if (this.connection.stalled || this.connection.unanswered > MOST_UNANSWERED) return this.dead();
    this.#moving = true;
    const [linear_m_s, angular_rad_s] = [wanted[0] * this.speeds.linear_m_s, wanted[1] * this.speeds.angular_rad_s];
    this.connection.request("drive", { linear_m_s, angular_rad_s }).then(
      (answer) => this.dispatchEvent(new CustomEvent("driven", { detail: answer })),
      (error) => this.dispatchEvent(new CustomEvent("refused", { detail: error })),
    );
    return undefined;
  }

  #release() {
    if (!this.#moving) return;
    this.#moving = false;
    this.connection.notify("drive", { linear_m_s: 0, angular_rad_s: 0 });
    this.connection.notify("release_control");
    this.dispatchEvent(new Event("released"));
  }
}

const isSpace = (event) => event.code === "Space" || event.key === " ";

// The gamepads that are connected; null where the browser gives none to this page.
function gamepads() {
  try {
    return navigator.getGamepads ? [...navigator.getGamepads()].filter((pad) => pad?.connected) : null;
  } catch {
    return null; // forbidden by a policy of whoever shows this page
  }
}

// A round pad under a finger or a mouse: up is ahead, left is left. Out of sight it counts as let go: its panel was closed or
// scrolled, or the window got too small, and nobody can steer by what is not seen.
export function joystick(pad, knob, driver) {
  let pointer = null;
  const end = () => {
    pointer = null;
    knob.style.transform = "";
    driver.stickReleased();
  };
  const move = (event) => {
    const box = pad.getBoundingClientRect();
    const reach = box.width / 2;
    let [right, up] = [(event.clientX - box.x) / reach - 1, 1 - (event.clientY - box.y) / reach];
    const length = Math.hypot(right, up);
    if (length > 1) [right, up] = [right / length, up / length];
    knob.style.transform = `translate(${right * reach}px, ${-up * reach}px)`;
    driver.stick(up, -right);
  };
  pad.addEventListener("pointerdown", (event) => {
    if (pointer !== null) return;
    pointer = event.pointerId;
    pad.setPointerCapture(pointer);
    move(event);
  });
  pad.addEventListener("pointermove", (event) => { if (event.pointerId === pointer) move(event); });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
    pad.addEventListener(name, (event) => { if (event.pointerId === pointer) end(); });
  }
  driver.addEventListener("dead", () => { if (pointer !== null) end(); });
  new IntersectionObserver((seen) => { if (pointer !== null && !seen.at(-1).isIntersecting) end(); }).observe(pad);
}
