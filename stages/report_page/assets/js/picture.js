// What is drawn, whoever draws it: looks of things, which blocks of points and which robots are
// seen, and how finely. Points of a block stand by level, coarse to fine, so that any number of
// levels is an even thinning of it.

/** What the view can show: colour, and whether it is shown at first. */
const LOOKS = {
  fixed: { name: "Fixed", color: [0.62, 0.66, 0.70], on: true, kind: "fixed" },
  floor: { name: "Floor", color: [0.42, 0.46, 0.50], on: true, kind: "floor" },
  uncertain: { name: "Uncertain, counts as fixed", color: [0.95, 0.85, 0.30], on: true,
    kind: "uncertain" },
  unknown: { name: "Edge of unseen space near robots", color: [0.36, 0.30, 0.55], on: false },
  link: { name: "Robots, points", color: [0.55, 0.82, 1.0], on: true, kind: "link" },
  attached: { name: "Attached to robots, points", color: [0.92, 0.45, 0.75], on: true,
    kind: "attachment" },
  trusted: { name: "Robots, trusted", color: [0.20, 0.56, 0.87], on: true },
  doubtful: { name: "Robots, doubtful", color: [0.93, 0.62, 0.10], on: true },
  hanging: { name: "Attached bodies", color: [0.80, 0.33, 0.62], on: true },
  before: { name: "Robots before the rescan", color: [0.93, 0.27, 0.25], on: true },
  gone: { name: "Gone or moved away", color: [0.93, 0.27, 0.25], on: true },
  came: { name: "New or moved here", color: [0.16, 0.78, 0.50], on: true },
  scanner: { name: "Scanners", color: [1.0, 1.0, 1.0], on: true },
};
/** Looks of points, by the number that the shader knows them by. */
const POINT_LOOKS = ["fixed", "floor", "uncertain", "unknown", "link", "attached"];
const FIELD = 0.9;
const NEAREST = 0.05;
const FARTHEST = 2000;
/** Cell of a body's coarse form, metres. */
const COARSE = 0.06;
/** Pixels of a metre below which the coarse form does. */
const COARSE_BELOW = 60;
/** Triangles of robots in a frame without graphics hardware. */
const QUICK_TRIANGLES = 12_000;


/** What draws a picture has: points, bodies, robots, and the section box. */
class Picture {
  constructor(canvas, cloud, meshes, robots) {
    Object.assign(this, { canvas, cloud, robots, low: [-1e9, -1e9, -1e9], high: [1e9, 1e9, 1e9],
      tone: [0, 0.1], boxes: [] });
    this.meshes = meshes.map(coarsened);
  }

  /** Blocks within the field of view: distance, and how many points each level has. */
  visible(camera) {
    const out = [];
    for (const block of this.cloud.blocks) {
      const looks = block.owner >= 0 ? [4, 5] : block.owner === -2 ? [3] : [0, 1, 2];
      if (!looks.some((i) => LOOKS[POINT_LOOKS[i]].on)) continue;
      const robot = block.owner >= 0 ? this.robots[block.owner] : null;
      const low = block.corner, high = block.corner.map((v) => v + block.edge);
      const isMoved = robot?.tree && robot.poses !== robot.foundPoses;
      if (!isMoved && (low.some((v, i) => v > this.high[i]) || high.some((v, i) => v < this.low[i])
        || isOutside(camera.clip, low, high))) continue;
      const nearest = camera.eye.map((v, i) => clamp(v, low[i], high[i]));
      const away = Math.max(0.4, Math.hypot(...minus(camera.eye, nearest)));
      out.push({ block, away, robot });
    }
    return out.sort((a, b) => a.away - b.away);
  }

  /** How many points of each visible block to draw, so that neighbours are `spacing` pixels apart. */
  chosen(visible, focal, spacing) {
    let total = 0;
    const rows = visible.map((entry) => {
      const { block, away } = entry;
      let n = 0, size = 0;
      for (let k = 0; k < block.counts.length; k++) {
        const edge = block.edge / 1024 * 2 ** (view.coarsest - k);
        n += block.counts[k];
        if (block.counts[k]) size = Math.max(edge, block.edge / 1024 * 2 ** block.shift);
        if (edge * focal / away < spacing) break;
      }
      total += n;
      return { ...entry, n, size };
    });
    return { rows, total };
  }

