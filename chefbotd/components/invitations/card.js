// Letting phones in: an administrator makes an invitation, shows its QR code, and revokes what was given.

import { $, element } from "../../dom.js";
import { language, t, translate } from "../../language.js";

const HTML = `
  <h2 id="invite-title" data-t="invitations.title"></h2>
  <form id="invite-form" class="row">
    <label><span data-t="invitations.may"></span> <select id="invite-role">
      <option value="guest" data-t="invitations.order"></option>
      <option value="drive" data-t="invitations.drive"></option>
      <option value="observe" data-t="invitations.watch"></option>
    </select></label>
    <label><span data-t="invitations.for"></span> <select id="invite-access">
      <option value="14400" data-t="invitations.hours"></option>
      <option value="86400" data-t="invitations.day"></option>
      <option value="604800" data-t="invitations.week"></option>
      <option value="" data-t="invitations.ever"></option>
    </select></label>
    <label><input id="invite-approval" type="checkbox"> <span data-t="invitations.ask"></span></label>
    <button type="submit" data-t="invitations.make"></button>
  </form>
  <div id="invite-made" hidden>
    <canvas id="invite-qr" role="img" data-t-aria-label="invitations.qr"></canvas>
    <p><span data-t="invitations.scan"></span> <strong id="invite-code"></strong>.</p>
    <p class="small" id="invite-where" role="status"></p>
    <button id="invite-done" type="button" data-t="invitations.done"></button>
  </div>
  <ul id="invite-list" class="plain" data-t-aria-label="invitations.list"></ul>`;
const SHOWN_MS = 2000;
const QUIET = 4; // modules around a QR code, ISO/IEC 18004
const MODULE_PX = 6;

export default class Invitations {
  #ask;
  #connection;
  #section;
  #can = false;
  #drawn = "";

  constructor({ connection, ask, section }) {
    section.innerHTML = HTML;
    translate(section);
    section.setAttribute("aria-labelledby", "invite-title");
    this.#ask = ask;
    this.#connection = connection;
    this.#section = section;
    $("invite-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.#make();
    });
    $("invite-done").addEventListener("click", () => { $("invite-made").hidden = true; });
    connection.addEventListener("closed", () => { this.#can = false; });
    setInterval(() => { if (!document.hidden) this.#list(); }, SHOWN_MS);
  }

  begin(can) {
    this.#can = can.has("method.make_invitation");
    this.#section.hidden = !this.#can;
    this.#list();
  }

  async #make() {
    const access = $("invite-access").value;
    const made = await this.#ask("make_invitation", {
      role: $("invite-role").value, approval: $("invite-approval").checked, access_s: access ? Number(access) : null,
    });
    if (!made) return;
    drawQr($("invite-qr"), made.qr);
    $("invite-code").textContent = made.code;
    $("invite-where").textContent = made.on_this_computer_only
      ? t("invitations.here_only")
      : t("invitations.one_use", { count: made.lifetime_s / 60 });
    $("invite-made").hidden = false;
    this.#list();
  }

  async #list() {
    if (!this.#can) return;
    const told = await this.#connection.request("list_invitations").catch(() => null);
    if (!told) return;
    const rows = [
      ...told.invitations.map((each) => ({ key: { invitation: each.invitation }, waits: each.device,
        words: t(`invitations.${each.device ? "waits" : "unused"}.${each.role}`, each) })),
      ...told.devices.map((each) => ({ key: { device: each.device }, words: t(`invitations.is_in.${each.role}`, { device: each.name, until: until(each.expires_s) }) })),
    ];
    const now = JSON.stringify(rows);
    if (now === this.#drawn) return; // a finger may be on a button
    this.#drawn = now;
    $("invite-list").replaceChildren(...rows.map((row) => this.#row(row)));
  }

  #row({ key, words, waits }) {
    const row = element("li", "", { className: "row" });
    row.append(element("span", words));
    if (waits) row.append(this.#button(t("invitations.let_in"), words, "approve_invitation", key));
    row.append(this.#button(t(waits ? "invitations.turn_away" : "invitations.revoke"), words, "revoke_access", key));
    return row;
  }

  #button(words, whom, method, params) {
    const button = element("button", words, { type: "button" });
    button.setAttribute("aria-label", `${words}: ${whom}`);
    button.addEventListener("click", async () => {
      await this.#ask(method, params);
      this.#list();
    });
    return button;
  }
}

function until(expires_s) {
  return expires_s === null ? t("invitations.until_revoked")
    : t("invitations.until", { time: new Date(1000 * expires_s).toLocaleString(language, { dateStyle: "short", timeStyle: "short" }) });
}

// Black on white also in dark mode: many scanners read no other.
function drawQr(canvas, rows) {
  const side = (rows.length + 2 * QUIET) * MODULE_PX;
  Object.assign(canvas, { width: side, height: side });
  const paint = canvas.getContext("2d");
  paint.fillStyle = "#fff";
  paint.fillRect(0, 0, side, side);
  paint.fillStyle = "#000";
  rows.forEach((row, y) => [...row].forEach((module, x) => {
    if (module === "1") paint.fillRect((x + QUIET) * MODULE_PX, (y + QUIET) * MODULE_PX, MODULE_PX, MODULE_PX);
  }));
}
