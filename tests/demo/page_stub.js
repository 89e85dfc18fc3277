// A page that is just enough for the player's script: elements with attributes and listeners, and no pictures.
class Stub {
  constructor(tagName, text = "") { Object.assign(this, { tagName, textContent: text, dataset: {}, attributes: {}, listeners: {}, value: "0" }); }
  setAttribute(name, value) { this.attributes[name] = value; }
  getAttribute(name) { return this.attributes[name]; }
  addEventListener(type, listener) { (this.listeners[type] ??= []).push(listener); }
  closest(tags) { return tags.split(", ").includes(this.tagName.toLowerCase()) ? this : null; }
  fire(type, event = {}) {
    const whole = { defaultPrevented: false, preventDefault() { this.defaultPrevented = true; }, target: this, ...event };
    for (const listener of this.listeners[type] ?? []) listener(whole);
    return whole.defaultPrevented;
  }
}
const times = [0, 0.1, 0.2, 0.6];
const views = times.map((time, k) => ({ clock: `frame ${k}`, images: {}, texts: {}, arrows: {}, time }));
const elements = { frames: new Stub("SCRIPT", JSON.stringify(views)) };
for (const [id, tag] of Object.entries({ slider: "INPUT", play: "BUTTON", back: "BUTTON", next: "BUTTON", clock: "OUTPUT", speed: "SELECT" })) elements[id] = new Stub(tag);
elements.speed.value = "1";
elements.clock.attributes["aria-live"] = "polite";
const document = Object.assign(new Stub("BODY"), {
  getElementById: (id) => elements[id],
  querySelectorAll: (selector) => (selector === "[aria-live]" ? [elements.clock] : []),
});
const window = new Stub("WINDOW"), location = { hash: "#2" };
let waiting = null;
const setTimeout = (call, delay) => { waiting = { call, delay }; return 1; };
const clearTimeout = () => { waiting = null; };
