// What this browser keeps of how somebody has set the page up. A browser that keeps nothing starts anew each time.

const PREFIX = "chefbotd-page-";

export function kept(name, otherwise) {
  try {
    return JSON.parse(localStorage.getItem(PREFIX + name)) ?? otherwise;
  } catch {
    return otherwise;
  }
}

export function keep(name, value) {
  try {
    localStorage.setItem(PREFIX + name, JSON.stringify(value));
  } catch { /* it is not allowed to, or is full */ }
}
