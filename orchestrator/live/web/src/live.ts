// The live page: reads its data, runs the opened preset in a worker, and draws it.

import { type Api, makeApi } from "./api";
import { sayFailure, unpacked } from "./dom";
import { Page } from "./page";
import { dataOf, RemoteEngine, serve } from "./worker";

async function start(script: string): Promise<Api> {
  const [[data], modules] = await Promise.all([unpacked("data"), unpacked("binary")]);
  const found = dataOf(data);
  const engine = new RemoteEngine(script, { data, modules }, found);
  const page = new Page(found, engine);
  await page.shown;
  return makeApi(found, engine, page);
}

function open(): void {
  // In a frame of another page there is less room.
  document.documentElement.classList.toggle("framed", window !== window.parent);
  const started = start(document.currentScript?.textContent ?? "");
  document.querySelector("form")?.addEventListener("submit", (event) => event.preventDefault());
  const api: Api = {
    set: async (changes) => (await started).set(changes),
    csv: async () => (await started).csv(),
  };
  Object.assign(globalThis, { auvfmu: api });
  started.catch(sayFailure);
}

// The worker runs this script, too.
if (typeof document === "undefined") serve();
else open();
