// Told when away: who is told of what, and whether the last message arrived.

import { $, element } from "../../dom.js";

const HTML = `
  <h2 id="notifications-title">Told when away</h2>
  <ul id="notifications-servers" class="plain"></ul>
  <p class="small" id="notifications-kinds"></p>
  <button type="button" id="notifications-test" hidden>Send a test message</button>`;
const KINDS = {
  goal_done: "a goal that is reached", goal_failed: "a goal that fails", stuck: "a robot that is stuck",
  battery_low: "a low battery", fault: "a fault", daemon_gone: "the end of the robot's program",
};
const FARED = { waits: "is not there yet", taken: "has arrived", given_up: "was given up" };

export default class Notifications {
  #mayTest = false;

  constructor({ connection, ask, section }) {
    section.innerHTML = HTML;
    section.setAttribute("aria-labelledby", "notifications-title");
    this.section = section;
    connection.on("notifications", (told) => this.#show(told));
    $("notifications-test").addEventListener("click", () => ask("send_test_notification"));
  }

  begin(can) {
    this.section.hidden = !can.has("topic.notifications");
    this.#mayTest = can.has("method.send_test_notification");
    $("notifications-test").hidden = !this.#mayTest;
  }

  #show({ kinds, servers }) {
    $("notifications-servers").replaceChildren(...servers.map(row));
    const told = kinds.map((kind) => KINDS[kind] ?? "").filter(Boolean);
    $("notifications-kinds").textContent = told.length ? `Told of: ${told.join(", ")}.` : "Nothing is told.";
  }
}

function row({ name, host, state, title, text, at_s, problem, waiting }) {
  const item = element("li");
  item.append(element("strong", name === "ntfy" ? `ntfy (${host})` : `Webhook (${host})`), element("br"));
  if (state === "silent") {
    item.append("No message yet.");
    return item;
  }
  const time = new Date(1000 * at_s).toLocaleString([], { dateStyle: "short", timeStyle: "short" });
  const others = waiting > 1 ? ` ${waiting} messages wait.` : "";
  const why = problem ? `: ${reason(problem)}` : "";
  item.append(`${time}, ${title}: ${text} It ${FARED[state]}${why}.${others}`);
  return item;
}

function reason(problem) {
  return problem.startsWith("HTTP status") ? `the server answers ${problem.replace("HTTP status", "with the code")}` : "the server does not answer";
}
