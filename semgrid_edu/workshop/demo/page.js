"use strict";
const frames = JSON.parse(document.getElementById("frames").textContent);
const slider = document.getElementById("slider");
const play = document.getElementById("play");
const clock = document.getElementById("clock");
const speed = document.getElementById("speed");
const last = frames.length - 1;
const watchers = []; // called with the number of the frame that is shown
let timer = null; // set while the drive plays

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
  slider.setAttribute("aria-valuetext", frame.clock);
  for (const watcher of watchers) watcher(k);
}

function shown() { return Number(slider.value); }
function go(k) { show(Math.max(0, Math.min(last, k))); }

// Milliseconds until the next frame: the drive's own time at speed 1.
function pause(k) {
  const next = frames[k + 1], seconds = next ? next.time - frames[k].time : 0;
  return 1000 * (seconds > 0 ? Math.min(seconds, 5) : 0.1) / Number(speed.value);
}

function advance() {
  const k = Math.min(shown() + 1, last);
  timer = setTimeout(advance, pause(k));
  show(k);
  if (k === last) toggle();
}

function toggle() {
  if (timer === null) {
    if (shown() === last) show(0);
    timer = setTimeout(advance, pause(shown()));
  } else { clearTimeout(timer); timer = null; }
  play.textContent = timer === null ? "▶ Play" : "❚❚ Pause";
  for (const region of document.querySelectorAll("[aria-live]")) region.setAttribute("aria-live", timer === null ? "polite" : "off");
  if (timer === null) show(shown()); // a frame at rest tells more
}

slider.addEventListener("input", () => show(shown()));
play.addEventListener("click", toggle);
document.getElementById("back").addEventListener("click", () => go(shown() - 1));
document.getElementById("next").addEventListener("click", () => go(shown() + 1));
document.addEventListener("keydown", (event) => {
  if (event.altKey || event.ctrlKey || event.metaKey || event.defaultPrevented) return; // those belong to the browser
  if (event.target.closest("select")) return; // its own keys choose an option
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (step) { event.preventDefault(); go(shown() + step); }
  else if (event.key === " " && !event.target.closest("button, summary")) { event.preventDefault(); toggle(); }
});
// index.html#12 opens frame 12.
function follow() { go(parseInt(location.hash.slice(1), 10) || 0); }
window.addEventListener("hashchange", follow);
follow();
