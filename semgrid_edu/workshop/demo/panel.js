// The panel that tells a cell's story, the marks in grids and images, and the switches of the grids.
const story = JSON.parse(document.getElementById("storydata").textContent);
const telling = document.getElementById("telling");
const where = document.getElementById("where");
const zoom = document.getElementById("zoom");
const errors = document.getElementById("errors");
const hover = document.getElementById("hover");
const brief = document.getElementById("brief");
const inset = document.getElementById("inset");
const grids = [...document.querySelectorAll("svg[data-grid]")];
const stateNames = ["free", "static", "dynamic", "unknown"];
const SVG = document.querySelector("svg").namespaceURI;
const places = unpack(story.grid, story.places_layout, story.places); // what holds in all frames
const unpacked = new Map(); // number of a frame -> its reader, or the promise of it
const decoded = new Map(); // pictures of the shown frame -> their colours, or the promise of them
let anchor = null; // the cell that was chosen, and the frame in which it was
let turn = 0; // counts tellings, so that a late one doesn't overwrite a newer one

const percent = (p) => `${Math.round(100 * p)} %`;
const signed = (value) => `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(1)}`;
const rgb = (colour) => `rgb(${colour.join(",")})`;
const escaped = (text) => String(text).replace(/[&<>"]/g, (letter) => `&#${letter.charCodeAt(0)};`);
const place = ([x, y]) => `${x.toFixed(2)} m ahead, ${Math.abs(y).toFixed(2)} m to the ${y < 0 ? "right" : "left"}`;

function readerOf(k) {
  if (!frames[k].details) return Promise.resolve(null);
  if (!unpacked.has(k)) unpacked.set(k, unpack(story.grid, story.layout, frames[k].details));
  return unpacked.get(k);
}

// The cell of frame k that holds the place that was chosen; -1 when it has left the grid, or none was chosen.
function cellIn(k) { return anchor === null ? -1 : cellThen(story.grid, frames[k].pose, frames[anchor.frame].pose, anchor.cell); }

// A cell of the road ahead, to begin with.
function cellAhead() { return Math.floor(0.8 * story.grid.rows) * story.grid.cols + Math.floor(story.grid.cols / 2); }

// Forget the cell that was chosen.
function clear() {
  anchor = null;
  turn++;
  places.then((everywhere) => mark(-1, everywhere, null));
  where.textContent = brief.textContent = "No cell is chosen.";
  telling.innerHTML = "<p>No cell is chosen. Click one, or move to a grid with the Tab key and use the arrow keys.</p>";
}

function choose(cell) { anchor = { frame: shown(), cell }; tell(shown()); }

async function tell(k) {
  const mine = ++turn;
  if (anchor === null) return;
  const cell = cellIn(k), everywhere = await places;
  if (mine !== turn) return;
  mark(cell, everywhere, null);
  const read = await readerOf(k);
  if (mine !== turn) return;
  if (cell >= 0 && read) mark(cell, everywhere, read("called", cell));
  if (cell < 0 || read === null) {
    const away = (frame) => Math.abs(frame.time - frames[k].time);
    const [near] = frames.filter((frame) => frame.details).sort((a, b) => away(a) - away(b));
    const reason = cell < 0 ? "The place has left the grid." : `To stay small, the page leaves out what this frame's stories need. The nearest frame that has it: ${near.clock}.`;
    where.textContent = "";
    telling.innerHTML = brief.innerHTML = `<p>${escaped(reason)}</p>`;
    return;
  }
  const past = [];
  for (let i = Math.max(0, k - 9); i <= k; i++) {
    const then = await readerOf(i), at = cellThen(story.grid, frames[i].pose, frames[k].pose, cell);
    if (then) past.push({ time: frames[i].time, states: at < 0 ? [0, 0, 0, 1] : states(story, then, "shown", at) });
  }
  if (mine !== turn) return;
  const pulls = timer === null ? strongest(story, read, cell) : null; // too restless while the drive plays
  const [label, rival, refined] = read("classes", cell);
  const unfolded = [...telling.querySelectorAll("details")].map((one) => one.open);
  where.textContent = `${place(centre(story.grid, cell))}: ${story.names[refined]}.`;
  const said = frames[k].scanned ? scanStory(cell, read, everywhere) : "<p>This frame has no scan, so the filter only predicts.</p>";
  telling.innerHTML = [heading(cell, read), said, stateStory(cell, read, past), partStory(cell, read, label, rival), crfStory(cell, read, pulls, [label, rival, refined])].join("");
  telling.querySelectorAll("details").forEach((one, i) => { one.open = unfolded[i] ?? false; });
  brief.innerHTML = [...telling.querySelectorAll(":scope > p")].slice(0, 2).map((one) => one.outerHTML).join("");
  if (pulls) drawPulls(cell, pulls);
}

function heading(cell, read) {
  const [, , refined, truth] = read("classes", cell), row = Math.floor(cell / story.grid.cols);
  return `<p><b>${place(centre(story.grid, cell))}</b> (row ${row}, column ${cell % story.grid.cols}): the refined grid says ${swatch(refined)}. ${truthOf(truth, refined)}</p>${sentences(story, read, cell).map((sentence) => `<p>${escaped(sentence)}</p>`).join("")}`;
}

// What is known of a cell: the kinds of unknown are the filter's own states, where nobody gave a label.
function truthOf(truth, refined) {
  if (truth === 255) return `Nobody labelled this ${frames[shown()].images.truth ? "cell" : "frame"}.`;
  const name = escaped(story.names[truth]);
  if (name.startsWith("unknown")) return truth === refined ? "This agrees with the filter; nobody labelled it." : `Nobody labelled it; to the filter it is <b>${name}</b>.`;
  return truth === refined ? "This is right." : `The truth is <b>${name}</b>.`;
}

function swatch(label) { const name = escaped(story.names[label]); return `<span class="class" data-texture="${name}" style="--swatch:${rgb(story.colours.classes[label])}">${name}</span>`; }

function scanStory(cell, read, everywhere) {
  const [obstacles] = read("obstacles", cell), [ground] = read("ground", cell), [reach] = read("reach", cell);
  const distance = wide(everywhere, "distance", cell)[0] * story.steps.distance, sees = (reach * story.steps.reach).toFixed(1);
  const count = (n, what) => `${n === 255 ? "255 or more" : n} ${what} return${n === 1 ? "" : "s"}`;
  const beam = reach ? `The beam through the cell's centre sees ${sees} m far; the cell is ${distance.toFixed(1)} m away.` : "Nothing came back in the beam through the cell's centre.";
  const verdict = {
    hit: "A return from an obstacle speaks for something that stands here, and overrules all else.",
    passed: "So the beam passes the cell, which speaks for free space.",
    ground: "The ground was seen here, which speaks for free space.",
    silent: "So this scan says nothing of the cell, and its past decides.",
  }[story.verdicts[read("verdict", cell)[0]]];
  return `<h3>What the scan says</h3><p>${count(obstacles, "obstacle")} and ${count(ground, "ground")} lie in the cell. ${beam} ${verdict}</p>`;
}

function stateStory(cell, read, past) {
  const words = { move: "moved", predict: "predicted", update: "updated", resample: "resampled", shown: "<b>shown</b>" };
  const row = (text, values) => `<tr><th scope="row">${text}</th>${values.map((p) => `<td>${percent(p)}</td>`).join("")}<td class="bands">${bands(values)}</td></tr>`;
  const rows = Object.entries(words).map(([name, text]) => row(text, states(story, read, name, cell)));
  const since = past.map((then) => row(`${then.time.toFixed(1)} s`, then.states));
  const head = `<thead><tr><th></th>${stateNames.map((name) => `<th scope="col">${name}</th>`).join("")}<th></th></tr></thead>`;
  return `<h3>Its four states</h3><p>The filter's map moves with the vehicle, predicts, is updated with the scan, and draws its particles again. The grid shows the prediction updated with the returns of exactly this cell; the map's cell may lie half a cell beside it.</p>
<table>${head}<tbody>${rows.join("")}</tbody></table><details><summary>The same place in ${past.length} frame${past.length === 1 ? "" : "s"} up to this one</summary><table>${head}<tbody>${since.join("")}</tbody></table></details>`;
}

function bands(values) {
  return `<span class="band">${values.map((p, i) => `<i style="width:${100 * p}%;background:${rgb(story.colours.states[i])}"></i>`).join("")}</span>`;
}

function partStory(cell, read, label, rival) {
  const of = parts(story, read, cell), score = of.totals.at(-1);
  const heights = story.heights.map((h) => `${h.toFixed(1)} m`), order = of.scores.map((_, i) => i).sort((a, b) => Math.abs(of.scores[b]) - Math.abs(of.scores[a]));
  const often = of.times > 1e6 ? "more than a million" : of.times.toLocaleString("en");
  const byClass = order.slice(0, 8);
  const before = read("classes", cell)[2] === label ? "Why" : "Before the CRF: why";
  return `<details><summary><h3>${before} ${escaped(story.names[label])} and not ${escaped(story.names[rival])}?</h3></summary>
<p>In the semantic grid ${swatch(label)} is about ${often} times as probable as ${swatch(rival)}: its fused score is higher by ${score.toFixed(1)}. Gradient times input splits this difference:</p>
${bars(["image, on the planes", "occupancy", story.uses_return_heights ? "constants and heights" : "constants", "sum"], of.totals)}
<p>The constants are biases and normalisations that the open ReLUs let pass: no input has a share in them.${story.uses_return_heights ? " The part of the returns' heights is in the same row." : ""} Image and occupancy count in all cells around that the network looks at. A part isn't what would change if its input were missing, and parts that cancel may be much larger than their sum. Below, each table has its own scale.</p>
<div class="two"><div><h4>Image, by class of its scores</h4>${bars(byClass.map((i) => escaped(story.names[i])), byClass.map((i) => of.scores[i]))}<h4>Occupancy, by state</h4>${bars(stateNames, of.occupancy)}</div>
<div><h4>Image, by height of the plane</h4>${bars([...heights].reverse(), [...of.planes].reverse())}</div></div></details>`;
}

// A table of numbers with bars to both sides of zero.
function bars(names, values) {
  const largest = Math.max(...values.map(Math.abs), 0.1);
  const bar = (value) => `<span class="${value < 0 ? "minus" : "plus"}" style="width:${(50 * Math.abs(value)) / largest}%"></span>`;
  const rows = values.map((value, i) => `<tr><th scope="row">${names[i]}</th><td>${signed(value)}</td><td class="bar-cell">${bar(value)}</td></tr>`);
  return `<table class="parts"><tbody>${rows.join("")}</tbody></table>`;
}

function crfStory(cell, read, pulls, [label, rival, refined]) {
  const before = read("before", cell), after = read("after", cell), shownClasses = [[label, 0], [rival, 1]];
  if (refined !== label && refined !== rival) shownClasses.push([refined, 2]);
  const added = messages(story, read, cell);
  const rows = shownClasses.map(([c, i]) => `<tr><th scope="row">${swatch(c)}</th><td>${percent(before[i] / 255)}</td><td>${pulls ? signed(added[i]) : ""}</td><td>${percent(after[i] / 255)}</td></tr>`);
  const near = (pulls ?? []).map(({ cell: j, pull }) => `<li>${place(centre(story.grid, j))}: ${signed(pull)}</li>`);
  const changed = refined === label ? "The CRF leaves the class as it is." : `The CRF turns ${swatch(label)} into ${swatch(refined)}.`;
  return `<h3>What the neighbours say</h3><p>${changed} In its last update the neighbours add this to the logarithm of each probability:</p>
<table><thead><tr><th></th><th scope="col">before</th><th scope="col">neighbours</th><th scope="col">after</th></tr></thead><tbody>${rows.join("")}</tbody></table>
${pulls ? `<p>They pull most towards ${swatch(refined)} (lines in the refined grid):</p><ol>${near.join("")}</ol>` : "<p>The neighbours are told when the drive is paused.</p>"}`;
}

// Marks: a square around the cell in every grid, and its points of equation (1) in every image, in the colours of what their pixels are called.
function mark(cell, everywhere, called) {
  const { grid } = story, [x, y] = cell < 0 ? [0, 0] : centre(grid, cell);
  for (const group of document.querySelectorAll("[data-marks]")) {
    group.replaceChildren();
    for (const [square, circle] of cell < 0 ? [] : [["halo", "halo"], ["mark", "ring"]])
      group.append(shape("rect", { class: square, x: -y - grid.cell / 2, y: -x - grid.cell / 2, width: grid.cell, height: grid.cell }), shape("circle", { class: circle, cx: -y, cy: -x, r: 0.4 + 1.2 / Number(zoom.value) }));
  }
  const seen = cell < 0 ? [] : pixels(story, everywhere, cell).flatMap((point, i) => (point ? [[...point, called ? rgb(story.colours.classes[called[i]]) : ""]] : []));
  const points = (size) => seen.map(([u, v, fill], i) => shape("circle", { cx: u, cy: v, r: size / (i ? 190 : 120), class: i ? "point" : "point lowest", style: fill && `fill:${fill}` }));
  for (const layer of document.querySelectorAll("[data-column]")) layer.replaceChildren(...points(story.width));
  showInset(seen, points);
  zoomGrids();
}

// A phone's small picture of the points, since the images are out of sight there.
function showInset(seen, points) {
  const rows = seen.map(([, v]) => v), high = Math.max(...rows) - Math.min(...rows), h = Math.max(story.width / 12, 1.1 * high), w = (h * 2) / 3;
  inset.toggleAttribute("hidden", seen.length === 0);
  if (seen.length === 0) return;
  const [[u]] = seen, middle = (Math.max(...rows) + Math.min(...rows)) / 2;
  inset.setAttribute("viewBox", [u - w / 2, middle - h / 2, w, h].join(" "));
  inset.querySelector("image").setAttribute("x", -0.5);
  inset.querySelector("image").setAttribute("y", -0.5);
  inset.querySelector("image").setAttribute("width", story.width);
  inset.querySelector("g").replaceChildren(...points(4 * h));
}

function drawPulls(cell, neighbours) {
  const [x, y] = centre(story.grid, cell);
  for (const group of document.querySelectorAll('[data-marks="refined"]'))
    for (const { cell: j } of neighbours) { const [a, b] = centre(story.grid, j); for (const kind of ["pull", "halo"]) group.prepend(shape("path", { class: kind, d: `M${-b} ${-a}L${-y} ${-x}` })); }
}

function shape(kind, attributes) {
  const element = document.createElementNS(SVG, kind);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

// Zoom: every grid shows the surroundings of the cell that was chosen, or of the road ahead, and its axes say so.
function zoomGrids() {
  const factor = Number(zoom.value), { x_min, x_max, y_min, y_max } = story.grid, [w, h] = [(y_max - y_min) / factor, (x_max - x_min) / factor];
  const chosen = cellIn(shown()), [x, y] = centre(story.grid, chosen < 0 ? cellAhead() : chosen);
  const clamp = (value, low, high) => Math.max(low, Math.min(high, value));
  const left = clamp(-y - w / 2, -y_max, -y_min - w), top = clamp(-x - h / 2, -x_max, -x_min - h);
  for (const svg of grids) {
    svg.querySelector("svg").setAttribute("viewBox", [left, top, w, h].join(" "));
    svg.classList.toggle("near", factor > 1);
    svg.querySelector("[data-axes]").replaceChildren(...axes(left, top, w, h));
  }
}

// Marks and numbers of both axes for the part of the map that is shown; `_axes` in Python draws the same for the whole.
function axes(left, top, w, h) {
  const { x_min, x_max, y_min, y_max } = story.grid, step = Math.max(1, Math.round((10 * h) / (x_max - x_min)));
  const multiples = (low, high) => Array.from({ length: Math.floor(high / step) - Math.ceil(low / step) + 1 }, (_, i) => (Math.ceil(low / step) + i) * step);
  const across = (y) => -y_max + ((-y - left) * (y_max - y_min)) / w, down = (x) => -x_max + ((-x - top) * (x_max - x_min)) / h;
  const drawn = (kind, attributes, text) => Object.assign(shape(kind, attributes), text === undefined ? {} : { textContent: text });
  return [
    ...multiples(-top - h, -top).flatMap((x) => [drawn("path", { class: "tick", d: `M${-y_max} ${down(x)}h-.7` }), drawn("text", { class: "x", x: -y_max - 1.1, y: down(x) + 0.7 }, x)]),
    ...multiples(-left - w, -left).flatMap((y) => [drawn("path", { class: "tick", d: `M${across(y)} ${-x_min}v.7` }), drawn("text", { class: "y", x: across(y), y: -x_min + 2.8 }, y)]),
  ];
}

// Errors: cells of a grid whose class isn't the truth's, painted red; the right ones fade. Read from the pictures themselves.
function colours(uri) {
  if (!decoded.has(uri)) decoded.set(uri, decode(uri));
  return decoded.get(uri);
}

async function decode(uri) {
  const image = new Image();
  image.src = uri;
  await image.decode();
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
  const pen = canvas.getContext("2d");
  pen.drawImage(image, 0, 0);
  return pen.getImageData(0, 0, canvas.width, canvas.height);
}

function errorsOn() { return errors.getAttribute("aria-pressed") === "true"; }

async function paintErrors(k) {
  const { images } = frames[k];
  document.getElementById("errorsnote").hidden = !errorsOn();
  for (const layer of document.querySelectorAll("[data-errors]")) {
    const estimate = images[layer.dataset.errors];
    if (!errorsOn() || !images.truth || !estimate) { layer.removeAttribute("href"); continue; }
    const [guess, truth] = [await colours(estimate), await colours(images.truth)];
    if (k !== shown() || !errorsOn()) return;
    const painted = new ImageData(guess.width, guess.height);
    for (let i = 0; i < guess.data.length; i += 4) {
      const [guessed, known] = [guess, truth].map(({ data }) => data.slice(i, i + 3).join());
      const right = guessed === known || known === "255,255,255"; // white: without a label
      painted.data.set(right ? [255, 255, 255, 200] : [215, 25, 28, 255], i);
    }
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [guess.width, guess.height];
    canvas.getContext("2d").putImageData(painted, 0, 0);
    layer.setAttribute("href", canvas.toDataURL());
  }
}

// Textures: a dot on every car cell, a stripe on every bicycle cell, so that hue alone tells no two classes apart.
const textures = { car: [[1, 1], [1, 2], [2, 1], [2, 2]], bicycle: [[0, 3], [1, 2], [2, 1], [3, 0]] };
async function paintTextures(k) {
  for (const layer of document.querySelectorAll("[data-textures]")) {
    const uri = frames[k].images[layer.dataset.textures];
    if (!uri) { layer.removeAttribute("href"); continue; }
    const { data, width, height } = await colours(uri);
    if (k !== shown()) return;
    const canvas = document.createElement("canvas"), pen = canvas.getContext("2d");
    [canvas.width, canvas.height] = [4 * width, 4 * height];
    pen.fillStyle = "#fff";
    for (const [name, dots] of Object.entries(textures)) {
      const [red, green, blue] = story.colours.classes[story.names.indexOf(name)] ?? [-1];
      for (let i = 0; i < width * height; i++)
        if (data[4 * i] === red && data[4 * i + 1] === green && data[4 * i + 2] === blue)
          for (const [row, col] of dots) pen.fillRect(4 * (i % width) + col, 4 * Math.floor(i / width) + row, 1, 1);
    }
    layer.setAttribute("href", canvas.toDataURL());
  }
}

// Hover: the class or the states of the cell below the pointer.
async function nameAt(name, cell) {
  const k = shown();
  if (name === "occupancy") {
    const read = await readerOf(k);
    return read ? states(story, read, "shown", cell).map((p, i) => `${stateNames[i]} ${percent(p)}`).join(", ") : "";
  }
  if (name === "your_occupancy" || !frames[k].images[name]) return "";
  const { data } = await colours(frames[k].images[name]);
  return story.names[story.colours.classes.findIndex((colour) => colour.every((value, j) => value === data[4 * cell + j]))] ?? "";
}

// The cell below the pointer: the inverse of what the browser did to draw the grid in metres.
function cellBelow(svg, event) {
  const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.querySelector("[data-marks]").getScreenCTM().inverse());
  return cellAt(story.grid, -y, -x);
}

function stepCell(event) {
  const step = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] }[event.key];
  if (!step || event.altKey || event.ctrlKey || event.metaKey) return;
  event.preventDefault();
  event.stopPropagation();
  const { rows, cols } = story.grid, chosen = cellIn(shown()), cell = chosen < 0 ? cellAhead() : chosen;
  const row = Math.max(0, Math.min(rows - 1, Math.floor(cell / cols) + step[0])), col = Math.max(0, Math.min(cols - 1, (cell % cols) + step[1]));
  choose(row * cols + col);
}

