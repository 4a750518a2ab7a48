// The camera, what moves it, and when what is drawn: few points while it moves, all at rest.

/** A frame of the moving view is to take no longer, milliseconds. */
const FRAME_MS = 45;
/** Pause after which everything is drawn, milliseconds. */
const PAUSE_MS = 160;
/** Time of a piece while the view rests, so that it stays ready to move, milliseconds. */
const REST_MS = 60;
/** Share of the picture's width and height that the plant fills at first. */
const SEEN_SHARE = 0.94;
/** Fewest points of a frame. */
const LEAST_POINTS = 8_000;

class View {
  constructor(drawing, robots) {
    Object.assign(this, { drawing, robots, canvas: drawing.canvas, yaw: -0.9, pitch: 0.6,
      away: 20, target: [0, 0, 0], budget: drawing.isSlow ? 150_000 : 1_200_000, lastMove: 0, lastFrame: 0,
      rest: null, isAsleep: true, chosen: null, labels: [] });
    this.measure();
    this.addLabels();
    this.listen();
    // Who has not moved the view yet sees all of the plant, also in a window made narrower.
    new ResizeObserver(() => this.isHome ? this.home() : this.wake()).observe(this.canvas);
    this.home();
  }

  /** Bounds of the plant from its coarse points: what few points lie beyond is left out. */
  measure() {
    const { points, blocks } = this.drawing.cloud;
    const sides = [[], [], []];
    const all = [[1e9, 1e9, 1e9], [-1e9, -1e9, -1e9]];
    for (const block of blocks.filter((b) => b.owner !== -2)) {
      const n = block.counts.slice(0, 5).reduce((sum, c) => sum + c, 0);
      for (let i = 4 * block.first; i < 4 * (block.first + n); i += 4) {
        for (let k = 0; k < 3; k++) {
          const v = block.corner[k] + (points[i + k] + 0.5) * block.edge / 1024;
          sides[k].push(v);
          all[0][k] = Math.min(all[0][k], v - 0.02);
          all[1][k] = Math.max(all[1][k], v + 0.02);
        }
      }
    }
    for (const robot of this.robots.filter((r) => r.tree)) {
      for (const m of robot.poses) [12, 13, 14].forEach((i, k) => {
        all[0][k] = Math.min(all[0][k], m[i] - 0.3);
        all[1][k] = Math.max(all[1][k], m[i] + 0.3);
      });
    }
    if (all[0][0] > all[1][0]) all.splice(0, 2, [-5, -5, 0], [5, 5, 5]);
    const side = (k, share) => {
      const sorted = Float64Array.from(sides[k]).sort();
      return sorted.length ? sorted[Math.floor(share * (sorted.length - 1))] : all[share < 0.5 ? 0 : 1][k];
    };
    this.bounds = all;
    this.core = [[0, 1, 2].map((k) => side(k, 0.005)), [0, 1, 2].map((k) => side(k, 0.995))];
    this.drawing.tone = [this.core[0][2], 1 / Math.max(1, this.core[1][2] - this.core[0][2])];
  }

  /** Above that a ceiling hides the plant: half a metre above the highest robot. */
  ceiling() {
    const tops = this.robots.filter((r) => r.tree).map((r) =>
      Math.max(...r.poses.map((m) => m[14])) + 0.7);
    const top = tops.length ? Math.max(...tops) : this.bounds[1][2];
    return top < this.core[1][2] - 0.3 ? top : this.bounds[1][2];
  }

  /** All of the plant from its corner, as near as its corners allow. */
  home() {
    this.turnTo(-0.9, 0.72, true);
    this.isHome = true;
  }

