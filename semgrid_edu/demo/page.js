"use strict";
const frames = JSON.parse(document.getElementById("frames").textContent);
const slider = document.getElementById("slider");
const play = document.getElementById("play");
const clock = document.getElementById("clock");
const PERIOD = 200; // ms: half the speed of a drive recorded at 10 Hz
let timer = null;

function show(k) {
  const frame = frames[k];
  for (const element of document.querySelectorAll("[data-image]")) {
    const image = frame.images[element.dataset.image];
    if (element.tagName === "IMG") element.src = image;
    else if (image) element.setAttribute("href", image);
    else element.removeAttribute("href");
  }
  for (const element of document.querySelectorAll("[data-text]")) {
    const name = element.tagName === "IMG" ? "alt" : "aria-label";
    element.setAttribute(name, frame.texts[element.dataset.text] ?? "");
  }
  for (const path of document.querySelectorAll("[data-arrows]")) {
    path.setAttribute("d", frame.arrows[path.dataset.arrows]);
  }
  for (const element of document.querySelectorAll("[data-missing]")) {
    element.toggleAttribute("hidden", element.dataset.missing in frame.images);
  }
  clock.textContent = frame.clock;
  slider.value = k;
}

function go(k) { show(Math.max(0, Math.min(frames.length - 1, k))); }

function toggle() {
  if (timer === null) timer = setInterval(() => show((Number(slider.value) + 1) % frames.length), PERIOD);
  else { clearInterval(timer); timer = null; }
  play.textContent = timer === null ? "▶ Play" : "❚❚ Pause";
  play.setAttribute("aria-pressed", String(timer !== null));
}

slider.addEventListener("input", () => show(Number(slider.value)));
play.addEventListener("click", toggle);
document.addEventListener("keydown", (event) => {
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (step) { event.preventDefault(); go(Number(slider.value) + step); }
  else if (event.key === " " && event.target !== play) { event.preventDefault(); toggle(); }
});
// index.html#12 opens frame 12.
go(parseInt(location.hash.slice(1), 10) || 0);
