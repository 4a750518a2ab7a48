// Draws without graphics hardware: points as a few pixels each and triangles row by row, each pixel
// with its nearness, one over the distance along the view. That takes a twentieth of the time that
// WebGL in software needs for points.

const TONES = 32;
/** Difference of nearness among neighbours on one surface, as a share. */
const EVEN = 0.012;

/** Pixels of a picture: colour as bytes red, green, blue, and nearness; 0 is nothing. */
class Sheet {
  fit(width, height) {
    if (width === this.width && height === this.height) return;
    Object.assign(this, { width, height, color: new Uint32Array(width * height),
      near: new Float32Array(width * height), image: new ImageData(width, height) });
  }
}

const packedColor = (color, by) => {
  const [r, g, b] = color.map((v) => Math.min(255, Math.round(255 * by * v)));
  return (0xff000000 | b << 16 | g << 8 | r) >>> 0;
};

class Software extends Picture {
  constructor(canvas, cloud, meshes, robots) {
    super(canvas, cloud, meshes, robots);
    const most = Math.max(1, ...this.meshes.map((mesh) => mesh.n_vertices));
    Object.assign(this, { context: canvas.getContext("2d", { alpha: false }), isSlow: true,
      sheets: { moving: new Sheet(), resting: new Sheet() },
      corners: [0, 1, 2].map(() => new Float64Array(most)) });
    this.meshes.forEach((mesh) => {
      mesh.normals = normals(mesh, mesh.corners);
      mesh.coarseNormals = normals(mesh, mesh.coarse);
    });
  }

  begin(name, width, height) {
    const sheet = this.sheets[name];
    sheet.fit(width, height);
    sheet.near.fill(0);
  }

  /** Colours of points by look and height; 0 for what is not shown. */
  palette() {
    const out = new Uint32Array(8 * TONES);
    POINT_LOOKS.forEach((name, i) => {
      const look = LOOKS[name];
      for (let t = 0; look.on && t < TONES; t++) {
        out[i * TONES + t] = packedColor(look.color, 0.55 + 0.45 * t / (TONES - 1));
      }
    });
    return out;
  }

  addPoints(name, rows, camera, focal, cap) {
    const palette = this.palette();
    const sheet = this.sheets[name];
    const { low, high, tone } = this;
    for (const { block, n, size, robot } of rows) {
      const step = block.edge / 1024;
      const isMoved = robot?.tree && robot.poses !== robot.foundPoses;
      const clips = isMoved ? robot.poses.map((m, l) => times(camera.clip, times(m, robot.back[l])))
        : [camera.clip];
      const ways = new Float64Array(clips.flatMap((clip) => way(sheet, clip, block.corner, step)));
      const from = low.map((v, i) => Math.ceil((v - block.corner[i]) / step - 0.5));
      const to = high.map((v, i) => Math.floor((v - block.corner[i]) / step - 0.5));
      const isCut = !isMoved && (from.some((v) => v > 0) || to.some((v) => v < 1023));
      const rise = tone[1] * (TONES - 1) * 0.76;
      drawPoints(sheet, this.cloud.points, { first: 4 * block.first, last: 4 * (block.first + n), ways,
        isMoved, isCut, from, to, palette, isRobot: block.owner >= 0, size: size * focal * 1.5, cap,
        tone: (block.corner[2] - tone[0]) * rise + 0.24 * TONES, rise: step * rise });
    }
  }

  finish(name, camera, focal, isQuick) {
    const sheet = this.sheets[name];
    for (const body of this.bodies(camera, focal, isQuick)) this.drawBody(sheet, camera, body);
    for (const { look, lines } of this.boxes) {
      if (!look.on) continue;
      const clip = way(sheet, camera.clip, [0, 0, 0], 1, 0);
      const ends = lines.map((p) => [0, 4, 8].map((k) =>
        clip[k] * p[0] + clip[k + 1] * p[1] + clip[k + 2] * p[2] + clip[k + 3]));
      const color = packedColor(look.color, 1);
      for (let i = 0; i < ends.length; i += 2) drawLine(sheet, ends[i], ends[i + 1], color);
    }
  }

