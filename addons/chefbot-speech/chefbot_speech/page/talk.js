// The button to talk. Pressing it is told to the robot at once, before the microphone is even asked for.

const $ = (id) => document.getElementById(id);
const TOKEN_KEY = "chefbot-speech-token";
const AGAIN_MS = 1000;
const FLUSH_MS = 300;
const NO_RATE_HZ = 48000; // while there is no microphone
const NO_MICROPHONE = "The browser gives no microphone to a page without https. Open this page by https, "
  + "or on the robot's own computer as http://localhost. Touching and stopping work all the same.";

let socket = null;
let sound = null; // {context, node}, once the microphone is allowed
let pressed = false;

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/socket`);
  socket.onopen = () => socket.send(JSON.stringify({ token: sessionStorage.getItem(TOKEN_KEY) }));
  socket.onmessage = ({ data }) => show(JSON.parse(data));
  socket.onclose = () => {
    pressed = false;
    $("connection").textContent = "not connected";
    $("talking").hidden = true;
    if ($("login").hidden) setTimeout(connect, AGAIN_MS);
  };
}

function send(message) {
  const words = typeof message === "string" ? { event: message } : message;
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(words));
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
  const opened = { context, node, flushed: () => {} };
  node.port.onmessage = ({ data }) => {
    if (data === "flushed") opened.flushed();
    else if (opened.sends && socket.readyState === WebSocket.OPEN) socket.send(data);
  };
  return opened;
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
    await sound.context.resume();
    await flush(); // what was heard before the press is not sent
    sound.sends = pressed;
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
  if (sound?.sends) {
    await flush();
    sound.sends = pressed; // somebody may have pressed again meanwhile
    if (pressed) return;
  }
  send("release");
}

$("talk").addEventListener("pointerdown", (event) => { $("talk").setPointerCapture(event.pointerId); press(); });
for (const name of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) $("talk").addEventListener(name, release);
$("talk").addEventListener("keydown", (event) => { if (event.code === "Space" && !event.repeat) { event.preventDefault(); press(); } });
$("talk").addEventListener("keyup", (event) => { if (event.code === "Space") release(); });
$("talk").addEventListener("contextmenu", (event) => event.preventDefault());
document.addEventListener("visibilitychange", () => { if (document.hidden) release(); });
document.addEventListener("pointerdown", (event) => { if (!event.target.closest("#talk, #confirm")) send("touch"); });
$("yes").addEventListener("click", () => send({ event: "answer", choice: "yes" }));
$("no").addEventListener("click", () => send({ event: "answer", choice: "no" }));
$("login").addEventListener("submit", (event) => {
  event.preventDefault();
  sessionStorage.setItem(TOKEN_KEY, $("token").value.trim().split(/\s+/).at(-1));
  $("token").value = "";
  $("login").hidden = true;
  connect();
});
connect();
