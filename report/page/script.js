"use strict";
document.documentElement.classList.add("scripted");

// Two pictures side by side become one with a slider.
for (const pair of document.querySelectorAll(".compare")) {
  const [before, after] = pair.querySelectorAll("figure");
  const slider = document.createElement("div");
  slider.className = "slider";
  const over = document.createElement("div");
  over.className = "over";
  over.append(before.querySelector("img"));
  const edge = document.createElement("div");
  edge.className = "edge";
  slider.append(after.querySelector("img"), over, edge);
  const names = document.createElement("div");
  names.className = "names";
  for (const figure of [before, after]) {
    const name = document.createElement("span");
    name.textContent = figure.querySelector("figcaption").textContent;
    names.append(name);
  }
  const range = document.createElement("input");
  range.type = "range";
  range.value = 50;
  range.setAttribute("aria-label", "share of the reference");
  const cut = (percent) => slider.style.setProperty("--cut", percent + "%");
  range.addEventListener("input", () => cut(range.value));
  slider.addEventListener("pointermove", (event) => {
    if (event.pointerType === "mouse" && event.buttons === 0) return;
    const box = slider.getBoundingClientRect();
    range.value = (100 * (event.clientX - box.left)) / box.width;
    cut(range.value);
  });
  pair.replaceWith(slider, names, range);
}

for (const button of document.querySelectorAll("[data-copy]")) {
  button.addEventListener("click", async () => {
    const text = button.parentElement.querySelector("pre");
    try {
      await navigator.clipboard.writeText(text.textContent);
      button.textContent = "Copied";
    } catch {
      // A page opened from a file may have no clipboard: select it for the keyboard.
      getSelection().selectAllChildren(text);
    }
  });
}

// A printed page shows everything.
addEventListener("beforeprint", () => {
  for (const details of document.querySelectorAll("details.view")) details.open = true;
});
