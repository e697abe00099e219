// Shows old, new and difference of a frame in step. One viewer serves all films: it moves into the film that is shown.
const viewer = document.getElementById("viewer-template").content.firstElementChild.cloneNode(true);
const part = (selector) => viewer.querySelector(selector);
const stage = part(".stage"), slider = part(".slider"), divider = part(".divider");
const views = [...viewer.querySelectorAll(".view")];
const wantsStill = matchMedia("(prefers-reduced-motion: reduce)");
// The time of one picture of a blink: two rounds a second, below the three flashes a second that may hurt.
const BLINK_MS = 250;
// The most pictures that are kept decoded, and the number of frames that are loaded ahead of a film.
const MOST_PICTURES = 64;
const FRAMES_AHEAD = 8;
const shown = { film: 0, at: 0, mode: "all", turn: 0, isPlaying: false, blink: 0 };

const film = () => report.films[shown.film];
const frame = () => film().frames[shown.at];

// ------------------------------------------------------------------------------------------------------------ pictures

const pictures = new Map(); // from address to a picture, the least recently used first

function load(address) {
  if (!address) return Promise.resolve(null);
  let picture = pictures.get(address);
  pictures.delete(address);
  if (!picture) {
    picture = new Image();
    picture.src = address;
    picture.ready = picture.decode().then(() => picture, () => null);
  }
  pictures.set(address, picture);
  if (pictures.size > MOST_PICTURES) pictures.delete(pictures.keys().next().value);
  return picture.ready;
}

const loadFrame = (each) => Promise.all([load(each.old), load(each.new)]);

function loadAhead(count) {
  const frames = film().frames;
  for (let step = 1; step <= Math.min(count, frames.length - 1); step++) loadFrame(frames[(shown.at + step) % frames.length]);
}

// A layer has a ground of its own, so that the alpha of both pictures differs by what can be seen of it.
function layer(picture, alt) {
  const image = document.createElement("img"), ground = document.createElement("div");
  image.src = picture.src;
  image.alt = alt;
  ground.className = "layer";
  ground.append(image);
  return ground;
}

function fill(side, found, text, each) {
  const sheet = part(`.${side} .sheet`), [first] = found;
  sheet.replaceChildren();
  sheet.removeAttribute("role");
  sheet.removeAttribute("aria-label");
  sheet.classList.toggle("absent", !first);
  if (!first) return void (sheet.textContent = text);
  sheet.style.setProperty("--width", first.naturalWidth);
  sheet.style.setProperty("--aspect", first.naturalWidth / first.naturalHeight);
  const layers = document.createElement("div");
  layers.className = "layers";
  const alt = `${side} picture of ${each.name}`;
  layers.append(...found.map((picture) => layer(picture, side === "difference" ? "" : alt)));
  if (side === "difference") {
    sheet.setAttribute("role", "img");
    sheet.setAttribute("aria-label", `difference of old and new ${each.name}`);
  }
  sheet.append(layers);
  if (each.part) sheet.append(partMark(each.part, first));
}

function partMark([x, y], { naturalWidth, naturalHeight }) {
  const mark = document.createElement("span"), share = (length, whole) => `${(100 * length) / whole}%`;
  mark.className = "part";
  mark.style.left = share(x, naturalWidth);
  mark.style.top = share(y, naturalHeight);
  mark.style.width = share(Math.min(report.partPx, naturalWidth), naturalWidth);
  mark.style.height = share(Math.min(report.partPx, naturalHeight), naturalHeight);
  return mark;
}

function fillAll([old, now], each) {
  const isPair = old && now && old.naturalWidth === now.naturalWidth && old.naturalHeight === now.naturalHeight;
  const absent = (picture, address) => (picture ? "" : address ? "this file is missing" : "no picture");
  fill("old", old ? [old] : [], absent(old, each.old), each);
  fill("new", now ? [now] : [], absent(now, each.new), each);
  fill("difference", isPair ? [old, now] : [], old && now ? "no difference: another size" : "no difference", each);
  stage.dataset.frame = shown.at;
  enlarge();
}

