// What the hand does becomes what is picked; the server finds the region and keeps every step before the page believes it.
import { View } from "./view.js";

const $ = (id) => document.getElementById(id);
const stage = $("stage"), view = new View(stage);
const NEAR = 10, MOVED = 5; // screen pixels within which a mark is meant, and from which on a press is a drag
const OPEN = { starts: [], nots: [], boxes: [], strokes: [], probability: null, clearance: null, alike: false, status: "open" };
const LEVEL = 0.002, WIDTH = 0.5; // probability and clearance (px) for one screen pixel of a drag
const SMALL = 600; // pixels of the longer side up to which an image is found whole as quickly as reduced
const MOST_LISTED = 300, NEWS_MS = 1500, TWICE_MS = 300; // presses of a key that follow sooner are one

const pending = []; // changes that the server has not yet
let about, label = 0, index = -1, image = null, picked = OPEN, statuses = {}, model = -1;
let notice = { text: "", bad: false }; // stays beside what is said of the region, until the hand does something
let tool = "pick", brush = 12, hovering = true, space = false, drag = null, history = [], saving = Promise.resolve();
export const times = []; // of contours drawn while the hand moved: for those who measure
window.ffsegTimes = times;

const GONE = "the server does not answer: start ffseg pick again; nothing that was drawn is lost";
const post = async (what, body = {}) => {
  const asked = { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ label, image: Math.max(index, 0), ...body }) };
  const answer = await fetch(what, asked).catch(() => { throw new Error(GONE); });
  const found = await answer.json();
  if (!answer.ok) throw Object.assign(new Error(found.error), { code: answer.status });
  return found;
};
const say = (text, bad = false) => {
  $("said").textContent = text ?? "";
  $("said").hidden = !text;
  $("said").classList.toggle("bad", bad);
};
const notify = (text, bad = false) => {
  notice = { text, bad };
  say(text, bad);
};

// --- the region: one question at a time in each lane, the newest waits, others are forgotten -----------------------

const lanes = { quick: { asking: false, waiting: null }, whole: { asking: false, waiting: null } }; // the hand need not wait for a large image
const drawn = { region: 0, preview: 0 };
let asked = 0;
const ask = (question) => {
  const lane = question.quick ? lanes.quick : lanes.whole;
  lane.waiting = { ...question, number: ++asked, place: index, kind: label };
  if (!lane.asking) void answer(lane);
};
const answer = async (lane) => {
  lane.asking = true;
  while (lane.waiting) {
    const { what, quick, id, begin, number, place, kind } = lane.waiting;
    lane.waiting = null;
    try {
      const sent = performance.now(), found = await post("find", { picked: what, quick });
      if (place !== index || kind !== label || number < drawn[id]) continue;
      drawn[id] = number;
      view.region(found, id);
      if (id === "region") {
        say([notice.text, found.said].filter(Boolean).join("; "), notice.bad);
        $("sure").textContent = found.score ? `expected IoU ${found.score.toFixed(2)}` : "";
      }
      if (begin) requestAnimationFrame(() => times.push({ quick, waited: sent - begin, server: found.server_ms, find: found.ms, asked: performance.now() - sent, all: performance.now() - begin }));
    } catch (error) {
      say(error.message, true);
    }
  }
  lane.asking = false;
};
const forget = () => { // what a click would give, as soon as there is something else to see
  drawn.preview = ++asked;
  view.region(null, "preview");
};
const show = (what, options = {}) => ask({ what, quick: false, id: "region", ...options });

const whole = (what) => { // of a large image first a reduced copy, so that a click is answered at once
  if (!image || image.problem) return;
  if (Math.max(...view.size) > SMALL) show(what, { quick: true });
  show(what);
};

// --- what is picked -------------------------------------------------------------------------------------------------

