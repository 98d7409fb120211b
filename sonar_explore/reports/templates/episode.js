"use strict";
const { scans, robot } = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const map = $("map");
const slider = $("step");
const END = scans.length; // the slider's last place: the whole episode, no scan picked out
let timer = null;

function draw(parent, name, attributes) {
  const mark = document.createElementNS(map.namespaceURI, name);
  for (const [key, value] of Object.entries(attributes)) mark.setAttribute(key, value);
  parent.append(mark);
  return mark;
}

const line = (parent, kind, [x1, y1, x2, y2]) => draw(parent, "line", { class: kind, x1, y1, x2, y2 });

function table(id, head, rows) {
  const make = (tag, cells) => {
    const tr = document.createElement("tr");
    for (const cell of cells) {
      const td = document.createElement(tag);
      const [text, kind] = Array.isArray(cell) ? cell : [cell];
      const holder = kind?.startsWith("#") ? td.appendChild(document.createElement("a")) : td;
      holder.textContent = text;
      if (holder !== td) holder.href = kind; // to the glossary
      else if (kind) td.className = kind;
      tr.append(td);
    }
    return tr;
  };
  const thead = document.createElement("thead");
  const tbody = document.createElement("tbody");
  thead.append(make("th", head));
  for (const { cells, mark } of rows) {
    const tr = make("td", cells);
    if (mark) tr.className = "chosen";
    tbody.append(tr);
  }
  $(id).replaceChildren(...(rows.length ? [thead, tbody] : []));
}

/** The chain that `chain` had become by scan k. */
function ownerAt(k) {
  const absorbed = new Map();
  for (const scan of scans.slice(0, k + 1)) for (const [survivor, gone] of scan.merges) absorbed.set(gone, survivor);
  return (chain) => {
    for (let hops = absorbed.size; hops-- && absorbed.has(chain); ) chain = absorbed.get(chain);
    return chain;
  };
}

function drawPast(k) {
  const owner = ownerAt(k);
  const dangling = new Set(k < END ? scans[k].dangling : []);
  const labelled = new Set();
  for (const wall of $("past").children) {
    const chain = owner(Number(wall.dataset.chain));
    const loose = dangling.has(chain);
    wall.classList.toggle("root", k < Number(wall.dataset.until));
    wall.classList.toggle("dangling", loose);
    if (!loose || labelled.has(chain) || Number(wall.dataset.s) > k) continue;
    labelled.add(chain);
    const middle = (a, b) => (Number(wall.getAttribute(a)) + Number(wall.getAttribute(b))) / 2;
    draw($("dangling"), "text", { class: "label", x: middle("x1", "x2"), y: middle("y1", "y2") }).textContent = `dangling ${chain}`;
  }
}

function drawFan(scan) {
  const [x, y] = scan.poses[1];
  for (const [ex, ey, heard] of scan.fan) line($("fan"), heard ? "ray" : "ray deaf", [x, y, ex, ey]);
  for (const [cx, cy, heard] of scan.fan) if (heard) draw($("fan"), "circle", { class: "echo", cx, cy });
}

function drawAssociations(scan) {
  const fate = scan.features.map((_, i) => {
    const mine = scan.associations.filter((a) => a.feature === i);
    return mine.length === 0 ? "new" : mine.some((a) => a.kept) ? "kept" : "cut";
  });
  scan.features.forEach((feature, i) => {
    if (feature[4] !== "wall") return;
    line($("links"), "halo", feature);
    line($("links"), `seen ${fate[i]}`, feature);
  });
  for (const a of scan.associations) if (a.line) line($("links"), a.kept ? "kept" : "cut", a.line);
}

/** Viridis: purple, teal, yellow; the same order for every kind of colour vision, and in grey. */
function colour(t) {
  const stops = [[68, 1, 84], [59, 82, 139], [33, 144, 140], [93, 201, 99], [253, 231, 37]];
  const at = Math.min(Math.max(t, 0), 1) * 4;
  const i = Math.min(Math.floor(at), 3);
  return `rgb(${stops[i].map((v, c) => Math.round(v + (at - i) * (stops[i + 1][c] - v))).join(" ")})`;
}

