// Agents, the programs that talk to people: what each says, its question with the answers to choose from, its buttons.

import { $, element } from "../../dom.js";
import { translate } from "../../language.js";

const HTML = `
  <h2 id="agents-title" data-t="agents.title"></h2>
  <ul id="agents"></ul>`;

export default class Agents {
  #can = new Set();
  #ask;
  #shown = "";
  #agents = { agents: [], buttons: [], questions: [] };

  constructor({ connection, ask, section }) {
    section.innerHTML = HTML;
    translate(section);
    section.setAttribute("aria-labelledby", "agents-title");
    this.#ask = ask;
    connection.on("agents", (agents) => { this.#agents = agents; this.#show(); });
    connection.addEventListener("closed", () => { this.#agents = { agents: [], buttons: [], questions: [] }; this.#show(); });
  }

  begin(can) {
    this.#can = can;
    this.#shown = "";
    this.#show();
  }

  // Drawn anew only where something is new: a finger or the keyboard may be on a button, and a screen reader reads it.
  #show() {
    const { agents } = this.#agents;
    $("agents-part").hidden = agents.length === 0;
    const now = JSON.stringify(this.#agents);
    if (now === this.#shown) return;
    this.#shown = now;
    const focused = document.activeElement?.id;
    const rows = new Map([...$("agents").children].map((row) => [row.dataset.agent, row]));
    $("agents").replaceChildren(...agents.map((agent) => this.#row(agent, rows.get(agent.name))));
    if (focused) $(focused)?.focus();
  }

  #row({ name, text }, before) {
    const row = before ?? element("li");
    row.dataset.agent = name;
    if (!before) row.append(element("h3", name), element("p", "", { role: "status" }), element("div"));
    const [, said, below] = row.children;
    if (said.textContent !== text) said.textContent = text;
    const questions = this.#agents.questions.filter(({ agent }) => agent === name).map((question) => this.#question(question));
    const own = this.#agents.buttons.filter(({ agent }) => agent === name);
    below.replaceChildren(...questions, ...(own.length ? [this.#buttons(own)] : []));
    return row;
  }

  #question({ question_id, question, choices }) {
    const whole = element("div", "", { className: "question", role: "group" });
    const asked = element("p", question, { id: `question-${question_id}` });
    whole.setAttribute("aria-labelledby", asked.id);
    const answers = element("div", "", { className: "buttons" });
    answers.append(...choices.map((choice, index) => this.#button(`choice-${question_id}-${index}`, choice,
      "answer_agent", { question_id, choice })));
    whole.append(asked, answers);
    return whole;
  }

  #buttons(own) {
    const buttons = element("div", "", { className: "buttons" });
    buttons.append(...own.map(({ button_id, label }) => this.#button(`button-${button_id}`, label, "press_button", { button_id })));
    return buttons;
  }

  #button(id, words, method, params) {
    const button = element("button", words, { type: "button", id, disabled: !this.#can.has(`method.${method}`) });
    button.addEventListener("click", () => this.#ask(method, params));
    return button;
  }
}
