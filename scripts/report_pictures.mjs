// What must be seen on the page of a result: its pictures compared with one another, so that neither
// typefaces nor drivers matter. `scripts/report_page.mjs` calls it for each size and scheme.
//
// Pictures are screenshots of the view without what lies over it (names, buttons, scale). A pixel is
// *drawn* where it differs from the picture with all switched off.

/** Difference of a channel, of 255, below which two pixels look the same. */
const SAME = 24;
/** Difference of a channel from the empty picture above which something is drawn there. */
const DRAWN = 6;
/** Pixels that may differ between two pictures of the same: none of our own drawing does. */
const STRAYS = 12;
/** Pixels around a change that change with it: edges are darkened. */
const MARGIN = 3;
/** The frame of a picture that is not compared, pixels: there the view's corners are round, and its edges may
 * lie between two pixels of the screen. */
const FRAME = 10;
/** Angle between a drawn pixel's colour and its legend's, degrees: light and shade change its length only. */
const HUE = 9;
/** Share of the drawn pixels of a class that have the legend's colour. The rest is rounding of dark pixels. */
const OF_HUE = 0.9;
/** Share of what a moved joint changes that is nearer to the name of its robot than to any other: an arm may
 * reach towards another robot. */
const OWN = 0.7;

/** Waits until everything is drawn. */
export async function rest(page) {
  await page.evaluate(() => { delete document.documentElement.dataset.drawn; });
  await page.locator("#canvas").dispatchEvent("wheel", { deltaY: 0 });
  await page.waitForFunction(() => document.documentElement.dataset.drawn, null, { timeout: 120_000 });
}

/** The pixels of a picture in PNG, decoded by the page. */
async function decoded(page, png) {
  const { width, height, text } = await page.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const image = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
    const canvas = new OffscreenCanvas(image.width, image.height).getContext("2d");
    canvas.drawImage(image, 0, 0);
    const { data } = canvas.getImageData(0, 0, image.width, image.height);
    let text = "";
    for (let i = 0; i < data.length; i += 32_768) {
      text += String.fromCharCode(...data.subarray(i, i + 32_768));
    }
    return { width: image.width, height: image.height, text: btoa(text) };
  }, png.toString("base64"));
  return { width, height, data: Buffer.from(text, "base64") };
}

/** What the view shows once all is drawn; `isBare` without names, buttons and scale. */
async function seen(page, isBare = true) {
  await rest(page);
  await page.evaluate((hidden) => {
    document.activeElement?.blur();
    for (const id of ["labels", "axes", "scale", "status", "tools"]) {
      document.getElementById(id).style.visibility = hidden ? "hidden" : "";
    }
  }, isBare);
  const picture = await decoded(page, await page.locator("#canvas").screenshot());
  await page.evaluate(() => {
    for (const id of ["labels", "axes", "scale", "status", "tools"]) {
      document.getElementById(id).style.visibility = "";
    }
  });
  return picture;
}

/** A number for each pixel at which two pictures differ by more than `by`: 1, else 0. */
function differs(one, other, by = SAME) {
  const out = new Uint8Array(one.width * one.height);
  if (one.width !== other.width || one.height !== other.height) return out.fill(1);
  for (let i = 0; i < out.length; i++) {
    const [x, y] = [i % one.width, Math.floor(i / one.width)];
    if (Math.min(x, y, one.width - 1 - x, one.height - 1 - y) < FRAME) continue;
    for (let k = 4 * i; k < 4 * i + 3; k++) {
      if (Math.abs(one.data[k] - other.data[k]) > by) { out[i] = 1; break; }
    }
  }
  return out;
}

const count = (mask) => mask.reduce((sum, v) => sum + v, 0);
const both = (a, b) => a.map((v, i) => v & b[i]);
const either = (a, b) => a.map((v, i) => v | b[i]);
const without = (a, b) => a.map((v, i) => v & ~b[i] & 1);

/** A mask made wider by `MARGIN` pixels to all sides. */
function wider(mask, width) {
  const out = new Uint8Array(mask.length);
  const height = mask.length / width;
  mask.forEach((v, i) => {
    if (!v) return;
    const [x, y] = [i % width, Math.floor(i / width)];
    for (let row = Math.max(0, y - MARGIN); row <= Math.min(height - 1, y + MARGIN); row++) {
      out.fill(1, row * width + Math.max(0, x - MARGIN), row * width + Math.min(width, x + MARGIN + 1));
    }
  });
  return out;
}

/** Share of the pixels of a mask that have the direction of a colour. */
function ofColor(picture, mask, color) {
  const length = (v) => Math.hypot(...v);
  let n = 0;
  mask.forEach((v, i) => {
    if (!v) return;
    const pixel = [...picture.data.subarray(4 * i, 4 * i + 3)];
    const cosine = pixel.reduce((sum, c, k) => sum + c * color[k], 0) / (length(pixel) * length(color) || 1);
    n += Math.acos(Math.min(1, cosine)) * 180 / Math.PI < HUE;
  });
  return n / Math.max(1, count(mask));
}