function drawDecision({ candidates, chosen, path }) {
  const scores = candidates.map((c) => c[3]);
  const low = Math.min(...scores);
  const span = Math.max(...scores) - low || 1;
  draw($("choices"), "polyline", { class: "plan", points: path });
  for (const [x, y, , score] of [...candidates].sort((a, b) => a[3] - b[3])) {
    const t = (score - low) / span;
    const dot = draw($("choices"), "circle", { class: "candidate", cx: x, cy: y });
    dot.style.fill = colour(t);
    dot.style.r = `calc(${(2.5 + 4 * t).toFixed(1)}px * var(--k))`;
    draw(dot, "title", {}).textContent = `score ${score}`;
  }
  const [x, y] = candidates[chosen] ?? [];
  if (x !== undefined) draw($("choices"), "circle", { class: "chosen-ring", cx: x, cy: y }).style.r = "calc(10px * var(--k))";
}

function drawPoses(scan) {
  ["predicted", "true", "believed"].forEach((kind) => {
    const [x, y, turn] = scan.poses[["predicted", "believed", "true"].indexOf(kind)];
    const body = draw($("robots"), "g", { transform: `translate(${x} ${y}) rotate(${turn})` });
    draw(body, "circle", { class: `pose ${kind}`, r: robot });
    draw(body, "path", { class: `pose ${kind}`, d: `M0 0H${robot}` });
  });
}

function tellScan(scan, k) {
  $("scan-title").textContent = `Scan ${k}`;
  $("scan-note").textContent = `${scan.driven.toFixed(1)} m driven, ${Math.floor(scan.time / 60)} min ${scan.time % 60} s, ${scan.explored.toFixed(1)} % explored`;
  const row = (name, kind, pose, errors) => ({
    cells: [name, pose[3].toFixed(2), pose[4].toFixed(2), pose[5].toFixed(1), ...errors],
  });
  const errors = ([position, heading]) => [position.toFixed(3), heading.toFixed(1)];
  table("poses", [["pose", "#word-pose"], "x [m]", "y [m]", "heading [°]", "off [m]", "off [°]"], [
    row("predicted", "predicted", scan.poses[0], errors(scan.errors[0])),
    row("corrected", "believed", scan.poses[1], errors(scan.errors[1])),
    row("true", "true", scan.poses[2], ["", ""]),
  ]);
}

function tellAssociations(scan) {
  const cut = scan.associations.filter((a) => !a.kept).length;
  const parts = [`${scan.associations.length - cut} kept`, `${cut} cut`];
  if (scan.roots.length) parts.push(`${scan.roots.length} new ${scan.roots.length === 1 ? "root" : "roots"}`);
  if (scan.merges.length) parts.push(scan.merges.map(([a, b]) => `${b} merged into ${a}`).join(", "));
  $("association-title").textContent = `Associations: ${parts.join(", ")}`;
  table("associations", ["feature", "chain", ["ADR [°]", "#word-adr"], ["NDR [cm]", "#word-ndr"], ["P", "#word-p"], ""], scan.associations.map((a) => ({
    cells: [a.feature, a.chain, a.angle.toFixed(1), a.normal.toFixed(1), a.kept ? a.probability.toFixed(2) : "",
      a.kept ? ["kept", "good"] : ["cut", "bad"]],
  })));
}

function tellDecision(decision) {
  $("decision-title").textContent = decision
    ? `Decision: ${decision.candidates.length} candidates, ${decision.outcome}` : "No decision: the episode ended here";
  if (!decision) return table("candidates", [], []);
  const rows = decision.candidates.map((cells, i) => ({ cells, mark: i === decision.chosen }));
  rows.sort((a, b) => b.cells[3] - a.cells[3]);
  table("candidates", [["score", "#word-candidates"], ...decision.terms.map((t) => t.replaceAll("_", " ")), "path [m]"], rows.map(({ cells, mark }) => ({
    mark,
    cells: [cells[3], ...cells.slice(4), cells[2]].map((v) => v.toFixed(2)),
  })));
}

