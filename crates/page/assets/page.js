// What the harness tells, shown as it comes. Texts are put in as texts and never as HTML: devices may say anything.
"use strict";
const byId = (id) => document.getElementById(id);
const secret = location.pathname.split("/")[1];
// This page comes again under its name after a break, and takes its own place.
const name = crypto.getRandomValues(new Uint32Array(2)).join("-");
const LOST_AFTER = 15_000;
const RETRY_AFTER = 2_000;
// A second tap of a hasty finger is no answer to the next question, which stands at the same place.
const CALM_FOR = 700;
const seen = { head: null, test: null, question: null, tests: [], findings: [], floor: null, vehicle: null, fleet: null };
let source = null;
let lastHeard = 0;
let retryAt = 0;
let ahead = 0;
let isOver = false;
let asked = 0;
let askedAt = 0;
let opener = null;

const put = (id, text) => {
  const element = byId(id);
  if (element.textContent !== text) element.textContent = text;
};
const show = (id, is) => {
  byId(id).hidden = !is;
};
const make = (tag, text, kind) => {
  const element = document.createElement(tag);
  if (text !== undefined) element.textContent = text;
  if (kind) element.className = kind;
  return element;
};
const clock = (at) => new Date(at).toLocaleTimeString();
const span = (milliseconds) => {
  const seconds = Math.max(0, Math.ceil(milliseconds / 1000));
  const two = (number) => String(number).padStart(2, "0");
  if (seconds >= 3600) return `${Math.floor(seconds / 3600)}:${two(Math.floor(seconds / 60) % 60)}:${two(seconds % 60)}`;
  return `${Math.floor(seconds / 60)}:${two(seconds % 60)}`;
};
const serverNow = () => Date.now() + ahead;

function showHead(head) {
  const { facts } = head;
  const watches = facts.command === "watch";
  document.body.toggleAttribute("data-watch", watches);
  const device = [facts.manufacturer, facts.serialNumber].filter(Boolean).join(" ");
  put("device", device || "vda5050-tck");
  put("about", [facts.command, facts.role, facts.protocol && `VDA 5050 ${facts.protocol}`, facts.run && `run ${facts.run}`].filter(Boolean).join(" · "));
  const phases = watches ? { runs: "Nothing is sent; what is heard is judged.", ended: "The watch is over." } : {
    begins: "The bench is put up.",
    "expects-device": "The device is awaited.",
    runs: "The run goes on.",
    stops: "The run ends: what the device was given is called off.",
    ended: "The run is over.",
  };
  put("phase", phases[head.phase] || "It begins to listen.");
  put("broker", facts.broker || "not known yet");
  put("address", head.address || "not known yet");
  put("connections", head.connections === null ? "none seen" : String(head.connections));
  put("connection", head.connection || "nothing yet");
  const stops = head.phase === "stops" || head.phase === "ended";
  byId("stop").disabled = stops;
  if (stops) show("sure", false);
  show("outcome", head.outcome !== null);
  if (head.outcome) {
    isOver = true;
    put("outcome-verdict", head.outcome.verdict);
    byId("outcome-verdict").className = head.outcome.verdict;
    put("outcome-statement", head.outcome.statement);
    put("outcome-report", `Report, on the machine of the harness: ${head.outcome.report}`);
  }
  title();
}

function showTest(test) {
  show("running", test !== null);
  if (!test) return;
  put("test-title", test.title);
  put("test-id", `${test.test} (${test.number} of ${test.of})`);
  put("step", test.step ? test.step.title || inWords(test.step.does) : "it begins");
}

// What a step without a title does, from the words of its suite, such as `expect: state`.
function inWords(does) {
  const [verb, what] = does.split(": ");
  const words = {
    send: "a message is sent",
    expect: "a message is awaited",
    never: "a message that must not come is looked out for",
    always: "every message is looked at",
    action: "an action is awaited",
    operator: "something has to be done at the device",
  };
  return what && words[verb] ? `${words[verb]} (${what})` : does;
}

function letAnswer() {
  const calm = askedAt + CALM_FOR - Date.now();
  for (const id of ["done", "skip", "end"]) byId(id).disabled = calm > 0;
  if (calm > 0) setTimeout(letAnswer, calm);
}

function showQuestion(question) {
  show("question", question !== null);
  if (question && asked !== question.number) askedAt = Date.now();
  letAnswer();
  put("question-said", "");
  if (!question) return title();
  const of = question.of === undefined ? "" : ` of ${question.of}`;
  put("question-title", `Prompt ${question.number}${of}: somebody has to do this`);
  put("question-text", question.text);
  put("question-test", [question.title, question.test].filter(Boolean).join(" – ") || "none");
  for (const id of ["question-step", "question-step-name"]) show(id, question.step !== null);
  put("question-step", question.step || "");
  put("question-why", question.why || "the test cannot go on without it");
  if (asked !== question.number) {
    asked = question.number;
    ring();
    byId("question").scrollIntoView({ block: "start" });
  }
  title();
}

