// The WebSocket: requests with answers, topics, reconnecting, and the notice when the network stalls.

import { read } from "./words.js";

const PING_MS = 500;
const STALLED_MS = 1500;
const GIVEN_UP_MS = 6000;
export const SHOWN_HZ = 10; // how often what moves is shown

export class Refused extends Error {
  constructor(error) {
    super(error.message);
    this.kind = error.data?.kind ?? "unknown";
    this.data = error.data ?? {};
  }
}

export class Connection extends EventTarget {
  #socket = null;
  #waiting = new Map();
  #id = 0;
  #heard = 0;
  #pinged = 0;
  #retryMs = 250;
  #rates = new Map();
  #latest = new Map(); // the last event of each topic, of this connection
  #timer = null;
  #can = null;

  constructor(url) {
    super();
    this.url = url;
    this.stalled = true;
    setInterval(() => this.#watch(), PING_MS);
  }

  get open() {
    return this.#socket?.readyState === WebSocket.OPEN;
  }

  // Requests that were sent and not answered yet.
  get unanswered() {
    return this.#waiting.size;
  }

  connect() {
    clearTimeout(this.#timer);
    this.#socket?.close();
    const socket = new WebSocket(this.url);
    this.#socket = socket;
    socket.onopen = () => { this.#heard = performance.now(); };
    socket.onmessage = (event) => this.#take(read(event.data));
    socket.onclose = () => { if (socket === this.#socket) this.#lost(true); };
  }

  // Close, and stay closed until connect().
  disconnect() {
    const socket = this.#socket;
    this.#socket = null;
    socket?.close();
    this.#lost(false);
  }

  // The answer as a promise; while the socket is closed nothing is kept for later.
  request(method, params = {}) {
    if (!this.open) return Promise.reject(new Refused({ message: "not connected", data: { kind: "not_connected" } }));
    const id = ++this.#id;
    this.#socket.send(JSON.stringify({ jsonrpc: "2.0", id, method, params }));
    return new Promise((resolve, reject) => this.#waiting.set(id, { resolve, reject }));
  }

  // Call ``take`` with the data of each event of a topic that ``begin`` subscribes to, at this rate at the most. A part
  // that was loaded late gets the last one, too.
  on(topic, take, rate_hz = 0) {
    const isNew = !this.#rates.has(topic);
    this.#rates.set(topic, Math.max(rate_hz, this.#rates.get(topic) ?? 0));
    if (isNew && this.#can) this.#subscribe([topic]).catch(() => {});
    this.addEventListener(`topic:${topic}`, ({ detail }) => take(detail.data, detail));
    const latest = this.#latest.get(topic);
    if (latest) queueMicrotask(() => { if (this.#latest.get(topic) === latest) take(latest.data, latest); });
  }

  // Subscribe to what there is of the topics that the page shows.
  begin(can) {
    this.#can = can;
    return this.#subscribe([...this.#rates.keys()]);
  }

  #subscribe(wanted) {
    const topics = wanted.filter((topic) => this.#can.has(`topic.${topic}`));
    const rates = new Set(topics.map((topic) => this.#rates.get(topic)));
    return Promise.all([...rates].map((rate) => this.request("subscribe", {
      topics: topics.filter((topic) => this.#rates.get(topic) === rate), ...(rate ? { max_rate_hz: rate } : {}),
    })));
  }

  // Sent without waiting for an answer.
  notify(method, params = {}) {
    if (this.open) this.#socket.send(JSON.stringify({ jsonrpc: "2.0", method, params }));
  }

  #take(message) {
    this.#heard = performance.now();
    if (this.stalled) this.#say("stalled", this.stalled = false);
    if (message.method === "event") {
      this.#latest.set(message.params.topic, message.params);
      this.#say(`topic:${message.params.topic}`, message.params);
    }
    else if (message.method) this.#say(message.method, message.params);
    else this.#answer(message);
  }

  #answer(message) {
    const asked = this.#waiting.get(message.id);
    if (!asked) {
      if (message.error) this.#say("ended", new Refused(message.error));
      return;
    }
    this.#waiting.delete(message.id);
    if (message.error) asked.reject(new Refused(message.error));
    else asked.resolve(message.result);
  }

  #watch() {
    const now = performance.now();
    if (!this.open) return;
    if (!this.stalled && now - this.#heard > STALLED_MS) this.#say("stalled", this.stalled = true);
    if (now - this.#heard > GIVEN_UP_MS) {
      const dead = this.#socket;
      this.#socket = null;
      dead.close();
      this.#lost(true);
      return;
    }
    if (this.#pinged) return;
    this.#pinged = now;
    this.request("ping")
      .then(() => this.#say("latency", performance.now() - now), () => {})
      .finally(() => { this.#pinged = 0; });
  }

  #lost(retry) {
    const waiting = [...this.#waiting.values()];
    this.#waiting.clear();
    this.#latest.clear();
    this.#can = null;
    this.#pinged = 0;
    this.stalled = true;
    this.#say("closed", null);
    for (const asked of waiting) asked.reject(new Refused({ message: "the connection ended before the robot answered", data: { kind: "connection_ended" } }));
    if (!retry) return;
    this.#timer = setTimeout(() => this.connect(), this.#retryMs);
    this.#retryMs = Math.min(2 * this.#retryMs, 4000);
  }

  // The daemon has taken us in: begin again with short waits.
  settled() {
    this.#retryMs = 250;
  }

  #say(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }
}
