// Opens the page of a result in a headless Chromium with the network off and checks it: no error on
// the console, no request, no serious fault for axe, numbers as in result.json, and that turning,
// choosing, filtering and moving a joint change what they should and nothing else
// (`report_pictures.mjs`). Four sizes and schemes; frames a second while it moves. Not part of CI,
// which has no browser. `report_breaks.mjs` shows that it can fail.
//
// `BASE=FOLDER` compares the screenshots with those of an earlier call: no more than one pixel of two
// hundred may differ. `ONLY=rest` takes screenshots alone.
//
//   npm install --prefix DIR playwright-core axe-core
//   NODE_PATH=DIR/node_modules CHROMIUM=/usr/bin/chromium \
//     node scripts/report_page.mjs OUT/report.html OUT/result.json [FOLDER FOR SCREENSHOTS]
import { createRequire } from "node:module";
import { existsSync, readFileSync, mkdirSync, writeFileSync } from "node:fs";
import { pathToFileURL } from "node:url";
import { resolve, join } from "node:path";
import { Pictures, ground, rest, samePicture } from "./report_pictures.mjs";

const require = createRequire(join(process.env.NODE_PATH || ".", "x.js"));
const { chromium } = require("playwright-core");
const axe = readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");
const [page_, result_, shots] = process.argv.slice(2);
const result = JSON.parse(readFileSync(result_, "utf8"));
// `DRAW=webgl` or `DRAW=software` chooses who draws; the page itself takes what is there.
const address = pathToFileURL(resolve(page_)).href + (process.env.DRAW ? `#${process.env.DRAW}` : "");
if (shots) mkdirSync(shots, { recursive: true });

let failed = 0;
function check(isRight, what, detail = "") {
  if (!isRight) failed += 1;
  console.log(`${isRight ? "ok    " : "FAILED"} ${what} ${detail}`);
}

const browser = await chromium.launch({ executablePath: process.env.CHROMIUM || "/usr/bin/chromium",
  args: ["--no-sandbox", "--enable-unsafe-swiftshader", "--disable-gpu"] });

async function open(width, height, colorScheme) {
  const context = await browser.newContext({ viewport: { width, height }, colorScheme, offline: true,
    hasTouch: width < 500 });
  const page = await context.newPage();
  const said = [];
  const asked = [];
  // What the driver says about its speed is no fault of the page.
  page.on("console", (m) => m.text().includes("GPU stall") || said.push(`${m.type()}: ${m.text()}`));
  page.on("pageerror", (e) => said.push(String(e)));
  page.on("request", (r) => { if (r.url() !== address && !r.url().startsWith("data:")) asked.push(r.url()); });
  const from = Date.now();
  await page.goto(address);
  await page.waitForFunction(() => document.documentElement.dataset.state);
  const took = Date.now() - from;
  await rest(page);
  return { page, said, asked, took, whole: Date.now() - from, context };
}

const picture = async (page) => (await page.locator("#canvas").screenshot()).toString("base64");
async function shot(page, name, whole = false) {
  if (shots) writeFileSync(join(shots, `${name}.png`), await page.screenshot({ fullPage: whole }));
}

/** The share of pixels that differ between two pictures, by any browser page. */
const differing = (page, a, b) => page.evaluate(async (both) => {
  const [one, other] = await Promise.all(both.map(async (text) => {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const image = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
    const canvas = new OffscreenCanvas(image.width, image.height).getContext("2d");
    canvas.drawImage(image, 0, 0);
    return canvas.getImageData(0, 0, image.width, image.height);
  }));
  if (one.width !== other.width || one.height !== other.height) return 1;
  let n = 0;
  for (let i = 0; i < one.data.length; i += 4) {
    n += [0, 1, 2].some((k) => Math.abs(one.data[i + k] - other.data[i + k]) > 24);
  }
  return n / (one.data.length / 4);
}, [a, b]);

/** Compares a screenshot with that of an earlier call. */
async function asBefore(page, name) {
  const path = process.env.BASE && join(process.env.BASE, `${name}.png`);
  if (!path || !existsSync(path)) return;
  const share = await differing(page, readFileSync(path).toString("base64"),
    (await page.screenshot()).toString("base64"));
  check(share < 0.005, `${name}: looks as before`, `${(100 * share).toFixed(2)} % of it differs`);
}

/** A window that was wide and became narrow shows what one that was narrow from the start shows. */
async function narrows() {
  const wide = await open(1280, 800, "light");
  await wide.page.setViewportSize({ width: 390, height: 844 });
  await wide.page.waitForTimeout(400);
  await rest(wide.page);
  const narrow = await open(390, 844, "light");
  const share = await differing(narrow.page, await picture(narrow.page), await picture(wide.page));
  // Buttons are larger on a touch screen, and only the narrow one is opened as such.
  check(share < 0.04, "a window made narrow shows all of the plant", `${(100 * share).toFixed(2)} % differ`);
  await Promise.all([wide.context.close(), narrow.context.close()]);
}

