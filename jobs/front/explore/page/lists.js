// Lists and button rows for pointer, keys and screen readers (WAI-ARIA: listbox, radiogroup).

let lists = 0;

/** A listbox in `element`: items {text} or {cells: [...]}. `focused` is called with the index that the user points at or moves to, `chosen`
 * with the one that is clicked or entered. */
export function makeList(element, { focused = () => {}, chosen = () => {}, left = () => {} }) {
  const id = `list${lists++}`;
  let items = [], current = -1;
  const mark = (index, asks) => {
    if (index < 0 || index >= items.length) return;
    items[current]?.setAttribute('aria-selected', 'false');
    current = index;
    items[index].setAttribute('aria-selected', 'true');
    element.setAttribute('aria-activedescendant', items[index].id);
    if (document.activeElement === element || asks) items[index].scrollIntoView({ block: 'nearest' });
    if (asks) focused(index);
  };
  element.addEventListener('keydown', (event) => {
    const steps = { ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1, PageDown: 10, PageUp: -10 };
    if (event.key in steps) mark(Math.max(0, Math.min(items.length - 1, current + steps[event.key])), true);
    else if (event.key === 'Home') mark(0, true);
    else if (event.key === 'End') mark(items.length - 1, true);
    else if (event.key === 'Enter' || event.key === ' ') current >= 0 && chosen(current);
    else return;
    event.preventDefault();
  });
  element.addEventListener('focus', () => mark(Math.max(0, current), true));
  element.addEventListener('blur', () => left());
  const clear = () => {
    items[current]?.setAttribute('aria-selected', 'false');
    element.removeAttribute('aria-activedescendant');
    current = -1;
  };
  return {
    fill(entries) {
      current = -1;
      items = entries.map((entry, index) => {
        const item = document.createElement('li');
        item.id = `${id}-${index}`;
        item.role = 'option';
        item.setAttribute('aria-selected', 'false');
        if (entry.label) item.setAttribute('aria-label', entry.label);
        if (entry.cells) item.append(...entry.cells.map((text) => Object.assign(document.createElement('span'), { textContent: text })));
        else item.textContent = entry.text;
        item.addEventListener('pointerdown', (event) => event.preventDefault());
        item.addEventListener('click', () => {
          mark(index, true);
          chosen(index);
        });
        return item;
      });
      element.replaceChildren(...items);
      element.removeAttribute('aria-activedescendant');
    },
    mark: (index) => (index < 0 ? clear() : mark(index, false)),
    item: (index) => items[index],
    get current() {
      return current;
    },
  };
}

/** A radiogroup in `element` with `names`; calls chosen(index). */
export function makeChoice(element, names, chosen, start = 0) {
  let current = start;
  const buttons = names.map((name, index) => {
    const button = document.createElement('span');
    button.role = 'radio';
    button.textContent = name;
    button.addEventListener('click', () => choose(index, true));
    return button;
  });
  const choose = (index, asks) => {
    current = index;
    buttons.forEach((button, i) => {
      button.setAttribute('aria-checked', String(i === index));
      button.tabIndex = i === index ? 0 : -1;
    });
    if (asks) chosen(index);
  };
  element.addEventListener('keydown', (event) => {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (!step) return;
    choose((current + step + names.length) % names.length, true);
    buttons[current].focus();
    event.preventDefault();
  });
  element.replaceChildren(...buttons);
  choose(start, false);
  return { choose: (index) => index < names.length && choose(index, true) };
}

/** A slider with a text of its value. toValue: from its position; calls changed(value). */
export function makeSlider(input, toValue, toText, changed) {
  const output = input.parentElement.querySelector('output');
  const show = () => {
    const value = toValue(Number(input.value)), text = toText(value);
    output.textContent = text;
    input.setAttribute('aria-valuetext', text);
    return value;
  };
  input.addEventListener('input', () => changed(show()));
  const start = input.value;
  input.addEventListener('dblclick', () => {
    input.value = start;
    changed(show());
  });
  show();
  return {
    get value() {
      return toValue(Number(input.value));
    },
    reset(position = start) {
      input.value = position;
      show();
    },
  };
}
