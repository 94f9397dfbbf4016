// The live page: it reads what Python has put into it, runs the preset that is opened, and draws it.

import { type Api, Engine, makeApi } from "./engine";
import { Page } from "./page";
import type { Data } from "./types";
import { sayFailure, unpacked } from "./unpacking";

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