/** Choosing a robot by its name in the view and by its body; filtering the table. */
async function chooses(page) {
  const names = page.locator("#labels button:visible");
  if (await names.count()) {
    const id = await names.first().textContent();
    const before = await picture(page);
    await names.first().click();
    await rest(page);
    check((await page.locator("#joints option:checked").textContent()).startsWith(id),
      "a click on a name chooses the robot");
    check(await picture(page) !== before, "and shows it");
    await page.locator("#tools [data-do=home]").click();
    await rest(page);
  }
  const search = page.getByLabel("Filter robots by name or model");
  if (!await search.count()) return;
  const rows = page.locator("#robots > .scroll tbody tr:visible");
  const last = result.robots[result.robots.length - 1];
  await search.fill(last.model);
  const wanted = result.robots.filter((r) => `${r.id} ${r.model}`.includes(last.model)).length;
  check(await rows.count() === wanted, "the filter leaves robots of one model", `${wanted}`);
  await search.fill("");
  const verdict = page.getByLabel("Filter robots by verdict");
  for (const word of ["trusted", "doubtful", "refused"]) {
    await verdict.selectOption(word);
    const n = result.robots.filter((r) => r.verdict === word).length;
    check(await rows.count() === n, `the filter leaves ${n} ${word}`);
  }
  await verdict.selectOption({ index: 0 });
}

/** After a rescan: what changed, before and after. */
async function changed(page) {
  if (!result.rescan) return;
  const data = JSON.parse(await page.locator("#data").textContent());
  const { robots, things } = data.changes;
  check(await page.locator("#changes").isVisible(), "what changed has its section");
  const [first, ...more] = await page.locator("#changes table").evaluateAll((all) =>
    all.map((table) => table.tBodies[0].rows.length));
  check(first === robots.length, "each robot of the cell has a row", `${first}`);
  if (things.length) check(more.at(-1) === things.length, "each thing has a row", `${things.length}`);
  const moved = robots.some((r) => r.joints.some((j) => j.is_change));
  if (moved) {
    const was = page.locator("#classes label", { hasText: "Robots before the rescan" });
    check(await was.count() === 1, "the earlier posture can be shown");
    await page.locator("#tools [data-do=home]").click();
    await rest(page);
    const before = await picture(page);
    await was.click();
    await rest(page);
    check(await picture(page) !== before, "hiding the earlier posture changes the picture");
    await was.click();
  }
  await page.locator("#changes").scrollIntoViewIfNeeded();
  if (shots) writeFileSync(join(shots, "changes.png"), await page.locator("#changes").screenshot());
  await page.evaluate(() => scrollTo(0, 0));
}

/** What is said, asked and drawn at one size. */
async function look(width, height, scheme) {
  const name = `${width}_${scheme}`;
  const { page, said, asked, took, whole, context } = await open(width, height, scheme);
  check((await page.evaluate(() => document.documentElement.dataset.state)) === "ready",
    `${name}: the view is there`, `after ${took} ms, whole after ${whole} ms`);
  await shot(page, `${name}_rest`);
  await asBefore(page, `${name}_rest`);
  await shot(page, `${name}_page`, true);
  const wide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  check(wide <= 0, `${name}: nothing is wider than the screen`, String(wide));
  await page.evaluate(axe);
  const found = await page.evaluate(() => globalThis.axe.run(document, { resultTypes: ["violations"] }));
  const serious = found.violations.filter((v) => ["serious", "critical"].includes(v.impact));
  for (const v of found.violations) console.log(`       axe ${v.impact}: ${v.id}: ${v.nodes[0].html.slice(0, 120)}`);
  check(serious.length === 0, `${name}: axe finds no serious fault`, `${found.violations.length} in all`);
  await ground(page, scheme, (isRight, what, detail) => check(isRight, `${name}: ${what}`, detail));
  const picture = process.env.ONLY === "rest" ? null
    : await new Pictures(page, name, result, check).all();
  return { page, said, asked, context, picture };
}