for (const svg of grids) {
  svg.setAttribute("tabindex", "0");
  svg.setAttribute("role", "application");
  svg.setAttribute("aria-roledescription", "map; arrow keys choose a cell");
  svg.addEventListener("click", (event) => { const cell = cellBelow(svg, event); if (cell >= 0) choose(cell); });
  svg.addEventListener("keydown", stepCell);
  svg.addEventListener("pointerleave", () => { hover.hidden = true; });
  svg.addEventListener("pointermove", async (event) => {
    const cell = cellBelow(svg, event), text = cell < 0 ? "" : await nameAt(svg.dataset.grid, cell);
    hover.hidden = !text || !svg.matches(":hover"); // the pointer may have left meanwhile
    hover.textContent = text;
    hover.style.left = `${Math.min(event.clientX + 14, innerWidth - 220)}px`;
    hover.style.top = `${event.clientY + 14}px`;
  });
}
zoom.addEventListener("change", () => (anchor === null ? zoomGrids() : tell(shown())));
errors.addEventListener("click", () => { errors.setAttribute("aria-pressed", String(!errorsOn())); paintErrors(shown()); });
errors.hidden = !frames.some((frame) => frame.images.truth);
document.addEventListener("keydown", (event) => { if (event.key === "Escape") clear(); });
watchers.push(() => decoded.clear(), tell, paintTextures, paintErrors);
// index.html#12/93/30 opens frame 12 and tells the story of row 93, column 30.
function followCell() {
  const { rows, cols } = story.grid, [, row, col] = location.hash.slice(1).split("/").map((part) => parseInt(part, 10));
  if (row >= 0 && row < rows && col >= 0 && col < cols) choose(row * cols + col);
}
// Without an address, begin with the frame in which most moves, and in it with the nearest cell, from 5 m on, whose points the camera sees all and in which a stage went wrong, or else, where no truth tells that, something moves.
async function begin() {
  const read = await readerOf(shown());
  if (read === null || anchor !== null) return;
  const far = (cell) => Math.hypot(...centre(story.grid, cell)), right = ["none", "mended"].map((name) => story.faults.indexOf(name));
  const cells = Array.from({ length: story.grid.rows * story.grid.cols }, (_, cell) => cell);
  const seen = cells.filter((cell) => far(cell) >= 5 && !read("called", cell).includes(255));
  const wrong = seen.filter((cell) => !right.includes(read("fault", cell)[0]));
  const first = wrong.length ? wrong : seen.filter((cell) => states(story, read, "shown", cell)[2] > 0.5);
  if (first.length) choose(first.reduce((one, other) => (far(other) < far(one) ? other : one)));
}
window.addEventListener("hashchange", followCell);
followCell();
if (location.hash === "") go(story.start);
else paintTextures(shown());
if (location.hash === "") begin();