// Small pictures are enlarged by whole pixels, and larger ones smoothly.
function enlarge() {
  for (const sheet of stage.querySelectorAll(".sheet"))
    sheet.classList.toggle("enlarged", sheet.clientWidth >= 2 * sheet.style.getPropertyValue("--width"));
}

// -------------------------------------------------------------------------------------------------------------- frames

async function showFrame(at) {
  const frames = film().frames, turn = ++shown.turn;
  shown.at = Math.min(Math.max(at, 0), frames.length - 1);
  const each = frame();
  slider.value = shown.at;
  slider.setAttribute("aria-valuetext", each.name);
  part(".frame-name").textContent = `${each.name}, ${shown.at + 1} of ${frames.length}: ${each.status}`;
  const figures = [each.why, each.flip && `FLIP ${each.flip}`, each.nearer].filter(Boolean);
  part(".frame-why").textContent = figures.join("; ");
  showCursor();
  showDecisions();
  if (!film().hasPictures) return;
  const found = await loadFrame(each);
  if (turn === shown.turn) fillAll(found, each);
}

function step(count) {
  stop();
  showFrame(shown.at + count).then(() => loadAhead(2));
}

function stop() {
  shown.isPlaying = false;
  part(".play").textContent = "Play";
  part(".frame-name").setAttribute("aria-live", "polite");
}

async function play() {
  if (shown.isPlaying) return stop();
  const frames = film().frames, number = shown.film, ms = 1000 / film().rate;
  shown.isPlaying = true;
  part(".play").textContent = "Pause";
  part(".frame-name").setAttribute("aria-live", "off");
  let due = performance.now();
  while (shown.isPlaying && shown.film === number) {
    const next = (shown.at + 1) % frames.length;
    loadAhead(FRAMES_AHEAD);
    due = Math.max(due + ms, performance.now() - ms);
    await Promise.all([loadFrame(frames[next]), new Promise((done) => setTimeout(done, due - performance.now()))]);
    if (shown.isPlaying && shown.film === number) await showFrame(next);
  }
}

// Returns the index of the first frame that fails, or of the worst one; undefined if none fails.
function failingFrame(where) {
  const { frames } = film(), decibels = (index) => frames[index].decibels ?? -1;
  const found = [...frames.keys()].filter((index) => frames[index].fails);
  return where === "worst" && found.length ? found.reduce((a, b) => (decibels(b) < decibels(a) ? b : a)) : found[0];
}

function go(where) {
  const index = failingFrame(where);
  if (index !== undefined) step(index - shown.at);
}

// --------------------------------------------------------------------------------------------------------------- views

function setMode(mode) {
  clearInterval(shown.blink);
  shown.mode = stage.dataset.mode = mode;
  stage.dataset.blink = "old";
  if (mode === "blink" && !wantsStill.matches) shown.blink = setInterval(swap, BLINK_MS);
  for (const button of viewer.querySelectorAll("[data-mode]"))
    if (button !== stage) button.setAttribute("aria-pressed", button.dataset.mode === mode);
  enlarge();
}

const swap = () => (stage.dataset.blink = stage.dataset.blink === "old" ? "new" : "old");

// Where the reader wants little motion, old and new are swapped each time that blinking is asked for.
function blink() {
  if (shown.mode !== "blink") setMode("blink");
  else if (wantsStill.matches) swap();
  else setMode("all");
}

function setZoom(zoom) {
  part(".zoom").value = stage.dataset.zoom = zoom;
  stage.style.setProperty("--zoom", zoom === "fit" ? 1 : zoom / devicePixelRatio);
  enlarge();
  const place = frame()?.part;
  if (zoom === "fit" || !place) return;
  for (const view of views) {
    const middle = (at) => ((at + report.partPx / 2) * zoom) / devicePixelRatio;
    view.scrollLeft = middle(place[0]) - view.clientWidth / 2;
    view.scrollTop = middle(place[1]) - view.clientHeight / 2;
  }
}

