// The recorder: whether it records, and what is kept in memory, to be saved after something has happened.

import { $, text } from "../../dom.js";
import { full, plain, sentence } from "../../words.js";

const HTML = `
  <h2 id="recorder-title">Recorder</h2>
  <p id="recorder"></p>
  <p id="recorder-told" role="status"></p>
  <div class="buttons">
    <button type="button" id="recorder-save" hidden>Save what has just happened</button>
    <button type="button" id="recorder-start" hidden>Record</button>
    <button type="button" id="recorder-stop" hidden>Stop recording</button>
  </div>`;

export default class Recorder {
  #can = new Set();

  constructor({ connection, ask, section }) {
    section.innerHTML = HTML;
    this.section = section;
    section.setAttribute("aria-labelledby", "recorder-title");
    connection.on("recording", (recording) => this.#show(recording));
    $("recorder-start").addEventListener("click", () => ask("start_recording"));
    $("recorder-stop").addEventListener("click", async () => {
      const ended = await ask("stop_recording");
      if (ended) text("recorder-told", `Recorded ${length(ended.seconds)} into ${ended.file}.`);
    });
    $("recorder-save").addEventListener("click", async () => {
      const saved = await ask("save_ring", { reason: "asked" });
      if (saved) text("recorder-told", `The last ${length(saved.seconds)} are in ${saved.file}.`);
    });
  }

  begin(can) {
    this.#can = can;
    this.section.hidden = !can.has("topic.recording");
    text("recorder-told", "");
  }

  #show({ state, file, seconds, bytes_written, ring_s, free_bytes, reason }) {
    const free = free_bytes === null ? "" : ` ${(free_bytes / 1e9).toFixed(1)} GB are free.`;
    const now = state === "recording"
      ? `Recording into ${file}: ${length(seconds)}, ${(bytes_written / 1e6).toFixed(1)} MB.${free}`
      : `Not recording.${reason ? ` ${full(sentence(plain(reason)))}` : ""}`;
    const kept = ring_s > 0 ? ` The last ${length(ring_s)} are kept in memory.` : "";
    text("recorder", now + kept);
    const show = (id, method, wanted) => { $(id).hidden = !wanted || !this.#can.has(`method.${method}`); };
    show("recorder-save", "save_ring", ring_s > 0);
    show("recorder-start", "start_recording", state !== "recording");
    show("recorder-stop", "stop_recording", state === "recording");
  }
}

function length(seconds) {
  return seconds < 120 ? `${seconds.toFixed(0)} s` : `${(seconds / 60).toFixed(0)} min`;
}
