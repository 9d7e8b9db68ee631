// The words of the page in its reader's language. English comes with the page and shows at once; another language is fetched
// and kept by the browser, so that neither the page nor its stop waits for it.

import { $, element } from "./dom.js";
import { ENGLISH, LANGUAGES } from "./english.js";

const [CHOSEN_KEY, KEPT_KEY] = ["chefbotd-language", "chefbotd-words"];
const PATIENCE_MS = 3000;
const ATTRIBUTES = "aria-label title placeholder".split(" ");

export const language = chosen();
let words = kept();
show();

// Settled once the words are those of the language, or cannot be had.
export const ready = language === "en" || kept().version === LANGUAGES[language].version ? Promise.resolve() : fetched();

// What was chosen on this page, or the first of the browser's languages that there is.
function chosen() {
  const wanted = [localStorage.getItem(CHOSEN_KEY), ...navigator.languages.map((tag) => tag.split("-")[0])];
  return wanted.find((tag) => Object.hasOwn(LANGUAGES, tag)) ?? "en";
}

function kept() {
  try {
    const all = JSON.parse(localStorage.getItem(KEPT_KEY)) ?? {};
    return all.language === language ? all : {};
  } catch (error) {
    console.warn(`the words that the browser has kept cannot be read: ${error}`);
    return {};
  }
}

async function fetchWords(wanted) {
  const file = new URL(`languages/${wanted}.json`, import.meta.url);
  const answer = await fetch(file, { signal: AbortSignal.timeout(PATIENCE_MS) });
  if (!answer.ok) throw new Error(`${file}: ${answer.status}`);
  const { version } = LANGUAGES[wanted];
  const all = { language: wanted, version, words: await answer.json() };
  localStorage.setItem(KEPT_KEY, JSON.stringify(all));
  return all;
}

function fetched() {
  return fetchWords(language).then((all) => { words = all; show(); }, (error) => console.warn(`English is shown: ${error}`));
}

function show() {
  if (!words.words && language !== "en") return;
  document.documentElement.lang = language;
  document.documentElement.dir = LANGUAGES[language].direction;
  translate(document.body);
}

// Whether there is a sentence of this id.
export const knows = (id) => Boolean(words.words?.[id] ?? ENGLISH[id]);

// The sentence of an id, with the arguments in the place of {their_names}; ``count`` chooses the plural form.
export function t(id, args = {}) {
  const own = words.words?.[id];
  const found = own ?? ENGLISH[id] ?? id;
  const pattern = typeof found === "string" ? found : found[new Intl.PluralRules(own ? language : "en").select(args.count)] ?? found.other;
  return pattern.replace(/\{(\w+)\}/g, (whole, name) => String(args[name] ?? whole));
}

// Write the words of each element with ``data-t``, and of the attributes with ``data-t-NAME``. `W` is a key to press.
// What a part of the page has written meanwhile stays.
export function translate(root) {
  for (const node of root.querySelectorAll("[data-t]")) {
    const { t: id } = node.dataset;
    const isOurs = !node.textContent || plain(node.textContent) === plain(ENGLISH[id].replaceAll("`", ""));
    if (isOurs) node.replaceChildren(...t(id).split("`").map((part, index) => (index % 2 ? element("kbd", part) : part)));
  }
  for (const name of ATTRIBUTES) {
    for (const node of root.querySelectorAll(`[data-t-${name}]`)) node.setAttribute(name, t(node.getAttribute(`data-t-${name}`)));
  }
}

const plain = (shown) => shown.replace(/\s+/g, " ").trim();

// The choice of a language, each by its own name. Another one is shown after the page has begun anew.
export function addChoice(parent, say) {
  const choice = element("select", "", { id: "language" });
  choice.setAttribute("aria-label", t("language.label"));
  for (const [tag, { name }] of Object.entries(LANGUAGES)) {
    const option = new Option(name, tag, false, tag === language);
    option.lang = tag;
    choice.append(option);
  }
  choice.addEventListener("change", async () => {
    try {
      await fetchWords(choice.value); // without a connection nothing is begun anew: a stop may be under way
      localStorage.setItem(CHOSEN_KEY, choice.value);
      location.reload();
    } catch (error) {
      console.warn(String(error));
      say(t("language.failed"));
      choice.value = language;
    }
  });
  parent.append(choice);
  ready.then(() => choice.setAttribute("aria-label", t("language.label")));
  return $("language");
}
