// A question before something is deleted. Not modal: the emergency stop stays in reach, on its key too.

import { $, text } from "./dom.js";
import { t } from "./language.js";

let settle = null;
let back = null;

// Whether the person says yes; a second question takes the first one back.
export function confirmed(question, yes, no = t("confirm.keep")) {
  dismiss();
  back = document.activeElement;
  text("confirm-question", question);
  text("confirm-yes", yes);
  text("confirm-no", no);
  $("confirm").show();
  $("confirm-no").focus();
  return new Promise((resolve) => { settle = resolve; });
}

export function dismiss() {
  answer(false);
}

function answer(yes) {
  if (settle === null) return;
  $("confirm").close();
  back?.focus();
  settle(yes);
  settle = null;
}

$("confirm-no").addEventListener("click", () => answer(false));
$("confirm-yes").addEventListener("click", () => answer(true));