const current = () => pending.reduce((now, change) => ({ ...now, ...change(now) }), picked);
const adopt = (found) => {
  image = found;
  picked = found.picked;
  view.marks(current());
  if (picked.status === "open") delete statuses[index];
  else statuses[index] = picked.status;
  $("undo").disabled = !found.undo;
  $("redo").disabled = !found.redo;
  $("alike").setAttribute("aria-pressed", String(current().alike));
  $("status").textContent = picked.status === "open" ? "" : picked.status;
};
// Steps are kept one after the other; what each changes is said of what the one before has left.
const step = (change, does = "pick") => {
  const place = index;
  notify("");
  if (change) pending.push(change);
  saving = saving.then(async () => {
    const before = picked.status, next = { ...picked, ...change?.(picked) }, there = place === index && image;
    const found = there && await post("change", { version: image.version, do: does, picked: next, picture: image.picture }).catch((error) => error);
    if (change) pending.splice(pending.indexOf(change), 1);
    if (!there) return false;
    if (found.code === 409) await load(index, "changed in another tab: this is how it stands now");
    else if (found instanceof Error) {
      adopt(image);
      notify(found.message, true);
    } else adopt(found);
    if (before === "accepted" || picked.status !== "accepted") whole(current()); // what is accepted is drawn already
    return !(found instanceof Error);
  });
  return saving;
};
const pick = (change) => {
  const kept = step(change);
  view.marks(current());
  forget();
  return kept;
};
const shut = () => { // what is done before the next is open is meant for none
  image = null;
  $("name").textContent = $("sure").textContent = "";
  view.region(null);
  forget();
  view.show("", 1, 1);
};
const load = async (place, said = "") => {
  letGo();
  if (place !== index) shut();
  const anew = !image;
  index = place;
  try {
    const found = await post("image");
    if (place !== index) return;
    if (anew) view.show(found.picture, found.width, found.height);
    adopt(found);
    notify(said || found.problem, Boolean(found.problem));
  } catch (error) {
    image = null;
    say(error.message, true);
  }
  $("name").textContent = about.images[place];
  location.replace(`#${label}/${place}`);
  whole(picked);
  void news();
};
const go = async (place) => {
  if (place < 0 || place === index) return;
  await saving;
  history.push(index);
  await load(place);
};
const next = async () => {
  await saving;
  const { image: place } = await post("following");
  if (place < 0) say(statuses[index] ? "all images are accepted or skipped" : "all other images are accepted or skipped");
  else await go(place);
  void prepare();
};
const prepare = async () => { // the next picture is fetched while this one is picked in
  const { image: place, picture } = await post("following");
  if (place >= 0) new Image().src = picture;
};
const previous = async () => {
  await saving;
  const place = history.pop() ?? index - 1;
  if (place >= 0 && place < about.images.length) await load(place);
};
let settling = false; // until the next image is open, a second key is meant for this one too
const settle = async (status) => {
  if (!image || settling) return;
  settling = true;
  try {
    if (!(await step(() => ({ status })))) return;
    await news();
    await next();
  } finally {
    settling = false;
  }
};

const pass = () => settling || next();

// --- news of the server: other tabs, the model, the run ----------------------------------------------------------------

const news = async () => {
  const place = index, kind = label;
  try {
    const found = await post("news");
    if (place !== index || kind !== label) return;
    $("line").textContent = [...found.lines, found.review && `reviewing ${found.review}`].filter(Boolean).join("; ");
    $("counts").textContent = `${found.accepted} accepted, ${found.skipped} skipped of ${about.images.length}`;
    $("command").textContent = found.command;
    $("run").disabled = found.running;
    if (image && found.version > image.version && !drag) await saving.then(() => found.version > image.version && load(index, "changed in another tab"));
    else if (found.model !== model && model >= 0 && !drag) whole(picked);
    model = found.model;
  } catch {
    $("line").textContent = GONE;
  }
};
setInterval(news, NEWS_MS);

// --- the pointer ----------------------------------------------------------------------------------------------------

const near = (point) => {
  const found = Object.entries(current()).filter(([kind]) => kind === "starts" || kind === "nots").flatMap(([kind, rows]) => rows.map((row) => ({ kind, row })));
  return found.find(({ row }) => Math.hypot(row[0] - point[0], row[1] - point[1]) * view.scale <= NEAR);
};
const circle = ([x, y]) => [x, y, Math.max(1, image.radius * Math.min(1, view.whole / view.scale))]; // who zooms in means something small
const without = (rows, row) => rows.filter((other) => other.join() !== row.join());
const corners = ([a, b], [c, d]) => {
  const [width, height] = view.size, cut = (value, most) => Math.round(Math.min(most - 1, Math.max(0, value)));
  return [cut(Math.min(a, c), width), cut(Math.min(b, d), height), cut(Math.max(a, c), width), cut(Math.max(b, d), height)];
};
const levelled = (event) => { // up is larger
  const by = drag.y - event.clientY;
  if (event.shiftKey) return { clearance: Math.min(1000, Math.max(0, (current().clearance ?? image.clearance) + by * WIDTH)) };
  return { probability: Math.min(0.99, Math.max(0.01, (current().probability ?? image.probability) - by * LEVEL)) };
};

