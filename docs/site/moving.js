// Widgets of lectures without a kernel: a slider chooses one of the pictures that were recorded before.
for (const widget of document.querySelectorAll(".moving")) {
  const picture = widget.querySelector("img"), sliders = [...widget.querySelectorAll("input")];
  const said = (slider) => JSON.parse(slider.dataset.values)[slider.value];
  function move(slider) {
    for (const other of sliders) {
      if (other !== slider) other.value = other.defaultValue; // pictures were recorded for one control at a time
      other.nextElementSibling.value = said(other);
    }
    picture.src = picture.src.replace(/[^/]*$/, `${slider.name}-${slider.value}.webp`);
    picture.alt = `What the widget shows: ${sliders.map((one) => `${one.previousElementSibling.textContent} = ${said(one)}`).join(", ")}`;
  }
  for (const slider of sliders) slider.addEventListener("input", () => move(slider));
}