  /** Looks from another side; `isWhole` brings all of the plant into the picture. */
  turnTo(yaw, pitch, isWhole = false) {
    [this.yaw, this.pitch] = [yaw, pitch];
    this.isHome = false;
    if (isWhole) {
      const [low, high] = [this.core[0], [...this.core[1]]];
      high[2] = Math.max(low[2] + 0.1, Math.min(high[2], this.ceiling()));
      this.target = low.map((v, i) => (v + high[i]) / 2);
      const { right, up, back } = this.camera();
      const tangent = Math.tan(FIELD / 2) * SEEN_SHARE;
      const aspect = this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight);
      const needed = boxLines(low, high).map((corner) => {
        const to = minus(corner, this.target);
        return dot(to, back) + Math.max(Math.abs(dot(to, right)) / Math.max(0.1, aspect),
          Math.abs(dot(to, up))) / tangent;
      });
      this.away = Math.max(1, ...needed);
    }
    this.wake();
  }

  /** Looks at a robot. */
  focus(robot) {
    this.isHome = false;
    this.chosen = robot;
    const at = robot.tree ? robot.poses.map((m) => m.slice(12, 15)) : [robot.base.slice(12, 15)];
    const low = [0, 1, 2].map((k) => Math.min(...at.map((p) => p[k])));
    const high = [0, 1, 2].map((k) => Math.max(...at.map((p) => p[k])));
    this.target = low.map((v, k) => (v + high[k]) / 2);
    this.away = 1.6 * Math.hypot(...minus(high, low)) + 1.2;
    if (this.pitch > 1.2) this.pitch = 0.5;
    this.wake();
  }

  camera() {
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch),
      Math.sin(this.pitch)];
    const back = [cy * cp, sy * cp, sp];
    const right = [-sy, cy, 0];
    const up = cross(back, right);
    const eye = plus(this.target, back, this.away);
    const look = [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0,
      right[2], up[2], back[2], 0, -dot(right, eye), -dot(up, eye), -dot(back, eye), 1];
    const aspect = this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight);
    return { clip: times(perspective(FIELD, aspect, NEAREST, FARTHEST), look), eye, right, up, back };
  }

  /** Pixels of a metre at a metre's distance, on a screen of this height. */
  focal = (height) => height / 2 / Math.tan(FIELD / 2);

  /** Something moved: draws a quick frame now, and everything after a pause. */
  wake() {
    this.lastMove = performance.now();
    this.rest = null;
    if (!this.isAsleep) return;
    this.isAsleep = false;
    requestAnimationFrame(() => this.tick());
  }

  size(scale) {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    return [Math.max(2, Math.round(w * scale)), Math.max(2, Math.round(h * scale))];
  }

  tick() {
    if (!this.canvas.clientWidth) {
      this.isAsleep = true;
      return;
    }
    const from = performance.now();
    const isMoving = from - this.lastMove < PAUSE_MS;
    const step = isMoving ? this.quick() : this.slow();
    this.drawing.whenDrawn(from, (took) => {
      if (step(took)) this.isAsleep = true;
      else requestAnimationFrame(() => this.tick());
    });
  }

  /** A frame while the view moves, within its time; what follows from the time that it took. */
  quick() {
    const { drawing } = this;
    const isPoor = drawing.isSlow || this.budget < 400_000;
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const [w, h] = this.size(isPoor ? 0.6 : ratio);
    const camera = this.camera();
    const focal = this.focal(h);
    drawing.begin("moving", w, h);
    const { rows, total } = drawing.within(drawing.visible(camera), focal, this.budget);
    drawing.addPoints("moving", rows, camera, focal, drawing.isSlow ? 4 : 8);
    drawing.finish("moving", camera, focal, isPoor);
    drawing.show("moving", 0.9);
    this.overlay(camera);
    const now = performance.now();
    const apart = now - this.lastFrame;
    this.lastFrame = now;
    return (took) => {
      const by = clamp(FRAME_MS / took, 0.6, 1.25);
      this.budget = clamp(this.budget * by, LEAST_POINTS, 6_000_000);
      if (apart < 1000) this.say(total, apart);
      return false;
    };
  }

  /** A piece of everything; whether it was the last one. */
  slow() {
    const { drawing } = this;
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const [w, h] = this.size(ratio);
    const focal = this.focal(h);
    if (!this.rest) {
      const camera = this.camera();
      const { rows, total } = drawing.chosen(drawing.visible(camera), focal, 0.6);
      this.rest = { camera, rows, total, at: 0, n: 20_000 };
      drawing.begin("resting", w, h);
      this.say(total, 0);
    }
    const { rest } = this;
    const now = [];
    for (let n = 0; n < rest.n && rest.at < rest.rows.length; rest.at++) {
      now.push(rest.rows[rest.at]);
      n += rest.rows[rest.at].n;
    }
    drawing.addPoints("resting", now, rest.camera, focal, 16 * ratio);
    const isLast = rest.at >= rest.rows.length;
    if (isLast) {
      drawing.finish("resting", rest.camera, focal, false);
      drawing.show("resting", 1.1);
      this.overlay(rest.camera);
    }
    return (took) => {
      rest.n = clamp(rest.n * clamp(REST_MS / took, 0.5, 2), 10_000, 5_000_000);
      if (!isLast || this.rest !== rest) return false;
      this.rest = null;
      this.say(rest.total, 0, true);
      document.documentElement.dataset.drawn = String(rest.total);
      return true;
    };
  }

  say(n, took, isDone = false) {
    const text = took ? `${many(n)} points, ${fixed(1e3 / took, 0)} frames/s`
      : `${many(n)} points${isDone ? "" : " …"}`;
    if ($("status").textContent !== text) $("status").textContent = text;
  }

  addLabels() {
    const add = (node, at, look, robot) => {
      $("labels").append(node);
      this.labels.push({ node, at, look, robot });
    };
    for (const robot of this.robots.filter((r) => r.entry.verdict !== "refused")) {
      const node = el("button", { type: "button", tabindex: -1, class: robot.entry.verdict,
        onclick: () => this.onChoose?.(robot, true) }, robot.entry.id);
      add(node, () => {
        const at = robot.tree ? robot.poses.map((m) => m.slice(12, 15)) : [robot.base.slice(12, 15)];
        return [at[0][0], at[0][1], Math.max(...at.map((p) => p[2])) + 0.35];
      }, null, robot);
    }
    data.scanners.forEach((scanner) => {
      const at = minus(scanner.at, view.origin);
      add(el("span", {}, scanner.name), () => plus(at, [0, 0, 0.25]), LOOKS.scanner);
    });
    (changes?.things || []).forEach((thing, k) => {
      const [low, high] = (thing.now || thing.then).map((p) => minus(p, view.origin));
      add(el("span", {}, `T${k + 1} ${thing.change}`),
        () => [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, high[2] + 0.1],
        thing.now ? LOOKS.came : LOOKS.gone);
    });
    for (const label of this.labels) label.half = label.node.offsetWidth / 2;
  }

  /** Labels, axes and scale over the picture. */
  overlay(camera) {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    const taken = [];
    const buttons = { left: $("tools").offsetLeft, bottom: $("tools").offsetTop + $("tools").offsetHeight };
    for (const { node, at, look, robot, half } of this.labels) {
      const p = at();
      const c = [0, 1, 3].map((r) => camera.clip[r] * p[0] + camera.clip[4 + r] * p[1]
        + camera.clip[8 + r] * p[2] + camera.clip[12 + r]);
      const [u, y] = [(c[0] / c[2] + 1) / 2 * w, (1 - c[1] / c[2]) / 2 * h];
      const x = clamp(u, half, w - half);
      const isFree = c[2] > NEAREST && u > 0 && y > 12 && u < w && y < h - 12
        && (x + half < buttons.left || y - 14 > buttons.bottom)
        && !taken.some(([a, b, r]) => Math.abs(a - x) < r + half + 2 && Math.abs(b - y) < 24);
      const isOn = this.withLabels !== false && (!look || look.on) && isFree;
      node.style.display = isOn ? "" : "none";
      if (!isOn) continue;
      taken.push([x, y, half]);
      node.style.transform = `translate(${Math.round(x - half)}px, ${Math.round(y - 11)}px)`;
      if (robot) node.classList.toggle("chosen", robot === this.chosen);
    }
    this.axes(camera);
    const metre = this.focal(h) / this.away;
    const length = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50].find((m) => m * metre > 60) || 100;
    $("scale").style.width = `${length * metre}px`;
    $("scale").firstChild.textContent = `${length} m`;
  }

  axes({ right, up, back }) {
    const ends = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis, i) => ({
      x: dot(axis, right), y: -dot(axis, up), z: dot(axis, back),
      name: "xyz"[i], color: ["#ff7b72", "#7ee787", "#79c0ff"][i] }));
    $("axes").replaceChildren(...ends.sort((a, b) => a.z - b.z).flatMap((e) => [
      el("line", { x1: 0, y1: 0, x2: 26 * e.x, y2: 26 * e.y, stroke: e.color, "stroke-width": 3 }),
      el("text", { x: 34 * e.x, y: 34 * e.y }, e.name)]));
  }

  /** Moves the view by pixels. */
  pan(dx, dy) {
    this.isHome = false;
    const { right, up } = this.camera();
    const by = this.away / this.focal(this.canvas.clientHeight);
    this.target = plus(plus(this.target, right, -dx * by), up, dy * by);
    this.wake();
  }

  turn(dx, dy) {
    this.isHome = false;
    this.yaw -= dx * 0.006;
    this.pitch = clamp(this.pitch + dy * 0.006, -1.5, 1.5);
    this.wake();
  }

  zoom(by) {
    this.isHome &&= by === 1;
    this.away = clamp(this.away * by, 0.3, 800);
    this.wake();
  }

  /** The ray through a pixel of the canvas. */
  ray(x, y) {
    const { eye, right, up, back } = this.camera();
    const { clientWidth: w, clientHeight: h } = this.canvas;
    const [a, b] = [(x - w / 2) / this.focal(h), (h / 2 - y) / this.focal(h)];
    return { eye, way: unit(plus(plus(back.map((v) => -v), right, a), up, b)) };
  }

  /** The robot at a pixel: that whose links pass nearest to its ray, if they are near. */
  robotAt(x, y) {
    const { eye, way } = this.ray(x, y);
    let best = null;
    for (const robot of this.robots.filter((r) => r.tree && r.entry.verdict !== "refused")) {
      for (const m of robot.poses) {
        const to = minus(m.slice(12, 15), eye);
        const along = dot(to, way);
        const beside = Math.hypot(...plus(to, way, -along));
        if (along > 0 && beside < 0.45 && (!best || along < best.along)) best = { robot, along };
      }
    }
    return best?.robot;
  }

  /** Turns about the place at a pixel, on the level that the view turns about. */
  pivot(x, y) {
    this.isHome = false;
    const { eye, way } = this.ray(x, y);
    const robot = this.robotAt(x, y);
    if (robot) return this.focus(robot);
    const along = (this.core[0][2] + 0.5 - eye[2]) / way[2];
    if (along > 0 && along < 4 * this.away) {
      this.target = plus(eye, way, along);
      this.away = clamp(along * 0.6, 2, this.away);
    }
    return this.wake();
  }

  listen() {
    const { canvas } = this;
    const fingers = new Map();
    let moved = 0;
    const spread = () => {
      const [a, b] = [...fingers.values()];
      return { x: (a[0] + b[0]) / 2, y: (a[1] + b[1]) / 2, d: Math.hypot(a[0] - b[0], a[1] - b[1]) };
    };
    canvas.addEventListener("pointerdown", (e) => {
      canvas.setPointerCapture(e.pointerId);
      fingers.set(e.pointerId, [e.clientX, e.clientY]);
      canvas.classList.add("dragged");
      moved = fingers.size > 1 ? 99 : 0;
    });
    canvas.addEventListener("pointermove", (e) => {
      const before = fingers.get(e.pointerId);
      if (!before) return;
      const [dx, dy] = [e.clientX - before[0], e.clientY - before[1]];
      moved += Math.abs(dx) + Math.abs(dy);
      if (fingers.size === 2) {
        const then = spread();
        fingers.set(e.pointerId, [e.clientX, e.clientY]);
        const now = spread();
        this.pan(now.x - then.x, now.y - then.y);
        if (now.d > 8) this.zoom(then.d / now.d);
        return;
      }
      fingers.set(e.pointerId, [e.clientX, e.clientY]);
      if (moved < 4) return;
      if (e.buttons & 6 || e.shiftKey) this.pan(dx, dy); else this.turn(dx, dy);
    });
    const up = (e) => {
      if (fingers.delete(e.pointerId) && moved < 4 && e.type === "pointerup" && e.button === 0) {
        const box = canvas.getBoundingClientRect();
        const robot = this.robotAt(e.clientX - box.left, e.clientY - box.top);
        if (robot) this.onChoose?.(robot, false);
      }
      if (!fingers.size) canvas.classList.remove("dragged");
    };
    canvas.addEventListener("pointerup", up);
    canvas.addEventListener("pointercancel", up);
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("dblclick", (e) => {
      const box = canvas.getBoundingClientRect();
      this.pivot(e.clientX - box.left, e.clientY - box.top);
    });
    canvas.addEventListener("wheel", (e) => {
      e.preventDefault();
      this.zoom(Math.exp(clamp(e.deltaY * (e.deltaMode ? 30 : 1), -300, 300) * 0.0015));
    }, { passive: false });
    canvas.addEventListener("keydown", (e) => this.key(e));
  }

  key(e) {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const way = arrows[e.key];
    const key = e.key.toLowerCase();
    if (way && e.shiftKey) this.pan(-30 * way[0], -30 * way[1]);
    else if (way) this.turn(-20 * way[0], -20 * way[1]);
    else if (key === "+" || key === "=") this.zoom(0.85);
    else if (key === "-") this.zoom(1.18);
    else if (key === "r") this.home();
    else if (key === "t") this.turnTo(-Math.PI / 2, 1.5, this.isHome);
    else if (key === "f") this.turnTo(-Math.PI / 2, 0.15, this.isHome);
    else if (key === "n" || key === "p") this.onStep?.(key === "n" ? 1 : -1);
    else return;
    e.preventDefault();
  }
}
