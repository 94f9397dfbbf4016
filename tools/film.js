// What the film does with pages: `film.seek(0.5)`.

globalThis.film = {
  /** Adds a style and an empty caption. */
  dress(style) {
    document.head.append(Object.assign(document.createElement("style"), { textContent: style }));
    const caption = document.documentElement.appendChild(document.createElement("div"));
    caption.id = "caption";
    caption.style.cssText = `position: fixed; inset: auto 0 0; z-index: 9; padding: 0 36px;
      background: #0b2540; color: #fff; font: 600 27px/72px sans-serif; text-align: left`;
  },

  caption(text) {
    const caption = document.getElementById("caption");
    caption.textContent = text;
    caption.style.display = text ? "block" : "none";
  },

  /** Shows one part of film.html. */
  part(name) {
    document.body.className = name;
  },

  card(html) {
    document.getElementById("card").innerHTML = html;
  },

  print(text) {
    document.getElementById("terminal").textContent = text;
  },

  /** Loads a picture: a wide one is shown whole, another from its top. */
  async figure(src) {
    const figure = document.getElementById("figure");
    figure.src = src;
    await figure.decode();
    if (figure.naturalHeight < 0.8 * figure.naturalWidth) figure.style.height = "648px";
  },

  /** Moves the picture up, by a share of what does not fit. */
  pan(share) {
    const figure = document.getElementById("figure");
    figure.style.marginTop = `${-share * Math.max(0, figure.height - 648)}px`;
  },

  /** Shows some sections of the live page's charts, after its first run. */
  async charts(chosen, layout) {
    await auvfmu.csv();
    const sections = [...document.querySelectorAll("#series > section")];
    for (const one of chosen) sections.at(one).classList.add("shown");
    document.querySelector("main").className = layout;
    // Charts are drawn once they are in sight.
    const empty = "#series .shown figure:first-of-type.pending";
    for (let k = 0; document.querySelector(empty); k++) {
      if (k > 100) throw new Error("charts stay empty");
      await new Promise((done) => setTimeout(done, 50));
    }
  },

  /** Moves the live page to a time, a share of the run. */
  seek(share) {
    const play = document.getElementById("play");
    const time = document.getElementById("time");
    if (play.dataset.playing === "true") play.click();
    time.valueAsNumber = Number(time.min) + share * (time.max - time.min);
    time.dispatchEvent(new Event("input"));
  },

  /** Moves a slider of the live page up, and back. */
  slide(share) {
    const value = 0.5 * 6 ** Math.sin(Math.PI * share);
    return auvfmu.set({ "controller.lambda": value.toPrecision(2) });
  },

  fault() {
    return auvfmu.set({ preset: "fig4", events: "fault-sensor" });
  },

  /** Moves the report to its verdict. */
  verdict() {
    document.documentElement.style.cssText = "overflow: hidden; scroll-behavior: auto";
    document.body.style.zoom = 1.3;
    const texts = [...document.querySelectorAll("h1, h2, p, li")];
    texts.find((one) => /[0-9]+ agree/.test(one.innerText)).scrollIntoView();
  },

  /** Waits until all is drawn. */
  drawn() {
    return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  },
};