/** How many pixels of a mask are nearest to each of some places, by their names. */
function nearest(mask, width, places) {
  const out = new Map(places.map((p) => [p.id, 0]));
  mask.forEach((v, i) => {
    if (!v) return;
    const away = (p) => Math.hypot(p.x - i % width, p.y - Math.floor(i / width));
    const { id } = places.reduce((best, p) => away(p) < away(best) ? p : best);
    out.set(id, out.get(id) + 1);
  });
  return out;
}

/** The switches of the panel: name, whether on, and the colour of the legend. */
const switches = (page) => page.locator("#classes label").evaluateAll((all) => all.map((label) => ({
  name: [...label.childNodes].filter((n) => n.nodeType === 3).map((n) => n.textContent).join(""),
  isOn: label.querySelector("input").checked,
  color: (getComputedStyle(label.querySelector(".swatch") || label).backgroundColor.match(/\d+/g) || [])
    .slice(0, 3).map(Number),
})));

/** Switches on what `wanted` says of a name, and all else off. */
async function switchTo(page, wanted) {
  for (const [at, { name }] of (await switches(page)).entries()) {
    await page.locator("#classes label input").nth(at).setChecked(Boolean(wanted(name)));
  }
}

/** Compares pictures of one page; hands back what it shows at first. */
export class Pictures {
  constructor(page, name, result, check) {
    Object.assign(this, { page, name, result, check });
  }

  say(isRight, what, detail = "") { this.check(isRight, `${this.name}: ${what}`, detail); }

  same(one, other, what) {
    const n = count(differs(one, other));
    this.say(n <= STRAYS, what, `${n} of ${one.width * one.height} pixels differ`);
  }

  async all() {
    const { page } = this;
    await page.locator("#tools [data-do=home]").click();
    this.classes = (await switches(page)).filter((s) => s.name !== "Names");
    this.shown = this.classes.filter((s) => s.isOn).map((s) => s.name);
    this.first = await seen(page);
    await this.switched();
    await this.names("at first");
    await this.turned();
    await this.clicked();
    await this.posed();
    await this.cut();
    await page.locator("#joints button", { hasText: "Show" }).click();
    await rest(page);
    await this.names("near a robot");
    const keys = async (...all) => {
      await page.locator("#canvas").focus();
      for (const key of all) await page.keyboard.press(key);
      await rest(page);
    };
    await keys("r", ...Array(9).fill("-"));
    await this.names("from afar");
    // The plant goes to the corner with the buttons.
    await keys(...Array(8).fill("Shift+ArrowDown"), ...Array(11).fill("Shift+ArrowLeft"));
    await this.names("in the corner");
    await page.locator("#tools [data-do=home]").click();
    await rest(page);
    return this.first;
  }

  /** Each class alone has the colour of its legend; hiding it takes it away and nothing else. */
  async switched() {
    const { page, first } = this;
    await switchTo(page, () => false);
    this.empty = await seen(page);
    const { width, height, data } = this.empty;
    let unequal = 0;
    for (let y = FRAME; y < height - FRAME; y++) {
      const middle = 4 * (y * width + (width >> 1));
      for (let x = FRAME; x < width - FRAME; x++) {
        unequal += [0, 1, 2].some((k) => Math.abs(data[4 * (y * width + x) + k] - data[middle + k]) > DRAWN);
      }
    }
    this.say(unequal <= STRAYS, "with all switched off nothing is drawn", `${unequal} pixels`);
    const alone = new Map();
    for (const { name, color } of this.classes) {
      await switchTo(page, (other) => other === name);
      const picture = await seen(page);
      const mask = differs(picture, this.empty, DRAWN);
      alone.set(name, { picture, mask });
      const share = ofColor(picture, mask, color);
      this.say(count(mask) > 0 && share >= OF_HUE, `"${name}" alone has the colour of its legend`,
        `${count(mask)} pixels, ${(100 * share).toFixed(1)} %`);
    }
    await switchTo(page, (name) => name === "Names" || this.shown.includes(name));
    this.same(first, await seen(page), "switched off and on again it looks as before");
    for (const name of this.shown) {
      const { picture, mask } = alone.get(name);
      await page.locator("#classes label", { hasText: name }).first().click();
      const hidden = await seen(page);
      await page.locator("#classes label", { hasText: name }).first().click();
      const changed = differs(first, hidden);
      const else_ = count(without(changed, wider(mask, first.width)));
      this.say(else_ <= STRAYS, `hiding "${name}" changes nothing else`,
        `${else_} pixels beside ${count(changed)}`);
      // Where it was in front, and what is behind has another colour or is nothing.
      const front = without(mask, differs(first, picture, DRAWN));
      const left = count(without(front, differs(hidden, picture, DRAWN)));
      this.say(left <= 0.1 * count(front), `hiding "${name}" takes it away`,
        `${left} of ${count(front)} pixels stay`);
    }
  }