function show(k) {
  const whole = k >= END;
  for (const id of ["fan", "links", "choices", "robots"]) $(id).replaceChildren();
  $("dangling").replaceChildren(...(whole ? finalLabels : []));
  for (const mark of map.querySelectorAll("[data-s]")) {
    mark.style.visibility = Number(mark.dataset.s) <= k ? "" : "hidden";
    mark.classList.toggle("now", Number(mark.dataset.s) === k);
  }
  $("final").setAttribute("visibility", whole ? "visible" : "hidden");
  $("past").style.display = whole ? "none" : layerShown("chains");
  $("past").setAttribute("visibility", "visible");
  map.classList.toggle("past-scan", !whole);
  $("whole").hidden = !whole;
  $("scan").hidden = whole;
  $("where").textContent = whole ? "Whole episode" : `Scan ${k} / ${END - 1}`;
  if (!whole) {
    drawPast(k);
    drawFan(scans[k]);
    drawAssociations(scans[k]);
    if (scans[k].decision) drawDecision(scans[k].decision);
    drawPoses(scans[k]);
    tellScan(scans[k], k);
    tellAssociations(scans[k]);
    tellDecision(scans[k].decision);
  }
  thinTexts();
  for (const cursor of document.querySelectorAll(".cursor")) {
    const x = cursor.dataset.x.split(" ")[k];
    cursor.setAttribute("visibility", whole ? "hidden" : "visible");
    if (!whole) for (const end of ["x1", "x2"]) cursor.setAttribute(end, x);
  }
}

function go(k) {
  slider.value = Math.min(Math.max(k, 0), END);
  show(Number(slider.value));
}

function play(on) {
  clearInterval(timer);
  timer = null;
  $("play").textContent = on ? "❚❚" : "▶";
  $("play").setAttribute("aria-label", on ? "Pause" : "Play");
  if (!on) return;
  if (Number(slider.value) >= END) go(0);
  timer = setInterval(() => {
    go(Number(slider.value) + 1);
    if (Number(slider.value) >= END) play(false);
  }, 900);
}

const layerShown = (name) => (document.querySelector(`[data-layer="${name}"]`).checked ? "" : "none");

function layers() {
  for (const box of document.querySelectorAll("[data-layer]"))
    for (const layer of map.querySelectorAll(`.layer-${box.dataset.layer}`)) layer.style.display = layerShown(box.dataset.layer);
  if (Number(slider.value) >= END) $("past").style.display = "none";
}

/** Of texts that would cover each other the first is shown: the current scan's number, then labels, then numbers. */
function thinTexts() {
  const numbers = [...map.querySelectorAll(".number")].filter((n) => n.parentNode.style.visibility !== "hidden");
  const now = numbers.filter((n) => n.parentNode.matches(".now"));
  const edge = map.getBoundingClientRect().right - 2;
  const many = map.matches(".many"); // a long episode numbers every 25th scan, and leaves it to dashes what dangles
  const others = numbers.filter((n) => !now.includes(n) && !(many && n.matches(".minor")));
  const texts = [...now, ...(many ? [] : $("dangling").children), ...others];
  for (const text of texts) {
    text.style.display = "";
    text.classList.remove("leftward");
    if (text.getBoundingClientRect().right > edge) text.classList.add("leftward");
  }
  const boxes = texts.map((text) => text.getBoundingClientRect());
  const placed = [];
  texts.forEach((text, i) => {
    const { left, right, top, bottom } = boxes[i];
    const free = placed.every((p) => left > p.right || right < p.left || top + 3 > p.bottom || bottom - 3 < p.top);
    text.style.display = free ? "" : "none";
    if (free) placed.push(boxes[i]);
  });
}

/** Text and marks keep their size on the screen whatever the window's width. */
function rescale() {
  const box = map.viewBox.baseVal;
  const scale = Math.min(map.clientWidth / box.width, map.clientHeight / box.height);
  if (scale > 0) map.style.setProperty("--k", (1 / scale).toFixed(3));
  thinTexts();
}

const finalLabels = [...$("dangling").children];
const fromAddress = () => go(Number(/^#scan=(\d+)$/.exec(location.hash)?.[1] ?? END));
slider.addEventListener("input", () => { play(false); go(Number(slider.value)); });
$("play").addEventListener("click", () => play(timer === null));
document.addEventListener("keydown", (event) => {
  if (event.target.matches("input, button, summary") && event.key === " ") return;
  const move = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
  if (move) { event.preventDefault(); play(false); go(Number(slider.value) + move); }
  else if (event.key === " ") { event.preventDefault(); play(timer === null); }
});
document.querySelector(".layers").addEventListener("change", layers);
window.addEventListener("hashchange", () => { if (location.hash.startsWith("#scan=")) fromAddress(); });
new ResizeObserver(rescale).observe(map);
rescale();
layers();
fromAddress();
