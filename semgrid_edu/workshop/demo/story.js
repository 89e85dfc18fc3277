// Reads the numbers of one cell's story from the bytes that Python wrote, and finds cells. Nothing here touches the page, so tests run it alone.

// Returns a function read(name, cell) -> the bytes of that name in a cell; cells are counted row by row.
async function unpack(grid, layout, uri) {
  const packed = Uint8Array.from(atob(uri.slice(uri.indexOf(",") + 1)), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  for (const [start, number, step, stride] of Object.values(layout))
    if (stride === 1) // maps whose rows are differences to the row before
      for (let map = 0; map < number; map++)
        for (let i = start + map * step + grid.cols; i < start + (map + 1) * step; i++) bytes[i] += bytes[i - grid.cols];
  return (name, cell) => {
    const [start, number, step, stride] = layout[name];
    return Array.from({ length: number }, (_, k) => bytes[start + k * step + cell * stride]);
  };
}

// Numbers of two bytes: the high ones, then the low ones.
function wide(read, name, cell) {
  const bytes = read(name, cell), half = bytes.length / 2;
  return Array.from({ length: half }, (_, k) => 256 * bytes[k] + bytes[half + k]);
}

// Free, static, dynamic, unknown after a step of the filter.
function states(story, read, name, cell) {
  const start = 4 * story.filter_steps.indexOf(name);
  return read("states", cell).slice(start, start + 4).map((byte) => byte / 255);
}

// The parts of the difference of two scores, and how many times as probable the one class is as the other.
function parts(story, read, cell) {
  const scaled = (values, zero) => values.map((value) => (value - zero) * story.steps.part);
  const totals = scaled(wide(read, "totals", cell), 32768), [digits, power] = read("times", cell);
  return { planes: scaled(read("planes", cell), 128), scores: scaled(read("scores", cell), 128), occupancy: totals.slice(0, 4), totals: totals.slice(4), times: (digits * 10 ** power) / 10 };
}

// A sentence of words.toml with the names in braces filled in.
function filled(sentence, values) { return sentence.replace(/{(\w+)}/g, (_, name) => values[name]); }

// How often each class occurs, the most frequent first.
function counted(classes, names) {
  const found = new Map();
  for (const c of classes) if (c < names.length) found.set(c, (found.get(c) ?? 0) + 1);
  return [...found].sort(([a, m], [b, n]) => n - m || a - b).map(([c, number]) => `${names[c]} (${number})`).join(", ");
}

// A cell's story in sentences, without its place and its numbers.
function sentences(story, read, cell) {
  const said = story.sentences, [label, , refined, truth] = read("classes", cell), added = messages(story, read, cell);
  const otherwise = Object.fromEntries(story.changes.map((change, i) => [change, story.names[read("otherwise", cell)[i]]]));
  const names = { label: story.names[label], refined: story.names[refined], truth: story.names[truth] };
  const weights = { for_refined: added[2].toFixed(1), for_truth: added[truth === label ? 0 : 1].toFixed(1) };
  const called = read("called", cell), seen = called.filter((c) => c !== 255), shows = counted(read("shown", cell), story.names);
  const heights = [story.heights[0], story.heights.at(-1)].map((height) => height.toFixed(1));
  const points = { points: called.length, lowest: heights[0], highest: heights[1], seen: seen.length, says: counted(seen, story.names) };
  const image = filled(seen.length ? said.image.some : said.image.none, points), partly = read("shown", cell).some((c, i) => called[i] !== 255 && c >= story.names.length);
  const here = { image_here: imageHere(story, called, read("shown", cell)), occupancy_here: truth === 255 ? "" : occupancyHere(story, states(story, read, "shown", cell), story.names[truth]) };
  return [
    filled(said.fault[story.faults[read("fault", cell)[0]]], { ...names, ...weights, ...here, all_true: otherwise["both true"] }),
    seen.length && shows ? `${image} ${filled(partly ? said.image.partly : said.image.shown, { shows })}` : image,
    story.layout.memory ? memory(story, read, cell) : "",
    filled(said.otherwise.removed, { no_image: otherwise["no image"], no_occupancy: otherwise["no occupancy"] }),
  ].filter((sentence) => sentence);
}

// Where the class with memory comes from.
function memory(story, read, cell) {
  const [kept, sure, known, then, tenths, earlier] = wide(read, "memory", cell), said = story.sentences.memory, back = known - 1;
  const values = { kept: story.names[kept], sure, then: story.names[then], label: story.names[read("classes", cell)[0]], seconds: (tenths / 10).toFixed(1), back, earlier };
  const told = filled(said[back < 0 ? "never" : back ? "before" : "now"], values);
  return states(story, read, "shown", cell)[2] > 0.5 ? `${told} ${said.moves}` : told;
}

// Whether the image network is right at the pixels above a cell, and the filter about the cell.
function imageHere(story, called, shown) {
  const labelled = shown.map((c, i) => [c, called[i]]).filter(([c]) => c < story.names.length), wrong = labelled.filter(([a, b]) => a !== b).length;
  return filled(story.sentences.image_here[wrong ? "wrong" : labelled.length ? "right" : "unknown"], { wrong, labelled: labelled.length });
}

function occupancyHere(story, probabilities, truth) {
  const state = probabilities.indexOf(Math.max(...probabilities)), said = story.sentences.occupancy_here;
  if (state === 3) return said.unknown;
  const wrong = story.flat.includes(truth) !== (state === 0);
  return filled(wrong ? said.wrong : said.right, { state: ["FREE", "STATIC", "DYNAMIC"][state] });
}

// What the neighbours add for label, rival and refined class.
function messages(story, read, cell) { return read("messages", cell).map((byte) => byte * story.steps.message); }

// The neighbours that pull most towards the refined class, the strongest first.
function strongest(story, read, cell) {
  const bytes = read("strongest", cell), number = bytes.length / 3;
  return Array.from({ length: number }, (_, k) => {
    const [rows, cols, pull] = [0, 1, 2].map((kind) => bytes[kind * number + k]);
    return { cell: cell + (rows - 128) * story.grid.cols + cols - 128, pull: pull * story.steps.message };
  });
}

// The pixel of each plane's point above a cell, from the lowest plane up; null where the camera doesn't see it.
function pixels(story, places, cell) {
  const found = wide(places, "pixels", cell), number = story.heights.length;
  return story.heights.map((_, i) => (found[i] === 65535 ? null : [found[i], found[number + i]].map((value) => value * story.steps.pixel)));
}

// The centre of a cell: x forward, y left, metres.
function centre(grid, cell) {
  const row = Math.floor(cell / grid.cols), col = cell % grid.cols;
  return [grid.x_max - (row + 0.5) * grid.cell, grid.y_max - (col + 0.5) * grid.cell];
}

// The cell that holds a point, or -1 outside the grid.
function cellAt(grid, x, y) {
  const row = Math.floor((grid.x_max - x) / grid.cell), col = Math.floor((grid.y_max - y) / grid.cell);
  return row >= 0 && row < grid.rows && col >= 0 && col < grid.cols ? row * grid.cols + col : -1;
}

// The cell of another frame that holds the centre of a cell of now; -1 outside the grid. A pose is x, y and yaw of the vehicle on one plane.
function cellThen(grid, [xThen, yThen, yawThen], [xNow, yNow, yawNow], cell) {
  const turned = ([x, y], yaw) => [Math.cos(yaw) * x - Math.sin(yaw) * y, Math.sin(yaw) * x + Math.cos(yaw) * y];
  const [x, y] = turned(centre(grid, cell), yawNow);
  return cellAt(grid, ...turned([x + xNow - xThen, y + yNow - yThen], -yawThen));
}
