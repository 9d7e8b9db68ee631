// A connection of a card's own, for what would hold up the robot's state and the joystick on the page's. It is open only
// while the card is seen.

import { Connection } from "./connection.js";

export class OwnConnection extends Connection {
  #isAllowed = false;
  #isInView = false;
  #isOpen = false;

  // ``begin`` is called each time that the daemon has let it in, ``follow`` when the card comes into sight or goes out of it.
  constructor(main, section, { name, begin, follow = () => {} }) {
    super(main.url);
    Object.assign(this, { main, name, begin, follow });
    this.addEventListener("hello", ({ detail }) => this.#enter(detail));
    main.addEventListener("closed", () => this.allow(false));
    document.addEventListener("visibilitychange", () => this.#update());
    new IntersectionObserver((entries) => {
      this.#isInView = entries.at(-1).isIntersecting;
      this.#update();
    }).observe(section);
  }

  get isWanted() {
    return this.#isAllowed && this.#isInView && !document.hidden;
  }

  // Whether this client may have what the card shows.
  allow(isAllowed) {
    this.#isAllowed = isAllowed;
    this.#update();
  }

  #update() {
    if (this.isWanted === this.#isOpen) return;
    this.#isOpen = this.isWanted;
    if (this.#isOpen) this.connect();
    else this.disconnect();
    this.follow(this.#isOpen);
  }

  async #enter({ auth }) {
    try {
      if (auth === "token") await this.request("authenticate", { token: this.main.token ?? "" });
      await this.request("set_client_name", { client: this.name });
      this.settled();
    } catch (error) {
      console.warn(`${this.name}: ${error}`); // it connects again by itself
      return;
    }
    this.begin();
  }
}