  drawBody(sheet, camera, { mesh, isCoarse, matrices, color, alpha, middle }) {
    const ways = matrices.map((m) => way(sheet, times(camera.clip, m), mesh.min, mesh.scale, 0));
    const [xs, ys, ns] = this.corners;
    const { vertices } = mesh;
    for (let i = 0; i < mesh.n_vertices; i++) {
      const w = ways[vertices[4 * i + 3]] || ways[0];
      const x = vertices[4 * i], y = vertices[4 * i + 1], z = vertices[4 * i + 2];
      const away = w[8] * x + w[9] * y + w[10] * z + w[11];
      ns[i] = away > NEAREST ? 1 / away : 0;
      xs[i] = (w[0] * x + w[1] * y + w[2] * z + w[3]) * ns[i] + sheet.width / 2;
      ys[i] = (w[4] * x + w[5] * y + w[6] * z + w[7]) * ns[i] + sheet.height / 2;
    }
    // Light from the eye, from above and from one side, in the frames of the links.
    const look = unit(minus(camera.eye, middle));
    const lights = matrices.map((m) => [look, [0, 0, 1], [1, 0, 0]].map((v) => turned(inverse(m), v)));
    const shades = Array.from({ length: 64 }, (_, i) =>
      packedColor(color, alpha < 1 ? 1 + 0.4 * i / 63 : i / 63 * 1.1));
    const isCut = this.low.some((v, i) => middle[i] - 4 < v) || this.high.some((v, i) => middle[i] + 4 > v);
    const corners = isCoarse ? mesh.coarse : mesh.corners;
    const normal = isCoarse ? mesh.coarseNormals : mesh.normals;
    for (let i = 0; i < corners.length; i += 3) {
      const a = corners[i], b = corners[i + 1], c = corners[i + 2];
      if (!(ns[a] && ns[b] && ns[c]) || isCut && this.isCutAway(mesh, a, matrices)) continue;
      const [eye, up, side] = lights[vertices[4 * a + 3]] || lights[0];
      const n = [normal[i], normal[i + 1], normal[i + 2]];
      const front = dot(n, eye);
      const by = front < 0 ? -1 : 1;
      const light = 0.42 + 0.38 * front * by + 0.2 * Math.max(0, by * dot(n, up)) + 0.1 * by * dot(n, side);
      drawTriangle(sheet, xs[a], ys[a], ns[a], xs[b], ys[b], ns[b], xs[c], ys[c], ns[c],
        shades[clamp(light / 1.1 * 63 | 0, 0, 63)], alpha < 1);
    }
  }

  isCutAway(mesh, a, matrices) {
    const local = [0, 1, 2].map((k) => mesh.min[k] + mesh.scale * mesh.vertices[4 * a + k]);
    const p = moved(matrices[mesh.vertices[4 * a + 3]] || matrices[0], local);
    return p.some((v, i) => v < this.low[i] || v > this.high[i]);
  }

  /** Brings the picture to the canvas; what lies behind its neighbours is darkened. */
  show(name, shade) {
    const { width, height, color, near, image } = this.sheets[name];
    const { canvas, context } = this;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const out = new Uint32Array(image.data.buffer);
    const by = 12 * shade;
    for (let y = 0, at = 0; y < height; y++) {
      const t = 1 - y / height;
      const back = packedColor([0.09 + 0.1 * t, 0.11 + 0.11 * t, 0.13 + 0.13 * t], 1);
      const up = y > 0 ? -width : 0, down = y < height - 1 ? width : 0;
      for (let x = 0; x < width; x++, at++) {
        const own = near[at];
        if (own === 0) { out[at] = back; continue; }
        const l = near[at - (x > 0 ? 1 : 0)], r = near[at + (x < width - 1 ? 1 : 0)];
        const u = near[at + up], d = near[at + down];
        let sum = 0;
        if (l > own) sum += 1 - own / l;
        if (r > own) sum += 1 - own / r;
        if (u > own) sum += 1 - own / u;
        if (d > own) sum += 1 - own / d;
        const c = color[at];
        // Points of one surface differ by a little.
        if (sum < EVEN) { out[at] = c; continue; }
        const k = 256 / (1 + by * Math.min(sum - EVEN, 0.12)) | 0;
        out[at] = 0xff000000 | ((c >> 16 & 255) * k >> 8) << 16 | ((c >> 8 & 255) * k >> 8) << 8
          | (c & 255) * k >> 8;
      }
    }
    context.putImageData(image, 0, 0);
  }

  whenDrawn(from, done) { done(performance.now() - from); }
}

/** From steps at a corner to pixels times distance, and distance: three rows of four numbers. */
function way({ width, height }, clip, corner, step, half = 0.5) {
  const c = plus(corner, [1, 1, 1], step * half);
  return [[0, width / 2], [1, -height / 2], [3, 1]].flatMap(([r, by]) => [
    by * step * clip[r], by * step * clip[4 + r], by * step * clip[8 + r],
    by * (clip[r] * c[0] + clip[4 + r] * c[1] + clip[8 + r] * c[2] + clip[12 + r])]);
}

/** Normals of triangles in the frames of their links. */
function normals(mesh, corners) {
  const out = new Float32Array(corners.length);
  const at = (i) => [...mesh.vertices.subarray(4 * i, 4 * i + 3)];
  for (let i = 0; i < corners.length; i += 3) {
    const a = at(corners[i]);
    out.set(unit(cross(minus(at(corners[i + 1]), a), minus(at(corners[i + 2]), a))), i);
  }
  return out;
}

