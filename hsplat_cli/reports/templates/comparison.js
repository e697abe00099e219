// Lists the films, shows one of them, and listens to keys.
const list = document.getElementById("film-list"), items = [...list.children];
const links = items.map((item) => item.firstElementChild);
const badges = items.map((item) => item.querySelector(".accepted"));
const articles = report.films.map((_, number) => document.getElementById(`film-${number}`));
const filterText = document.getElementById("filter-text"), filterVerdict = document.getElementById("filter-verdict");
const isListed = (number) => !items[number].hidden;

// --------------------------------------------------------------------------------------------------------------- films

function showFilm(number, at = null) {
  stop();
  links[shown.film].removeAttribute("aria-current");
  articles[shown.film].hidden = true;
  shown.film = number;
  articles[number].hidden = false;
  links[number].setAttribute("aria-current", "true");
  links.forEach((link, index) => (link.tabIndex = index === number ? 0 : -1));
  links[number].scrollIntoView({ block: "nearest" });
  run.first = run.last = null;
  viewer.remove();
  articles[number].querySelector(".place")?.append(viewer);
  const { frames } = film();
  if (!frames.length) return;
  slider.max = frames.length - 1;
  slider.disabled = frames.length < 2;
  part(".play").disabled = frames.length < 2;
  showFrame(at ?? failingFrame("worst") ?? 0).then(() => loadAhead(2));
}

// Returns the film and the frame that the address names, #film-3 or #film-3-frame-12; null for no frame.
function addressed() {
  const found = /^#film-(\d+)(?:-frame-(\d+))?$/.exec(location.hash), number = Number(found?.[1] ?? 0);
  if (number >= report.films.length) return [0, null];
  return [number, found?.[2] === undefined ? null : Number(found[2])];
}

// Shows a film at once: the event of a changed address comes later, perhaps after the next key.
function openFilm(number) {
  if (number === shown.film) return;
  showFilm(number);
  location.hash = `film-${number}`;
}

function move(from, count) {
  const listed = report.films.map((_, number) => number).filter(isListed);
  const at = listed.indexOf(from), next = listed[Math.min(Math.max(at + count, 0), listed.length - 1)];
  if (next !== undefined) openFilm(next);
  return next;
}

function filter() {
  const words = filterText.value.toLowerCase().split(/\s+/), verdict = filterVerdict.value;
  report.films.forEach(({ name, verdict: found }, number) => {
    const lower = name.toLowerCase();
    items[number].hidden = (verdict && found !== verdict) || !words.every((word) => lower.includes(word));
  });
  const count = items.filter((item) => !item.hidden).length;
  document.getElementById("filter-result").textContent = count < items.length ? `${count} of ${items.length} films` : "";
  if (count && !isListed(shown.film)) openFilm(items.findIndex((item) => !item.hidden));
}

list.addEventListener("keydown", (event) => {
  const steps = { ArrowDown: 1, ArrowUp: -1, Home: -Infinity, End: Infinity, PageDown: 10, PageUp: -10 };
  if (!(event.key in steps) || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  event.stopPropagation();
  const next = move(links.indexOf(event.target), steps[event.key]);
  if (next !== undefined) links[next].focus();
});
filterText.addEventListener("input", filter);
filterVerdict.addEventListener("change", filter);
addEventListener("hashchange", () => {
  const [number, at] = addressed();
  if (number !== shown.film || at !== null) showFilm(number, at);
});

// ---------------------------------------------------------------------------------------------------- table of frames

const FIGURES = [["worst part, dB", "decibels"], ["whole, dB", "whole"], ["largest error", "largest"]];

function fillTable(details, number) {
  if (details.querySelector("table")) return;
  const cell = (kind, text, name) => {
    const made = document.createElement(kind);
    if (kind === "th") made.scope = name;
    else made.className = name;
    made.textContent = text;
    return made;
  };
  const table = document.createElement("table"), head = table.createTHead().insertRow(), body = table.createTBody();
  head.append(...["frame", "status", ...FIGURES.map(([title]) => title)].map((title) => cell("th", title, "col")));
  report.films[number].frames.forEach((each, index) => {
    const row = body.insertRow(), name = cell("th", "", "row"), link = document.createElement("a");
    link.href = `#film-${number}-frame-${index}`;
    link.textContent = each.name;
    name.className = "text";
    name.append(link);
    const figures = FIGURES.map(([, key]) => cell("td", each[key] >= 200 ? "same" : each[key] ?? "", ""));
    row.append(name, cell("td", each.status, "text"), ...figures);
  });
  const scroll = document.createElement("div");
  scroll.className = "scroll";
  scroll.tabIndex = 0;
  scroll.setAttribute("role", "group");
  scroll.setAttribute("aria-label", "Table of frames");
  scroll.append(table);
  details.append(scroll);
}

articles.forEach((article, number) => {
  const svg = article.querySelector(".errors svg.axes[role]"), details = article.querySelector("details.frames");
  if (svg) listenToChart(svg);
  details?.addEventListener("toggle", () => details.open && fillTable(details, number));
});

// ---------------------------------------------------------------------------------------------------------------- keys

const ofFrames = {
  ArrowLeft: () => step(-1), ArrowRight: () => step(1), Home: () => step(-Infinity), End: () => step(Infinity),
  p: play, " ": play, 0: () => setMode("all"), 1: () => setMode("old"), 2: () => setMode("new"), 3: () => setMode("difference"),
  b: blink, s: () => setMode(shown.mode === "swipe" ? "all" : "swipe"),
  z: nextZoom, g: nextGain, m: () => part(".show-part").click(), f: () => go("first"), w: () => go("worst"), a: toggleFrame,
};
const ofFilms = { j: () => move(shown.film, 1), k: () => move(shown.film, -1) };

// Whether an element needs a key for itself.
function isTaken(target, key) {
  if (target.matches("textarea, #filter-verdict, input:is([type=search], [type=number], :not([type]))")) return true;
  if (key === " ") return target.matches("button, input, select, summary, a");
  const isScrolled = target.matches(".scroll") || (target.matches(".view") && stage.dataset.zoom !== "fit");
  return /^(Arrow|Home|End)/.test(key) && (target.matches("input[type=range], select") || isScrolled);
}

addEventListener("keydown", (event) => {
  const { key, target } = event;
  if (event.ctrlKey || event.altKey || event.metaKey || event.shiftKey || isTaken(target, key)) return;
  const act = ofFilms[key] ?? (viewer.isConnected && film().hasPictures ? ofFrames[key] : undefined);
  if (!act) return;
  event.preventDefault();
  act();
});

// --------------------------------------------------------------------------------------------------------------- start

document.querySelector(".filter").hidden = report.films.length < 2;
document.querySelector(".report").classList.toggle("single", report.films.length < 2);
articles.forEach((article) => (article.hidden = true));
reportPlace.value = ownFolder();
decisions.hidden = !acceptable.some((indices) => indices.length);
restore();
setMode("all");
setGain(4);
setDivider();
showFilm(...addressed());
showAllDecisions();
