// Coming in by an invitation: the link's secret or a typed code is exchanged for a token, once somebody has agreed.

import { $, text } from "./dom.js";
import { t } from "./language.js";
import { refusal } from "./words.js";

const AGAIN_MS = 2000;
const LETTERS = /^[A-HJKMNP-TV-Z2-9]{8}$/;

// The code that was typed, without what people put between its letters; null: it is none.
export function codeOf(typed) {
  const code = typed.toUpperCase().replace(/[\s-]/g, "");
  return LETTERS.test(code) ? code : null;
}

export class Joining {
  #secret = null; // of the link, a code, or the ticket with which a phone that waits asks again

  // ``connect`` opens the connection again, ``refused`` is told why there is no way in by this invitation.
  constructor(connection, { connect, refused }) {
    Object.assign(this, { connection, connect, refused });
    const [, secret] = location.hash.match(/^#join=([\w-]+)$/) ?? [];
    if (secret) history.replaceState(null, "", location.pathname + location.search); // not in the history, nor in a bookmark
    this.invited = secret ?? null;
    window.addEventListener("hashchange", () => { if (location.hash.startsWith("#join=")) location.reload(); });
    $("join").addEventListener("click", () => {
      this.begin(this.invited);
      text("join-told", "");
      connect();
    });
  }

  get isUnderWay() {
    return this.#secret !== null;
  }

  begin(secret) {
    this.#secret = secret;
    this.invited = null;
  }

  // The token; null: there is none (yet), which the page says.
  async redeem() {
    try {
      const answer = await this.connection.request("redeem_invitation", { secret: this.#secret, device: device() });
      if (answer.state === "admitted") {
        this.#secret = null;
        return answer.token;
      }
      this.#secret = answer.ticket;
      this.refused(t("join.wait"));
      setTimeout(() => { if (this.isUnderWay) this.connect(); }, AGAIN_MS);
    } catch (error) {
      if (error.kind === "connection_ended") return null; // asked again when it is back
      this.#secret = null;
      this.refused(error.kind === "method_not_found" || error.kind === "unauthenticated" ? t("join.nobody") : refusal(error));
    }
    return null;
  }
}

// What a person in a list tells phones apart by.
function device() {
  const [kind] = navigator.userAgent.match(/iPhone|iPad|Android|Windows|Macintosh|Linux/) ?? ["browser"];
  return kind === "Macintosh" ? "Mac" : kind;
}