let pressed = { key: "", at: 0 }; // the key before, unless something was picked since
const fingers = new Map(); // that touch the stage, and where: two zoom and move
const pinch = (event) => {
  const measure = () => {
    const [[a, b], [c, d]] = fingers.values();
    return [Math.max(1, Math.hypot(c - a, d - b)), (a + c) / 2, (b + d) / 2];
  };
  const [apart, x, y] = measure(), box = stage.getBoundingClientRect();
  fingers.set(event.pointerId, [event.clientX, event.clientY]);
  const [wide, toX, toY] = measure();
  view.move(toX - x, toY - y);
  view.zoom(wide / apart, toX - box.left, toY - box.top);
};
const lift = (event) => { // whether it was one of two fingers, or another than the one that drags
  fingers.delete(event.pointerId);
  const other = drag?.kind === "fingers" || drag && drag.id !== event.pointerId;
  if (drag?.kind === "fingers" && !fingers.size) letGo();
  return other;
};

stage.addEventListener("pointerdown", (event) => {
  if (event.pointerType === "touch") fingers.set(event.pointerId, [event.clientX, event.clientY]);
  if (!image || image.problem || event.button > 2) return;
  stage.setPointerCapture(event.pointerId);
  pressed = { key: "", at: 0 };
  if (fingers.size === 2 && event.pointerType === "touch") {
    letGo();
    drag = { kind: "fingers" };
    whole(current());
  }
  if (drag) return;
  const point = view.at(event), not = event.button === 2 || event.altKey;
  if (event.button === 1 || space) drag = { kind: "move" };
  else if (tool !== "pick") drag = { kind: "stroke", stroke: { inside: (tool === "brush") !== not, radius: brush / view.scale, points: [point] } };
  else if (!view.holds(point)) return;
  else drag = { kind: not ? "not" : "press", point, mark: near(point), x: event.clientX, y: event.clientY };
  if (drag.kind === "stroke") view.stroke(drag.stroke);
  drag.id = event.pointerId;
  forget();
});
stage.addEventListener("pointermove", (event) => {
  const begin = event.timeStamp;
  if (!image || image.problem) return;
  if (!drag) return hover(view.at(event), begin);
  if (drag.kind === "fingers") return fingers.size === 2 && fingers.has(event.pointerId) && pinch(event);
  if (drag.id !== event.pointerId) return;
  if (drag.kind === "move") return view.move(event.movementX, event.movementY);
  if (drag.kind === "stroke") {
    for (const place of (event.getCoalescedEvents?.() ?? [event]).map((one) => view.at(one))) {
      const [x, y] = drag.stroke.points.at(-1);
      if (Math.hypot(place[0] - x, place[1] - y) * view.scale >= 1) drag.stroke.points.push(place); // a stroke has 20,000 at most
    }
    return view.stroke(drag.stroke);
  }
  if (drag.kind === "press" && Math.hypot(event.clientX - drag.x, event.clientY - drag.y) > MOVED) drag.kind = drag.mark?.kind === "starts" ? "level" : "box";
  if (drag.kind === "level") {
    drag.change = levelled(event);
    const [[name, value]] = Object.entries(drag.change);
    $("status").textContent = `${name} ${value.toFixed(name === "clearance" ? 0 : 2)}`;
    show({ ...current(), ...drag.change }, { quick: true, begin });
  } else if (drag.kind === "box") {
    drag.box = corners(drag.point, view.at(event));
    view.box(drag.box);
    if (drag.box[2] > drag.box[0] && drag.box[3] > drag.box[1]) show({ ...current(), boxes: [...current().boxes, drag.box] }, { quick: true, begin });
  }
});
const hover = (point, begin) => {
  if (tool !== "pick" || !hovering || !view.holds(point) || near(point)) return forget();
  ask({ what: { ...current(), starts: [...current().starts, circle(point)] }, quick: true, id: "preview", begin });
};
const letGo = () => {
  const done = drag;
  drag = null;
  view.box(null);
  view.stroke(null);
  return done;
};
stage.addEventListener("pointerup", (event) => {
  if (lift(event)) return;
  const done = letGo();
  if (!done || !image) return;
  const { kind, point, mark } = done;
  const add = (key, row) => void pick((now) => ({ [key]: [...now[key], row] }));
  if (kind === "stroke") add("strokes", done.stroke);
  else if (kind === "level") void pick(() => done.change);
  else if (kind === "box" && done.box[2] - done.box[0] > 1 && done.box[3] - done.box[1] > 1) add("boxes", done.box);
  else if ((kind === "press" || kind === "not") && mark) void pick((now) => ({ [mark.kind]: without(now[mark.kind], mark.row) }));
  else if (kind === "press") add("starts", circle(point));
  else if (kind === "not") void pick((now) => ({ nots: [...now.nots, [...circle(point), now.starts.length]] }));
});
stage.addEventListener("pointercancel", (event) => {
  if (lift(event)) return;
  letGo();
  whole(picked);
});
stage.addEventListener("pointerleave", () => forget());
stage.addEventListener("contextmenu", (event) => event.preventDefault());
stage.addEventListener("wheel", (event) => {
  event.preventDefault();
  const box = stage.getBoundingClientRect();
  view.zoom(Math.exp(-event.deltaY / 400), event.clientX - box.left, event.clientY - box.top);
}, { passive: false });

