// The live page: reads its data, runs the opened preset, and draws it.

import { type Api, makeApi } from "./api";
import { sayFailure, unpacked } from "./dom";
import { Page } from "./page";
import { Engine } from "./simulate";
import type { Data } from "./types";

async function start(): Promise<Api> {
  const [[data], modules] = await Promise.all([unpacked("data"), unpacked("binary")]);
  const found: Data = JSON.parse(new TextDecoder().decode(data));
  const engine = await Engine.load(modules, found);
  return makeApi(found, engine, new Page(found, engine));
}

const started = start();
document.querySelector("form")?.addEventListener("submit", (event) => event.preventDefault());
const api: Api = {
  set: async (changes) => (await started).set(changes),
  csv: async () => (await started).csv(),
};
Object.assign(globalThis, { auvfmu: api });
started.catch(sayFailure);
