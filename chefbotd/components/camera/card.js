// The camera's picture. It comes by a connection of its own, one at a time, so that a slow one holds up nothing else; what
// is not seen is not asked for.

import { $ } from "../../dom.js";
import { figure, t, translate } from "../../language.js";
import { OwnConnection } from "../../own_connection.js";
import { plain, told } from "../../words.js";

const HTML = `
  <h2 id="camera-title" data-t="camera.title"></h2>
  <canvas id="camera-picture" role="img" aria-labelledby="camera-title" aria-describedby="camera-told" hidden></canvas>
  <p class="small" id="camera-told"></p>`;
const [OLD_S, VERY_OLD_S, WAIT_S] = [0.5, 10, 5];
const [AGAIN_MS, SHOW_AGE_MS, CLOCK_AGAIN_MS] = [1000, 200, 30_000];

export default class Camera {
  #number = 0;
  #stamp = null; // when the picture that is shown was taken, by the daemon's clock; null: none is shown
  #clock = null; // the daemon's clock less the browser's
  #measured = -Infinity;
  #timer = null;

  constructor({ connection, section }) {
    section.innerHTML = HTML;
    section.setAttribute("aria-labelledby", "camera-title");
    translate(section);
    Object.assign(this, { section, canvas: $("camera-picture") });
    this.own = new OwnConnection(connection, section, {
      name: "camera of a page",
      begin: () => this.#look(),
      follow: (isSeen) => this.#follow(isSeen),
    });
    $("camera-told").textContent = t("camera.none_yet");
  }

  begin(can) {
    this.section.hidden = !can.has("method.get_camera_frame");
    this.own.allow(!this.section.hidden);
  }

  #follow(isSeen) {
    clearInterval(this.#timer);
    if (isSeen) this.#timer = setInterval(() => this.#showAge(), SHOW_AGE_MS);
  }

  async #look() {
    this.#number = 0;
    this.#measured = -Infinity;
    while (this.own.open) {
      try {
        if (performance.now() - this.#measured > CLOCK_AGAIN_MS) await this.#compareClocks();
        await this.#show(await this.own.request("get_camera_frame", { after: this.#number, wait_s: WAIT_S }));
      } catch (error) {
        if (!this.own.open) return; // begun anew when it is open again
        this.#tell(error);
        await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
      }
    }
  }

  async #compareClocks() {
    const asked = performance.now();
    const { stamp_s } = await this.own.request("ping");
    this.#measured = performance.now();
    this.#clock = stamp_s - (asked + this.#measured) / 2000;
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
    $("camera-told").textContent = age_s < VERY_OLD_S ? t("camera.age", { age_s: figure(age_s, 1) }) : t("camera.old", { age_s: figure(age_s, 0) });
  }

  #tell({ message, data }) {
    this.#stamp = null;
    this.canvas.hidden = true;
    $("camera-told").textContent = t("camera.none", { why: whyNot(message, data) });
  }
}

// Why there is no picture, without the frame of the refusal.
function whyNot(message, data) {
  const why = data?.arguments?.why ?? message.replace(/^no picture: /, "");
  return typeof why === "string" ? plain(why) : told(why);
}
