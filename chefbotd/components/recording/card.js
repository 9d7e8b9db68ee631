// The recorder: whether it records, and what is kept in memory, to be saved after something has happened.

import { $, text } from "../../dom.js";
import { figure, t, translate } from "../../language.js";
import { full, plain, sentence } from "../../words.js";

const HTML = `
  <h2 id="recorder-title" data-t="recording.title"></h2>
  <p id="recorder"></p>
  <p id="recorder-told" role="status"></p>
  <div class="buttons">
    <button type="button" id="recorder-save" data-t="recording.save" hidden></button>
    <button type="button" id="recorder-start" data-t="recording.start" hidden></button>
    <button type="button" id="recorder-stop" data-t="recording.stop" hidden></button>
  </div>`;

export default class Recorder {
  #can = new Set();

  constructor({ connection, ask, section }) {
    section.innerHTML = HTML;
    translate(section);
    this.section = section;
    section.setAttribute("aria-labelledby", "recorder-title");
    connection.on("recording", (recording) => this.#show(recording));
    $("recorder-start").addEventListener("click", () => ask("start_recording"));
    $("recorder-stop").addEventListener("click", async () => {
      const ended = await ask("stop_recording");
      if (ended) text("recorder-told", t("recording.recorded", { length: length(ended.seconds), file: ended.file }));
    });
    $("recorder-save").addEventListener("click", async () => {
      const saved = await ask("save_ring", { reason: "asked" });
      if (saved) text("recorder-told", t("recording.saved", { length: length(saved.seconds), file: saved.file }));
    });
  }

  begin(can) {
    this.#can = can;
    this.section.hidden = !can.has("topic.recording");
    text("recorder-told", "");
  }

  #show({ state, file, seconds, bytes_written, ring_s, free_bytes, reason }) {
    const free = free_bytes === null ? "" : ` ${t("recording.free", { gigabytes: figure(free_bytes / 1e9, 1) })}`;
    const now = state === "recording"
      ? t("recording.now", { file, length: length(seconds), megabytes: figure(bytes_written / 1e6, 1) }) + free
      : `${t("recording.not_now")}${reason ? ` ${full(sentence(plain(reason)))}` : ""}`;
    const kept = ring_s > 0 ? ` ${t("recording.kept", { length: length(ring_s) })}` : "";
    text("recorder", now + kept);
    const show = (id, method, wanted) => { $(id).hidden = !wanted || !this.#can.has(`method.${method}`); };
    show("recorder-save", "save_ring", ring_s > 0);
    show("recorder-start", "start_recording", state !== "recording");
    show("recorder-stop", "stop_recording", state === "recording");
  }
}

function length(seconds) {
  return seconds < 120 ? t("recording.seconds", { count: Number(seconds.toFixed(0)) }) : t("recording.minutes", { count: Number((seconds / 60).toFixed(0)) });
}
