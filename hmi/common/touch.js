// What a person's hand does: orders are sent once, some have to be held, and every touch keeps the person logged in.
"use strict";

(() => {
  const HOLD_MS = 1000;
  // Time for the second press of a button that is not held. An estimate.
  const AGAIN_MS = 5000;
  // Least time between two reports that the person is here. An estimate.
  const HERE_MS = 5000;
  // Longest wait for the pages' process before an order is sent. An estimate.
  const REACH_MS = 2000;
  // Time after a page is shown in which a touch presses nothing, in ms: the second contact of a glove that touches twice
  // is for the page before. A stop is pressed all the same. An estimate.
  const SETTLE_MS = 400;
  const shownAt = performance.now();
  // What a click presses; typed fields have a menu of their own.
  const PRESSED = "a, button:not([data-hold]), summary, [type=radio], [type=checkbox]";
  const reached = new WeakSet();
  let toldHere = 0;
  let isEarly = false;
  let slow = null;

  const isSecondContact = (pressed) => isEarly && !pressed.closest("[data-stop]");
  document.addEventListener(
    "pointerdown",
    (event) => {
      isEarly = performance.now() - shownAt < SETTLE_MS;
      if (event.isPrimary) {
        slow = null;
      }
    },
    true,
  );
  document.addEventListener(
    "click",
    (event) => {
      if (event.pointerType === "touch" && isSecondContact(event.target)) {
        event.preventDefault();
        event.stopImmediatePropagation();
      }
    },
    true,
  );

  // A glove is slow: what is touched for half a second and more is pressed like any other. Chromium takes that for a long
  // press, which opens a menu, and makes no click.
  document.addEventListener("contextmenu", (event) => {
    slow = event.pointerType === "touch" ? event.target.closest(PRESSED) : null;
    if (slow) {
      event.preventDefault();
    }
  });
  document.addEventListener("pointercancel", () => (slow = null));
  document.addEventListener("pointerup", (event) => {
    if (!event.isPrimary) {
      return;
    }
    const pressed = slow;
    slow = null;
    const isOn = pressed && pressed.contains(document.elementFromPoint(event.clientX, event.clientY));
    if (isOn && !isSecondContact(pressed)) {
      pressed.click();
    }
  });

  // An order is sent once, however often the button is pressed.
  document.addEventListener("submit", (event) => {
    const form = event.target;
    if (form.method !== "post") {
      return;
    }
    if (form.dataset.sent) {
      event.preventDefault();
      return;
    }
    form.dataset.sent = "yes";
    form.setAttribute("aria-busy", "true");
    if (!reached.delete(form) && !stream.isHeard()) {
      event.preventDefault();
      sendIfReached(form, event.submitter);
      return;
    }
    if (form.csrf && !form.csrf.value) {
      form.csrf.value = document.body.dataset.token;
    }
  });

  // Sent while the pages' process is away, an order would leave the browser's own error page, from which a panel has no
  // way back. Where no answer comes at once the page stays and says how old it is; the button can be pressed again.
  async function sendIfReached(form, submitter) {
    const asked = fetch("/here", { method: "POST", signal: AbortSignal.timeout(REACH_MS) });
    const isReached = await asked.then((answer) => answer.ok).catch(() => false);
    delete form.dataset.sent;
    form.removeAttribute("aria-busy");
    if (isReached) {
      if (!form.isConnected) {
        // Its part was renewed meanwhile: what was pressed is what is sent.
        form.hidden = true;
        document.body.append(form);
      }
      reached.add(form);
      form.requestSubmit(submitter);
    }
  }

  // Held for a second, by finger, mouse or key. A screen reader, which can only click, presses twice.
  function holdable(button) {
    let timer = 0;
    let held = false;
    let label = "";
    const begin = () => {
      if (timer || button.form.dataset.sent) {
        return;
      }
      held = false;
      button.classList.add("holding");
      timer = setTimeout(() => {
        held = true;
        end();
        button.form.requestSubmit();
      }, HOLD_MS);
    };
    const end = () => {
      clearTimeout(timer);
      timer = 0;
      button.classList.remove("holding");
    };
    button.addEventListener("pointerdown", (event) => {
      // Captured, a finger would not leave the button, wherever it went.
      event.target.releasePointerCapture(event.pointerId);
      if (event.button === 0) {
        begin();
      }
    });
    for (const name of ["pointerup", "pointerleave", "pointercancel", "blur"]) {
      button.addEventListener(name, end);
    }
    button.addEventListener("contextmenu", (event) => event.preventDefault());
    button.addEventListener("keydown", (event) => {
      if (event.key === "Enter" || event.key === " ") {
        event.preventDefault();
        if (!event.repeat) {
          begin();
        }
      }
    });
    button.addEventListener("keyup", end);
    button.addEventListener("click", (event) => {
      event.preventDefault();
      if (held || event.pointerType) {
        return;
      }
      if (button.dataset.armed) {
        button.form.requestSubmit();
        return;
      }
      button.dataset.armed = "yes";
      label = button.innerHTML;
      button.textContent = button.dataset.again;
      setTimeout(() => {
        delete button.dataset.armed;
        button.innerHTML = label;
      }, AGAIN_MS);
    });
  }

  function here() {
    const now = performance.now();
    if (document.body.dataset.caller.startsWith("|") || now - toldHere < HERE_MS) {
      return;
    }
    toldHere = now;
    fetch("/here", { method: "POST" }).catch(() => undefined);
  }

  for (const more of document.querySelectorAll("[data-more]")) {
    more.addEventListener("click", () => {
      const open = more.closest("nav").classList.toggle("open");
      more.setAttribute("aria-expanded", String(open));
    });
  }

  const wire = (root) => root.querySelectorAll("[data-hold]").forEach(holdable);
  wire(document);
  document.addEventListener("renewed", (event) => wire(event.target));
  // A wheel counts as a touch, because a person who reads uses it. "scroll" does not: a page that renews itself causes it
  // too.
  for (const name of ["pointerdown", "keydown", "wheel"]) {
    document.addEventListener(name, here, { passive: true });
  }
})();