async function moves(page) {
  const box = await page.locator("#canvas").boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  let before = await picture(page);
  const differs = async (what) => {
    // A wheel's event comes after the call that turned it has returned.
    await page.waitForTimeout(400);
    await rest(page);
    const now = await picture(page);
    check(now !== before, `${what} changes the picture`);
    before = now;
  };
  await page.mouse.move(x, y);
  await page.mouse.down();
  // The text of each frame, while the mouse goes on.
  await page.evaluate(() => {
    globalThis.rates = [];
    new MutationObserver(() => {
      const rate = document.getElementById("status").textContent.match(/(\d+) frames/);
      if (rate) globalThis.rates.push(Number(rate[1]));
    }).observe(document.getElementById("status"), { childList: true });
  });
  const from = Date.now();
  for (let i = 0; Date.now() - from < 6_000; i++) {
    await page.mouse.move(x + 4 * (i % 90), y + (i % 9));
    await page.waitForTimeout(10);
  }
  const rates = (await page.evaluate(() => globalThis.rates)).slice(8);
  await shot(page, "moving");
  await page.mouse.up();
  rates.sort((a, b) => a - b);
  const middle = rates[rates.length >> 1];
  check(middle >= 15, "15 frames a second while it moves", `median ${middle}, least ${rates[0]}`);
  await differs("dragging");
  await page.mouse.wheel(0, -400);
  await differs("the wheel");
  await page.locator("#canvas").focus();
  await page.keyboard.press("ArrowLeft");
  await differs("an arrow key");
  await page.locator("#classes label", { hasText: /^Fixed/ }).click();
  await differs("a switch");
  await page.locator("#classes label", { hasText: /^Fixed/ }).click();
  await rest(page);
  if (await page.locator("#joints input[type=range]").count()) {
    await page.locator("#joints button", { hasText: "Show" }).click();
    await rest(page);
    await shot(page, "robot");
    before = await picture(page);
    const slider = page.locator("#joints input[type=range]").nth(1);
    await slider.focus();
    for (let i = 0; i < 12; i++) await page.keyboard.press("PageUp");
    await differs("a joint");
    await shot(page, "joint_moved");
    await page.locator("#joints button", { hasText: "As found" }).click();
    await differs("back to as found");
  }
  await page.locator("#tools [data-do=home]").click();
  await rest(page);
  before = await picture(page);
  await page.locator("#cut summary").click();
  await page.locator("#section input").nth(1).focus();
  for (let i = 0; i < 4; i++) await page.keyboard.press("PageDown");
  await differs("the section box");
}

/** Numbers of the page against those of the result. */
async function numbers(page) {
  for (const at of result.robots.keys()) {
    await page.evaluate((id) => { document.getElementById(id).open = true; }, `robot-${at + 1}`);
  }
  await page.waitForTimeout(100);
  let n = 0;
  for (const [at, robot] of result.robots.entries()) {
    const rows = await page.locator(`#robot-${at + 1} table`).first().locator("tbody tr").evaluateAll(
      (all) => all.map((row) => [...row.cells].map((c) => c.textContent)));
    for (const [name, value] of Object.entries(robot.joints)) {
      const slides = (robot.slides || []).includes(name);
      const factor = slides ? 1e3 : 180 / Math.PI;
      const row = rows.find((r) => r[0] === name);
      const near = (text, v) => Math.abs(parseFloat(text.replace("± ", "")) - v * factor) <= 0.0501;
      const isRight = row && Math.abs(parseFloat(row[1]) - value * factor) <= 0.000501
        && near(row[2], robot.sigma[name]) && row[3] === robot.certainty[name];
      if (!isRight) check(false, `${robot.id} ${name}`, JSON.stringify(row));
      n += 1;
    }
    const text = await page.locator(`#robot-${at + 1}`).textContent();
    for (const reason of robot.reasons) check(text.includes(reason), `${robot.id}: ${reason}`);
    check(text.includes(robot.verdict), `${robot.id} is ${robot.verdict}`);
  }
  console.log(`ok     ${n} joints as in the result`);
}

const first = await look(1280, 800, "light");
await numbers(first.page);
if (process.env.ONLY !== "rest") {
  await chooses(first.page);
  await changed(first.page);
  await moves(first.page);
  await narrows();
}
await first.page.emulateMedia({ media: "print" });
if (shots) writeFileSync(join(shots, "print.pdf"), await first.page.pdf({ format: "A4" }));
const others = [await look(1280, 800, "dark"), await look(390, 844, "light"), await look(390, 844, "dark")];
if (first.picture) {
  check(samePicture(first.picture, others[0].picture), "1280: the view is the same in light and dark");
  check(samePicture(others[1].picture, others[2].picture), "390: the view is the same in light and dark");
}
for (const { said, asked } of [first, ...others]) {
  check(said.length === 0, "the console is empty", said.slice(0, 3).join(" | "));
  check(asked.length === 0, "nothing is requested", asked.slice(0, 3).join(" "));
}
await browser.close();
console.log(failed ? `${failed} failed` : "all is well");
process.exit(failed ? 1 : 0);