function showTests(tests) {
  const count = {};
  for (const { state } of tests) count[state] = (count[state] || 0) + 1;
  const runs = tests.length - (count["left-out"] || 0);
  const done = runs - (count.left || 0) - (count.runs || 0);
  byId("bar").max = Math.max(1, runs);
  byId("bar").value = done;
  const verdicts = ["fail", "error", "inconclusive", "warning", "pass"].filter((verdict) => count[verdict]);
  const parts = [`${done} of ${runs} done`, ...verdicts.map((verdict) => `${count[verdict]} ${verdict}`)];
  if (count["left-out"]) parts.push(`${count["left-out"]} left out`);
  put("counts", tests.length ? parts.join(" · ") : "not planned yet");
  const rows = tests.map(({ test, state, why }) => {
    const row = make("tr");
    const head = make("th", test);
    head.scope = "row";
    row.append(head, make("td", state.replace("-", " "), state), make("td", why || ""));
    return row;
  });
  byId("tests").replaceChildren(...rows);
}

function showFleet({ heard, vehicles }) {
  show("fleet", heard > 0);
  put("fleet-heard", heard > vehicles.length ? `The worst ${vehicles.length} of ${heard}.` : `${heard} heard, the worst first.`);
  const number = (value) => (Number.isFinite(value) ? value.toFixed(1) : "?");
  const rows = vehicles.map((vehicle) => {
    const row = make("tr");
    const head = make("th", vehicle.name);
    head.scope = "row";
    const found = make("td");
    if (vehicle.finding) found.append(make("span", vehicle.finding[0], vehicle.finding[0]), ` ${vehicle.finding[1]}`);
    else found.textContent = "nothing";
    const place = Number.isFinite(vehicle.x) ? `${number(vehicle.x)}, ${number(vehicle.y)} on ${vehicle.map || "?"}${vehicle.driving ? ", drives" : ""}` : "not known";
    const cells = [vehicle.connection, vehicle.mode, vehicle.order, vehicle.lastNode, place, vehicle.errors.join(", "), vehicle.heard === null ? "" : clock(vehicle.heard)];
    row.append(head, found, ...cells.map((text) => make("td", text || "none")));
    return row;
  });
  byId("vehicles").replaceChildren(...rows);
  window.floorPicture.fleet(vehicles);
}

function recordButton(number, label) {
  const button = make("button", label, "link");
  button.type = "button";
  button.addEventListener("click", () => openRecord(number, button));
  return button;
}

function showFindings(findings) {
  show("no-findings", findings.length === 0);
  const items = findings.map(({ requirement, verdict, by, message, record, count, asks }) => {
    const item = make("li");
    item.append(make("span", verdict, verdict), ` ${requirement}: ${asks ? `${asks} Seen: ` : ""}${message} `);
    if (count > 1) item.append(`(${count} times) `);
    item.append(make("span", `– found by ${by} `));
    if (record !== undefined) item.append(recordButton(record, `message #${record}`));
    return item;
  });
  byId("findings").replaceChildren(...items);
  window.floorPicture.findings(findings.filter(({ spot }) => spot));
}

function addMessages(messages, reset) {
  for (const way of ["to-device", "from-device"]) {
    const list = byId(way);
    if (reset) list.replaceChildren();
    for (const message of messages.filter((one) => one.way === way)) {
      const item = make("li");
      const at = make("time", clock(message.at));
      item.append(at, " ", recordButton(message.record, `#${message.record}`), ` ${message.topic} `, make("code", message.text));
      list.prepend(item);
    }
    while (list.children.length > 20) list.lastChild.remove();
  }
}

function addLines(lines, reset) {
  const list = byId("lines");
  if (reset) list.replaceChildren();
  for (const { at, kind, text, record } of lines) {
    const item = make("li");
    item.append(make("time", clock(at)), " ", make("span", text, kind));
    if (record !== null) item.append(" ", recordButton(record, `#${record}`));
    list.prepend(item);
  }
  while (list.children.length > 200) list.lastChild.remove();
}

async function openRecord(number, from) {
  opener = from;
  put("record-title", `Record #${number}`);
  put("record-text", "…");
  show("record", true);
  try {
    const response = await fetch(`record/${number}`);
    const told = await response.json();
    put("record-text", response.ok ? [told.payload, told.whole].filter(Boolean).join("\n\n") : told.error);
  } catch {
    put("record-text", "The harness does not answer.");
  }
  byId("record").focus();
  byId("record").scrollIntoView({ block: "nearest" });
}