function drawPoints({ width, height, color, near }, points, block) {
  const { first, last, ways, isMoved, isCut, palette, isRobot, size, cap, tone, rise } = block;
  const [halfWidth, halfHeight] = [width / 2, height / 2];
  const [x0, y0, z0] = block.from, [x1, y1, z1] = block.to;
  let [ax, ay, az, aw, bx, by, bz, bw, cx, cy, cz, cw] = ways;
  for (let i = first; i < last; i += 4) {
    const x = points[i], y = points[i + 1], z = points[i + 2], tag = points[i + 3];
    if (isCut && (x < x0 || y < y0 || z < z0 || x > x1 || y > y1 || z > z1)) continue;
    if (isMoved) {
      const k = 12 * (tag >> 1);
      if (k >= ways.length) continue;
      ax = ways[k]; ay = ways[k + 1]; az = ways[k + 2]; aw = ways[k + 3];
      bx = ways[k + 4]; by = ways[k + 5]; bz = ways[k + 6]; bw = ways[k + 7];
      cx = ways[k + 8]; cy = ways[k + 9]; cz = ways[k + 10]; cw = ways[k + 11];
    }
    const away = cx * x + cy * y + cz * z + cw;
    if (away < NEAREST) continue;
    const n = 1 / away;
    const px = (ax * x + ay * y + az * z + aw) * n + halfWidth;
    const py = (bx * x + by * y + bz * z + bw) * n + halfHeight;
    if (!(px >= 0 && py >= 0 && px < width && py < height)) continue;
    const look = isRobot ? 4 + (tag & 1) : tag;
    const t = tone + rise * z;
    const c = palette[look * TONES + (t < 0 ? 0 : t > TONES - 1 ? TONES - 1 : t | 0)];
    if (c === 0) continue;
    const wide = size * n * (look === 2 || look === 4 ? 0.6 : 1);
    if (wide < 1.5) {
      const at = (py | 0) * width + (px | 0);
      if (n > near[at]) { near[at] = n; color[at] = c; }
      continue;
    }
    const side = wide > cap ? cap : wide + 0.5 | 0;
    const left = (px | 0) - (side >> 1), low = (py | 0) - (side >> 1);
    const right = left + side > width ? width : left + side;
    const top = low + side > height ? height : low + side;
    for (let v = low < 0 ? 0 : low; v < top; v++) {
      for (let at = v * width + (left < 0 ? 0 : left), end = v * width + right; at < end; at++) {
        if (n > near[at]) { near[at] = n; color[at] = c; }
      }
    }
  }
}

function drawTriangle({ width, height, color, near }, ax, ay, an, bx, by, bn, cx, cy, cn, c, isThin) {
  const area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
  if (!(Math.abs(area) > 1e-6)) return;
  const low = Math.max(0, Math.ceil(Math.min(ay, by, cy) - 0.5));
  const high = Math.min(height - 1, Math.floor(Math.max(ay, by, cy) - 0.5));
  const nx = ((bn - an) * (cy - ay) - (cn - an) * (by - ay)) / area;
  const ny = ((cn - an) * (bx - ax) - (bn - an) * (cx - ax)) / area;
  for (let row = low; row <= high; row++) {
    const y = row + 0.5;
    let from = 1e9, to = -1e9, x;
    if (ay <= y !== by <= y) {
      x = ax + (y - ay) / (by - ay) * (bx - ax);
      if (x < from) from = x;
      if (x > to) to = x;
    }
    if (by <= y !== cy <= y) {
      x = bx + (y - by) / (cy - by) * (cx - bx);
      if (x < from) from = x;
      if (x > to) to = x;
    }
    if (cy <= y !== ay <= y) {
      x = cx + (y - cy) / (ay - cy) * (ax - cx);
      if (x < from) from = x;
      if (x > to) to = x;
    }
    const left = Math.max(0, Math.ceil(from - 0.5)), right = Math.min(width - 1, Math.floor(to - 0.5));
    let n = an + nx * (left + 0.5 - ax) + ny * (y - ay);
    for (let at = row * width + left, end = row * width + right; at <= end; at++, n += nx) {
      if (n > near[at] && !(isThin && (at + row) & 1)) { near[at] = n; color[at] = c; }
    }
  }
}

/** A line between two places, as pixels times distance, and distance. */
function drawLine({ width, height, color, near }, a, b, c) {
  if (a[2] < NEAREST && b[2] < NEAREST) return;
  const cut = (p, q) => p[2] >= NEAREST ? p : plus(p, minus(q, p), (NEAREST - p[2]) / (q[2] - p[2]));
  const [p, q] = [cut(a, b), cut(b, a)].map(([x, y, w]) => [x / w + width / 2, y / w + height / 2, 1 / w]);
  const n = Math.min(4000, Math.ceil(Math.max(Math.abs(q[0] - p[0]), Math.abs(q[1] - p[1]))) || 1);
  for (let i = 0; i <= n; i++) {
    const [x, y, nearness] = plus(p, minus(q, p), i / n);
    if (!(x >= 0 && y >= 0 && x < width && y < height)) continue;
    const at = (y | 0) * width + (x | 0);
    if (nearness * 1.002 > near[at]) { near[at] = nearness; color[at] = c; }
  }
}
