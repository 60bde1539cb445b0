// Polled parts, requested again only after the last answer is shown; and the recipe chart, redrawn while a person types.
"use strict";

(() => {
  const AFTER_FAULT_MS = 1500;
  // Longest wait for an answer; a part is requested again later. An estimate.
  const FETCH_TIMEOUT_MS = 15000;
  // Pause in typing after which the chart is redrawn. An estimate.
  const DEBOUNCE_MS = 300;
  // Period of the check of a part's age. An estimate.
  const AGE_CHECK_MS = 250;

  async function fetched(address) {
    const ended = new AbortController();
    const timer = setTimeout(() => ended.abort(), FETCH_TIMEOUT_MS);
    try {
      const answer = await fetch(address, { signal: ended.signal, credentials: "same-origin" });
      if (!answer.ok) {
        throw new Error(String(answer.status));
      }
      return { html: await answer.text(), headers: answer.headers };
    } finally {
      clearTimeout(timer);
    }
  }

  // The next image is asked for when this one is there: the browser sets the pace.
  const shown = (part) =>
    Promise.all(
      [...part.querySelectorAll("img:not([loading])")].map((image) => (image.decode ? image.decode().catch(() => 0) : 0)),
    );

  // As for live parts: a part whose data is older than two seconds, for whatever reason, is greyed, inert, and shows its age.
  function aging(part) {
    let takenAt = performance.now();
    const look = () => {
      const old = performance.now() - takenAt;
      const isOld = old > staleness.staleMs;
      part.classList.toggle("old-part", isOld);
      part.inert = isOld;
      if (isOld) {
        part.dataset.old = staleness.words(old);
      } else {
        delete part.dataset.old;
      }
    };
    const timer = setInterval(look, AGE_CHECK_MS);
    return {
      renewed: () => {
        takenAt = performance.now();
        look();
      },
      over: () => clearInterval(timer),
    };
  }

  async function poll(part) {
    const everyMs = Number(part.dataset.everyMs);
    const age = aging(part);
    let pauseMs = everyMs;
    let filled = null;
    while (part.isConnected) {
      await new Promise((done) => setTimeout(done, pauseMs));
      if (document.hidden) {
        continue;
      }
      try {
        const { html, headers } = await fetched(part.dataset.poll);
        const reload = part.dataset.reload;
        if (reload && headers.get("x-state") !== reload) {
          if (!renewal.mayReload()) {
            continue;
          }
          renewal.reload();
          return;
        }
        const top = part.querySelector(".scroll") ? part.querySelector(".scroll").scrollTop : 0;
        const focused = document.activeElement && part.contains(document.activeElement);
        // Compared with what was fetched: the browser's own markup of it may differ.
        if (filled !== html && !renewal.isPressed(part)) {
          renewal.fill(part, html);
          filled = html;
          const scroll = part.querySelector(".scroll");
          if (scroll) {
            scroll.scrollTop = top;
            if (focused && !part.contains(document.activeElement)) {
              scroll.focus({ preventScroll: true });
            }
          }
        }
        // A pressed part keeps its content, which then ages.
        if (filled === html) {
          age.renewed();
        }
        pauseMs = everyMs;
        await shown(part);
        // Only when it is shown: what a finger has kept out of the part is asked for again.
        if (filled === html && headers.get("x-over")) {
          part.dataset.over = "";
          break;
        }
      } catch {
        pauseMs = AFTER_FAULT_MS;
      }
    }
    age.over();
  }

  function draw(form) {
    const here = form.querySelector("[data-chart-here]");
    let timer = 0;
    let number = 0;
    form.addEventListener("input", () => {
      clearTimeout(timer);
      timer = setTimeout(async () => {
        number += 1;
        const mine = number;
        const typed = new URLSearchParams([...new FormData(form)].filter(([name]) => name.startsWith("v:")));
        try {
          const { html } = await fetched(`${form.dataset.chart}?${typed}`);
          if (mine === number) {
            here.innerHTML = html;
            here.classList.remove("old-part");
          }
        } catch {
          here.classList.add("old-part");
        }
      }, DEBOUNCE_MS);
    });
  }

  document.querySelectorAll("[data-poll]").forEach(poll);
  // A slider has no name and so is not sent: it moves its field, and the field's typed value moves it.
  function slide(slider) {
    const field = document.getElementById(slider.dataset.slides);
    slider.addEventListener("input", () => {
      field.value = slider.value;
    });
    field.addEventListener("input", () => {
      slider.value = field.value.replace(",", ".");
    });
  }

  document.querySelectorAll("[data-slides]").forEach(slide);
  document.querySelectorAll("form[data-chart]").forEach(draw);
})();
