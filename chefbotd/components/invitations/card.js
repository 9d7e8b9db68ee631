// Letting phones in: an administrator makes an invitation, shows its QR code, and revokes what was given.

import { $, element } from "../../dom.js";

const HTML = `
  <h2 id="invite-title">Let a phone in</h2>
  <form id="invite-form" class="row">
    <label>It may <select id="invite-role">
      <option value="guest">order and stop</option>
      <option value="drive">drive</option>
      <option value="observe">watch and stop</option>
    </select></label>
    <label>for <select id="invite-access">
      <option value="14400">4 hours</option>
      <option value="86400">a day</option>
      <option value="604800">a week</option>
      <option value="">ever, until revoked</option>
    </select></label>
    <label><input id="invite-approval" type="checkbox"> Ask me before</label>
    <button type="submit">Make an invitation</button>
  </form>
  <div id="invite-made" hidden>
    <canvas id="invite-qr" role="img" aria-label="QR code of the invitation"></canvas>
    <p>Scan it, or open this page on the phone and type the code <strong id="invite-code"></strong>.</p>
    <p class="small" id="invite-where" role="status"></p>
    <button id="invite-done" type="button">Done</button>
  </div>
  <ul id="invite-list" class="plain" aria-label="Invitations and phones that were let in"></ul>`;
const MAY = { observe: "watches", guest: "orders", agent: "is a program", drive: "drives", admin: "administers" };
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
      ? "Only this computer reaches the page: let it listen on the network first."
      : `One phone can use it, within ${made.lifetime_s / 60} minutes.`;
    $("invite-made").hidden = false;
    this.#list();
  }

  async #list() {
    if (!this.#can) return;
    const told = await this.#connection.request("list_invitations").catch(() => null);
    if (!told) return;
    const rows = [
      ...told.invitations.map((each) => ({ key: { invitation: each.invitation }, waits: each.device,
        words: each.device ? `${each.device} waits to be let in (${MAY[each.role]})` : `Invitation ${each.invitation}, not used yet (${MAY[each.role]})` })),
      ...told.devices.map((each) => ({ key: { device: each.device }, words: `${each.name} ${MAY[each.role]} ${until(each.expires_s)}` })),
    ];
    const now = JSON.stringify(rows);
    if (now === this.#drawn) return; // a finger may be on a button
    this.#drawn = now;
    $("invite-list").replaceChildren(...rows.map((row) => this.#row(row)));
  }

  #row({ key, words, waits }) {
    const row = element("li", "", { className: "row" });
    row.append(element("span", words));
    if (waits) row.append(this.#button("Let in", words, "approve_invitation", key));
    row.append(this.#button(waits ? "Turn away" : "Revoke", words, "revoke_access", key));
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
  return expires_s === null ? "until revoked" : `until ${new Date(1000 * expires_s).toLocaleString([], { dateStyle: "short", timeStyle: "short" })}`;
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
