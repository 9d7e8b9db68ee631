// The words of the page in its reader's language. English comes with the page and shows at once; another language is fetched
// and kept by the browser, so that neither the page nor its stop waits for it.

import { element } from "./dom.js";
import { ENGLISH, LANGUAGES } from "./english.js";
import { keep, kept } from "./kept.js";

const PATIENCE_MS = 3000;
const ATTRIBUTES = "aria-label title placeholder".split(" ");

export const language = chosen();
const formats = new Map(); // of numbers, by language and digits
const NOTHING = { version: "", words: {} };
let all = ofLanguage(kept("words", NOTHING));
show();

// Settled once the words are those of the language, or cannot be had.
export const ready = language === "en" || all.version === LANGUAGES[language].version ? Promise.resolve() : fetched();

// What was chosen on this page, or the first of the browser's languages that there is.
function chosen() {
  const wanted = [kept("language", ""), ...navigator.languages.map((tag) => tag.split("-")[0])];
  return wanted.find((tag) => Object.hasOwn(LANGUAGES, tag)) ?? "en";
}

// What the browser has kept, also of an older version: it is shown until the new words are there.
function ofLanguage(some) {
  return some.language === language ? some : NOTHING;
}

async function fetchWords(wanted) {
  const file = new URL(`languages/${wanted}.json`, import.meta.url);
  const answer = await fetch(file, { signal: AbortSignal.timeout(PATIENCE_MS) });
  if (!answer.ok) throw new Error(`${file}: ${answer.status}`);
  const { version } = LANGUAGES[wanted];
  const told = { language: wanted, version, words: await answer.json() };
  keep("words", told);
  return told;
}

function fetched() {
  return fetchWords(language).then((told) => { all = told; show(); }, (error) => console.warn(`English is shown: ${error}`));
}

function show() {
  if (!all.version && language !== "en") return;
  document.documentElement.lang = language;
  document.documentElement.dir = LANGUAGES[language].direction;
  translate(document.body);
}

// Whether there is a sentence of this id.
export const knows = (id) => Boolean(all.words[id] ?? ENGLISH[id]);

// Whether the language has a sentence of its own for this id: what the daemon says is English already.
export const isTranslated = (id) => id in all.words;

// What one of a group is called, such as a state of the daemon; one that has no words is called by its own name.
export const named = (group, name) => (knows(`${group}.${name}`) ? t(`${group}.${name}`) : name);

// The sentence of an id, with the arguments in the place of {their_names}; ``count`` chooses the plural form.
export function t(id, args = {}) {
  const own = all.words[id];
  const found = own ?? ENGLISH[id] ?? id;
  const pattern = typeof found === "string" ? found : found[new Intl.PluralRules(own ? language : "en").select(args.count)] ?? found.other;
  return pattern.replace(/\{(\w+)\}/g, (whole, name) => (name in args ? isolated(shown(args[name] ?? whole), own) : whole));
}

// A number with so many digits behind the language's decimal sign; nothing for none. The digits are those of the page's figures.
export function figure(value, digits) {
  if (value === null || value === undefined) return value;
  return format({ minimumFractionDigits: digits, maximumFractionDigits: digits }).format(value);
}

function format(options) {
  const tag = all.version ? language : "en"; // its words may not be there yet
  const key = tag + JSON.stringify(options);
  if (!formats.has(key)) formats.set(key, new Intl.NumberFormat(`${tag}-u-nu-latn`, { useGrouping: false, ...options }));
  return formats.get(key);
}

function shown(value) {
  return typeof value === "number" ? format({ maximumFractionDigits: 2 }).format(value) : String(value);
}

// Figures and names keep their own direction in a sentence that runs from the right (Unicode's FSI and PDI).
function isolated(words, isOwn) {
  return isOwn && LANGUAGES[language].direction === "rtl" ? `\u2068${words}\u2069` : words;
}

// Write the words of each element with ``data-t``, and of the attributes with ``data-t-NAME``. `W` is a key to press.
// What a part of the page has written meanwhile stays.
export function translate(root) {
  for (const node of root.querySelectorAll("[data-t]")) {
    const { t: id } = node.dataset;
    const isOurs = !node.textContent || joined(node.textContent) === ENGLISH[id].replaceAll("`", "");
    if (isOurs) node.replaceChildren(...t(id).split("`").map((part, index) => (index % 2 ? element("kbd", part) : part)));
  }
  for (const name of ATTRIBUTES) {
    for (const node of root.querySelectorAll(`[data-t-${name}]`)) node.setAttribute(name, t(node.getAttribute(`data-t-${name}`)));
  }
}

function joined(shown) {
  return shown.replace(/\s+/g, " ").trim();
}

// Write the words of an id into an element, and in another language as soon as that is there.
export function tell(node, id) {
  node.dataset.t = id;
  if (node.textContent !== t(id)) node.textContent = t(id);
}

// The same for what a screen reader calls it.
export function label(node, id) {
  node.setAttribute("data-t-aria-label", id);
  node.setAttribute("aria-label", t(id));
}

// The choice of a language, each by its own name. Another one is shown after the page has begun anew; ``say`` tells why not.
export function offerLanguages(choice, say) {
  for (const [tag, { name }] of Object.entries(LANGUAGES)) {
    const option = new Option(name, tag, tag === language, tag === language);
    option.lang = tag;
    choice.append(option);
  }
  choice.addEventListener("change", async () => {
    try {
      await fetchWords(choice.value); // without a connection nothing is begun anew: a stop may be under way
      keep("language", choice.value);
      location.reload();
    } catch (error) {
      console.warn(String(error));
      say(t("language.failed"));
      choice.value = language;
    }
  });
}