  /** Names come and go where they stand. */
  async names(where) {
    const { page } = this;
    // A button under the mouse looks otherwise.
    await page.mouse.move(1, 1);
    const boxes = await page.locator("#labels > *:visible").evaluateAll((all) => {
      const from = document.getElementById("canvas").getBoundingClientRect();
      return all.map((node) => node.getBoundingClientRect())
        .map((r) => [r.left - from.left, r.top - from.top, r.right - from.left, r.bottom - from.top]);
    });
    // The view may begin between two pixels.
    const around = (from, to, end) => [Math.max(0, Math.floor(from) - 1), Math.min(end, Math.ceil(to) + 1)];
    const on = await seen(page, false);
    await page.locator("#classes label", { hasText: "Names" }).click();
    await page.mouse.move(1, 1);
    const off = await seen(page, false);
    await page.locator("#classes label", { hasText: "Names" }).click();
    const changed = differs(on, off);
    const at = new Uint8Array(changed.length);
    for (const [left, top, right, bottom] of boxes) {
      const [x0, x1] = around(left, right, on.width), [y0, y1] = around(top, bottom, on.height);
      for (let y = y0; y < y1; y++) at.fill(1, y * on.width + x0, y * on.width + x1);
    }
    const beside = count(without(changed, at));
    const isEnough = boxes.length > 0 || where === "in the corner";
    this.say(isEnough && count(changed) >= 100 * boxes.length && beside <= STRAYS,
      `${where}, without names all but the names is as before`, `${boxes.length} names, ${beside} pixels beside them`);
    const within = boxes.every(([l, t, r, b]) => l >= 0 && t >= 0 && r <= on.width && b <= on.height);
    this.say(within, `${where}, names lie within the view`);
    const tools = await page.locator("#tools").evaluate((node) => {
      const [r, from] = [node, document.getElementById("canvas")].map((n) => n.getBoundingClientRect());
      return [r.left - from.left, r.top - from.top, r.right - from.left, r.bottom - from.top];
    });
    const meet = ([l, t, r, b], [x, y, z, w]) => l < z && x < r && t < w && y < b;
    this.say(!boxes.some((box, i) => meet(box, tools) || boxes.slice(0, i).some((other) => meet(box, other))),
      `${where}, names cover neither buttons nor one another`);
  }

