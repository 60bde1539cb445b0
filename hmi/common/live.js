// What changes on a page by itself: parts sent by the station's pages, their age, and times that go on.
"use strict";

(() => {
  const STALE_MS = 2000;
  const AGAIN_MS = 1000;
  const SILENT_MS = 5000;
  // Longest time from a finger's lifting to its click, which is a later event, in ms. An estimate.
  const CLICK_MS = 300;
  const body = document.body;
  const line = document.querySelector("[data-stale]");
  const parts = new Map([...document.querySelectorAll("[data-live]")].map((part) => [part.dataset.live, part]));
  let source = null;
  let openedAt = 0;
  let broken = false;
  let heardAt = performance.now();
  let ageThen = Number(body.dataset.ageMs);
  let clockOffset = null;
  const coming = new Map();
  let pressed = null;
  let pressedAt = 0;
  let isLifted = true;
  let touchedAt = -Infinity;
  let lifting = 0;
  let loggedOut = false;

  const age = () => (ageThen < 0 ? Infinity : ageThen + performance.now() - heardAt);

  function take(reply) {
    if (loggedOut || reply.boot !== body.dataset.boot || reply.caller !== body.dataset.caller) {
      if (!keepTyped()) {
        if (mayReload()) {
          reload();
        }
        return;
      }
      loggedOut = true;
    }
    heardAt = performance.now();
    broken = false;
    ageThen = reply.age_ms === null ? -1 : reply.age_ms;
    if (reply.utc_ms) {
      clockOffset = reply.utc_ms + Math.max(0, ageThen) - Date.now();
    }
    for (const [name, part] of Object.entries(reply.parts)) {
      coming.set(name, part);
    }
    renew();
    look();
  }

  // The answer to an order is not loaded anew: that would send the order again.
  const reload = () => ("answer" in body.dataset ? location.replace("/") : location.reload());

  // Not under a finger, nor while what it pressed or this page's own order is being answered: a reload would call that off.
  // Meanwhile what the page shows ages.
  const mayReload = () => !document.querySelector("form[data-sent]") && performance.now() - touchedAt > STALE_MS;

  // What a person has typed into an order's form outlasts the log-in, to be copied; the form cannot be sent any more.
  // In the answer to an order it is the form's own: a reload would send that again.
  function keepTyped() {
    if (body.dataset.caller.startsWith("|")) {
      return false;
    }
    const isTyped = (each) =>
      each.options
        ? each.selectedIndex !== Math.max(0, [...each.options].findIndex((option) => option.defaultSelected))
        : each.value !== each.defaultValue;
    const fields = [...document.querySelectorAll('form[method="post"] :is(textarea, select, input:not([type]))')];
    const typed = fields.filter((each) => "answer" in body.dataset || isTyped(each));
    for (const field of typed) {
      field.form.querySelectorAll("button").forEach((button) => (button.disabled = true));
    }
    return typed.length > 0;
  }

  // A part with a finger on it stays as it is until that is lifted: what is touched must not be another thing by then.
  // Two seconds at most, twice what has to be held: a wet glove that lies there must not keep old values shown as live.
  function renew() {
    const keeps = performance.now() - pressedAt <= STALE_MS;
    for (const [name, [digest, html]] of coming) {
      const part = parts.get(name);
      if (part && part === pressed && keeps) {
        continue;
      }
      coming.delete(name);
      if (part && part.dataset.digest !== digest) {
        fill(part, html);
        part.dataset.digest = digest;
      }
    }
  }

  // What has the focus keeps it, if its new self has the same id.
  function fill(part, html) {
    const focused = part.contains(document.activeElement) ? document.activeElement.id : "";
    part.innerHTML = html;
    if (focused && document.getElementById(focused)) {
      document.getElementById(focused).focus({ preventScroll: true });
    }
    part.dispatchEvent(new CustomEvent("renewed", { bubbles: true }));
  }

  // A key that is held, and a second finger, begin no new time.
  const press = (event) => {
    clearTimeout(lifting);
    touchedAt = performance.now();
    const part = event.target instanceof Element ? event.target.closest("[data-live], [data-poll]") : null;
    if (part !== pressed || isLifted) {
      pressed = part;
      pressedAt = performance.now();
    }
    isLifted = false;
  };
  const lift = (event) => {
    isLifted = true;
    const waitsForClick = event.type === "pointerup" && event.pointerType !== "mouse";
    clearTimeout(lifting);
    lifting = setTimeout(
      () => {
        pressed = null;
        renew();
      },
      waitsForClick ? CLICK_MS : 0,
    );
  };
  for (const name of ["pointerdown", "keydown"]) {
    document.addEventListener(name, press);
  }
  for (const name of ["pointerup", "pointercancel", "keyup", "click"]) {
    document.addEventListener(name, lift);
  }
  window.addEventListener("blur", lift);

  function open() {
    if (source || document.hidden) {
      return;
    }
    openedAt = performance.now();
    const query = [...parts.keys()].map((name) => `part=${encodeURIComponent(name)}`).join("&");
    source = new EventSource(`/live?${query}`);
    source.onmessage = (event) => take(JSON.parse(event.data));
    source.onerror = () => {
      broken = true;
      if (source && source.readyState === EventSource.CLOSED) {
        close();
        setTimeout(open, AGAIN_MS);
      }
    };
  }

  function close() {
    if (source) {
      source.close();
      source = null;
    }
  }

  // After an outage beyond this machine's own cable the stream's connection looks open, and says nothing for minutes.
  function watch() {
    if (source && performance.now() - Math.max(heardAt, openedAt) > SILENT_MS) {
      close();
      open();
    }
  }

  // Never a stale value shown as live: older than two seconds, and the page is greyed and says how old it is.
  function look() {
    const old = age();
    const stale = old > STALE_MS;
    body.classList.toggle("stale", stale);
    for (const part of parts.values()) {
      part.inert = stale;
    }
    if (line) {
      const fresh = loggedOut ? line.dataset.loggedOut : "";
      const text = !stale ? fresh : old === Infinity ? line.dataset.never : oldWords(old);
      if (line.textContent !== text) {
        line.textContent = text;
      }
    }
    for (const time of stale ? [] : document.querySelectorAll("[data-since]")) {
      const seconds = Math.max(0, Math.floor((Date.now() + (clockOffset || 0) - Number(time.dataset.since)) / 1000));
      const text = spoken(seconds);
      if (time.textContent !== text) {
        time.textContent = text;
      }
    }
  }

  const oldWords = (old) =>
    line.dataset.text
      .replace("{age}", Math.floor(old / 1000))
      .replace("{clock}", new Date(Date.now() - old).toLocaleTimeString(document.documentElement.lang, { hourCycle: "h23" }));

  function spoken(seconds) {
    if (seconds < 60) {
      return `${seconds} s`;
    }
    const minutes = Math.floor(seconds / 60);
    return minutes < 60 ? `${minutes} min` : `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
  }

  globalThis.staleness = { staleMs: STALE_MS, words: oldWords };
  globalThis.stream = { isHeard: () => !broken && performance.now() - heardAt <= STALE_MS };
  globalThis.renewal = { fill, isPressed: (part) => part === pressed, mayReload, reload };
  document.addEventListener("visibilitychange", () => (document.hidden ? close() : open()));
  window.addEventListener("pagehide", close);
  window.addEventListener("pageshow", (event) => event.persisted && reload());
  setInterval(() => {
    look();
    watch();
  }, 250);
  look();
  open();
})();
