// A picture of many frames, row by row, behind a window: a slider, or dragging, chooses which one is seen.
const turn = document.querySelector(".turn"), slider = turn.querySelector("input"), view = turn.querySelector(".window");
const number = Number(slider.max) + 1, columns = {{ columns }};
const show = () => {
  const at = slider.valueAsNumber, angle = `${Math.round((360 * at) / number)}°`;
  view.firstElementChild.style.transform =
    `translate(${(-100 * (at % columns)) / columns}%, ${(-100 * Math.floor(at / columns) * columns) / number}%)`;
  turn.querySelector("figcaption").textContent = angle;
  slider.setAttribute("aria-valuetext", angle);
};
let start = null;
slider.hidden = false;
slider.addEventListener("input", show);
view.addEventListener("pointerdown", (event) => {
  view.setPointerCapture(event.pointerId);
  start = event.clientX + (view.clientWidth / number) * slider.valueAsNumber;
});
view.addEventListener("pointermove", (event) => {
  if (start === null) return;
  const at = Math.round(((start - event.clientX) / view.clientWidth) * number);
  slider.value = ((at % number) + number) % number;
  show();
});
for (const end of ["pointerup", "pointercancel"]) view.addEventListener(end, () => (start = null));
