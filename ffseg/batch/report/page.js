"use strict";
(() => {
  const report = JSON.parse(document.getElementById("data").textContent);
  const UNITS = 100; // of the packed paths in a pixel
  const STAGES = ["decode_ms", "edges_ms", "evolve_ms", "obstacles_ms", "write_ms"];
  const DOUBTS = { empty: "empty", filled: "fills its domain", border: "follows the border", early: "stopped early", start: "start across an edge" };
  const MOST_FAILURES = 200, MOST_PARTS = 500;
  const $ = (id) => document.getElementById(id);
  const NS = "http://www.w3.org/2000/svg";

  // Every text goes through a text node: no name or message can become markup.
  const fill = (element, attributes, children) => {
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.append(...children.filter((child) => child !== null && child !== undefined));
    return element;
  };
  const make = (tag, attributes = {}, ...children) => fill(document.createElement(tag), attributes, children);
  const draw = (tag, attributes = {}, ...children) => fill(document.createElementNS(NS, tag), attributes, children);

  const methods = [...new Set(report.images.flatMap((image) => image.rows.map((row) => row.method)))].filter(Boolean);
  const entries = report.images.map((image, index) => ({
    ...image, index, card: null,
    failed: image.rows.some((row) => row.status === "failed"),
    hopeless: image.rows.every((row) => row.status === "failed"),
    haystack: [image.name, ...image.rows.flatMap((row) => [row.error, row.method, row.stop_reason, row.note])].join("\n").toLowerCase(),
  }));
  const has = (key) => entries.some((entry) => entry.rows.some((row) => typeof row[key] === "number"));
  let shown = entries, method = methods[0], open = null;

  const rowOf = (entry) => entry.rows.find((row) => row.method === method) ?? entry.rows[0] ?? {};
  const number = (value) => {
    if (typeof value !== "number") return "";
    const size = Math.abs(value);
    return Number.isInteger(value) ? String(value) : value.toFixed(size < 1 ? 4 : size < 100 ? 2 : 0);
  };
  const median = (values) => {
    const sorted = [...values].sort((a, b) => a - b), half = sorted.length >> 1;
    return sorted.length % 2 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
  };
  const columnOf = (list, key, name = method) => list
    .flatMap((entry) => entry.rows.filter((row) => row.method === name || methods.length < 2))
    .filter((row) => row.status === "ok").map((row) => row[key]).filter((value) => typeof value === "number");

  // --- contours ------------------------------------------------------------------------------------------------

  const unpacked = async (text) => {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
    return new Response(stream).json();
  };
  const partsOf = async (entry) => {
    if (!entry.contours) return [];
    entry.parts ??= unpacked(entry.contours).then((parts) => parts.sort((a, b) => (b.area > 0) - (a.area > 0) || Math.abs(b.area) - Math.abs(a.area)), () => []);
    return entry.parts;
  };
  const kindOf = (part) => part.area > 0 ? "outer" : part.d ? "hole" : "given back";
  const verdictOf = (part) => {
    if (!part.verdict) return "";
    const facts = [typeof part.altitude === "number" ? `${part.altitude.toFixed(3)} m` : null, typeof part.points === "number" ? `${part.points} points` : null];
    return `${part.verdict.replaceAll("_", " ")} (${facts.filter(Boolean).join(", ")})`;
  };

  const drawnPart = (part) => {
    const classes = ["part", part.area > 0 ? "outer" : "hole", part.verdict ?? ""].join(" ").trim();
    if (part.d) return draw("path", { d: part.d, class: classes });
    const radius = Math.sqrt(Math.abs(part.area) / Math.PI) * UNITS; // merged: its place is known, its outline is gone
    return draw("circle", { cx: (part.at[0] + 0.5) * UNITS, cy: (part.at[1] + 0.5) * UNITS, r: radius, class: classes });
  };
  const layer = (entry, parts) => {
    const row = entry.rows.find((candidate) => candidate.width) ?? {};
    const box = `0 0 ${(row.width ?? 1) * UNITS} ${(row.height ?? 1) * UNITS}`;
    const fill = draw("path", { d: parts.map((part) => part.d ?? "").join(""), class: "fill" });
    return draw("svg", { viewBox: box, "aria-hidden": "true" }, fill, ...parts.map(drawnPart));
  };

  // --- pictures ------------------------------------------------------------------------------------------------

  const kinds = (entry) => Object.keys(entry.pictures);
  const picture = (entry, order) => {
    const sources = order.filter((kind) => entry.pictures[kind]).map((kind) => entry.pictures[kind]);
    if (entry.thumbnail) sources.push(entry.thumbnail);
    if (!sources.length) return make("span", { class: "nothing" }, "no picture");
    const image = make("img", { alt: entry.name, decoding: "async", draggable: "false" });
    image.addEventListener("error", () => {
      sources.shift();
      if (sources.length) image.src = sources[0];
      else image.replaceWith(make("span", { class: "nothing" }, "the picture is gone"));
    });
    image.src = sources[0];
    return image;
  };

  const furnish = async (entry) => {
    if (entry.furnished) return;
    entry.furnished = true;
    const place = entry.card.querySelector(".picture");
    const drawn = ["overlay", "panel", "image", "mask"], plain = ["image", "overlay", "mask"];
    place.replaceChildren(picture(entry, entry.thumbnail ? [] : entry.contours ? plain : drawn));
    if (!entry.contours) return;
    const parts = await partsOf(entry);
    if (entry.furnished) place.append(layer(entry, parts)); // not scrolled away meanwhile
  };
  let printing = false;
  const bare = (entry) => {
    if (printing) return;
    entry.furnished = false;
    entry.card.querySelector(".picture").replaceChildren();
  };

  const summaryOf = (entry) => {
    const row = rowOf(entry);
    if (row.status !== "ok") return [methods.length > 1 ? row.method : "", row.error || row.status].filter(Boolean).join(": ");
    const facts = [], sorted = $("sort").value;
    if (methods.length > 1) facts.push(row.method);
    if (typeof row.score === "number") facts.push(`score ${row.score.toFixed(2)}`);
    if (typeof row.iou === "number") facts.push(`IoU ${row.iou.toFixed(4)}`);
    if (typeof row.area_px === "number" && row.width > 0) facts.push(`area ${row.area_px} px (${(100 * row.area_px / row.width / row.height).toFixed(1)} %)`);
    if (typeof row.total_ms === "number" && (methods.length > 1 || sorted.endsWith("_ms"))) facts.push(`${number(row.total_ms)} ms`);
    if (typeof row.holes === "number") facts.push(`${row.holes} ${row.holes === 1 ? "hole" : "holes"}`);
    return facts.join(", ");
  };
  const doubtsOf = (entry) => String(rowOf(entry).doubts ?? "").split(" ").filter(Boolean);
  const notesOf = (entry) => [doubtsOf(entry).map((name) => DOUBTS[name] ?? name).join(", "), rowOf(entry).note].filter(Boolean).join("; ");
  const cardOf = (entry) => {
    if (!entry.card) {
      const place = make("span", { class: "picture" });
      const parts = [place, make("span", { class: "name", title: entry.name }, entry.name), make("span", { class: "numbers" }), make("span", { class: "note" })];
      const classes = ["card", entry.failed ? "failed" : "", entry.hopeless ? "wordy" : ""].filter(Boolean).join(" ");
      entry.card = make("button", { type: "button", class: classes, "data-index": entry.index }, ...parts);
      sight.observe(entry.card);
    }
    entry.card.querySelector(".numbers").textContent = summaryOf(entry);
    const note = notesOf(entry), place = entry.card.querySelector(".note");
    [place.textContent, place.title] = [note, note];
    return entry.card;
  };

  // --- the sheet: every card is in the document, to be found and printed; pictures are there while they are in sight ---

  let columns = 1;
  const sight = new IntersectionObserver((changes) => {
    for (const { target, isIntersecting } of changes) (isIntersecting ? furnish : bare)(entries[Number(target.dataset.index)]);
  }, { rootMargin: "600px" });
  const measure = () => { columns = getComputedStyle($("sheet")).gridTemplateColumns.split(" ").length; };
  const fillSheet = () => $("sheet").replaceChildren(...shown.map(cardOf));
  const focusOn = (at) => {
    $("sheet").style.setProperty("--head", `${getComputedStyle($("filters")).position === "sticky" ? $("filters").offsetHeight : 0}px`);
    shown[at].card.focus();
  };
  addEventListener("beforeprint", () => {
    printing = true; // what is out of sight keeps its picture
    entries.filter((entry) => entry.card?.isConnected).forEach(furnish);
  });
  addEventListener("afterprint", () => { printing = false; });

  // --- sorting and filtering -----------------------------------------------------------------------------------

  const SORTS = [["look", "what needs a look"], ["", "table order"], ["score", "score"], ["area_px", "area"], ["note", "doubts and notes"], ["name", "name"], ["iou", "IoU"], ["total_ms", "total time"], ["evolve_ms", "time of the evolution"],
    ["holes", "holes"], ["components", "components"], ["iterations", "iterations"], ["final_points", "control points"]];
  const RANGES = ["iou", "total_ms", "holes"];
  const bound = (id) => $(id).value === "" ? null : Number($(id).value);

  const matches = (entry) => {
    const words = $("text").value.toLowerCase().split(/\s+/).filter(Boolean), status = $("status").value;
    if (!words.every((word) => entry.haystack.includes(word))) return false;
    if (status && (status === "failed") !== entry.failed) return false;
    const doubt = $("doubt").value, found = doubtsOf(entry);
    if (doubt && (doubt === "any" ? !found.length : doubt === "none" ? found.length || entry.failed : !found.includes(doubt))) return false;
    return RANGES.every((key) => {
      const value = rowOf(entry)[key], low = bound(`${key}-min`), high = bound(`${key}-max`);
      if (low === null && high === null) return true;
      return typeof value === "number" && (low === null || value >= low) && (high === null || value <= high);
    });
  };
  const compared = (key, sign) => (a, b) => {
    if (a.failed !== b.failed) return a.failed ? -1 : 1; // failures on top
    if (key === "look") { // doubts, notes, then low scores
      const [one, two] = [rowOf(a), rowOf(b)];
      return sign * (!!two.doubts - !!one.doubts || !!two.note - !!one.note || (one.score ?? 2) - (two.score ?? 2)) || a.index - b.index;
    }
    if (key === "note") {
      const [one, two] = [notesOf(a), notesOf(b)];
      return !one - !two || sign * one.localeCompare(two) || a.index - b.index;
    }
    if (!key) return sign * (a.index - b.index);
    const [left, right] = key === "name" ? [a.name, b.name] : [rowOf(a)[key], rowOf(b)[key]];
    if (key === "name") return sign * left.localeCompare(right, undefined, { numeric: true });
    if (typeof left !== "number" || typeof right !== "number") return (typeof right === "number") - (typeof left === "number");
    return sign * (left - right) || a.index - b.index;
  };
  const refresh = () => {
    shown = entries.filter(matches).sort(compared($("sort").value, $("descending").checked ? -1 : 1));
    measure();
    fillSheet();
    $("count").textContent = `${shown.length} of ${entries.length} images`;
    tiles();
    plots();
  };
  let waiting = 0;
  const soon = () => {
    cancelAnimationFrame(waiting);
    waiting = requestAnimationFrame(refresh);
  };

  // --- summary and plots ---------------------------------------------------------------------------------------

  const tiles = () => {
    const facts = [["images", shown.length], ["failed", shown.filter((entry) => entry.failed).length]];
    const doubted = shown.filter((entry) => doubtsOf(entry).length).length;
    if (doubted) facts.push(["doubtful", doubted]);
    for (const [key, label] of [["score", "median score"], ["iou", "median IoU"], ["total_ms", "median ms"], ["holes", "median holes"]]) {
      const values = columnOf(shown, key);
      if (values.length) facts.push([methods.length > 1 ? `${label}, ${method}` : label, number(median(values))]);
    }
    $("tiles").replaceChildren(...facts.map(([label, value]) => make("div", {}, make("b", {}, String(value)), make("span", {}, label))));
  };

  const logScale = (values, from, to) => {
    const positive = values.filter((value) => value > 0);
    const first = Math.log10(Math.min(...positive)), last = Math.log10(Math.max(...positive));
    const margin = Math.max(0.05, (0.75 - (last - first)) / 2); // at least a factor of 5, so that a tick is in it
    const low = first - margin, high = last + margin;
    const at = (value) => from + (to - from) * (Math.log10(Math.max(value, 10 ** low)) - low) / (high - low);
    const ticks = [];
    for (let power = Math.floor(low); power <= high; power++) {
      for (const digit of high - low > 2.5 ? [1] : [1, 2, 5]) ticks.push(digit * 10 ** power);
    }
    return { at, ticks: ticks.filter((tick) => Math.log10(tick) >= low && Math.log10(tick) <= high) };
  };
  const dotsOf = (key) => shown.flatMap((entry) => entry.rows
    .filter((row) => row.status === "ok" && row.total_ms > 0 && typeof row[key] === "number")
    .map((row) => ({ entry, row, colour: Math.max(0, methods.indexOf(row.method)) % 8 })));
  const dot = ({ entry, row, colour }, x, y) => draw("circle", { class: `dot c${colour}`, cx: x.toFixed(1), cy: y.toFixed(1), r: 3, "data-index": entry.index },
    draw("title", {}, `${entry.name}, ${row.method ?? ""}: ${number(row.total_ms)} ms${typeof row.iou === "number" ? `, IoU ${row.iou.toFixed(4)}` : ""}`));
  const timeAxis = (scale, height) => scale.ticks.flatMap((tick) => [
    draw("line", { class: "axis", x1: scale.at(tick), x2: scale.at(tick), y1: 4, y2: height - 18 }),
    draw("text", { x: scale.at(tick), y: height - 5, "text-anchor": "middle" }, String(Number(tick.toPrecision(1)))),
  ]);
  const framed = (title, ...content) => make("figure", {}, make("figcaption", {}, title), ...content);
  const key = (names) => make("div", { class: "key" }, ...names.map((name, index) => name === null ? null : make("span", {},
    draw("svg", { viewBox: "0 0 10 10" }, draw("rect", { width: 10, height: 10, class: `c${index % 8}` })), name)));

  const timePlot = () => {
    const dots = dotsOf("total_ms"), names = methods.length ? methods : [""], height = 26 + 34 * names.length;
    const scale = logScale(dots.map(({ row }) => row.total_ms), 96, 412);
    const rows = names.map((name, index) => {
      const times = columnOf(shown, "total_ms", name), y = 20 + 34 * index;
      const middle = times.length ? scale.at(median(times)) : null;
      return draw("g", {}, draw("text", { x: 0, y: y + 4 }, name),
        middle === null ? null : draw("line", { class: "middle", x1: middle, x2: middle, y1: y - 14, y2: y + 14 }));
    });
    const marks = dots.map((item) => dot(item, scale.at(item.row.total_ms),
      20 + 34 * Math.max(0, names.indexOf(item.row.method)) + ((item.entry.index * 7919) % 21 - 10)));
    return framed("Time of each image in ms (bar: median)", draw("svg", { viewBox: `0 0 420 ${height}` }, ...timeAxis(scale, height), ...marks, ...rows));
  };
  const stageBar = (times) => {
    const total = STAGES.reduce((sum, stage) => sum + (times[stage] ?? 0), 0) || 1;
    let x = 0;
    const pieces = STAGES.map((stage, index) => {
      const width = 400 * (times[stage] ?? 0) / total;
      const piece = draw("rect", { x, y: 2, width, height: 18, class: `c${index}` }, draw("title", {}, `${stage.replace("_ms", "")}: ${number(times[stage] ?? 0)} ms`));
      x += width;
      return piece;
    });
    return make("div", { class: "bar" }, draw("svg", { viewBox: "0 0 400 22", preserveAspectRatio: "none" }, ...pieces));
  };
  const stagePlot = () => {
    const names = methods.length ? methods : [""];
    const bars = names.flatMap((name) => {
      const times = Object.fromEntries(STAGES.map((stage) => {
        const values = columnOf(shown, stage, name);
        return [stage, values.length ? values.reduce((a, b) => a + b, 0) / values.length : 0];
      }));
      const total = Object.values(times).reduce((a, b) => a + b, 0);
      return total ? [make("div", {}, `${name}: ${number(total)} ms`), stageBar(times)] : [];
    });
    return framed("Where the time goes, mean of an image", ...bars, stageKey());
  };
  const stageKey = () => key(STAGES.map((stage) => has(stage) ? stage.replace("_ms", "") : null));
  const qualityPlot = () => {
    const dots = dotsOf("iou"), height = 150, scale = logScale(dots.map(({ row }) => row.total_ms), 44, 412);
    const least = Math.min(...dots.map(({ row }) => row.iou)), low = 1 - [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1].find((span) => 1 - span <= least);
    const up = (value) => 8 + (height - 32) * (1 - value) / (1 - low);
    const lines = [1, (1 + low) / 2, low].flatMap((tick) => [
      draw("line", { class: "axis", x1: 40, x2: 412, y1: up(tick), y2: up(tick) }),
      draw("text", { x: 0, y: up(tick) + 4 }, tick.toFixed(4)),
    ]);
    const marks = dots.map((item) => dot(item, scale.at(item.row.total_ms), up(item.row.iou)));
    return framed("IoU over time in ms", draw("svg", { viewBox: `0 0 420 ${height}` }, ...timeAxis(scale, height), ...lines, ...marks), methods.length > 1 ? key(methods) : null);
  };
  const plots = () => {
    const found = [];
    if (dotsOf("total_ms").length) found.push(timePlot(), stagePlot());
    if (dotsOf("iou").length) found.push(qualityPlot());
    if (report.map) found.push(framed("Map of the drive and its ways", make("a", { href: "map/map.png" }, make("img", { src: report.map, alt: "map" }))));
    $("plots").replaceChildren(...found);
  };

  // --- one image -----------------------------------------------------------------------------------------------

  const view = { scale: 1, x: 0, y: 0 };
  const place = () => {
    const layers = $("layers");
    layers.style.transform = `translate(${view.x}px, ${view.y}px) scale(${view.scale})`;
    layers.style.setProperty("--stroke", `${2 / view.scale}px`);
    layers.classList.toggle("pixels", view.scale > 3);
  };
  const zoom = (factor, x = $("stage").clientWidth / 2, y = $("stage").clientHeight / 2) => {
    const scale = Math.min(64, Math.max(1, view.scale * factor)), ratio = scale / view.scale;
    Object.assign(view, scale === 1 ? { scale: 1, x: 0, y: 0 } : { scale, x: x - (x - view.x) * ratio, y: y - (y - view.y) * ratio });
    place();
  };
  const fit = () => zoom(0);

  const tableOf = (head, rows) => make("table", {}, make("thead", {}, make("tr", {}, ...head.map((text) => make("th", {}, text)))),
    make("tbody", {}, ...rows));
  const valueRow = (name, value) => make("tr", {}, make("th", {}, name), make("td", {}, typeof value === "number" ? number(value) : String(value)));
  const factsOf = (row) => make("section", {},
    make("h2", {}, row.method ? `${row.method}: ${row.status}` : String(row.status ?? "")),
    row.error ? make("p", { class: "problem" }, row.error) : null,
    ...(STAGES.some((stage) => row[stage] > 0) ? [stageBar(row), stageKey()] : []),
    make("table", {}, make("tbody", {}, ...Object.entries(row).filter(([name]) => !["method", "status", "error"].includes(name)).map(([name, value]) => valueRow(name, value)))));

  const sideBySide = (rows) => {
    const names = [...new Set(rows.flatMap(Object.keys))].filter((name) => !["method", "error"].includes(name));
    const cell = (row, name) => make("td", {}, typeof row[name] === "number" ? number(row[name]) : String(row[name] ?? ""));
    const problems = rows.filter((row) => row.error).map((row) => make("p", { class: "problem" }, `${row.method}: ${row.error}`));
    return make("section", {}, ...problems, tableOf(["", ...rows.map((row) => row.method ?? "")],
      names.map((name) => make("tr", {}, make("th", {}, name), ...rows.map((row) => cell(row, name))))));
  };

  const partTable = (parts, marks) => {
    const rows = parts.slice(0, MOST_PARTS).map((part, index) => {
      const cells = [kindOf(part), String(Math.abs(Math.round(part.area))), part.at.map((v) => v.toFixed(0)).join(", "), verdictOf(part)];
      const line = make("tr", {}, ...cells.map((cell) => make("td", {}, cell)));
      const hot = (on) => [line, marks[index]].forEach((element) => element.classList.toggle("hot", on));
      for (const element of [line, marks[index]]) {
        element.addEventListener("pointerenter", () => hot(true));
        element.addEventListener("pointerleave", () => hot(false));
      }
      marks[index].append(draw("title", {}, cells.filter(Boolean).join(", ")));
      return line;
    });
    const holes = parts.filter((part) => part.area < 0).length, judged = parts.some((part) => part.verdict);
    const table = tableOf(["component", "px\u00b2", "centre", judged ? "verdict" : ""], rows);
    return make("section", { class: "parts" }, make("h2", {}, `${parts.length - holes} outer, ${holes} inner components`), table);
  };
  const parameterTable = () => tableOf(["parameter", "value"], report.parameters.map(([name, value, changed]) =>
    make("tr", changed ? { class: "changed", title: "differs from the default" } : {}, make("td", {}, name), make("td", {}, value))));
  const parameterTitle = () => {
    const changed = report.parameters.filter((line) => line[2]).length;
    return `Parameters (${changed} of ${report.parameters.length} differ from the defaults)`;
  };

  const backdrop = (entry, kind) => {
    $("layers").querySelector("img, .nothing")?.remove();
    const others = ["image", "overlay", "panel", "mask"].filter((other) => other !== kind);
    $("layers").prepend(picture(entry, [kind, ...others]));
    for (const button of $("backdrops").children) button.setAttribute("aria-pressed", button.textContent === kind);
  };
  const show = async (entry) => {
    open = entry;
    $("viewer-name").textContent = entry.name;
    $("backdrops").replaceChildren(...kinds(entry).map((kind) => {
      const button = make("button", { type: "button" }, kind);
      button.addEventListener("click", () => backdrop(entry, kind));
      return button;
    }));
    $("layers").replaceChildren();
    $("facts").replaceChildren(...(entry.rows.length > 1 ? [sideBySide(entry.rows)] : entry.rows.map(factsOf)));
    $("contours-label").hidden = !entry.contours;
    if (report.parameters.length) $("facts").append(make("details", {}, make("summary", {}, parameterTitle()), parameterTable()));
    backdrop(entry, kinds(entry)[0] ?? "image");
    fit();
    if (!$("viewer").open) $("viewer").showModal();
    history.replaceState(null, "", `#image-${entry.index + 1}`);
    const parts = await partsOf(entry);
    if (open !== entry || !parts.length) return; // another image was opened meanwhile
    const drawn = layer(entry, parts);
    $("layers").append(drawn);
    if ($("facts").firstChild) $("facts").firstChild.after(partTable(parts, [...drawn.querySelectorAll(".part")]));
    toggleContours();
  };
  const toggleContours = () => $("layers").querySelector("svg")?.toggleAttribute("hidden", !$("contours").checked);
  const fillRegions = (on) => {
    $("filled").checked = on;
    document.body.classList.toggle("filled", on);
  };
  const step = (by) => {
    const at = shown.indexOf(open) + by;
    if (at >= 0 && at < shown.length) show(shown[at]);
  };
  const fromHash = () => {
    const found = /^#image-(\d+)$/.exec(location.hash);
    if (found && entries[found[1] - 1]) show(entries[found[1] - 1]);
  };

  // --- wiring --------------------------------------------------------------------------------------------------

  const viewerKeys = {
    ArrowLeft: () => step(-1), ArrowRight: () => step(1), "+": () => zoom(1.5), "=": () => zoom(1.5), "-": () => zoom(1 / 1.5), 0: fit,
    f: () => fillRegions(!$("filled").checked),
    c: () => { $("contours").checked = !$("contours").checked; toggleContours(); },
    b: () => {
      const buttons = [...$("backdrops").children], at = buttons.findIndex((button) => button.getAttribute("aria-pressed") === "true");
      buttons[(at + 1) % buttons.length]?.click();
    },
  };
  const sheetKeys = { ArrowLeft: () => -1, ArrowRight: () => 1, ArrowUp: () => -columns, ArrowDown: () => columns, Home: () => -Infinity, End: () => Infinity };
  const sheetKey = (event) => {
    const index = document.activeElement?.dataset.index, at = shown.indexOf(entries[Number(index)]);
    if (index === undefined || at < 0 || !sheetKeys[event.key]) return;
    event.preventDefault();
    focusOn(Math.min(shown.length - 1, Math.max(0, at + sheetKeys[event.key]())));
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const typing = event.target.matches("input:not([type=checkbox]), select");
    if ($("viewer").open) {
      if (!typing && viewerKeys[event.key]) { event.preventDefault(); viewerKeys[event.key](); }
    } else if (!typing && !$("help").open) {
      if (event.key === "/") { event.preventDefault(); $("text").focus(); }
      else if (event.key === "?") $("help").showModal();
      else if (event.key === "f") fillRegions(!$("filled").checked);
      else sheetKey(event);
    }
  });

  const stage = $("stage");
  stage.addEventListener("wheel", (event) => {
    event.preventDefault();
    const box = stage.getBoundingClientRect();
    zoom(Math.exp(-event.deltaY / 400), event.clientX - box.left, event.clientY - box.top);
  }, { passive: false });
  stage.addEventListener("pointermove", (event) => {
    if (!(event.buttons & 1) || view.scale === 1) return;
    view.x += event.movementX;
    view.y += event.movementY;
    place();
  });

  const opener = (event) => {
    const target = event.target.closest("[data-index]");
    if (target) show(entries[Number(target.dataset.index)]);
  };
  for (const id of ["sheet", "plots", "failure-list"]) $(id).addEventListener("click", opener);
  for (const [id, act] of [["close", () => $("viewer").close()], ["previous", () => step(-1)], ["next", () => step(1)], ["zoom-in", () => zoom(1.5)],
    ["zoom-out", () => zoom(1 / 1.5)], ["zoom-fit", fit], ["help-button", () => $("help").showModal()]]) $(id).addEventListener("click", act);
  $("contours").addEventListener("change", toggleContours);
  $("viewer").addEventListener("close", () => {
    history.replaceState(null, "", location.pathname + location.search);
    if (shown.includes(open)) focusOn(shown.indexOf(open));
    open = null;
  });
  $("theme").addEventListener("click", () => {
    const themes = ["", "dark", "light"], root = document.documentElement;
    root.dataset.theme = themes[(themes.indexOf(root.dataset.theme ?? "") + 1) % 3];
  });
  $("filters").addEventListener("input", soon);
  $("filters").addEventListener("submit", (event) => event.preventDefault());
  $("filters").addEventListener("reset", () => setTimeout(() => { soon(); fillRegions(false); }));
  $("filled").addEventListener("change", () => fillRegions($("filled").checked));
  $("method").addEventListener("change", () => { method = $("method").value; });

  const failures = () => {
    const failed = entries.filter((entry) => entry.failed);
    $("failures").hidden = !failed.length;
    $("failures-title").textContent = `${failed.length} of ${entries.length} images failed`;
    const lines = failed.slice(0, MOST_FAILURES).map((entry) => make("li", {},
      make("button", { type: "button", "data-index": entry.index }, entry.name),
      entry.rows.filter((row) => row.status === "failed").map((row) => (methods.length > 1 ? `${row.method}: ` : "") + (row.error ?? row.status)).join("; ")));
    if (failed.length > MOST_FAILURES) lines.push(make("li", {}, `and ${failed.length - MOST_FAILURES} more: choose the status "failed" below`));
    $("failure-list").replaceChildren(...lines);
  };
  const about = () => {
    const { started, seconds, versions = {}, status, problems = [] } = report.about;
    const facts = [`ffseg ${report.version}`, started, typeof seconds === "number" ? `${number(seconds)} s` : null, versions.opencv ? `OpenCV ${versions.opencv}` : null,
      status === "interrupted" ? "interrupted: not all images are here" : null, ...problems];
    $("about").textContent = facts.filter(Boolean).join(", ");
  };
  const doubts = () => {
    const counts = new Map();
    for (const name of entries.flatMap(doubtsOf)) counts.set(name, (counts.get(name) ?? 0) + 1);
    const doubted = entries.filter((entry) => doubtsOf(entry).length).length;
    const options = [["any", "any", doubted], ["none", "none", entries.filter((entry) => !entry.failed).length - doubted],
      ...[...counts].map(([name, count]) => [name, DOUBTS[name] ?? name, count])];
    $("doubt-label").hidden = !doubted;
    $("doubt").append(...options.map(([value, label, count]) => make("option", { value }, `${label} (${count})`)));
  };
  const narrow = matchMedia("(max-width: 800px)");
  const fold = () => { $("fold").open = !narrow.matches; };
  const start = () => {
    $("title").textContent = report.title;
    $("sheet").classList.toggle("panels", report.kind === "compare");
    about();
    failures();
    if (report.parameters.length) {
      $("parameters").hidden = false;
      $("parameters").firstElementChild.textContent = parameterTitle();
      $("parameters").append(parameterTable());
    }
    $("sort").append(...SORTS.filter(([key]) => !key || key === "name" || (key === "note" ? entries.some(notesOf) : has(key === "look" ? "score" : key))).map(([key, label]) => make("option", { value: key }, label)));
    $("method-label").hidden = methods.length < 2;
    $("method").append(...methods.map((name) => make("option", { value: name }, name)));
    $("range-iou").hidden = !has("iou");
    doubts();
    fold();
    refresh();
    fromHash();
  };
  addEventListener("hashchange", fromHash);
  addEventListener("resize", measure);
  narrow.addEventListener("change", fold);
  start();
})();
