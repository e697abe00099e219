// Use the page of a comparison in headless Chromium: `node tests/machines/comparison_page.js FOLDER`.
//
// Needs puppeteer-core and axe-core of npm, and hsplat and chromium on the path. FOLDER gets a project of three scenes,
// two of which change, its report, and pictures of the screen. Ends with 1 where anything is wrong.
const { spawnSync } = require("node:child_process");
const fs = require("node:fs");
const { audit, check, end, folder, hsplat, launch, open, run, wait } = require("./browser.js");

const PAGE = "report/index.html";
const NUM_FRAMES = 12;
const scene = (middle, tolerance) => `volume: {procedural: {name: engine_block, shape: [48, 48, 48]}}
transfer_function:
  points:
    - {value: 0, color: black, opacity: 0}
    - {value: ${middle}, color: orange, opacity: 0.1}
    - {value: 1, color: white, opacity: 0.9}
camera: {path: {type: turntable, frames: ${NUM_FRAMES}, elevation: 20}}
output: {file: a.mp4, size: [96, 96], frames_per_second: 20}
error: {tolerance: ${tolerance}}
`;

function makeReport() {
  const write = (name, ...values) => fs.writeFileSync(`${folder}/scenes/${name}.yaml`, scene(...values));
  fs.rmSync(`${folder}/scenes`, { recursive: true, force: true });
  fs.mkdirSync(`${folder}/scenes`);
  for (const name of ["kept", "it's changed", "torn"]) write(name, 0.4, 0.1);
  run("golden", "scenes", "--quiet");
  write("it's changed", 0.3, 0.2);
  fs.writeFileSync(`${folder}/scenes/torn.yaml`, "volume: <b>\n");
  const compared = spawnSync(hsplat, ["compare", "scenes", "--report", "report", "--quiet"], { cwd: folder });
  check("the comparison fails", compared.status > 0);
}

const text = (page, selector) => page.$eval(`article:not([hidden]) ${selector}`, (element) => element.textContent);
const mode = (page) => page.$eval(".stage", (stage) => stage.dataset.mode);
const at = (page) => page.$eval(".slider", (slider) => slider.valueAsNumber);
const value = (page, id) => page.$eval(`#${id}`, (field) => field.value);
const names = (page) => page.$$eval("#film-list li", (all) => all.filter((each) => each.offsetParent).map((each) => each.querySelector(".name").textContent));
const isSeen = (page, side) => page.$eval(`.stage .${side}`, (figure) => getComputedStyle(figure).visibility === "visible");

async function show(page, name) {
  const number = (await page.$$eval("#film-list .name", (all) => all.map((each) => each.textContent))).indexOf(name);
  await page.click(`#film-list li:nth-child(${number + 1}) a`);
  await wait(300);
}

async function useList(page) {
  check("films come worst first", (await names(page)).join() === "torn,it's changed,kept");
  check("an error is shown, and markup in it is text", (await text(page, ".error")).includes("<b>") || (await text(page, ".error")).length > 10);
  await page.type("#filter-text", "CHANGED");
  check("the filter finds a name, and shows its film", (await names(page)).join() === "it's changed" && (await text(page, "h2")) === "it's changed");
  await page.$eval("#filter-text", (field) => ((field.value = ""), field.dispatchEvent(new Event("input"))));
  await page.select("#filter-verdict", "passes");
  check("the filter finds a verdict", (await names(page)).join() === "kept");
  await page.select("#filter-verdict", "");
  await page.focus("#film-list a[aria-current]");
  await page.keyboard.press("ArrowUp");
  check("arrow keys move in the list", (await text(page, "h2")) === "it's changed");
  await page.keyboard.press("j");
  const next = await text(page, "h2");
  await page.keyboard.press("k");
  await wait(100); // for the events of changed addresses
  check("j and k move over films", next === "kept" && (await text(page, "h2")) === "it's changed");
}

async function useViews(page) {
  await page.focus("article:not([hidden])");
  for (const [key, side] of [["1", "old"], ["2", "new"], ["3", "difference"]]) {
    await page.keyboard.press(key);
    const seen = await Promise.all(["old", "new", "difference"].map((each) => isSeen(page, each)));
    check(`key ${key} shows ${side} alone`, (await mode(page)) === side && seen.filter(Boolean).length === 1 && (await isSeen(page, side)));
  }
  await page.keyboard.press("b");
  const sides = new Set();
  const start = Date.now();
  let swaps = 0, last = null;
  while (Date.now() - start < 2000) {
    const side = await page.$eval(".stage", (stage) => stage.dataset.blink);
    if (last !== null && side !== last) swaps++;
    sides.add((last = side));
    await wait(20);
  }
  check(`b blinks old and new: ${swaps} times in 2 s`, sides.size === 2 && swaps >= 6 && swaps <= 9);
  await page.keyboard.press("s");
  const clip = () => page.$eval(".stage .new .view", (view) => getComputedStyle(view).clipPath);
  const before = await clip();
  await page.focus(".divider");
  for (let i = 0; i < 5; i++) await page.keyboard.press("PageUp");
  const byKeys = await clip();
  const box = await (await page.$(".divider")).boundingBox();
  const frameBefore = await at(page), fraction = await page.$eval(".divider", (each) => each.value / each.max);
  await page.mouse.move(box.x + 12 + (box.width - 24) * fraction, box.y + 100);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * 0.2, box.y + 100, { steps: 5 });
  await page.mouse.up();
  check("the divider of the swipe moves by keys and by dragging, and the frame stays", before !== byKeys && (await clip()) !== byKeys && (await page.$eval(".divider", (each) => each.value)) < 300 && frameBefore === (await at(page)));
  await page.focus("article:not([hidden])");
  await page.keyboard.press("0");
  await page.keyboard.press("z");
  const width = () => page.$eval(".stage .old img", (image) => image.clientWidth);
  const actual = await width();
  await page.keyboard.press("z");
  check("zoom shows actual pixels, and twice as many", actual === 96 && (await width()) === 192);
  await page.keyboard.press("z");
  await page.keyboard.press("z");
  const difference = await page.$eval(".difference .layer + .layer", (layer) => getComputedStyle(layer).mixBlendMode);
  check("the difference is blended, with a gain", difference === "difference" && (await page.$eval(".difference .layers", (each) => getComputedStyle(each).filter)).startsWith("brightness(4"));
}

