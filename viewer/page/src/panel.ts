// The panel of controls, made of plain elements.

/** An element with attributes and children. */
export function element<K extends keyof HTMLElementTagNameMap>(
  name: K,
  attributes: Record<string, string> = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

export function section(title: string, ...children: Node[]): HTMLDetailsElement {
  const made = element("details", {}, element("summary", {}, title), ...children);
  made.open = true;
  return made;
}

export interface SliderRange {
  min: number;
  max: number;
  step: number;
}

/** A slider with its value beside it. */
export function slider(title: string, range: SliderRange, value: number, changed: (value: number) => void) {
  const { min, max, step } = range;
  const input = element("input", { type: "range", min: `${min}`, max: `${max}`, step: `${step}` });
  const output = element("output");
  const digits = Math.max(0, -Math.floor(Math.log10(step)));
  const show = () => (output.textContent = input.valueAsNumber.toFixed(digits));
  input.valueAsNumber = value;
  show();
  input.addEventListener("input", () => {
    show();
    changed(input.valueAsNumber);
  });
  const set = (now: number) => {
    input.valueAsNumber = now;
    show();
  };
  return { label: element("label", {}, title, input, output), input, set };
}

/** Numbers side by side, each with a name of its own. */
export function numbers(names: string[], values: number[], changed: (values: number[]) => void) {
  const inputs = values.map((value, k) => {
    const input = element("input", { type: "number", step: "any", "aria-label": names[k] });
    input.valueAsNumber = value;
    input.addEventListener("change", () => {
      const now = inputs.map((one) => one.valueAsNumber);
      if (now.every(Number.isFinite)) changed(now);
    });
    return input;
  });
  const set = (now: number[]) => inputs.forEach((input, k) => (input.value = `${tidy(now[k])}`));
  set(values);
  return { row: element("div", { class: "numbers" }, ...inputs), set };
}

/** A number as people write it. */
export const tidy = (value: number): number => Number(value.toPrecision(5));

export function select(title: string, values: readonly string[], value: string, changed: (value: string) => void) {
  const options = values.map((one) => element("option", { value: one }, one));
  const input = element("select", { "aria-label": title }, ...options);
  input.value = value;
  input.addEventListener("change", () => changed(input.value));
  return element("label", {}, title, input);
}

export function checkbox(title: string, changed: (on: boolean) => void) {
  const input = element("input", { type: "checkbox" });
  input.addEventListener("change", () => changed(input.checked));
  return { label: element("label", { class: "check" }, input, title), input };
}

export function button(title: string, pressed: () => void): HTMLButtonElement {
  const made = element("button", { type: "button" }, title);
  made.addEventListener("click", pressed);
  return made;
}

/** Buttons of which one is pressed. */
export function choice<T extends string>(values: readonly T[], value: T, changed: (value: T) => void): HTMLElement {
  const buttons = values.map((one) => {
    const made = button(one, () => {
      buttons.forEach((other) => other.setAttribute("aria-pressed", `${other === made}`));
      changed(one);
    });
    made.setAttribute("aria-pressed", `${one === value}`);
    return made;
  });
  return element("div", { class: "row", role: "group" }, ...buttons);
}
