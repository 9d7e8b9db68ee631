// What every part of the page needs of the document.

export const $ = (id) => document.getElementById(id);

// Only what is new is written: a screen reader would read the same again.
export function text(id, words) {
  if ($(id).textContent !== words) $(id).textContent = words;
}

export function element(name, words = "", properties = {}) {
  return Object.assign(document.createElement(name), { textContent: words, ...properties });
}