async function useFrames(page) {
  await page.keyboard.press("Home");
  await page.keyboard.press("ArrowRight");
  await wait(200);
  const files = () => page.$$eval(".stage img", (all) => all.map((image) => image.src.split("/").at(-1)));
  check("arrow keys step, and all pictures follow", (await at(page)) === 1 && new Set(await files()).size === 1 && (await files())[0] === "frame-0001.png");
  await page.keyboard.press("p");
  await wait(1000);
  await page.keyboard.press("p");
  const moved = await at(page);
  await wait(200);
  check(`the film plays at its rate, to frame ${moved} after 1 s of 20 frames, and stops`, moved !== 1 && moved === (await at(page)));
  const chart = await (await page.$("article:not([hidden]) .errors svg")).boundingBox();
  const x = (share) => chart.x + chart.width * (0.062 + 0.924 * share);
  await page.mouse.click(x(0.5 / NUM_FRAMES), chart.y + 40);
  check("a click on the chart goes to its frame", (await at(page)) === 0);
}

async function useDecisions(page) {
  const chart = await (await page.$("article:not([hidden]) .errors svg")).boundingBox();
  const x = (frame) => chart.x + chart.width * (0.062 + (0.924 * (frame + 0.5)) / NUM_FRAMES);
  await page.mouse.move(x(2), chart.y + 40);
  await page.mouse.down();
  await page.mouse.move(x(4), chart.y + 40, { steps: 6 });
  await page.mouse.up();
  const range = await page.$$eval(".run input", (all) => all.map((each) => each.value).join());
  await page.click(".accept-run");
  await page.focus("article:not([hidden])");
  await page.keyboard.press("End");
  await page.keyboard.press("a");
  const expected = `hsplat golden scenes --accept ${folder}/report --only 'it'"'"'s changed:2-4,11'`;
  check(`a dragged run, ${range}, and a frame become a command`, range === "2,4" && (await value(page, "command")) === expected);
  check("the workflow gets the same list", (await value(page, "workflow")) === `'it'"'"'s changed:2-4,11'`);
  await page.reload();
  await wait(500);
  check("decisions survive a reload", (await value(page, "command")) === expected);
  await page.click("#copy-command");
  check("the command can be copied", (await page.$eval("#copied", (each) => each.textContent)) === "Copied.");
  await page.keyboard.press("2");
  check("keys work after the command was copied", (await mode(page)) === "new");
  await page.focus(".zoom");
  await page.keyboard.press("3");
  check("keys work where a drop-down has the focus", (await mode(page)) === "difference");
  await page.hover('[data-mode="difference"]:not(.stage)');
  const colors = await page.$eval('button[data-mode="difference"]', (button) => [getComputedStyle(button).color, getComputedStyle(button).backgroundColor]);
  const raised = await page.$eval("#decisions", (panel) => getComputedStyle(panel).backgroundColor);
  check(`the label of a pressed button stays under the mouse: ${colors.join(" on ")}`, colors[0] !== colors[1] && colors[1] !== raised);
  const panel = await page.$eval("#decisions", (each) => each.getBoundingClientRect().height);
  check(`the open command takes less than a third of the window: ${Math.round(panel)} of 1000 pixels`, panel < 300);
  await page.keyboard.press("0");
  const accepting = spawnSync("sh", ["-c", (await value(page, "command")).replace(/^hsplat/, hsplat)], { cwd: folder });
  check(`the command accepts four frames: ${accepting.stdout}${accepting.stderr}`, accepting.status === 0 && String(accepting.stdout).includes("4 frames"));
  await show(page, "it's changed");
  await page.click(".accept-film");
  check("a whole film needs no frames", (await value(page, "workflow")) === `'it'"'"'s changed'`);
  await page.click("#accept-none");
  check("nothing accepted, no command", (await value(page, "command")) === "");
}

async function useWithLittleMotion(browser) {
  const page = await open(browser, PAGE, 1300, "light");
  await page.emulateMediaFeatures([{ name: "prefers-reduced-motion", value: "reduce" }]);
  await show(page, "it's changed");
  const side = () => page.$eval(".stage", (stage) => stage.dataset.blink);
  await page.keyboard.press("b");
  const first = await side();
  await wait(700);
  const later = await side();
  await page.keyboard.press("b");
  check("with little motion, each b swaps old and new, and nothing blinks", first === "old" && later === "old" && (await side()) === "new");
  await page.close();
}

(async () => {
  makeReport();
  const browser = await launch();
  await audit(browser, PAGE);
  await audit(browser, `${PAGE}#film-1`);
  const page = await open(browser, PAGE, 1300, "light");
  await useList(page);
  await useViews(page);
  await useFrames(page);
  await useDecisions(page);
  check(`no error on the console: ${page.errors}`, !page.errors.length);
  await useWithLittleMotion(browser);
  await end(browser);
})();
