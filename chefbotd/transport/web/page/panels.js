// The panels: one at a time is open, beside the map on a wide screen, on a sheet from below on an upright phone. A panel
// has a tab only where one of its cards is shown. Which one is open is kept over a reload.

import { $, element } from "./dom.js";
import { keep, kept } from "./kept.js";
import { knows, t } from "./language.js";
import { Sheet } from "./sheet.js";
import { sentence } from "./words.js";

const NONE = "";
const ICON = "M4 4h7v7H4zM13 4h7v7h-7zM4 13h7v7H4zM13 13h7v7h-7z";
const DEFAULT_ORDER = 50;
const LEAST_TABS = 5;
const SETTLES_MS = 5000; // cards that are there from the beginning have come until then

export class Panels {
  #open = NONE;
  #kept = kept("panel", null); // null: nobody has chosen one yet
  #wish = this.#kept; // what is opened as soon as it is there
  #isInUse = false; // a pointer or the keyboard is at the panels, or may be
  #anchor = null; // a card, and where it was

  constructor() {
    this.sheet = new Sheet(() => this.#choose(NONE));
    for (const tab of $("rail").children) this.#listen(tab);
    for (const name of ["pointerdown", "pointermove", "focusin"]) {
      $("dock").addEventListener(name, () => { this.#isInUse = true; }, { passive: true });
    }
    $("panels").addEventListener("scroll", () => this.#remember(), { passive: true });
    const changes = new MutationObserver(() => this.#update());
    changes.observe($("panels"), { subtree: true, childList: true, attributes: true, attributeFilter: ["hidden"] });
    changes.observe(document.body, { attributes: true, attributeFilter: ["data-role"] });
    this.#update();
  }

  // A section for a component's card, at its place in its panel; a panel that the page does not have is made.
  add(id, { panel, title, order, forGuests }) {
    const section = element("section", "", { id, className: "card", hidden: true });
    section.classList.toggle("for-guests", forGuests);
    section.dataset.order = order;
    const whole = $(`panel-${panel}`) ?? this.#make(panel, titleOf(panel, title));
    whole.insertBefore(section, [...whole.children].find((other) => Number(other.dataset.order ?? DEFAULT_ORDER) > order) ?? null);
    return section;
  }

  // The daemon has let this page in: where nobody has chosen, what the role is for is opened, and on a phone the map.
  begin() {
    const isGuest = document.body.dataset.role === "guest";
    if (this.#kept === null && this.#open === NONE && (isGuest || !this.sheet.isUsed)) this.#wish = isGuest ? "programs" : "drive";
    this.#update();
    setTimeout(() => { this.#isInUse = true; }, SETTLES_MS);
  }

  isOpen(name) {
    return this.#open === name;
  }

  // Open a panel because something in it is needed; what somebody has chosen stays what is kept.
  show(name) {
    if (!$(`tab-${name}`)?.hidden) this.#show(name);
  }

  // In a small window, leave the map its room while something is drawn on it.
  fold(isFolded) {
    $("dock").classList.toggle("folded", isFolded);
    this.sheet.follow(!isFolded && this.#open !== NONE);
  }

  #listen(tab) {
    tab.addEventListener("click", () => this.#choose(this.#open === nameOf(tab) && !this.sheet.isFolded ? NONE : nameOf(tab)));
  }

  #choose(name) {
    this.#kept = name;
    keep("panel", name);
    this.#show(name);
  }

  #make(name, title) {
    const tab = element("button", "", { type: "button", id: `tab-${name}`, hidden: true });
    tab.setAttribute("aria-controls", `panel-${name}`);
    tab.setAttribute("aria-expanded", "false");
    tab.innerHTML = `<svg viewBox="0 0 24 24" aria-hidden="true"><path d="${ICON}"/></svg>`;
    tab.append(element("span", title));
    this.#listen(tab);
    $("tab-workshop").before(tab);
    const whole = element("div", "", { id: `panel-${name}`, className: "panel", hidden: true });
    $("panels").append(whole);
    return whole;
  }

  #update() {
    for (const tab of $("rail").children) this.#showTab(tab, [...$(`panel-${nameOf(tab)}`).children].some(isSeen));
    const tabs = [...$("rail").children].filter(isThere);
    if (!this.#isInUse) $("rail").style.setProperty("--tabs", Math.max(tabs.length, LEAST_TABS));
    const names = tabs.map(nameOf);
    if (this.#open !== NONE && !names.includes(this.#open)) [this.#wish, this.#open] = [this.#wish ?? this.#open, NONE];
    if (this.#wish !== null && names.includes(this.#wish)) this.#show(this.#wish);
    else if (this.#open === NONE && !$("panels").hidden) this.#show(NONE, this.#wish);
    this.#keepInPlace();
  }

  // While somebody is at the panels no tab moves: one that comes stands behind the others, one that goes leaves a gap.
  #showTab(tab, isShown) {
    if (isThere(tab) === isShown) return;
    if (this.#isInUse && isShown && tab.hidden) tab.classList.add("late");
    if (this.#isInUse && !isShown) tab.classList.add("gone");
    else {
      tab.hidden = !isShown;
      tab.classList.remove("gone");
    }
  }

  #show(name, wish = null) {
    [this.#open, this.#wish, this.#anchor] = [name, wish, null];
    for (const panel of $("panels").children) if (panel.hidden !== (panel.id !== `panel-${name}`)) panel.hidden = !panel.hidden;
    for (const tab of $("rail").children) tab.setAttribute("aria-expanded", String(nameOf(tab) === name));
    $("panels").hidden = name === NONE;
    $("panels").dataset.panel = name;
    $("panels").setAttribute("aria-labelledby", `tab-${name}`);
    $("panels").scrollTop = 0;
    for (const panel of $("panels").children) panel.style.minHeight = "";
    this.sheet.follow(name !== NONE);
    this.#remember();
  }

  // The first card that is seen, and where it is.
  #remember() {
    const top = $("panels").getBoundingClientRect().top;
    const card = [...($(`panel-${this.#open}`)?.children ?? [])].find((each) => isSeen(each) && each.getBoundingClientRect().bottom > top);
    this.#anchor = card ? { card, top: card.getBoundingClientRect().top - top } : null;
  }

  // A card that comes or goes above what somebody is about to touch does not move it.
  #keepInPlace() {
    const [panels, anchor] = [$("panels"), this.#anchor];
    if (this.#isInUse && anchor && isSeen(anchor.card)) {
      const moved = anchor.card.getBoundingClientRect().top - panels.getBoundingClientRect().top - anchor.top;
      if (Math.abs(moved) > 1) {
        const wanted = Math.max(0, panels.scrollTop + moved);
        anchor.card.parentElement.style.minHeight = `${wanted + panels.clientHeight}px`;
        panels.scrollTop = wanted;
      }
    }
    this.#remember();
  }
}

// A panel of a component has the words of its languages for ``NAME.panel``.
function titleOf(panel, title) {
  return knows(`${panel}.panel`) ? t(`${panel}.panel`) : title || sentence(panel.replaceAll("_", " "));
}

const nameOf = (tab) => tab.id.replace("tab-", "");
const isThere = (tab) => !tab.hidden && !tab.classList.contains("gone");

// Whether a card is there for this role.
function isSeen(card) {
  return !card.hidden && (document.body.dataset.role !== "guest" || card.classList.contains("for-guests"));
}
