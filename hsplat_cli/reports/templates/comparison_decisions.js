// Collects which new pictures become golden, and writes the command that does it.
const accepted = report.films.map(() => new Set()); // for each film, indices of frames
const decisions = document.getElementById("decisions");
const command = document.getElementById("command"), workflow = document.getElementById("workflow");
const reportPlace = document.getElementById("report-place");
const KEY = `hsplat-decisions-${report.key}`;

const acceptable = report.films.map(({ frames }) => frames.flatMap((each, index) => (each.accepts ? [index] : [])));
const isAccepted = (number, index) => accepted[number].has(index);
const counted = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;

// ------------------------------------------------------------------------------------------------------------- command

// Numbers in ascending order as `--only` reads them: 12-18,40.
function runsOf(numbers) {
  const runs = [];
  for (const number of numbers) {
    const last = runs.at(-1);
    if (last && number === last[1] + 1) last[1] = number;
    else runs.push([number, number]);
  }
  return runs.map(([first, last]) => (first === last ? `${first}` : `${first}-${last}`)).join(",");
}

// A text as one word of a POSIX shell.
const quoted = (text) => (/^[\w@%+=:,./-]+$/.test(text) ? text : `'${text.replaceAll("'", `'"'"'`)}'`);

// The values of `--only`: a film alone stands for all its frames that fail.
function wordsOfDecisions() {
  return report.films.flatMap(({ name, frames }, number) => {
    const taken = [...accepted[number]].sort((a, b) => a - b);
    if (!taken.length) return [];
    const isWhole = taken.length === frames.filter((each) => each.fails).length && !name.includes(":");
    return [isWhole ? name : `${name}:${runsOf(taken.map((index) => frames[index].number))}`];
  });
}

function showCommand() {
  const words = wordsOfDecisions().map(quoted);
  const start = ["hsplat golden", ...[...report.arguments, "--accept", reportPlace.value].map(quoted)];
  command.value = words.length ? [...start, ...words.map((word) => `--only ${word}`)].join(" ") : "";
  workflow.value = words.join(" ");
  const count = accepted.reduce((sum, each) => sum + each.size, 0);
  const ofFilms = counted(accepted.filter((each) => each.size).length, "film");
  document.getElementById("decided").textContent = count
    ? `${counted(count, "frame")} of ${ofFilms} accepted. Nothing is written until the command runs.`
    : "Nothing is accepted yet.";
  for (const id of ["copy-command", "copy-workflow", "accept-none"]) document.getElementById(id).disabled = !count;
}

// The pages of some browsers have no clipboard, or none for files: the text is selected, to be copied by keys. Once it
// is copied, the button has the focus again, so that the keys of the page work.
async function copy(field, button) {
  document.getElementById("decisions-more").open = true;
  field.select();
  let isCopied = false;
  try {
    isCopied = document.execCommand("copy");
    if (!isCopied) await navigator.clipboard.writeText(field.value).then(() => (isCopied = true));
  } catch {}
  if (isCopied) button.focus();
  document.getElementById("copied").textContent = isCopied ? "Copied." : "Selected: copy it by the keys of your system.";
}

// ----------------------------------------------------------------------------------------------------------- decisions

function save() {
  try {
    localStorage.setItem(KEY, JSON.stringify(accepted.map((each) => [...each])));
  } catch {} // without storage, decisions last as long as the page
}

function restore() {
  try {
    const kept = JSON.parse(localStorage.getItem(KEY)) ?? [];
    acceptable.forEach((indices, number) => (accepted[number] = new Set(indices.filter((index) => kept[number]?.includes(index)))));
  } catch {}
}

function accept(number, indices, isTaken) {
  for (const index of indices)
    if (report.films[number].frames[index].accepts) accepted[number][isTaken ? "add" : "delete"](index);
}

function decide(changes) {
  changes();
  save();
  showAllDecisions();
}

const decideHere = (indices, isTaken) => decide(() => accept(shown.film, indices, isTaken));

function toggleFrame() {
  if (frame()?.accepts) decideHere([shown.at], !isAccepted(shown.film, shown.at));
}

function toggleFilm() {
  decideHere(acceptable[shown.film], accepted[shown.film].size < acceptable[shown.film].length);
}

const place = (index) => film().frames[index].number ?? index;

function runIndices() {
  const [first, last] = [part(".run-first").valueAsNumber, part(".run-last").valueAsNumber];
  return film().frames.flatMap((each, index) => (first <= place(index) && place(index) <= last ? [index] : []));
}

function showRun() {
  const [first, last] = run.first === null ? [shown.at, shown.at] : [run.first, run.last];
  part(".run-first").value = place(first);
  part(".run-last").value = place(last);
}

function showDecisions() {
  if (!frame()) return;
  const all = acceptable[shown.film], taken = accepted[shown.film], box = part(".accept-frame");
  part(".accepting").hidden = !all.length;
  box.checked = isAccepted(shown.film, shown.at);
  box.disabled = !frame().accepts;
  box.nextElementSibling.textContent = frame().accepts ? `this frame, ${place(shown.at)}` : "this frame: nothing to accept";
  part(".accept-film").textContent = taken.size < all.length ? `accept all ${all.length} that fail` : "accept none";
  part(".film-decided").textContent = `${taken.size} of ${all.length} accepted`;
  if (run.first === null) showRun();
}

function showAllDecisions() {
  acceptable.forEach((indices, number) => {
    const count = accepted[number].size;
    badges[number].textContent = count ? ` ${count} of ${indices.length} accepted` : "";
  });
  showDecisions();
  showCursor();
  showCommand();
}

function acceptListed() {
  decide(() => acceptable.forEach((indices, number) => isListed(number) && accept(number, indices, true)));
}

part(".accept-frame").addEventListener("change", toggleFrame);
part(".accept-film").addEventListener("click", toggleFilm);
part(".accept-run").addEventListener("click", () => decideHere(runIndices(), true));
part(".refuse-run").addEventListener("click", () => decideHere(runIndices(), false));
document.getElementById("accept-listed").addEventListener("click", acceptListed);
document.getElementById("accept-none").addEventListener("click", () => decide(() => accepted.forEach((each) => each.clear())));
document.getElementById("copy-command").addEventListener("click", ({ target }) => copy(command, target));
document.getElementById("copy-workflow").addEventListener("click", ({ target }) => copy(workflow, target));
reportPlace.addEventListener("input", showCommand);

// The folder of this page is a report that the command reads.
function ownFolder() {
  if (location.protocol !== "file:") return "REPORT.zip";
  return decodeURIComponent(location.pathname).replace(/\/[^/]*$/, "").replace(/^\/([A-Za-z]:)/, "$1");
}
