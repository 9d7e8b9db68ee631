// Runs where the sound is: turns it into 16-bit samples, and hands over 128 ms at a time.

const PIECE_S = 0.128;

class Microphone extends AudioWorkletProcessor {
  #piece = new Int16Array(Math.round(PIECE_S * sampleRate));
  #filled = 0;

  constructor() {
    super();
    // What is left is handed over with an answer, so that the last word is not lost.
    this.port.onmessage = () => { this.#hand(); this.port.postMessage("flushed"); };
  }

  process([channels]) {
    for (const sample of channels[0] ?? []) {
      this.#piece[this.#filled++] = Math.max(-1, Math.min(1, sample)) * 32767;
      if (this.#filled === this.#piece.length) this.#hand();
    }
    return true;
  }

  #hand() {
    if (this.#filled) this.port.postMessage(this.#piece.slice(0, this.#filled).buffer);
    this.#filled = 0;
  }
}

registerProcessor("microphone", Microphone);