function tick() {
  const now = serverNow();
  if (seen.question) {
    const left = seen.question.until - now;
    put("question-left", left > 0 ? `${span(left)} left` : "the time is up");
  }
  const step = seen.test && seen.test.step;
  if (step) {
    const waited = span(now - step.since);
    put("waits", step.until && step.until > now ? `${span(step.until - now)} at most (for ${waited} already)` : `for ${waited} already`);
  } else {
    put("waits", "");
  }
  const ends = seen.head && seen.head.ends;
  const goesOn = ends > now ? `About ${span(ends - now)} left, until ${clock(ends - ahead)}` : "It takes longer than was expected.";
  if (seen.head) put("ends", seen.question ? "The run goes on when the question is answered." : ends ? goesOn : "");
  const isLost = !isOver && Date.now() - lastHeard > LOST_AFTER;
  show("lost", isLost || (source === null && !isOver));
  if (isLost && source && Date.now() > retryAt) {
    retryAt = Date.now() + LOST_AFTER;
    listen();
  }
}

function title() {
  const device = byId("device").textContent;
  document.title = seen.question ? `▶ Do this: ${device}` : isOver ? `Over: ${device}` : device;
}

function take(told) {
  ahead = told.now - Date.now();
  for (const part of Object.keys(seen)) if (part in told) seen[part] = told[part];
  if ("head" in told) showHead(told.head);
  if ("test" in told) showTest(told.test);
  if ("question" in told) showQuestion(told.question);
  if ("tests" in told) showTests(told.tests);
  if ("findings" in told) showFindings(told.findings);
  if ("floor" in told) window.floorPicture.floor(told.floor);
  if ("vehicle" in told) window.floorPicture.vehicle(told.vehicle);
  if ("fleet" in told) showFleet(told.fleet);
  addMessages(told.messages, told.reset);
  addLines(told.lines, told.reset);
  tick();
}

// A new connection is told everything from the start, so nothing is lost by a break.
function listen() {
  if (source) source.close();
  if (isOver) return;
  const own = new EventSource(`events?page=${name}`);
  source = own;
  const heard = () => {
    lastHeard = Date.now();
  };
  own.addEventListener("message", (event) => {
    heard();
    take(JSON.parse(event.data));
    if (isOver) own.close();
  });
  own.addEventListener("alive", heard);
  own.addEventListener("error", () => {
    own.close();
    if (source !== own) return;
    source = null;
    tick();
    if (!isOver) setTimeout(() => source || listen(), RETRY_AFTER);
  });
}

async function post(what, body, said) {
  put(said, "…");
  try {
    const response = await fetch(what, {
      method: "POST",
      headers: { "content-type": "application/json", "x-page-secret": secret },
      body: JSON.stringify(body),
    });
    const told = await response.json();
    put(said, response.ok ? "The harness has it." : told.error);
    return response.ok;
  } catch {
    put(said, "The harness does not answer; press again.");
    return false;
  }
}

for (const id of ["done", "skip", "end"]) {
  byId(id).addEventListener("click", async () => {
    if (!seen.question) return;
    const { number } = seen.question;
    for (const other of ["done", "skip", "end"]) byId(other).disabled = true;
    const taken = await post("answer", { number, answer: id }, "question-said");
    if (!taken && seen.question && seen.question.number === number) for (const other of ["done", "skip", "end"]) byId(other).disabled = false;
  });
}
byId("stop").addEventListener("click", () => {
  show("sure", true);
  byId("sure-yes").focus();
});
byId("sure-no").addEventListener("click", () => {
  show("sure", false);
  byId("stop").focus();
});
byId("sure-yes").addEventListener("click", () => {
  show("sure", false);
  post("stop", {}, "stop-said");
});
byId("record-close").addEventListener("click", () => {
  show("record", false);
  if (opener && opener.isConnected) opener.focus();
});

// A browser lets a page ring only once somebody has pressed something there.
let sound = null;
byId("sound").addEventListener("click", () => {
  if (sound) {
    sound.close();
    sound = null;
  } else {
    sound = new AudioContext();
    ring();
  }
  byId("sound").setAttribute("aria-pressed", String(sound !== null));
  put("sound", sound ? "Sound on" : "Sound off");
});
function ring() {
  if (!sound) return;
  for (const start of [0, 0.4, 0.8]) {
    const tone = sound.createOscillator();
    const volume = sound.createGain();
    tone.frequency.value = 880;
    volume.gain.value = 0.3;
    tone.connect(volume).connect(sound.destination);
    tone.start(sound.currentTime + start);
    tone.stop(sound.currentTime + start + 0.25);
  }
}

addEventListener("online", listen);
document.addEventListener("visibilitychange", () => {
  if (!document.hidden && Date.now() - lastHeard > 6_000) listen();
});
lastHeard = Date.now();
listen();
setInterval(tick, 500);
