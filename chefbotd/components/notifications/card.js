// Told when away: who is told of what, and whether the last message arrived.

import { $, element } from "../../dom.js";
import { knows, language, t, translate } from "../../language.js";

const HTML = `
  <h2 id="notifications-title" data-t="notifications.title"></h2>
  <ul id="notifications-servers" class="plain"></ul>
  <p class="small" id="notifications-kinds"></p>
  <button type="button" id="notifications-test" data-t="notifications.test" hidden></button>`;

export default class Notifications {
  #mayTest = false;

  constructor({ connection, ask, section }) {
    section.innerHTML = HTML;
    translate(section);
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
    const told = kinds.map((kind) => `notifications.kind.${kind}`).filter(knows).map((id) => t(id));
    $("notifications-kinds").textContent = told.length ? t("notifications.told", { kinds: told.join(", ") }) : t("notifications.nothing");
  }
}

function row({ name, host, state, title, text, at_s, problem, waiting }) {
  const item = element("li");
  item.append(element("strong", name === "ntfy" ? `ntfy (${host})` : `Webhook (${host})`), element("br"));
  if (state === "silent") {
    item.append(t("notifications.no_message"));
    return item;
  }
  const time = new Date(1000 * at_s).toLocaleString(language, { dateStyle: "short", timeStyle: "short" });
  const others = waiting > 1 ? ` ${t("notifications.waiting", { count: waiting })}` : "";
  const why = problem ? `: ${reason(problem)}` : "";
  item.append(t("notifications.last", { time, title, text, state: `${t(`notifications.state.${state}`)}${why}` }) + others);
  return item;
}

function reason(problem) {
  return problem.startsWith("HTTP status") ? t("notifications.code", { code: problem.replace("HTTP status ", "") }) : t("notifications.no_answer");
}