// --- keys and buttons -------------------------------------------------------------------------------------------------

const use = (name) => {
  tool = tool === name ? "pick" : name;
  for (const one of ["brush", "eraser"]) $(one).setAttribute("aria-pressed", String(tool === one));
  forget();
};
const size = (by) => {
  brush = Math.min(200, Math.max(1, brush * by));
  say(`brush of ${(brush / view.scale).toFixed(1)} px`);
};
const choose = (kind) => {
  if (!(kind in about.labels) || kind === label) return;
  void saving.then(async () => {
    label = kind;
    shut();
    ({ statuses } = await post("statuses"));
    classes();
    model = -1;
    await load(index);
  });
};
const keys = {
  a: () => settle("accepted"), Enter: () => settle("accepted"), s: () => settle("skipped"),
  n: pass, ArrowRight: pass, p: previous, ArrowLeft: previous,
  z: () => step(null, "undo"), y: () => step(null, "redo"),
  x: () => pick(() => OPEN),
  k: () => pick((now) => ({ alike: !now.alike })),
  b: () => use("brush"), e: () => use("eraser"), "[": () => size(1 / 1.25), "]": () => size(1.25),
  h: () => { hovering = !hovering; $("hover").setAttribute("aria-pressed", String(hovering)); forget(); },
  "+": () => view.zoom(1.5), "=": () => view.zoom(1.5), "-": () => view.zoom(1 / 1.5), 0: () => view.fit(),
  l: () => { list(); $("list").showModal(); }, "?": () => $("help").showModal(),
  t: () => {
    const themes = ["", "dark", "light"], root = document.documentElement;
    root.dataset.theme = themes[(themes.indexOf(root.dataset.theme ?? "") + 1) % 3];
  },
};
const tried = (act) => void Promise.resolve(act()).catch((error) => say(error.message, true));
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]") || event.target.matches("input")) return;
  if (event.key === " " && !event.target.matches("button")) { space = true; stage.classList.add("moving"); event.preventDefault(); return; }
  if (/^[1-9]$/.test(event.key)) return choose(Number(event.key) - 1);
  const act = keys[event.key] ?? keys[event.key.toLowerCase()];
  const again = event.repeat || event.key === pressed.key && event.timeStamp - pressed.at < TWICE_MS;
  if (!again) pressed = { key: event.key, at: event.timeStamp };
  if (!act || again && /^(a|s|enter)$/i.test(event.key)) return;
  if (event.key === "Enter" && event.target.matches("button")) return;
  event.preventDefault();
  tried(act);
});
document.addEventListener("keyup", (event) => {
  if (event.key === " ") { space = false; stage.classList.remove("moving"); }
});
for (const button of document.querySelectorAll("button[data-key]")) button.addEventListener("click", () => tried(keys[button.dataset.key]));
$("run").addEventListener("click", () => saving.then(() => post("run")).then(news).catch((error) => say(error.message, true)));

const classes = () => $("classes").replaceChildren(...about.labels.filter(Boolean).map((name, kind) => {
  const button = document.createElement("button");
  button.textContent = `${kind + 1} ${name}`;
  button.setAttribute("aria-pressed", String(kind === label));
  button.addEventListener("click", () => choose(kind));
  return button;
}));
const list = () => {
  const wanted = $("find").value.toLowerCase();
  const found = about.images.map((name, place) => [name, place]).filter(([name, place]) => name.toLowerCase().includes(wanted) || (statuses[place] ?? "open") === wanted);
  $("names").replaceChildren(...found.slice(0, MOST_LISTED).map(([name, place]) => {
    const item = document.createElement("li"), button = document.createElement("button"), status = document.createElement("span");
    status.textContent = statuses[place] ?? "";
    button.append(name, status);
    button.addEventListener("click", () => { $("list").close(); void go(place); });
    item.append(button);
    return item;
  }));
  if (found.length > MOST_LISTED) $("names").append(`and ${found.length - MOST_LISTED} more`);
};
$("find").addEventListener("input", list);

const start = async () => {
  about = await post("about");
  const [, kind, place] = /^#(\d+)\/(\d+)$/.exec(location.hash) ?? [];
  label = kind in about.labels ? Number(kind) : 0;
  ({ statuses } = await post("statuses"));
  classes();
  const first = place in about.images ? Number(place) : statuses[0] ? (await post("following")).image : 0;
  await load(Math.max(0, first));
  document.body.dataset.ready = "yes";
  void prepare();
};
start().catch((error) => say(error.message, true));