const setGain = (gain) => stage.style.setProperty("--gain", (part(".gain").value = gain));
const setDivider = () => stage.style.setProperty("--divider", divider.value / divider.max);

function choose(select, set) {
  const values = [...select.options].map((option) => option.value);
  set(values[(values.indexOf(select.value) + 1) % values.length]);
}

const nextZoom = () => choose(part(".zoom"), setZoom);
const nextGain = () => choose(part(".gain"), setGain);

for (const button of viewer.querySelectorAll("button[data-mode]"))
  button.addEventListener("click", () => (button.dataset.mode === "blink" ? blink() : setMode(button.dataset.mode)));
for (const button of viewer.querySelectorAll("[data-go]")) button.addEventListener("click", () => go(button.dataset.go));
for (const view of views)
  view.addEventListener("scroll", () => {
    for (const other of views) [other.scrollLeft, other.scrollTop] = [view.scrollLeft, view.scrollTop];
  });
part(".zoom").addEventListener("change", (event) => setZoom(event.target.value));
part(".gain").addEventListener("change", (event) => setGain(event.target.value));
part(".show-part").addEventListener("change", (event) => stage.classList.toggle("unmarked", !event.target.checked));
part(".play").addEventListener("click", play);
slider.addEventListener("input", () => step(slider.valueAsNumber - shown.at));
divider.addEventListener("input", setDivider);
addEventListener("resize", enlarge);

// --------------------------------------------------------------------------------------------------------------- chart

const run = { first: null, last: null }; // indices of the selected run of frames; null without one

const chart = () => document.querySelector(`#film-${shown.film} .errors svg.axes[role]`);

function across(place) {
  const { left, right, low, high } = film().chart;
  return left + ((place - low) / (high - low)) * (right - left);
}

const svgElement = (name) => document.createElementNS(chart().namespaceURI, name);

function band(className, first, last, top, bottom) {
  const frames = film().frames, shape = svgElement("rect");
  const x = across(frames[first].place - 0.5);
  shape.setAttribute("class", className);
  for (const [name, value] of Object.entries({ x, y: top, width: across(frames[last].place + 0.5) - x, height: bottom - top }))
    shape.setAttribute(name, value);
  return shape;
}

// Draws the frame that is shown, the selected run and the decisions over the chart.
function showCursor() {
  if (!film().chart) return;
  const { top, bottom } = film().chart, svg = chart(), frames = film().frames;
  svg.querySelector(".over")?.remove();
  const over = svgElement("g");
  over.setAttribute("class", "over");
  frames.forEach((each, index) => {
    if (each.fails) over.append(band(isAccepted(shown.film, index) ? "taken" : "failed", index, index, bottom - 7, bottom));
  });
  if (run.first !== null) over.append(band("run", run.first, run.last, top, bottom));
  over.append(band("cursor", shown.at, shown.at, top, bottom));
  svg.append(over);
}

function indexAt(svg, event) {
  const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  const { left, right, low, high } = film().chart;
  const place = low + ((point.x - left) / (right - left)) * (high - low);
  const distances = film().frames.map((each) => Math.abs(each.place - place));
  return distances.indexOf(Math.min(...distances));
}

function select(first, last) {
  [run.first, run.last] = first === null ? [null, null] : [Math.min(first, last), Math.max(first, last)];
  showRun();
  showCursor();
}

function listenToChart(svg) {
  let start = null;
  svg.addEventListener("pointerdown", (event) => {
    if (event.button) return;
    svg.setPointerCapture(event.pointerId);
    const at = indexAt(svg, event);
    stop();
    start = at;
    select(null);
    showFrame(at);
  });
  svg.addEventListener("pointermove", (event) => {
    if (start === null) return;
    const at = indexAt(svg, event);
    if (at === start && run.first === null) return;
    select(start, at);
    if (at !== shown.at) showFrame(at);
  });
  for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => (start = null));
}