  /** Turned by mouse and keys, and back. */
  async turned() {
    const { page, first } = this;
    await page.locator("#canvas").scrollIntoViewIfNeeded();
    const box = await page.locator("#canvas").boundingBox();
    const [x, y] = [box.x + box.width * 0.3, box.y + box.height * 0.8];
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + 110, y - 40, { steps: 8 });
    const turned = await seen(page);
    await page.mouse.move(x, y, { steps: 5 });
    await page.mouse.up();
    const share = count(differs(first, turned)) / (first.width * first.height);
    this.say(share > 0.05, "dragging turns it", `${(100 * share).toFixed(1)} % of the picture`);
    this.same(first, await seen(page), "dragged back it looks as before");
    const keys = async (...all) => {
      await page.locator("#canvas").focus();
      for (const key of all) await page.keyboard.press(key);
      return seen(page);
    };
    const left = await keys("ArrowLeft", "ArrowLeft", "ArrowUp");
    this.say(count(differs(first, left)) > 0.05 * first.width * first.height, "arrow keys turn it");
    this.same(first, await keys("ArrowRight", "ArrowRight", "ArrowDown"), "turned back by keys it looks as before");
    const moved = await keys("Shift+ArrowLeft");
    this.say(count(differs(first, moved)) > 0.02 * first.width * first.height, "arrow keys with Shift move it");
    this.same(first, await keys("Shift+ArrowRight"), "moved back it looks as before");
    for (const does of ["top", "front", "in", "out"]) {
      const before = await seen(page);
      await page.locator(`#tools [data-do=${does}]`).click();
      this.say(count(differs(before, await seen(page))) > 0.02 * first.width * first.height, `"${does}" changes it`);
    }
    await page.locator("#tools [data-do=home]").click();
    this.same(first, await seen(page), "\"All\" shows what was there at first");
  }

  /** The names of robots in the view, and where they stand: over their bases. */
  namedPlaces() {
    return this.page.locator("#labels button:visible").evaluateAll((all) => {
      const from = document.getElementById("canvas").getBoundingClientRect();
      return all.map((node) => {
        const r = node.getBoundingClientRect();
        return { id: node.textContent, x: (r.left + r.right) / 2 - from.left, y: r.bottom - from.top };
      });
    });
  }

  /** A click on the body of a robot chooses it. */
  async clicked() {
    const { page, first } = this;
    const named = await this.namedPlaces();
    await switchTo(page, (name) => /^Robots, (trusted|doubtful)/.test(name));
    const bodies = differs(await seen(page), this.empty, DRAWN);
    await switchTo(page, (name) => name === "Names" || this.shown.includes(name));
    let [right, n] = [0, 0];
    for (const { id, x, y } of named) {
      // Down from the name to the first pixel of a body.
      let row = Math.ceil(y);
      while (row < first.height && !bodies[row * first.width + Math.round(x)]) row += 1;
      if (row >= first.height - 1) continue;
      await page.locator("#canvas").click({ position: { x: Math.round(x), y: row + 1 }, force: true });
      const chosen = await page.locator("#joints option:checked").textContent();
      right += chosen.startsWith(`${id} `);
      n += 1;
    }
    // In a crowded hall another robot may stand before one.
    this.say(n > 0 && right >= 0.8 * n, "a click on a robot chooses it", `${right} of ${n}`);
    await page.locator("#tools [data-do=home]").click();
  }

  /** A moved joint changes its robot and nothing else; points, body and what hangs on it go along. */
  async posed() {
    const { page, first, result } = this;
    const ofRobots = this.shown.filter((name) => /^(Robots, |Attached)/.test(name));
    const named = await this.namedPlaces();
    const standing = result.robots.filter((r) => r.verdict !== "refused" && Object.keys(r.joints).length > 2);
    for (const { id, model, verdict } of new Set([standing[0], standing.at(-1)].filter(Boolean))) {
      await page.locator("#joints select").selectOption({ label: `${id} ${model}` });
      await page.locator("#tools [data-do=home]").click();
      this.same(first, await seen(page), `choosing ${id} leaves its picture`);
      const before = await this.looks(ofRobots);
      const slider = page.locator("#joints input[type=range]").nth(1);
      const [low, high, value] = await slider.evaluate((s) => [s.min, s.max, s.value].map(Number));
      await slider.focus();
      await page.keyboard.press(high - value > value - low ? "End" : "Home");
      const after = await this.looks(ofRobots);
      const changes = ofRobots.map((name) => differs(before.get(name), after.get(name), DRAWN));
      const changed = differs(before.get("all"), after.get("all"));
      const beside = count(without(changed, wider(changes.reduce(either), first.width)));
      this.say(count(changed) > STRAYS && beside <= STRAYS, `a joint of ${id} moves its robot alone`,
        `${count(changed)} pixels, ${beside} of them elsewhere`);
      if (named.some((p) => p.id === id)) {
        const share = nearest(changed, first.width, named).get(id) / count(changed);
        this.say(share >= OWN, `what changed is at ${id}`, `${(100 * share).toFixed(0)} % is nearest to it`);
      }
      for (const name of ["Robots, points", `Robots, ${verdict}`]) {
        const at = ofRobots.indexOf(name);
        const left = count(both(changes[at], differs(before.get(name), this.empty, DRAWN)));
        this.say(left > 0, `"${name}" of ${id} went along`, `${left} pixels left their place`);
      }
      await page.locator("#joints button", { hasText: "As found" }).click();
      this.same(first, await seen(page), `${id} as found looks as before`);
    }
  }

  /** The pictures of some classes, each alone, and of all together. */
  async looks(names) {
    const out = new Map();
    for (const name of names) {
      await switchTo(this.page, (other) => other === name);
      out.set(name, await seen(this.page));
    }
    await switchTo(this.page, (name) => name === "Names" || this.shown.includes(name));
    return out.set("all", await seen(this.page));
  }

  /** The section box cuts away what is above it, and gives it back. */
  async cut() {
    const { page, first } = this;
    await page.locator("#cut summary").click();
    const slider = page.getByLabel("Section box, z to, metres");
    await slider.focus();
    await page.keyboard.press("Home");
    const cut = await seen(page);
    const [n, of] = [cut, first].map((picture) => count(differs(picture, this.empty, DRAWN)));
    this.say(n < 0.2 * of, "a section box of no height leaves next to nothing", `${n} of ${of} pixels`);
    await page.locator("#section button", { hasText: "As at first" }).click();
    this.same(first, await seen(page), "the box as at first, it looks as before");
    await page.locator("#cut summary").click();
  }
}

/** Whether the page itself is light or dark as asked for, by a pixel of its edge. */
export async function ground(page, scheme, say) {
  const { data } = await decoded(page, await page.screenshot());
  const light = (data[0] + data[1] + data[2]) / 765;
  say(scheme === "dark" ? light < 0.2 : light > 0.8, `the page is ${scheme}`, light.toFixed(2));
}

export const samePicture = (one, other) => count(differs(one, other)) <= STRAYS;