  /** The finest spacing with no more than so many points. */
  within(visible, focal, most) {
    let [fine, coarse] = [0.5, 400];
    let best = this.chosen(visible, focal, coarse);
    const all = this.chosen(visible, focal, fine);
    if (all.total <= most) return all;
    for (let i = 0; i < 12; i++) {
      const middle = Math.sqrt(fine * coarse);
      const tried = this.chosen(visible, focal, middle);
      if (tried.total > most) fine = middle; else { coarse = middle; best = tried; }
    }
    return best;
  }

  /** Bodies to draw, nearest robots first; quickly only so many triangles of them. */
  bodies(camera, focal, isQuick) {
    const out = [];
    const standing = this.robots.filter((r) => r.tree && r.entry.verdict !== "refused").map((robot) => {
      const middle = robot.poses[robot.poses.length >> 1].slice(12, 15);
      return { robot, middle, away: Math.hypot(...minus(middle, camera.eye)) };
    }).filter(({ middle }) => !isOutside(camera.clip, middle.map((v) => v - 2.5),
      middle.map((v) => v + 2.5))).sort((a, b) => a.away - b.away);
    let left = isQuick ? QUICK_TRIANGLES : Infinity;
    for (const { robot, away, middle } of standing) {
      const isCoarse = isQuick || focal / away < COARSE_BELOW;
      const add = (number, matrices, color, alpha = 1) => {
        if (!Number.isInteger(number) || left <= 0) return;
        const mesh = this.meshes[number];
        const corners = isCoarse ? mesh.coarse : mesh.corners;
        left -= corners.length / 3;
        out.push({ mesh, isCoarse, matrices, color, alpha, middle });
      };
      const look = LOOKS[robot.entry.verdict] || LOOKS.doubtful;
      if (look.on) add(robot.body.mesh, robot.poses, look.color);
      if (LOOKS.hanging.on) add(robot.body.hanging, robot.poses, LOOKS.hanging.color);
      if (robot.before && LOOKS.before.on) add(robot.body.mesh, robot.before, LOOKS.before.color, 0.5);
    }
    return out;
  }
}

/** A body with a coarse form of itself: corners in one cell become one. */
function coarsened(mesh) {
  const cell = COARSE / mesh.scale;
  const known = new Map();
  const first = new Uint32Array(mesh.n_vertices);
  for (let i = 0; i < mesh.n_vertices; i++) {
    const [x, y, z, link] = mesh.vertices.subarray(4 * i, 4 * i + 4);
    const key = [link, Math.round(x / cell), Math.round(y / cell), Math.round(z / cell)].join();
    if (!known.has(key)) known.set(key, i);
    first[i] = known.get(key);
  }
  const coarse = [];
  for (let i = 0; i < mesh.corners.length; i += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => first[mesh.corners[i + k]]);
    if (a !== b && b !== c && a !== c) coarse.push(a, b, c);
  }
  return { ...mesh, coarse: coarse.length > 180 ? Uint32Array.from(coarse) : mesh.corners };
}

/** Whether a box lies outside of one side of the field of view. */
function isOutside(clip, low, high) {
  const corners = [];
  for (let i = 0; i < 8; i++) {
    const p = [i & 1 ? high[0] : low[0], i & 2 ? high[1] : low[1], i & 4 ? high[2] : low[2], 1];
    corners.push([0, 1, 2, 3].map((r) =>
      clip[r] * p[0] + clip[4 + r] * p[1] + clip[8 + r] * p[2] + clip[12 + r]));
  }
  return [0, 1].some((i) => corners.every((c) => c[i] > c[3]) || corners.every((c) => c[i] < -c[3]))
    || corners.every((c) => c[3] < NEAREST);
}

/** The twelve edges of a box, as places of lines. */
function boxLines(low, high) {
  const corner = (i) => [i & 1 ? high[0] : low[0], i & 2 ? high[1] : low[1], i & 4 ? high[2] : low[2]];
  const out = [];
  for (let i = 0; i < 8; i++) {
    for (const bit of [1, 2, 4]) if (!(i & bit)) out.push(corner(i), corner(i | bit));
  }
  return out;
}
