// The button to talk. Pressing it is told to the robot at once, before the microphone is even asked for.

import { onContact } from "./stops.js";

const $ = (id) => document.getElementById(id);
const TOKEN_KEY = "chefbot-speech-token";
const AGAIN_MS = 1000;
const FLUSH_MS = 300;
const ANSWER_MS = 800;
const LOST = "not connected: the robot may still be driving, and nothing on this page stops it";
const UNREACHED = "The stop did not reach the robot. Hold it or switch its motors off.";
const NO_RATE_HZ = 48000; // while there is no microphone
const NO_MICROPHONE = "The browser gives no microphone to a page without https. Open this page by https, "
  + "or on the robot's own computer as http://localhost. Touching and stopping work all the same.";
const GONE = "The microphone is gone: nothing more was heard. Plug it in, and hold the button again.";

let socket = null;
let sound = null; // {context, node, track}, once the microphone is allowed
let pressed = false;
let unanswered = null; // the timer of a stop

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/socket`);
  socket.onopen = () => socket.send(JSON.stringify({ token: sessionStorage.getItem(TOKEN_KEY) }));
  socket.onmessage = ({ data }) => show(JSON.parse(data));
  socket.onclose = () => {
    pressed = false;
    $("connection").textContent = LOST;
    $("talking").hidden = true;
    if ($("login").hidden) setTimeout(connect, AGAIN_MS);
  };
}

function send(message) {
  const words = typeof message === "string" ? { event: message } : message;
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(words));
}

// Ask for a stop, and say so where it does not arrive.
function stop() {
  if (socket.readyState !== WebSocket.OPEN) return warn(true);
  unanswered ??= setTimeout(() => warn(true), ANSWER_MS);
  return send("stop");
}

function warn(isUnreached) {
  clearTimeout(unanswered);
  unanswered = null;
  $("unreached").hidden = !isUnreached;
  $("unreached").textContent = isUnreached ? UNREACHED : "";
}

function show(state) {
  if (state.refused !== undefined) {
    $("login").hidden = false;
    $("connection").textContent = state.refused;
    return;
  }
  $("login").hidden = true;
  $("talking").hidden = false;
  if ($("connection").textContent !== "connected") $("connection").textContent = "connected";
  if ($("text").textContent !== state.text) $("text").textContent = state.text;
  $("confirm").hidden = !state.proposal;
  if (state.stopped !== undefined) warn(!state.stopped);
  document.body.dataset.phase = state.phase;
  if (state.places) showPlaces(state);
}

function showPlaces({ places, left_out: leftOut }) {
  const examples = [...places.map((place) => `Go to ${place}`), "Stop", "Cancel"];
  $("places").replaceChildren(...examples.map((words) => Object.assign(document.createElement("li"), { textContent: words })));
  $("left-out").hidden = leftOut.length === 0;
  $("left-out").textContent = `These places sound like another, or have words that I do not know: ${leftOut.join(", ")}`;
}

async function openMicrophone() {
  if (!navigator.mediaDevices || !window.isSecureContext) throw new Error(NO_MICROPHONE);
  const stream = await navigator.mediaDevices.getUserMedia({ audio: { channelCount: 1 } });
  const context = new AudioContext();
  await context.audioWorklet.addModule("/microphone.js");
  const node = new AudioWorkletNode(context, "microphone", { numberOfOutputs: 0 });
  context.createMediaStreamSource(stream).connect(node);
  const [track] = stream.getAudioTracks();
  const opened = { context, node, track, flushed: () => {} };
  for (const name of ["ended", "mute"]) track.addEventListener(name, () => loseMicrophone(opened));
  node.port.onmessage = ({ data }) => {
    if (data === "flushed") opened.flushed();
    else if (opened.sends && socket.readyState === WebSocket.OPEN) socket.send(data);
  };
  return opened;
}

// One that is unplugged, or that the system takes away, would send silence for ever. The next press asks for one again.
function loseMicrophone(lost) {
  if (sound !== lost) return;
  [sound, lost.sends] = [null, false];
  lost.track.stop();
  lost.context.close();
  lost.flushed();
  $("microphone").textContent = GONE;
  if (!pressed) return;
  pressed = false;
  $("talk").setAttribute("aria-pressed", "false");
  send("lost");
}

// What is on its way is handed over; the promise ends when it is, or after a while.
function flush() {
  const flushed = new Promise((resolve) => { sound.flushed = resolve; setTimeout(resolve, FLUSH_MS); });
  sound.node.port.postMessage("flush");
  return flushed;
}

async function press() {
  if (pressed) return;
  pressed = true;
  $("talk").setAttribute("aria-pressed", "true");
  send({ event: "press", rate_hz: sound?.context.sampleRate ?? NO_RATE_HZ });
  try {
    if (sound === null) {
      sound = await openMicrophone();
      if (pressed) send({ event: "press", rate_hz: sound.context.sampleRate });
    }
    const own = sound;
    await own.context.resume();
    await flush(); // what was heard before the press is not sent
    if (sound !== own) return; // lost meanwhile
    own.sends = pressed;
    $("microphone").textContent = "";
  } catch (problem) {
    sound = null;
    $("microphone").textContent = problem.message || String(problem);
  }
}

async function release() {
  if (!pressed) return;
  pressed = false;
  $("talk").setAttribute("aria-pressed", "false");
  const own = sound;
  if (own?.sends) {
    await flush();
    if (sound === own) own.sends = pressed; // somebody may have pressed again meanwhile
    if (pressed) return;
  }
  send("release");
}

$("talk").addEventListener("pointerdown", (event) => { $("talk").setPointerCapture(event.pointerId); press(); });
for (const name of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) $("talk").addEventListener(name, release);
// While another finger scrolls, no pointer is told of. Talking with such a touch only brakes.
$("talk").addEventListener("touchstart", () => { if (!pressed) stop(); }, { passive: true });
$("talk").addEventListener("keydown", (event) => { if (event.code === "Space" && !event.repeat) { event.preventDefault(); press(); } });
$("talk").addEventListener("keyup", (event) => { if (event.code === "Space") release(); });
onContact($("stop"), stop);
// Esc everywhere, and Space everywhere but on the button to talk, whose press brakes too, and where it is typed.
addEventListener("keydown", (event) => {
  const isSpace = event.code === "Space" && !event.target.closest?.("#talk, input");
  if (!isSpace && event.code !== "Escape") return;
  event.preventDefault();
  if (!event.repeat) stop();
}, { capture: true });
addEventListener("keyup", (event) => { if (event.code === "Space" && !event.target.closest?.("#talk, input")) event.preventDefault(); }, { capture: true });
$("talk").addEventListener("contextmenu", (event) => event.preventDefault());
document.addEventListener("visibilitychange", () => { if (document.hidden) release(); });
document.addEventListener("pointerdown", (event) => { if (!event.target.closest("#talk, #confirm")) send("touch"); });
$("yes").addEventListener("click", () => send({ event: "answer", choice: "yes" }));
onContact($("no"), () => send({ event: "answer", choice: "no" }));
$("login").addEventListener("submit", (event) => {
  event.preventDefault();
  sessionStorage.setItem(TOKEN_KEY, $("token").value.trim().split(/\s+/).at(-1));
  $("token").value = "";
  $("login").hidden = true;
  connect();
});
connect();
