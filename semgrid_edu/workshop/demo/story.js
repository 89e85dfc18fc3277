// The numbers of one cell's story, computed from the maps of a frame. Nothing here touches the page, so tests run it alone.

// Returns the bytes of a frame's maps, one map after the other.
async function unpack(uri) {
  const bytes = Uint8Array.from(atob(uri.slice(uri.indexOf(",") + 1)), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Returns a function read(name, cell) -> the bytes of the maps of that name in a cell; cells are counted row by row.
function reader(story, bytes) {
  const cells = story.grid.rows * story.grid.cols;
  const starts = {};
  let start = 0;
  for (const [name, count] of Object.entries(story.layout)) { starts[name] = start; start += count * cells; }
  return (name, cell) => Array.from({ length: story.layout[name] }, (_, k) => bytes[starts[name] + k * cells + cell]);
}

// Free, static, dynamic, unknown: they sum to 1.
function states(read, name, cell) {
  const known = read(name, cell).map((byte) => byte / 255);
  return [...known, Math.max(0, 1 - known[0] - known[1] - known[2])];
}

// The parts of the difference of two scores. They sum to the score: rest holds the network's constants, and what rounding loses.
function parts(story, read, cell) {
  const step = story.steps.part, small = (name) => read(name, cell).map((byte) => byte - 128);
  const large = read("large", cell), half = large.length / 2;
  const [planes, scores] = [small("planes"), small("scores")];
  const numbers = Array.from({ length: half }, (_, k) => 256 * large[k] + large[half + k] - 32768);
  const [score, occupancy] = [numbers[half - 1], numbers.slice(0, half - 1)];
  const rest = score - sum(planes) - sum(occupancy);
  const scaled = (values) => values.map((value) => value * step);
  return { score: score * step, planes: scaled(planes), scores: scaled(scores), occupancy: scaled(occupancy), rest: rest * step };
}

function sum(values) { return values.reduce((total, value) => total + value, 0); }

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

// The cell of an earlier frame that holds the centre of a cell of now, through both poses; -1 outside the grid.
function cellThen(grid, poseThen, poseNow, cell) {
  const [x, y] = centre(grid, cell), R = poseThen;
  const d = [0, 1, 2].map((i) => poseNow[4 * i + 3] - poseThen[4 * i + 3]);
  const column = (v) => [0, 1, 2].map((j) => R[j] * v[0] + R[4 + j] * v[1] + R[8 + j] * v[2]); // R^T v
  const ahead = column([poseNow[0], poseNow[4], poseNow[8]]), shift = column(d);
  const yaw = Math.atan2(ahead[1], ahead[0]), cos = Math.cos(yaw), sin = Math.sin(yaw);
  return cellAt(grid, cos * x - sin * y + shift[0], sin * x + cos * y + shift[1]);
}

// Equation (1): the pixel of each plane's point above a cell, from the lowest plane up.
function pixels(story, cell) {
  const { K, T_camera_from_grid: T, size } = story.camera, [x, y] = centre(story.grid, cell);
  return story.heights.map((height) => {
    const [X, Y, Z] = [0, 4, 8].map((i) => T[i] * x + T[i + 1] * y + T[i + 2] * height + T[i + 3]);
    const [u, v] = [0, 3].map((i) => (K[i] * X + K[i + 1] * Y + K[i + 2] * Z) / Z);
    return { height, u, v, visible: Z > 0 && u >= 0 && v >= 0 && u <= size[1] - 1 && v <= size[0] - 1 };
  });
}

// The bracket of equation (4) between a cell and each other cell of a window of four widths: a map from cell to weight.
function weights(story, read, cell) {
  const { grid, crf } = story, reach = Math.ceil(4 * crf.sigma_alpha), known = new Map();
  const state = (i) => { if (!known.has(i)) known.set(i, states(read, "shown", i)); return known.get(i); };
  const apart = (i, j) => [Math.floor(i / grid.cols) - Math.floor(j / grid.cols), (i % grid.cols) - (j % grid.cols)];
  const bilateral = (i, j) => {
    const [r, c] = apart(i, j), [a, b] = [state(i), state(j)];
    const unlike = (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2 + (a[3] - b[3]) ** 2;
    return Math.exp(-0.5 * ((r * r + c * c) / crf.sigma_alpha ** 2 + unlike / crf.sigma_beta ** 2));
  };
  const spatial = (i, j) => { const [r, c] = apart(i, j); return Math.exp((-0.5 * (r * r + c * c)) / crf.sigma_gamma ** 2); };
  const symmetric = crf.normalization === "symmetric";
  const degree = (i, kernel) => (symmetric ? sum(around(grid, i, reach).map((j) => kernel(i, j))) : 1);
  const [own, ownSpatial] = [degree(cell, bilateral), degree(cell, spatial)];
  const found = new Map();
  for (const j of around(grid, cell, reach)) {
    if (j === cell) continue;
    const near = crf.w_bilateral * bilateral(cell, j), close = crf.w_spatial * spatial(cell, j);
    if (near + close < 1e-6) continue; // too far or too different for its row sum to be worth computing
    found.set(j, near / Math.sqrt(own * degree(j, bilateral)) + close / Math.sqrt(ownSpatial * degree(j, spatial)));
  }
  return found;
}

function around(grid, cell, reach) {
  const row = Math.floor(cell / grid.cols), col = cell % grid.cols, cells = [];
  for (let r = Math.max(0, row - reach); r <= Math.min(grid.rows - 1, row + reach); r++)
    for (let c = Math.max(0, col - reach); c <= Math.min(grid.cols - 1, col + reach); c++) cells.push(r * grid.cols + c);
  return cells;
}

// What the neighbours add to the logarithm of each class's probability: the sum over j of k_ij Q_j(l).
function messages(story, read, weightOf) {
  const total = story.names.map(() => 0);
  for (const [j, weight] of weightOf) read("neighbours", j).forEach((byte, label) => { total[label] += (weight * byte) / 255; });
  return total;
}

// The neighbours that pull most towards a class, the strongest first.
function strongest(read, weightOf, label, number) {
  const pulls = [...weightOf].map(([cell, weight]) => ({ cell, pull: (weight * read("neighbours", cell)[label]) / 255 }));
  return pulls.sort((a, b) => b.pull - a.pull).slice(0, number);
}
