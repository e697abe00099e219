// Opens pages of hsplat in headless Chromium and checks them, for the scripts beside this one.
const { execFileSync } = require("node:child_process");
const fs = require("node:fs"), path = require("node:path");
const puppeteer = require("puppeteer-core");

const folder = path.resolve(process.argv[2]), hsplat = process.env.HSPLAT || "hsplat";
const axe = fs.readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");
const wait = (ms) => new Promise((done) => setTimeout(done, ms));
const run = (...words) => execFileSync(hsplat, words, { cwd: folder });
fs.mkdirSync(folder, { recursive: true });
let wrong = 0;

function check(what, isRight) {
  console.log(isRight ? "ok   " : "WRONG", what);
  if (!isRight) wrong++;
}

async function open(browser, file, width, scheme) {
  const page = await browser.newPage();
  page.errors = [];
  page.on("console", (message) => message.type() === "error" && page.errors.push(message.text()));
  page.on("pageerror", (error) => page.errors.push(String(error)));
  page.on("request", (request) => /^(file|data|blob):/.test(request.url()) || page.errors.push(request.url()));
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
  await page.setViewport({ width, height: 1000 });
  const start = Date.now();
  await page.goto(`file://${folder}/${file}`);
  console.log("     loaded in", Date.now() - start, "ms");
  await wait(1000);
  return page;
}

async function audit(browser, file) {
  for (const scheme of ["light", "dark"]) for (const width of [1300, 400]) {
    const page = await open(browser, file, width, scheme);
    await page.screenshot({ path: `${folder}/${file.replace(".html", "").replace(/[/#]/g, "-")}-${scheme}-${width}.png` });
    await page.evaluate(axe);
    const found = (await page.evaluate(() => axe.run())).violations.map((each) => each.id);
    const isWide = await page.evaluate(() => document.documentElement.scrollWidth > innerWidth);
    const told = [...found, ...page.errors, ...(isWide ? ["overflow"] : [])];
    check(`${file} ${scheme} ${width}: ${told.join(", ") || "axe, console and width"}`, !told.length);
    await page.close();
  }
}

const launch = () =>
  puppeteer.launch({
    executablePath: process.env.CHROMIUM || "/usr/bin/chromium",
    args: ["--no-sandbox", "--disable-gpu", "--allow-file-access-from-files"],
  });

async function end(browser) {
  await browser.close();
  process.exit(wrong ? 1 : 0);
}

module.exports = { audit, check, end, folder, hsplat, launch, open, run, wait };
