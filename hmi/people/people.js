// The keypad, and the cleaning lock, which ends by itself.
"use strict";

(() => {
  for (const keypad of document.querySelectorAll("[data-keypad]")) {
    const form = keypad.closest("form");
    const fields = [...form.querySelectorAll(".pin")];
    let field = fields[0];
    fields.forEach((each) => each.addEventListener("focus", () => (field = each)));
    keypad.addEventListener("click", (event) => {
      const button = event.target.closest("button");
      if (!button) {
        return;
      }
      if (button.dataset.digit !== undefined && field.value.length < field.maxLength) {
        field.value += button.dataset.digit;
      } else if (button.dataset.erase !== undefined) {
        field.value = field.value.slice(0, -1);
      }
    });
  }

  const lock = document.querySelector("[data-cleaning]");
  const left = lock.querySelector("[data-left]");
  lock.addEventListener("cancel", (event) => event.preventDefault());
  for (const button of document.querySelectorAll("[data-clean]")) {
    button.addEventListener("click", () => {
      let seconds = Number(button.dataset.clean);
      const tick = () => {
        left.textContent = `${seconds} s`;
        if (seconds === 0) {
          lock.close();
          renewal.reload();
          return;
        }
        seconds -= 1;
        setTimeout(tick, 1000);
      };
      fetch("/people/clean", { method: "POST", headers: { "X-CSRF-Token": document.body.dataset.token } }).catch(
        () => undefined,
      );
      lock.showModal();
      tick();
    });
  }
})();
