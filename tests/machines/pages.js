// Open the pages of hsplat in headless Chromium and use them: `node tests/machines/pages.js FOLDER`.
//
// Needs puppeteer-core and axe-core of npm, and hsplat and chromium on the path. FOLDER gets the pages and pictures of
// the screen, 1300 and 400 pixels wide, light and dark, to be looked at. Ends with 1 where anything is wrong.
const { spawn } = require("node:child_process");
const fs = require("node:fs");
const { audit, check, end, folder, hsplat, launch, open, run, wait } = require("./browser.js");
async function usePreview(browser) {
  const page = await open(browser, "scene.html", 1300, "light");
  const place = () => page.$eval(".window img", (image) => image.style.transform);
  await page.focus(".turn input");
  await page.keyboard.press("ArrowRight");
  const stepped = await place();
  const box = await (await page.$(".window")).boundingBox();
  await page.mouse.move(box.x + 20, box.y + 20);
  await page.mouse.down();
  await page.mouse.move(box.x + 120, box.y + 20);
  await page.mouse.up();
  check("the preview turns by keyboard and by dragging", stepped && stepped !== (await place()));
  await page.close();
}

async function useGallery(browser) {
  const page = await open(browser, "films/index.html", 1300, "light");
  const names = () => page.$$eval("tbody tr", (rows) => rows.filter((row) => row.offsetParent).map((row) => row.cells[1].innerText));
  const all = await names(), start = Date.now();
  await page.click("thead th:nth-child(2) button");
  await page.click("thead th:nth-child(2) button");
  const sorted = await names();
  check(`the gallery sorts ${all.length} rows in ${Date.now() - start} ms`, sorted[0] > sorted.at(-1));
  await page.type("input[type=search]", all.at(-1));
  await wait(300);
  check("the gallery finds a name", (await names()).length === 1);
  await page.close();
}

// Ten edits of a scene, wrong ones included, as an editor writes them.
async function useWatch(browser) {
  const scene = `${folder}/edited.yaml`, text = fs.readFileSync(`${folder}/scene.yaml`, "utf8");
  fs.writeFileSync(scene, text);
  const watching = spawn(hsplat, ["preview", "edited.yaml", "--watch"], { cwd: folder });
  await wait(3000);
  const page = await open(browser, "edited.html", 1300, "light");
  const edits = [
    text.replace("elevation: 20", "elevation: 60"), text.replace("camera:", "camera: ["), text.replace("tolerance:", "tolerence:"),
    text, "", text.replace("elevation: 20", "elevation: -30"), null, text.replace(/opacity: 0\.\d+/, "opacity: 1"),
    `${text}\nmode: maximum\n`, text,
  ];
  for (const [number, edit] of edits.entries()) {
    const before = await page.evaluate(() => [shown, picture.src]), start = Date.now();
    if (edit === null) fs.rmSync(scene);
    else if (number % 2) (fs.writeFileSync(`${scene}~`, edit), fs.renameSync(`${scene}~`, scene));
    else fs.writeFileSync(scene, edit);
    await page.waitForFunction((last) => shown > last, { timeout: 20000 }, before[0]);
    const ms = Date.now() - start;
    await wait(1500);
    const [error, src] = await page.evaluate(() => [document.getElementById("error").innerText, picture.src]);
    console.log(`     edit ${number + 1}: news after ${ms} ms; ${error.split("\n")[0] || "a picture"}`);
    check(`edit ${number + 1}`, src.startsWith("data:image/webp") && Boolean(error) === [1, 2, 4, 6, 8].includes(number) && (!error || src === before[1]));
  }
  check(`no error on the console: ${page.errors}`, !page.errors.length);
  watching.kill("SIGINT");
  await new Promise((done) => watching.on("exit", done));
}

(async () => {
  const volume = "procedural: {name: engine_block, shape: [96, 96, 64]}";
  fs.writeFileSync(`${folder}/scene.yaml`, `volume: {${volume}}
transfer_function: {points: [{value: 60, color: black, opacity: 0}, {value: 200, color: [1, 0.9, 0.8], opacity: 0.5}]}
shading: {ambient: 0.7, occlusion: 0.8}
camera: {target: visible, path: {type: turntable, frames: 24, elevation: 20}}
error: {tolerance: 0.1}
output: {file: film.mp4, size: [256, 256]}
`);
  run("preview", "scene.yaml", "--quiet");
  run("measure", "scene.yaml", "--quiet", "--output", "measured");
  const volumes = process.argv.slice(3);
  if (volumes.length) run("turntable", ...volumes, "-o", "films", "--frames", "12", "--size", "128", "--quiet");
  const browser = await launch();
  await audit(browser, "scene.html");
  await usePreview(browser);
  await audit(browser, "measured/index.html");
  if (fs.existsSync(`${folder}/films/index.html`)) {
    await audit(browser, "films/index.html");
    await useGallery(browser);
  }
  await useWatch(browser);
  await end(browser);
})();
