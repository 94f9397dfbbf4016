// How long redraws take: `node test/redraw.mjs PAGE.html [MOVES]` moves the slider of eps_t, once
// for each picture of the screen, in headless Chromium without a graphics card.
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const [page, moves = "60"] = process.argv.slice(2);
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"],
});
const tab = await browser.newPage({ viewport: { width: 1280, height: 900 } });
await tab.goto(pathToFileURL(page).href);
await tab.evaluate(() => globalThis.auvfmu.csv().then(() => null));
const found = await tab.evaluate(async (n) => {
  const slider = document.querySelector('input[data-names="controller.eps_t"]');
  const real = requestAnimationFrame.bind(window);
  let busy = 0;
  // What the page does for a picture is in such callbacks.
  globalThis.requestAnimationFrame = (draw) =>
    real((now) => {
      const begin = performance.now();
      draw(now);
      busy += performance.now() - begin;
    });
  const next = () => new Promise(real);
  await next();
  const [computed, between] = [[], []];
  for (let i = -10; i < n; i++) {
    const begin = performance.now();
    busy = 0;
    slider.value = String(300 + ((10 * i) % 400));
    slider.dispatchEvent(new Event("input", { bubbles: true }));
    await next();
    // The first moves let the browser compile.
    if (i < 0) continue;
    computed.push(busy);
    between.push(performance.now() - begin);
  }
  return { computed, between };
}, Number(moves));
await browser.close();
const said = (values) => {
  const sorted = values.toSorted((a, b) => a - b);
  const [median, most] = [sorted[sorted.length >> 1], sorted[sorted.length - 1]];
  return `median ${median.toFixed(1)} ms, max ${most.toFixed(1)} ms`;
};
console.log(`${moves} moves of a slider, both controllers, as long as the page's scenario`);
console.log(`run and draw, in the script      ${said(found.computed)}`);
console.log(`from one picture to the next     ${said(found.between)}`);
