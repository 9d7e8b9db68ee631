// Coming in: the daemon's greeting, the token if it asks for one, and what the role that comes with it may do.

import { $, text } from "./dom.js";
import { codeOf, Joining } from "./joining.js";
import { knows, t, tell } from "./language.js";
import { me } from "./words.js";

const TOKEN_KEY = "chefbotd-token";
const RANKS = ["observe", "guest", "agent", "drive", "admin"];

export class Login {
  #token = sessionStorage.getItem(TOKEN_KEY) ?? localStorage.getItem(TOKEN_KEY); // what an invitation gave is kept longer
  #joining;

  // ``begin`` is called with the capabilities each time the daemon has let this page in.
  constructor(connection, begin) {
    Object.assign(this, { connection, begin });
    this.#joining = new Joining(connection, {
      connect: () => connection.connect(),
      refused: (words) => this.#askForToken(words),
    });
    connection.addEventListener("hello", ({ detail }) => this.#greeted(detail));
    $("login-form").addEventListener("submit", () => {
      const code = codeOf($("token").value);
      if (code) this.#joining.begin(code);
      else this.#token = $("token").value.trim().split(/\s+/).at(-1); // a line of a token file, or the token alone
      $("token").value = "";
      text("login-told", "");
      this.#setBehind(false);
      connection.connect();
    });
  }

  async #greeted(hello) {
    text("robot", hello.robot);
    document.title = hello.robot;
    if (this.#joining.isUnderWay && !(await this.#join())) return undefined;
    if (hello.auth === "token" && (this.#token === null || this.#joining.invited)) return this.#askForToken("");
    const role = await this.#role();
    if (role === null) return undefined;
    $("login").close();
    this.#setBehind(false);
    this.connection.settled();
    tell($("connection"), "connection.connected");
    const can = await this.#permitted(new Set(hello.capabilities), role);
    await this.connection.request("set_client_name", { client: me }).catch(() => {});
    return this.begin(can);
  }

  // Whether an invitation has given a token, which this browser keeps until it is revoked.
  async #join() {
    const token = await this.#joining.redeem();
    if (token === null) return false;
    this.#token = token;
    sessionStorage.removeItem(TOKEN_KEY);
    localStorage.setItem(TOKEN_KEY, token);
    return true;
  }

  // The role that the daemon gives, with or without a token; null where it lets nobody in.
  async #role() {
    try {
      const { role } = await this.connection.request("authenticate", { token: this.#token ?? "" });
      this.connection.token = this.#token; // for a part with a connection of its own
      if (this.#token !== null && this.#token !== localStorage.getItem(TOKEN_KEY)) sessionStorage.setItem(TOKEN_KEY, this.#token);
      return role;
    } catch (error) {
      if (error.kind !== "wrong_token") return null;
      this.#token = null;
      for (const kept of [sessionStorage, localStorage]) kept.removeItem(TOKEN_KEY);
      this.#askForToken(t("login.wrong_token"));
      return null;
    }
  }

  #askForToken(words) {
    text("login-told", words);
    $("join-part").hidden = !this.#joining.invited;
    $("token-part").hidden = Boolean(this.#joining.invited);
    this.#setBehind(true);
    if (!$("login").open) $("login").show(); // not modal: the stops stay in reach, and say that they do not reach the robot
    this.connection.disconnect();
  }

  // Without a token there is nothing else to do on this page.
  #setBehind(isBehind) {
    for (const part of document.querySelectorAll("header, main")) part.inert = isBehind;
  }

  // The daemon's capabilities without what this role may not use: that is as good as absent.
  async #permitted(capabilities, role) {
    document.body.dataset.role = role; // guests see the cards that are for them
    const mayAll = !knows(`role.${role}`);
    $("role-part").hidden = mayAll;
    text("role", mayAll ? "" : t(`role.${role}`));
    if (mayAll) return capabilities;
    const { methods, topics } = await this.connection.request("describe");
    const mayNot = role === "guest" ? (each) => !each.for_guests : ({ role: needed }) => RANKS.indexOf(needed) > RANKS.indexOf(role);
    for (const [name, method] of Object.entries(methods)) if (mayNot(method)) capabilities.delete(`method.${name}`);
    for (const [name, topic] of Object.entries(topics)) if (role === "guest" && mayNot(topic)) capabilities.delete(`topic.${name}`);
    return capabilities;
  }
}
