// On an upright phone the panels are a sheet from below: closed, half or full, by dragging its grip or by pressing it.

import { $ } from "./dom.js";
import { keep, kept } from "./kept.js";
import { label } from "./language.js";

const UPRIGHT = matchMedia("(max-width: 48rem) and (orientation: portrait)");
const MOVED_PX = 8; // less is a press
const SIZES = ["closed", "half", "full"];

export class Sheet {
  #size = "closed";
  #opened = kept("sheet", "half"); // how large it is when it is open
  #drag = null;

  // ``close`` is called where somebody has closed it by its grip.
  constructor(close) {
    this.close = close;
    const grip = $("grip");
    grip.addEventListener("click", (event) => { if (event.detail === 0 || !this.#drag?.moved) this.#press(); });
    grip.addEventListener("pointerdown", (event) => this.#begin(event));
    grip.addEventListener("pointermove", (event) => this.#move(event));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) grip.addEventListener(name, (event) => this.#end(event));
  }

  get isUsed() {
    return UPRIGHT.matches;
  }

  // Whether it is closed though a panel is chosen.
  get isFolded() {
    return this.isUsed && this.#size === "closed";
  }

  // Be as the panels are: open or closed.
  follow(isOpen) {
    this.#set(isOpen ? this.#opened : "closed");
  }

  #set(size) {
    this.#size = size;
    $("dock").dataset.size = size;
    $("dock").style.height = "";
    label($("grip"), `sheet.${size}`);
    if (size === "closed") return;
    this.#opened = size;
    keep("sheet", size);
  }

  #press() {
    if (!$("panels").hidden) this.#set(this.#size === "half" ? "full" : "half");
    else document.querySelector("#rail > :not([hidden])")?.click();
  }

  #begin(event) {
    if (this.#drag?.pointer !== undefined) return;
    $("grip").setPointerCapture(event.pointerId);
    this.#drag = { pointer: event.pointerId, from: event.clientY, height: $("dock").offsetHeight, moved: false };
  }

  #move(event) {
    const drag = this.#drag;
    if (drag?.pointer !== event.pointerId) return;
    const up = drag.from - event.clientY;
    if (Math.abs(up) > MOVED_PX && !drag.moved) {
      drag.moved = true;
      if ($("panels").hidden) document.querySelector("#rail > :not([hidden])")?.click();
      $("dock").classList.add("dragged");
    }
    if (drag.moved) $("dock").style.height = `${drag.height + up}px`;
  }

  // The nearest of its sizes.
  #end(event) {
    const drag = this.#drag;
    if (drag?.pointer !== event.pointerId) return;
    drag.pointer = undefined; // whether it moved is asked by the click that follows
    if (!drag.moved) return;
    const [height, room] = [$("dock").offsetHeight, $("dock").parentElement.offsetHeight];
    $("dock").classList.remove("dragged");
    const least = $("grip").offsetHeight + $("rail").offsetHeight;
    const at = { closed: least, half: 0.46 * room, full: room - 80 };
    const nearest = SIZES.reduce((best, size) => (Math.abs(at[size] - height) < Math.abs(at[best] - height) ? size : best));
    if (nearest === "closed") this.close();
    else this.#set(nearest);
  }
}
