// The on-screen keyboard of a panel, for fields that are typed in: letters in the page's language, signs, or digits.
"use strict";

(() => {
  const board = document.querySelector("[data-keyboard]");
  const LETTERS = {
    de: ["qwertzuiopü", "asdfghjklöä", "yxcvbnmß-"],
    es: ["qwertyuiop", "asdfghjklñ", "zxcvbnm-_"],
    en: ["qwertyuiop", "asdfghjkl", "zxcvbnm-_"],
  };
  const SIGNS = ["1234567890", "-_/.,:;+#'*\\", "@()&\"!?=%|<>"];
  const BRACKETS = "[]{}";
  const ACCENTS = { de: "", es: "áéíóúü¿¡", en: "" };
  const DIGITS = ["789", "456", "123", "-0.,"];
  const language = document.documentElement.lang in LETTERS ? document.documentElement.lang : "en";
  // Time from leaving a field to the keyboard's closing, in ms: the page moves with it, which must not be before what the
  // finger touched is pressed. An estimate.
  const CLOSE_MS = 300;
  let closing = 0;
  let isTouched = false;
  let field = null;
  let layer = "letters";
  let shifted = false;

  const typed = (each) =>
    each instanceof HTMLTextAreaElement ||
    (each instanceof HTMLInputElement && ["text", "search"].includes(each.type) && !each.readOnly && !each.disabled);
  const numeric = () => ["numeric", "decimal"].includes(field.dataset.mode);

  function rows() {
    const first = SIGNS[0];
    if (numeric()) {
      return DIGITS;
    }
    return layer === "signs" ? [...SIGNS, BRACKETS + ACCENTS[language]] : [first, ...LETTERS[language]];
  }

  function key(label, name, press) {
    const button = document.createElement("button");
    button.type = "button";
    button.className = `button keycap keycap-${name}`;
    button.textContent = label;
    if (board.dataset[name]) {
      button.setAttribute("aria-label", board.dataset[name]);
    }
    // Keep the focus in the field; a key must not take it.
    button.addEventListener("pointerdown", (event) => event.preventDefault());
    button.addEventListener("click", press);
    return button;
  }

  function write(text) {
    const room = field.maxLength < 0 ? Infinity : field.maxLength - field.value.length;
    const [from, to] = [field.selectionStart, field.selectionEnd];
    if (text && text.length > room + to - from) {
      return;
    }
    field.setRangeText(text, text || from !== to ? from : Math.max(0, from - 1), to, "end");
    field.dispatchEvent(new Event("input", { bubbles: true }));
    if (shifted) {
      shifted = false;
      draw();
    }
  }

  function draw() {
    const drawn = rows().map((row) => {
      const line = document.createElement("div");
      for (const sign of row) {
        const shown = shifted ? sign.toLocaleUpperCase(language) : sign;
        line.append(key(shown, "sign", () => write(shown)));
      }
      return line;
    });
    const last = document.createElement("div");
    if (!numeric()) {
      last.append(
        key("⇧", "shift", () => {
          shifted = !shifted;
          draw();
        }),
        key(layer === "signs" ? "abc" : "?1á", "layer", () => {
          layer = layer === "signs" ? "letters" : "signs";
          draw();
        }),
        key(" ", "space", () => write(" ")),
      );
    }
    if (field instanceof HTMLTextAreaElement) {
      last.append(key("⏎", "enter", () => write("\n")));
    }
    last.append(
      key("⌫", "erase", () => write("")),
      key(board.dataset.done, "done", () => field.blur()),
    );
    board.replaceChildren(...drawn, last);
    board.classList.toggle("digits", numeric());
  }

  function open(next) {
    clearTimeout(closing);
    field = next;
    field.dataset.mode ??= field.inputMode;
    field.inputMode = "none"; // the system's own keyboard would cover this one
    layer = "letters";
    shifted = false;
    draw();
    board.hidden = false;
    document.body.classList.add("typing");
    field.scrollIntoView({ block: "end" });
  }

  function close() {
    field = null;
    board.hidden = true;
    document.body.classList.remove("typing");
  }

  function closeLater() {
    clearTimeout(closing);
    closing = setTimeout(() => (isTouched ? closeLater() : close()), CLOSE_MS);
  }

  document.addEventListener("focusin", (event) =>
    typed(event.target) && !event.target.matches(".pin") ? open(event.target) : closeLater(),
  );
  document.addEventListener("focusout", (event) => event.target === field && closeLater());
  for (const name of ["pointerdown", "pointerup", "pointercancel"]) {
    document.addEventListener(name, () => (isTouched = name === "pointerdown"));
  }
})();
