// The camera's picture. It comes by a connection of its own, one at a time, so that a slow one holds up nothing else; what
// is not shown is not asked for.

import { Connection } from "../../connection.js";
import { $ } from "../../dom.js";
import { t, translate } from "../../language.js";

const HTML = `
  <h2 id="camera-title" data-t="camera.title"></h2>
  <canvas id="camera-picture" role="img" aria-labelledby="camera-title" aria-describedby="camera-told" hidden></canvas>
  <p class="small" id="camera-told" data-t="camera.none_yet"></p>`;
const OLD_S = 0.5;
const WAIT_S = 5;
const AGAIN_MS = 1000;
const SHOW_AGE_MS = 200;
const CLOCK_AGAIN_MS = 30_000;

export default class Camera {
  #isPermitted = false;
  #isInView = false;
  #isLooking = false;
  #number = 0;
  #stamp = null; // when the picture that is shown was taken, by the daemon's clock; null: none is shown
  #clock = null; // the daemon's clock less the browser's, as the quickest of its answers has it
  #timer = null;

  constructor({ connection, section }) {
    section.innerHTML = HTML;
    translate(section);
    section.setAttribute("aria-labelledby", "camera-title");
    Object.assign(this, { section, own: connection, canvas: $("camera-picture"), pictures: new Connection(connection.url) });
    this.pictures.addEventListener("hello", ({ detail }) => this.#enter(detail));
    this.pictures.addEventListener("closed", () => { this.#isLooking = false; });
    connection.addEventListener("closed", () => {
      this.#isPermitted = false;
      this.#update();
    });
    document.addEventListener("visibilitychange", () => this.#update());
    new IntersectionObserver((entries) => {
      this.#isInView = entries.at(-1).isIntersecting;
      this.#update();
    }).observe(section);
  }

  begin(can) {
    this.#isPermitted = can.has("method.get_camera_frame");
    this.section.hidden = !this.#isPermitted;
    this.#update();
  }

  get #isWanted() {
    return this.#isPermitted && this.#isInView && !document.hidden;
  }

  // Connect when it is to be shown, and end the connection when it is not.
  #update() {
    if (this.#isWanted && this.#timer === null) {
      this.#timer = setInterval(() => this.#showAge(), SHOW_AGE_MS);
      this.pictures.connect();
    } else if (!this.#isWanted && this.#timer !== null) {
      clearInterval(this.#timer);
      this.#timer = null;
      this.pictures.disconnect();
    }
  }

  async #enter({ auth }) {
    try {
      if (auth === "token") await this.pictures.request("authenticate", { token: this.own.token ?? "" });
      await this.pictures.request("set_client_name", { client: "camera of a page" });
      this.pictures.settled();
      this.#number = 0;
      this.#isLooking = true;
      await this.#look();
    } catch (error) {
      this.#tell(error); // the connection has ended: it connects again by itself
    }
  }

  async #look() {
    let measured = -Infinity;
    while (this.#isLooking) {
      if (performance.now() - measured > CLOCK_AGAIN_MS) {
        await this.#compareClocks();
        measured = performance.now();
      }
      try {
        await this.#show(await this.pictures.request("get_camera_frame", { after: this.#number, wait_s: WAIT_S }));
      } catch (error) {
        if (!this.#isLooking) return;
        this.#tell(error);
        await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
      }
    }
  }

  async #compareClocks() {
    const asked = performance.now();
    const { stamp_s } = await this.pictures.request("ping");
    this.#clock = stamp_s - (asked + performance.now()) / 2000;
  }

  async #show({ number, stamp_s, jpeg }) {
    this.#number = number;
    const bytes = Uint8Array.from(atob(jpeg), (letter) => letter.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/jpeg" }));
    const { canvas } = this;
    if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) Object.assign(canvas, { width: bitmap.width, height: bitmap.height });
    canvas.getContext("2d").drawImage(bitmap, 0, 0);
    bitmap.close();
    canvas.hidden = false;
    this.#stamp = stamp_s;
    this.#showAge();
  }

  // How old the picture is, its way to this page included; an old one is grey.
  #showAge() {
    if (this.#stamp === null) return;
    const age_s = Math.max(performance.now() / 1000 + this.#clock - this.#stamp, 0);
    this.canvas.classList.toggle("is-old", age_s > OLD_S);
    $("camera-told").textContent = age_s < 10 ? t("camera.age", { age_s: age_s.toFixed(1) }) : t("camera.old", { age_s: age_s.toFixed(0) });
  }

  #tell({ message }) {
    this.#stamp = null;
    this.canvas.hidden = true;
    $("camera-told").textContent = t("camera.none", { why: message.replace(/^no picture: /, "") });
  }
}
